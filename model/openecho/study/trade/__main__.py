"""What speed costs; ``make trade``. The report is ``build/reports/trade.json``, with a page and a picture beside it."""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from datetime import UTC, datetime
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from openecho import report
from openecho.study import figure
from openecho.study.bench import SINGLE_THREAD
from openecho.study.trade import accuracy, advice, cost, page, picture
from openecho.study.trade.sets import recipes
from openecho.study.trade.ways import EXTENTS

SIZES = {"full": 1000, "quick": 100}
"""Waveforms of a set."""


def study(extent: str, seed: int, data: Path | None) -> dict[str, Any]:
    """Content of the report; `scripts/ways.py` has been run before."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("speed of all ways on one core", total=None)
        ways = cost.costs(extent == "quick", seed)
        progress.update(task, description="accuracy, sets", total=0)
        made = recipes(SIZES[extent], seed, data)
        progress.update(task, total=len(made))
        sets, accuracies = [], []
        with ProcessPoolExecutor(len(os.sched_getaffinity(0)), get_context("spawn")) as pool:
            for described, rows in pool.map(accuracy.judged, made):
                sets.append(described)
                accuracies += rows
                progress.advance(task)
    content: dict[str, Any] = {
        "tools": cost.hardware()["tools"] | report.tools("numpy", "scipy", "numba"),
        "seed": seed,
        "quick": extent == "quick",
        "date": datetime.now(UTC).date().isoformat(),
        "machine": cost.machine(),
        "ways": ways,
        "sets": sets,
        "accuracy": accuracies,
        "paper": cost.comparison(ways),
    }
    return content | {"advice": advice.advice(content), "claims": advice.claims(content)}


def table(content: dict[str, Any]) -> Table:
    """What a terminal is told: each way's speed, area, and what it finds of the land waveforms."""
    shown = Table(title="land waveforms: found, RMS of the peak in bins and over its bound; waveforms a second; LUTs")
    for name in ("way", "found", "peak", "/ bound", "waveforms/s", "software/s", "LUT"):
        shown.add_column(name, justify="left" if name == "way" else "right", no_wrap=True)
    land = {row["way"]: row for row in content["accuracy"] if row["set"] == "land"}
    for row in content["ways"]:
        found = land[row["name"]]
        numbers = (
            found["peak"]["rms"],
            found["peak"]["bound"],
            row["waveforms_per_s"],
            row["software_per_s"],
            row["lut"],
        )
        cells = ("" if value is None else form.format(value) for value, form in zip(numbers, FORMS, strict=True))
        shown.add_row(row["name"], f"{found['detected']:.1%}", *cells)
    return shown


FORMS = ("{:.3f}", "{:.2f}", "{:,.0f}", "{:,.0f}", "{:,}")
"""Of the numbers of `table`."""


def main() -> int:
    """Return 0, or 2 if it could not be tried."""
    parser = argparse.ArgumentParser(prog="openecho.study.trade", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="of all that is random (0)")
    parser.add_argument("--extent", default="full", choices=EXTENTS, help=f"waveforms of a set: {SIZES} (full)")
    options = parser.parse_args()
    if any(os.environ.get(name) != value for name, value in SINGLE_THREAD.items()):
        # Libraries take their number of threads when they are loaded, which they are by now: once more from the start.
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | SINGLE_THREAD)
    data = os.environ.get("OPENECHO_DATA")
    try:
        content = study(options.extent, options.seed, Path(data) if data else None)
    except FileNotFoundError as error:
        print(f"error: no {error.filename}: run make trade, which measures the hardware first", file=sys.stderr)
        return 2
    Console().print(table(content))
    for claim in content["claims"]:
        print(claim)
    if not data:
        print("recorded sets are left out: set OPENECHO_DATA to their folder")
    print(f"seed {options.seed}")
    path = report.write("trade", content)
    page.write(content, path.with_suffix(".html"))
    figure.save(picture.draw(content), path.with_suffix(".png"))
    for suffix in (".json", ".html", ".png"):
        print(path.with_suffix(suffix))
    return 0


if __name__ == "__main__":
    sys.exit(main())
