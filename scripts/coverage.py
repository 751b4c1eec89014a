"""Count what the benches reach of the RTL: lines and branches, of which a floor must hold, and toggles of every bit.

The benches run once more on Verilator, built so that it counts. A point is a statement or a branch, or a bit and a
direction in which it toggles, in whatever module instance or build: a build without floating point has none of its.
What can't be reached is excluded, with its reason, in tb/coverage.toml. The report is build/reports/coverage.json.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from openecho import report
from openecho.hardware import ROOT
from tb.env.runner import COVERAGE_VARIABLE

FOLDER = ROOT / "build" / "coverage"
EXCLUSIONS = ROOT / "tb" / "coverage.toml"
FLOOR = 0.98
"""Share of the lines and branches that must be reached."""

BENCHES = (
    ("tb/test_rtl.py", "tb/test_axi.py", "-m", "counted"),
    ("tb/float", "-k", "verilator and exact_under"),
)
"""What runs, and which of its tests: modules and AXI shell; float units."""
VECTORS = "5000"
"""For each float unit: lines and bits are reached by its directed operands."""


@dataclass(frozen=True)
class Point:
    """What Verilator counts at one place of a source.

    Attributes
    ----------
    file : str
        Relative to the repository.
    line : int
    toggle : bool
        Whether it is a bit that toggles, else a statement or a branch.
    what : str
        Bit and direction; or ``if``, ``else``, ``block`` and the column.
    """

    file: str
    line: int
    toggle: bool
    what: str


def run_benches() -> None:
    """Run the benches with counting.

    Raises
    ------
    CalledProcessError
        If a bench fails.
    """
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    environment = os.environ | {COVERAGE_VARIABLE: str(FOLDER), "OPENECHO_FLOAT_VECTORS": VECTORS}
    for chosen in BENCHES:
        command = [sys.executable, "-m", "pytest", "-q", "-n", "auto", "--dist", "worksteal", *chosen]
        subprocess.run(command, cwd=ROOT, env=environment, check=True)


def read(paths: Iterable[Path]) -> dict[Point, bool]:
    """All points, and whether any simulation reached them in any instance.

    A file has lines of ``C '<attributes>' <count>``, a point each; the last attribute, h, is the instance.
    """
    found, reached = set[bytes](), set[bytes]()
    for path in paths:
        with path.open("rb") as file:
            for line in file:
                attributes, _, count = line.rpartition(b"' ")
                raw = attributes.partition(b"\1h\2")[0]
                found.add(raw)
                if count.strip() != b"0":
                    reached.add(raw)
    points: dict[Point, bool] = {}
    for raw in found:  # with other parameters a module has another name, and the same points
        point = parsed(raw)
        if point is not None:
            points[point] = points.get(point, False) or raw in reached
    return points


def parsed(attributes: bytes) -> Point | None:
    """Point of the RTL from its attributes, names and values between control characters; None for any other file."""
    values = dict(pair.split("\2", 1) for pair in attributes.decode().split("\1")[1:])
    if not values or not Path(values["f"]).is_relative_to(ROOT / "rtl"):
        return None
    toggle = values["page"].startswith("v_toggle/")
    what = values["o"] if toggle else f"{values['o']} column {values['n']}"
    return Point(str(Path(values["f"]).relative_to(ROOT)), int(values["l"]), toggle, what)


def exclude(missed: Iterable[Point]) -> tuple[list[Point], list[str]]:
    """Points that no exclusion argues away, and exclusions that argue away nothing."""
    listed = [
        (entry["file"], name)
        for entry in tomllib.loads(EXCLUSIONS.read_text())["excluded"]
        for name in entry["functions"]
    ]
    spans = {place: body(*place) for place in listed}
    left, used = [], set()
    for point in missed:
        within = [place for place in listed if place[0] == point.file and point.line in spans[place]]
        used.update(within)
        if not within:
            left.append(point)
    return left, [f"{name} of {file}" for file, name in listed if (file, name) not in used]


def body(file: str, name: str) -> range:
    """Lines of a function, from 1; none if there is no such function."""
    lines = (ROOT / file).read_text().splitlines()
    begin = [number for number, line in enumerate(lines, 1) if re.search(rf"\bfunction automatic .*\b{name}\(", line)]
    if not begin:
        return range(0)
    end = next(number for number, line in enumerate(lines, 1) if number > begin[0] and "endfunction" in line)
    return range(begin[0], end + 1)


def summary(points: dict[Point, bool], left: list[Point]) -> list[dict[str, Any]]:
    """Points of each file: how many there are, and how many were reached or argued away."""
    rows: dict[str, dict[str, Any]] = defaultdict(lambda: dict.fromkeys(("lines", "reached", "toggles", "toggled"), 0))
    open_points = set(left)
    for point, reached in sorted(points.items(), key=lambda item: (item[0].file, item[0].line)):
        row = rows[point.file]
        row["toggles" if point.toggle else "lines"] += 1
        row["toggled" if point.toggle else "reached"] += reached if point.toggle else point not in open_points
    return [{"file": file, **row} for file, row in rows.items()]


def show(rows: list[dict[str, Any]], console: Console) -> None:
    """Print the table."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("file", no_wrap=True)
    for name in ("lines", "reached", "toggles", "toggled"):
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(
            row["file"],
            str(row["lines"]),
            share(row, "reached", "lines"),
            str(row["toggles"]),
            share(row, "toggled", "toggles"),
        )
    console.print(table)


def share(row: dict[str, Any], part: str, whole: str) -> str:
    """Percentage of a row."""
    return f"{row[part] / row[whole]:.1%}" if row[whole] else ""


def main() -> int:
    """Return 0 if the floor holds, 1 if not or if a bench failed."""
    console = Console(highlight=False)
    try:
        run_benches()
    except subprocess.CalledProcessError as error:
        print(f"error: the benches end with status {error.returncode}", file=sys.stderr)
        return 1
    points = read(FOLDER.glob("*.dat"))
    shutil.rmtree(FOLDER)  # gigabytes
    left, idle = exclude(point for point, reached in points.items() if not reached and not point.toggle)
    rows = summary(points, left)
    show(rows, console)
    total = {name: sum(row[name] for row in rows) for name in ("lines", "reached", "toggles", "toggled")}
    for point in sorted(left, key=lambda point: (point.file, point.line)):
        console.print(f"{point.file}:{point.line}: {point.what} never reached", soft_wrap=True)
    console.print(f"lines {share(total, 'reached', 'lines')}, toggles {share(total, 'toggled', 'toggles')}")
    content = {"tools": report.tools("verilator", "cocotb"), "floor": FLOOR, "total": total, "rows": rows}
    console.print(report.write("coverage", content), soft_wrap=True)
    if idle:
        print(f"error: {EXCLUSIONS}: found nothing missed in {idle[0]}, expected no exclusion of it", file=sys.stderr)
        return 1
    if total["reached"] < FLOOR * total["lines"]:
        print(f"error: {share(total, 'reached', 'lines')} of the lines reached, expected {FLOOR:.0%}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
