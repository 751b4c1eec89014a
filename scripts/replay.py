"""Replay a whole file through the core with no Python on its clock, and compare every record with the golden model."""

from __future__ import annotations

import argparse
import platform
import sys
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from openecho import formats, report
from openecho.golden import ARITHMETICS, TAP_SETS, Config
from tb.env import runner
from tb.replay import bench


@dataclass(frozen=True)
class Job:
    """What was asked for."""

    arithmetic: str
    taps: str
    simulator: str
    data: str
    waveforms: formats.Waveforms

    @property
    def config(self) -> Config:
        """The core with its default settings."""
        return Config(taps=TAP_SETS[self.taps]).in_arithmetic(self.arithmetic)


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
    parser.add_argument("--data", help="waveforms to replay, any file that openecho.formats opens")
    parser.add_argument("--arith", default="fixed", help=f"one of {', '.join(ARITHMETICS)}; fixed if left out")
    parser.add_argument("--taps", default="paper", help=f"one of {', '.join(TAP_SETS)}; the paper's if left out")
    parser.add_argument("--sim", default="verilator", help=f"one of {', '.join(runner.SIMULATORS)}; Verilator if not")
    options = parser.parse_args(arguments)
    if options.arith not in ARITHMETICS:
        raise UsageError(f"ARITH: found {options.arith!r}, expected one of {', '.join(ARITHMETICS)}")
    if options.taps not in TAP_SETS:
        raise UsageError(f"TAPS: found {options.taps!r}, expected one of {', '.join(TAP_SETS)}")
    if options.sim not in runner.SIMULATORS:
        raise UsageError(f"SIM: found {options.sim!r}, expected one of {', '.join(runner.SIMULATORS)}")
    if options.data is None:
        raise UsageError("DATA: found none, expected a file of waveforms")
    runner.require(options.sim)
    waveforms = formats.load(options.data, Config().sample_w)
    return Job(options.arith, options.taps, options.sim, options.data, waveforms)


def run(job: Job, console: Console) -> tuple[bench.Replay, bench.Comparison]:
    """Simulate and compare, showing how far it is."""
    samples, length = job.waveforms.samples, job.waveforms.length
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console) as progress:
        building = progress.add_task(f"building for {job.simulator}", total=None)
        bench.build(job.config, job.simulator)
        progress.update(building, total=1, completed=1)
        task = progress.add_task("simulating, samples", total=int(length.sum()))
        replayed = bench.replay(
            samples, length, job.config, job.simulator, lambda done: progress.update(task, completed=done)
        )
        progress.update(task, completed=int(length.sum()))
        comparing = progress.add_task("comparing, waveforms", total=len(length))
        compared = bench.compare(
            replayed.records, samples, length, job.config, lambda done: progress.update(comparing, completed=done)
        )
    return replayed, compared


def main() -> int:
    """Return 0 if all records agree, 1 if not, 2 if it could not be tried, 130 if it was interrupted."""
    console = Console(highlight=False)
    try:
        job = parse(sys.argv[1:])
    except (UsageError, formats.DataError, runner.MissingToolError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    try:
        replayed, compared = run(job, console)
    except runner.SimulationError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted", file=sys.stderr)
        return 130
    waveforms = len(job.waveforms.length)
    content = {
        "tools": {"python": platform.python_version()} | runner.tool_versions(job.simulator),
        "data": job.data,
        "arithmetic": job.arithmetic,
        "taps": job.taps,
        "simulator": job.simulator,
        "build": " ".join(bench.COMMANDS[job.simulator]),
        "waveforms": waveforms,
        "samples": int(job.waveforms.length.sum()),
        "echoes": len(replayed.records) - waveforms,
        "mismatches": compared.mismatches,
        "cycles": replayed.cycles,
        "stalls": replayed.stalls,
        "kcycles_per_s": round(replayed.cycles / replayed.seconds / 1e3, 1),
        "waveforms_per_s": round(waveforms / replayed.seconds, 1),
    }
    for name in list(content)[1:]:
        console.print(f"{name:16}{content[name]}", soft_wrap=True)
    console.print(report.write("replay", content), soft_wrap=True)
    if compared.mismatches:
        first = "\n".join(f"error: {difference}" for difference in compared.differences)
        print(f"error: {compared.mismatches} records differ from the golden model's\n{first}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
