"""Simulate RTL modules on lidar waveforms, compare every transfer with the golden model, and measure."""

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
from openecho.hardware import ROOT, bench_names
from openecho.study import comparison, figure
from tb.env import runner
from tb.env.run import Run

CONFIG = golden.Config()
RUNS = ROOT / "build" / "runs" / "sim"
POLL = 0.1
"""Seconds between two looks at the progress of a simulation."""
SLOWEST = 300
"""Samples a second below which a simulation counts as hung."""


@dataclass(frozen=True)
class Job:
    """What was asked for."""

    modules: tuple[str, ...]
    simulator: str
    waveforms: formats.Waveforms
    recorded: bool
    seed: int
    waves: bool


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
    parser.add_argument("--module", help=f"one of {', '.join(bench_names())}; all if left out")
    parser.add_argument("--sim", help=f"one of {', '.join(runner.SIMULATORS)}; Verilator if left out")
    parser.add_argument("--data", help="waveforms to use, .npz or .npy; the 40 reference waveforms if left out")
    parser.add_argument("--seed", default="0", help="of the reference waveforms")
    parser.add_argument("--waves", action="store_true", help="record every signal in an FST file")
    options = parser.parse_args(arguments)
    if options.module not in (None, *bench_names()):
        raise UsageError(f"MODULE: found {options.module!r}, expected one of {', '.join(bench_names())}")
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
        waveforms = formats.load(options.data, CONFIG.sample_w)
    modules = (options.module,) if options.module else bench_names()
    return Job(modules, simulator, waveforms, options.data is not None, int(options.seed), options.waves)


def simulate(job: Job, directory: Path, progress: Progress, failures: list[str]) -> Iterator[dict[str, Any]]:
    """Simulate each module, yield its row of the report and add to `failures`; raise SimulationError without a row."""
    stored = directory / "waveforms.npz"
    np.savez(stored, samples=job.waveforms.samples, length=job.waveforms.length)
    count, samples = len(job.waveforms.length), int(job.waveforms.length.sum())
    task = progress.add_task("", total=count * len(job.modules))
    with ThreadPoolExecutor(1) as pool:
        for done, module in enumerate(job.modules):
            home = directory / module
            home.mkdir()
            result, ticks = home / "result.json", home / "progress"
            run = Run(module, CONFIG, job.seed, str(stored), str(result), str(ticks))
            progress.update(task, description=f"{module}, building")
            pool.submit(runner.build, module, CONFIG, job.simulator, job.waves).result()
            progress.update(task, description=f"{module}, {job.simulator}")
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
            row = {"module": module, "simulator": job.simulator, "arithmetic": "fixed"}
            yield row | json.loads(result.read_text())
            if job.waves:
                progress.console.print(f"waves: {home / runner.WAVES}", soft_wrap=True)


def show(rows: list[dict[str, Any]], console: Console) -> None:
    """Print the table."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for column in ("module", "simulator"):
        table.add_column(column)
    for column in ("waveforms", "mismatches", "latency", "cycles/waveform"):
        table.add_column(column, justify="right")
    for row in rows:
        latency, cycles, wrong = row["latency_cycles"], row["cycles_per_waveform"], row["mismatches"]
        table.add_row(
            row["module"],
            row["simulator"],
            str(row["waveforms"]),
            f"[bold red]{wrong}" if wrong else "0",
            f"{latency['min']} to {latency['max']}" if latency else "none",
            f"{cycles:.1f}" if cycles else "none",
        )
    console.print(table)


def report_core(job: Job, directory: Path, console: Console) -> None:
    """Write what the core's records are compared with and drawn from, on the reference waveforms."""
    records = golden.decode_records(np.load(directory / "core" / "result.npy"), CONFIG)
    waveforms = job.waveforms
    compared = comparison.compare(records, waveforms.samples, waveforms.length, CONFIG)
    tools = runner.tool_versions(job.simulator)
    console.print(report.write("core_vs_float64", {"tools": tools, "seed": job.seed} | compared), soft_wrap=True)
    picture = report.FOLDER / "core.png"
    rows = {"land": 0, "ocean": stimulus.WAVEFORMS}
    figure.draw(picture, records, waveforms.samples, waveforms.length, CONFIG, rows)
    console.print(picture, soft_wrap=True)


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
    failures: list[str] = []
    try:
        with Progress(*columns, console=console) as progress:
            rows += simulate(job, directory, progress, failures)
    except runner.SimulationError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    show(rows, console)
    tools = {"python": platform.python_version()} | runner.tool_versions(job.simulator)
    console.print(report.write("sim", {"tools": tools, "seed": job.seed, "rows": rows}), soft_wrap=True)
    if failures:
        print("\n".join(f"error: {failure}" for failure in failures), file=sys.stderr)
        return 1
    if "core" in job.modules and not job.recorded:
        report_core(job, directory, console)
    if not job.waves:
        shutil.rmtree(directory)
    return 0


if __name__ == "__main__":
    sys.exit(main())
