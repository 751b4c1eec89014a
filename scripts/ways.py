"""Measure what every core that the trade-off compares takes of hardware: area, clock, cycles; for `make trade`.

Area and clock as `make synth` does, of one routing each; cycles in simulation of the RTL on the land waveforms, whose
records must be those of the model. The report is build/reports/ways.json; with --extent quick only the usual core is
simulated, nothing is synthesised, and what an earlier report has of that is kept.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from openecho import golden, report, stimulus
from openecho.golden import Config
from openecho.study.trade.ways import EXTENTS, USUAL, WAYS, Way
from scripts import synth
from tb.env import runner
from tb.replay import bench

SEEDS = (1,)
"""Of the routing."""
WAVEFORMS = 400
"""That are simulated."""
LONE = stimulus.quantise(20 + 200 * np.exp(-0.5 * ((np.arange(300) - 200) / 6) ** 2))[None]
"""Waveform (1, m) of one echo."""
AREA = ("lut", "ff", "dsp", "bram36", "path_ns", "fmax_mhz")
"""Columns of `make synth` that are kept."""


def land() -> np.ndarray:
    """The land waveforms (n, 1024)."""
    return np.concatenate([stimulus.land(seed).samples for seed in range(WAVEFORMS // stimulus.WAVEFORMS)])


def simulated(config: Config) -> dict[str, Any]:
    """Cycles of a core, and how fast its simulation is.

    The latency is that of a lone echo: from the transfer of the sample that decides it, the last of its waveform, to
    the transfer of the trailer behind it.
    """
    samples = land()
    length = np.full(len(samples), samples.shape[1])
    replayed = bench.replay(samples, length, config)
    compared = bench.compare(replayed.records, samples, length, config)
    if compared.mismatches:
        raise runner.SimulationError("\n".join([f"{compared.mismatches} records differ", *compared.differences]))
    last = decided(LONE, config)
    alone = bench.replay(LONE[:, :last], np.array([last]), config)
    return {
        "cycles_per_waveform": (samples.size + replayed.stalls) / len(samples),
        "latency_cycles": alone.cycles - last - 1,  # the first sample is there a cycle after reset
        "simulated_per_s": len(samples) / replayed.seconds,
    }


def decided(samples: np.ndarray, config: Config) -> int:
    """Samples of a waveform (1, m) up to that which decides its last echo."""
    beats, noise = golden.reader(golden.stream(samples, np.array([samples.shape[1]]), config), config)
    differences = golden.second_difference(golden.filter(beats, config), config)
    components = golden.inflection(differences, noise, config)
    return int(components["cause"][~components["last"]][-1]) + 1


def cores(ways: tuple[Way, ...], progress: Progress) -> Iterator[dict[str, Any]]:
    """Row of each core: what its simulation tells."""
    done: dict[Config, dict[str, Any]] = {}
    task = progress.add_task("simulation", total=len(ways))
    for way in ways:
        assert way.config is not None
        if way.config not in done:  # one without multipliers counts the same cycles
            done[way.config] = simulated(way.config)
        yield {"name": way.name} | done[way.config]
        progress.advance(task)


def known() -> list[dict[str, Any]]:
    """Rows of an earlier report."""
    path = report.FOLDER / "ways.json"
    return list(json.loads(path.read_text())["rows"]) if path.exists() else []


def main() -> int:
    """Return 0 if everything was built and equals its model, 1 if not, 2 if it could not be tried."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--extent", default="full", help="full, or quick: the usual core is simulated, no more (full)")
    extent = parser.parse_args().extent
    if extent not in EXTENTS:
        print(f"error: TRADE: found {extent!r}, expected one of {', '.join(EXTENTS)}", file=sys.stderr)
        return 2
    quick = extent == "quick"
    built = tuple(way for way in WAYS if way.in_hardware)
    chosen = tuple(way for way in built if way.name == USUAL) if quick else built
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    try:
        runner.require("verilator")
        versions = runner.tool_versions("verilator") | ({} if quick else report.tools(*synth.TOOLS))
        with Progress(*columns, console=Console(stderr=True)) as progress:
            rows = {row["name"]: row for row in cores(chosen, progress)}
            if not quick:
                builds = [synth.Build(way.name, "core", way.config or Config(), True, way.dsp) for way in built]
                for row in synth.rows(builds, SEEDS, versions, progress):
                    rows[row["name"]] |= {name: row[name] for name in AREA}
    except runner.MissingToolError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except (runner.SimulationError, synth.SynthesisError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    before = {row["name"]: row for row in known()}
    merged = [before.get(way.name, {}) | rows.get(way.name, {"name": way.name}) for way in built]
    print(report.write("ways", {"tools": report.tools("openecho") | versions, "seeds": SEEDS, "rows": merged}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
