"""Numerical stability where it hurts; ``make extremes``. The report is ``build/reports/extremes.json``, with a page."""

from __future__ import annotations

import argparse
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from openecho import report
from openecho.study import page
from openecho.study.extremes.cases import CASES

HEAD = ("case", "tried", "guaranteed", "found", "with a fault", "found then")


def study(full: bool, seed: int) -> list[dict[str, Any]]:
    """Run all cases as they are and with their faults; a row of the report for each."""
    rows = []
    for case in track(CASES, "extremes", console=Console(stderr=True), transient=True):
        outcome, faulty = case.run(seed, full), case.broken(seed)
        row: dict[str, Any] = {"name": case.name, "area": case.area, "tried": case.tried, "guarantee": case.guarantee}
        row |= {"found": outcome.found, "held": outcome.held, "fault": case.fault}
        rows.append(row | {"fault_found": faulty.found, "caught": not faulty.held})
    return rows


def failed(row: dict[str, Any]) -> bool:
    """Whether a guarantee did not hold, or a fault was not noticed."""
    return not (row["held"] and row["caught"])


def write(rows: list[dict[str, Any]], full: bool, seed: int) -> Path:
    """Write report and page; return the report's path."""
    tools, date = report.tools("numpy", "scipy", "numba"), datetime.now(UTC).date().isoformat()
    content = {"tools": tools, "seed": seed, "quick": not full, "date": date, "rows": rows}
    path = report.write("extremes", content)
    cells = [[row[name] for name in ("name", "tried", "guarantee", "found", "fault", "fault_found")] for row in rows]
    sections = [
        page.Section(
            area.capitalize(),
            "",
            [
                page.table(
                    HEAD,
                    [cell for cell, row in zip(cells, rows, strict=True) if row["area"] == area],
                    prose=True,
                    failed=[failed(row) for row in rows if row["area"] == area],
                )
            ],
        )
        for area in dict.fromkeys(row["area"] for row in rows)
    ]
    lead = (
        f"{len(rows)} cases, of which {sum(row['held'] for row in rows)} held. Each was tried once more with a mistake "
        f"built in, and {sum(row['caught'] for row in rows)} of these were noticed. Rows that failed are red."
    )
    versions = ", ".join(f"{name} {number}" for name, number in tools.items())
    page.write(
        path.with_suffix(".html"), "OpenEcho at the extremes", lead, sections, f"{date}, seed {seed}, {versions}"
    )
    return path


def main() -> int:
    """Return 0 if every guarantee holds and every fault is noticed, else 1."""
    parser = argparse.ArgumentParser(prog="openecho.study.extremes", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="of all that is random (0)")
    parser.add_argument("--quick", action="store_true", help="about a second for each case, as the tests do")
    options = parser.parse_args()
    rows = study(not options.quick, options.seed)
    table = Table()
    for name in ("case", "found", "held", "fault noticed"):
        table.add_column(name)
    for row in rows:
        table.add_row(row["name"], row["found"], *("yes" if row[key] else "NO" for key in ("held", "caught")))
    Console().print(table)
    print(f"seed {options.seed}")
    path = write(rows, not options.quick, options.seed)
    print(path, path.with_suffix(".html"), sep="\n")
    return int(any(failed(row) for row in rows))


if __name__ == "__main__":
    sys.exit(main())
