"""Break the RTL one line at a time and count how many of the faults the module benches catch.

The faults are in tb/mutations.toml. Each is put into a scratch copy of the sources, where that test of `make test` runs
which checks the named module on Verilator, with default parameters or with those that it names. The report is
build/reports/mutate.json.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from openecho import report
from openecho.hardware import ROOT, RTL

LIST = ROOT / "tb" / "mutations.toml"
SCRATCH = ROOT / "build" / "mutate"
COPIED = ("model", "rtl", "tb", "conftest.py", "pyproject.toml")
"""What a scratch copy holds: all that the benches read."""

TIMEOUT = 900
"""Seconds after which a bench counts as hung, which no fault may cause."""

PASSED, TESTS_FAILED = 0, 1
"""Exit statuses of pytest that say something about the RTL; the others are about the run itself."""


@dataclass(frozen=True)
class Mutation:
    """A fault: `line` of `file` in rtl/ becomes `becomes`, and the module `bench`, built as `config`, has to notice."""

    fault: str
    file: str
    bench: str
    line: str
    becomes: str
    config: str = "default"


def mutations() -> list[Mutation]:
    """Read the list.

    Raises
    ------
    ValueError
        If a line does not occur exactly once in its file.
    """
    listed = [Mutation(**entry) for entry in tomllib.loads(LIST.read_text())["mutation"]]
    for mutation in listed:
        count = (RTL / mutation.file).read_text().count(mutation.line)
        if count != 1:
            raise ValueError(f"{LIST}: {mutation.file} has {count} times {mutation.line!r}, expected once")
    return listed


def bench_passes(scratch: Path, bench: str, config: str, faulty: bool) -> bool:
    """Whether a module's tests pass in a scratch copy.

    Raises
    ------
    RuntimeError
        If they could not be run, or fail on the RTL as it is: then they say nothing about a fault.
    """
    command = [sys.executable, "-m", "pytest", "-x", "-q", "tb/test_rtl.py", "-k", f"{bench}-verilator-{config}"]
    path = os.pathsep.join([str(scratch / "model"), str(scratch)])
    environment = os.environ | {"PYTHONPATH": path}
    run = subprocess.run(
        command, cwd=scratch, env=environment, capture_output=True, text=True, timeout=TIMEOUT, check=False
    )
    log = scratch / "bench.log"
    log.write_text(run.stdout + run.stderr)
    if run.returncode not in (PASSED, TESTS_FAILED) or "does not build" in run.stdout:
        raise RuntimeError(f"the tests of {bench} could not be run ({log})")
    if run.returncode != PASSED and not faulty:
        raise RuntimeError(f"the tests of {bench} fail without any fault ({log})")
    return run.returncode == PASSED


def renew(scratch: Path, mutation: Mutation | None) -> None:
    """Copy the sources, with a fault or as they are; what was built in the scratch copy before stays."""
    for name in COPIED:
        shutil.rmtree(scratch / name, ignore_errors=True)
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, scratch / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copyfile(ROOT / name, scratch / name)
    if mutation is not None:
        path = scratch / "rtl" / mutation.file
        path.write_text(path.read_text().replace(mutation.line, mutation.becomes))


def main() -> int:
    """Run all mutations, print the score and return 1 if one survived."""
    listed = mutations()
    workers: SimpleQueue[Path] = SimpleQueue()
    count = os.cpu_count() or 1
    for number in range(count):
        (SCRATCH / str(number)).mkdir(parents=True, exist_ok=True)
        workers.put(SCRATCH / str(number))

    def passes(bench: tuple[str, str], mutation: Mutation | None) -> tuple[bool, float]:
        scratch, start = workers.get(), time.monotonic()
        try:
            renew(scratch, mutation)
            return bench_passes(scratch, *bench, mutation is not None), time.monotonic() - start
        finally:
            workers.put(scratch)
            progress.advance(task)

    # A bench that fails without a fault would kill everything, so each runs on the RTL as it is first.
    benches = sorted({(mutation.bench, mutation.config) for mutation in listed})
    with Progress() as progress, ThreadPoolExecutor(count) as pool:
        task = progress.add_task("mutations", total=len(benches) + len(listed))
        list(pool.map(lambda bench: passes(bench, None), benches))
        results = list(pool.map(lambda mutation: passes((mutation.bench, mutation.config), mutation), listed))

    rows = [
        asdict(mutation) | {"killed": not survived, "seconds": round(seconds, 1)}
        for mutation, (survived, seconds) in zip(listed, results, strict=True)
    ]
    killed = sum(row["killed"] for row in rows)
    table = Table(title=f"{killed} of {len(rows)} faults caught")
    for column in ("bench", "fault", "result"):
        table.add_column(column)
    for row in rows:
        table.add_row(row["bench"], row["fault"], "killed" if row["killed"] else "[bold red]survived")
    Console().print(table)
    content = {
        "tools": report.tools("cocotb", "pytest", "verilator"),
        "killed": killed,
        "total": len(rows),
        "rows": rows,
    }
    print(report.write("mutate", content))
    return 0 if killed == len(rows) else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (ValueError, RuntimeError, subprocess.TimeoutExpired) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
