"""From waveforms to terrain; ``make terrain``. The report is ``build/reports/terrain.json``, pictures are beside it."""

from __future__ import annotations

import argparse
import shutil
import sys
from datetime import UTC, datetime
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from openecho import report
from openecho.study import figure
from openecho.study.terrain import experiment, filters, picture, scaling
from openecho.study.terrain.flights import SHOTS, echoes, fly

FOLDER = report.FOLDER.parent / "terrain"
"""Waveforms and echoes, until the study is complete: an interrupted one goes on with them."""

CELLS = {"mountain": 5.0, "forest": 1.0, "roofs": 1.0}
"""Of the elevation models, m."""

SHARES = {False: 1.0, True: 0.1}
"""Of the flights, in full and quick."""


def study(seed: int, *, quick: bool, console: Console) -> tuple[dict[str, Any], dict[str, Any]]:
    """Content of the report, and its pictures by name."""
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        stage, detail = progress.add_task("terrain", total=None), progress.add_task("", total=None)

        def advance(doing: str, done: int, total: int | None) -> None:
            progress.update(detail, description=doing, completed=done, total=total)

        def told(what: str) -> None:
            progress.update(stage, description=what)

        flights = {}
        for name in SHOTS:
            told(f"flight over the {name}")
            flights[name] = fly(name, FOLDER, seed, SHARES[quick], advance)
        compared = []
        for name, flight in flights.items():
            told(f"ground filters, {name}")
            cloud, of_ground = echoes(flight, "gaussian", advance)
            progress.update(detail, description="filters tried", completed=0, total=None)
            compared += filters.compare(
                flight, cloud.places, of_ground, CELLS[name], lambda: progress.advance(detail), quick=quick
            )
        rows, made = [], {}
        for variant, method, one in experiment.terrains(flights["mountain"], seed, advance, told):
            rows.append(one.row)
            made[variant, method] = one
        told("cost of a million points")
        costs = scaling.costs(scaling.COUNTS[:2] if quick else scaling.COUNTS, seed)
    mountain = flights["mountain"]
    shown = {method: made[DENOISED, method] for method in experiment.METHODS}
    pictures = {
        "terrain_pixels": picture.pixels(mountain, shown, DENOISED),
        "terrain": picture.terrains(mountain, shown["V–L"], f"V–L, {DENOISED}"),
        "terrain_cost": picture.cost(costs),
    }
    content = {
        "tools": report.tools("numpy", "scipy", "numba", "cloth-simulation-filter"),
        "date": datetime.now(UTC).date().isoformat(),
        "seed": seed,
        "quick": quick,
        "filters": compared,
        "experiment": rows,
        "cost": costs,
    }
    return content, pictures


DENOISED = f"{experiment.PULSES} weak pulses, denoised"
"""Waveforms of the pictures."""


def tables(content: dict[str, Any]) -> list[Table]:
    """What a terminal is told."""
    made = []
    heads = {
        "filters": ("scene", "filter", "type_1", "type_2", "total", "model_rms", "model_95", "covered", "seconds"),
        "experiment": ("waveforms", "method", "echoes", "echoes_of_ground", "ground_rms", "total", "model_rms"),
        "cost": ("points", "unknown", "filter", "grid"),
    }
    for part, names in heads.items():
        table = Table(*(name.replace("_", " ") for name in names), title=part)
        for row in content[part]:
            table.add_row(*(f"{row[name]:.4f}" if isinstance(row[name], float) else str(row[name]) for name in names))
        made.append(table)
    return made


def main() -> int:
    """Return 0."""
    parser = argparse.ArgumentParser(prog="openecho.study.terrain", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of scenes, noise and all else (1)")
    parser.add_argument("--quick", action="store_true", help="a tenth of the flights, few settings, few points")
    options = parser.parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    content, pictures = study(options.seed, quick=options.quick, console=Console(stderr=True))
    for table in tables(content):
        Console().print(table)
    print(f"seed {options.seed}")
    path = report.write("terrain", content)
    print(path)
    for name, drawn in pictures.items():
        figure.save(drawn, path.with_name(f"{name}.png"))
        print(path.with_name(f"{name}.png"))
    shutil.rmtree(FOLDER)
    return 0


if __name__ == "__main__":
    sys.exit(main())
