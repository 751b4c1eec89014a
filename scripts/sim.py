"""Simulate RTL modules on lidar waveforms, compare every transfer with the golden model, and measure.

Float units are simulated beside them, on operands of their own: their latencies belong in the same table.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from openecho import formats, golden, report, stimulus
from openecho.decompose import tabulate
from openecho.golden import ARITHMETICS, TAP_SETS
from openecho.hardware import ROOT, bench_names
from openecho.study import comparison, figure
from tb.env import runner
from tb.env.run import Run
from tb.float import bench
from tb.float.lanes import SHOWN, Lane

UNITS = tuple(dict.fromkeys(lane.module for lane in SHOWN))
VECTORS = 10_000
"""Operands that a float unit gets."""
RUNS = ROOT / "build" / "runs" / "sim"
POLL = 0.1
"""Seconds between two looks at the progress of a simulation."""
SLOWEST = 300
"""Samples a second below which a simulation counts as hung."""


@dataclass(frozen=True)
class Job:
    """What was asked for.

    `modules` and `units` name rows of the module table with the arithmetic that they are built for.
    """

    modules: tuple[tuple[str, str], ...]
    units: tuple[Lane, ...]
    taps: str
    simulator: str
    waveforms: formats.Waveforms
    recorded: bool
    seed: int
    waves: bool

    def config(self, arithmetic: str) -> golden.Config:
        """What a module is built with and set to."""
        return golden.Config(taps=TAP_SETS[self.taps]).in_arithmetic(arithmetic)


class UsageError(ValueError):
    """An argument that can't be used: what was found and what was expected."""


def parse(arguments: list[str]) -> Job:
    """Check everything before anything is built.

    Raises
    ------
    UsageError, DataError, MissingToolError
        One line with what was found and what was expected.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--module", help=f"one of {', '.join((*bench_names(), *UNITS))}; all if left out")
    parser.add_argument("--arith", help=f"one of {', '.join(ARITHMETICS)}; if left out, fixed, and the core in all")
    parser.add_argument("--taps", default="paper", help=f"one of {', '.join(TAP_SETS)}; the paper's if left out")
    parser.add_argument("--sim", help=f"one of {', '.join(runner.SIMULATORS)}; Verilator if left out")
    parser.add_argument(
        "--data", help="waveforms to use, any file that openecho.formats opens; the 40 reference waveforms if left out"
    )
    parser.add_argument("--seed", default="0", help="of the reference waveforms")
    parser.add_argument("--waves", action="store_true", help="record every signal in an FST file")
    options = parser.parse_args(arguments)
    modules, units = plan(options.module, options.arith)
    if options.taps not in TAP_SETS:
        raise UsageError(f"TAPS: found {options.taps!r}, expected one of {', '.join(TAP_SETS)}")
    if options.sim not in (None, *runner.SIMULATORS):
        raise UsageError(f"SIM: found {options.sim!r}, expected one of {', '.join(runner.SIMULATORS)}")
    if not options.seed.isdecimal():
        raise UsageError(f"SEED: found {options.seed!r}, expected a whole number from 0")
    simulator = options.sim or "verilator"
    runner.require(simulator)
    if options.data is None:
        reference = stimulus.reference_set(int(options.seed))
        waveforms = formats.Waveforms(reference.samples, reference.length)
    else:
        waveforms = formats.load(options.data, golden.Config().sample_w)
    return Job(
        modules, units, options.taps, simulator, waveforms, options.data is not None, int(options.seed), options.waves
    )


def plan(module: str | None, arithmetic: str | None) -> tuple[tuple[tuple[str, str], ...], tuple[Lane, ...]]:
    """What to simulate: modules with their arithmetics, and float units.

    Raises
    ------
    UsageError
        If there is no such module, no such arithmetic, or not both together.
    """
    known = (*bench_names(), *UNITS)
    if module is not None and module not in known:
        raise UsageError(f"MODULE: found {module!r}, expected one of {', '.join(known)}")
    if arithmetic is not None and arithmetic not in ARITHMETICS:
        raise UsageError(f"ARITH: found {arithmetic!r}, expected one of {', '.join(ARITHMETICS)}")
    floats = [name for name in ARITHMETICS if name != "fixed"] if arithmetic is None else [arithmetic]
    units = tuple(
        lane for name in floats for lane in SHOWN if lane.arithmetic == name and module in (None, lane.module)
    )
    if module in UNITS:
        if not units:
            raise UsageError(
                f"ARITH: found {arithmetic!r}, expected one of {', '.join(list(ARITHMETICS)[1:])} for {module}"
            )
        return (), units
    if module is not None:
        return ((module, arithmetic or "fixed"),), ()
    if arithmetic is not None:
        return tuple((name, arithmetic) for name in bench_names()), units
    return (*((name, "fixed") for name in bench_names()), *(("core", name) for name in floats)), units


def simulate(job: Job, directory: Path, progress: Progress, failures: list[str]) -> Iterator[dict[str, Any]]:
    """Simulate each module, yield its row of the report and add to `failures`; raise SimulationError without a row."""
    stored = directory / "waveforms.npz"
    np.savez(stored, samples=job.waveforms.samples, length=job.waveforms.length)
    count, samples = len(job.waveforms.length), int(job.waveforms.length.sum())
    task = progress.add_task("", total=count * len(job.modules))
    with ThreadPoolExecutor(1) as pool:
        for done, (module, arithmetic) in enumerate(job.modules):
            home, config = directory / f"{module}-{arithmetic}", job.config(arithmetic)
            home.mkdir()
            result, ticks = home / "result.json", home / "progress"
            run = Run(module, config, job.seed, str(stored), str(result), str(ticks))
            progress.update(task, description=f"{module}, {arithmetic}, building")
            pool.submit(runner.build, module, config, job.simulator, job.waves).result()
            progress.update(task, description=f"{module}, {arithmetic}, {job.simulator}")
            limit = runner.LIMIT + samples / SLOWEST
            future = pool.submit(
                runner.simulate, run, job.simulator, home, ["tb.env.reference"], waves=job.waves, limit=limit
            )
            while wait([future], POLL).not_done:
                ticked = ticks.stat().st_size if ticks.exists() else 0
                progress.update(task, completed=done * count + ticked)
            progress.update(task, completed=(done + 1) * count)
            try:
                future.result()
            except runner.SimulationError as error:
                if not result.exists():
                    raise
                failures.append(str(error))
            row = {"module": module, "simulator": job.simulator, "arithmetic": arithmetic}
            yield row | json.loads(result.read_text())
            if job.waves:
                progress.console.print(f"waves: {home / runner.WAVES}", soft_wrap=True)


def simulate_units(job: Job, directory: Path, progress: Progress, failures: list[str]) -> Iterator[dict[str, Any]]:
    """Stream operands through each float unit, yield its row of the report and add to `failures`."""
    task = progress.add_task("float units", total=len(job.units))
    for lane in job.units:
        progress.update(task, description=f"{lane.name}, {job.simulator}")
        row = bench.measure(lane, VECTORS, job.simulator, directory)
        if row["mismatches"]:
            failures.append(
                f"{lane.name} on {job.simulator}: {row['mismatches']} of {row['results']} results are wrong"
            )
        yield {
            "module": lane.module,
            "form": lane.form_name,
            "simulator": job.simulator,
            "arithmetic": lane.arithmetic,
        } | row
        progress.advance(task)


def show(title: str, rows: list[dict[str, Any]], console: Console) -> None:
    """Print the table of the modules, counted in waveforms, or of the float units, counted in results."""
    if not rows:
        return
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for column in (title, "arithmetic"):
        table.add_column(column)
    counted = "waveform" if "waveforms" in rows[0] else "result"
    for column in (f"{counted}s", "mismatches", "latency", f"cycles/{counted}"):
        table.add_column(column, justify="right")
    for row in rows:
        latency, cycles, wrong = row["latency_cycles"], row[f"cycles_per_{counted}"], row["mismatches"]
        table.add_row(
            " ".join(filter(None, (row["module"], row.get("form")))),
            row["arithmetic"],
            str(row[f"{counted}s"]),
            f"[bold red]{wrong}" if wrong else "0",
            f"{latency['min']} to {latency['max']}" if latency else "none",
            f"{cycles:.1f}" if cycles else "none",
        )
    console.print(table)


def report_cores(job: Job, directory: Path, console: Console) -> None:
    """Write what the records of each core are compared with and drawn from, on the reference waveforms."""
    samples, length = job.waveforms.samples, job.waveforms.length
    compared = {}
    for module, arithmetic in job.modules:
        if module != "core":
            continue
        config = job.config(arithmetic)
        records = np.load(directory / f"core-{arithmetic}" / "result.npy")
        compared[arithmetic] = comparison.compare(golden.decode_records(records, config), samples, length, config)
        if arithmetic == "fixed":
            picture = report.FOLDER / "core.png"
            rows = {"land": 0, "ocean": stimulus.WAVEFORMS}
            figure.save(figure.draw(tabulate(records, config, None), samples, length, config, rows), picture)
            console.print(picture, soft_wrap=True)
    if compared:
        content = {
            "tools": runner.tool_versions(job.simulator),
            "seed": job.seed,
            "taps": job.taps,
            "arithmetics": compared,
        }
        console.print(report.write("core_vs_float64", content), soft_wrap=True)


def main() -> int:
    """Return 0 if everything agrees, 1 if not, 2 if it could not be tried."""
    console = Console()
    try:
        job = parse(sys.argv[1:])
        absent = [name for name in runner.SIMULATORS if name not in runner.find_simulators()]
        if absent and os.environ.get("CI"):
            raise UsageError(f"CI: found no {', '.join(absent)}, expected every simulator")
    except (UsageError, formats.DataError, runner.MissingToolError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    console.print(f"seed {job.seed}, {len(job.waveforms.length)} waveforms, on {job.simulator}", highlight=False)
    if absent:
        console.print(f"{', '.join(absent)} is not installed: nothing runs on it", highlight=False)
    RUNS.mkdir(parents=True, exist_ok=True)
    # A directory of its own, so that runs at the same time don't meet; kept where there is something to look at.
    directory = Path(tempfile.mkdtemp(prefix=f"{job.simulator}-", dir=RUNS))
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    rows: list[dict[str, Any]] = []
    units: list[dict[str, Any]] = []
    failures: list[str] = []
    try:
        with Progress(*columns, console=console) as progress:
            rows += simulate(job, directory, progress, failures)
            units += simulate_units(job, directory, progress, failures)
    except (runner.SimulationError, bench.BenchError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    show("module", rows, console)
    show("float unit", units, console)
    tools = {"python": platform.python_version()} | runner.tool_versions(job.simulator)
    console.print(
        report.write("sim", {"tools": tools, "seed": job.seed, "taps": job.taps, "rows": rows + units}), soft_wrap=True
    )
    if failures:
        print("\n".join(f"error: {failure}" for failure in failures), file=sys.stderr)
        return 1
    if not job.recorded:
        report_cores(job, directory, console)
    if not job.waves:
        shutil.rmtree(directory)
    return 0


if __name__ == "__main__":
    sys.exit(main())
