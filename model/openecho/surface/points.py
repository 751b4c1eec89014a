"""Points: echoes that have a place, out of any table of echoes that this package writes, or any LAS."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from openecho.tables.parquet import require
from openecho.tables.table import TableError

POINT = np.dtype(
    [
        *((axis, np.float64) for axis in "xyz"),
        ("intensity", np.float32),
        ("width", np.float32),
        ("number", np.int16),
        ("count", np.int16),
        ("waveform", np.int64),
        ("class", np.uint8),
    ]
)
"""A point: x, y, z (m, or whatever the file has); intensity (the echo's amplitude, counts) and width (σ, bins), nan
where nobody knows; number of the echo, from 1, of how many of its waveform; the waveform, from 0; and its class."""

UNCLASSIFIED, GROUND, LOW, HIGH = 1, 2, 7, 18
"""Classes as LAS 1.4 has them: what is above the ground, the ground, and points that are none: too low, too high."""

CLASSES: Mapping[int, str] = {UNCLASSIFIED: "above ground", GROUND: "ground", LOW: "low noise", HIGH: "high noise"}
"""What this package calls them."""

NEEDED = ("x", "y", "z")

NEIGHBOURS = 8
"""In plan, that tell what is usual around a point: how far points are apart, how high they are."""


@dataclass(frozen=True)
class Cloud:
    """Points of a file.

    Attributes
    ----------
    points : structured (n,) of `POINT`
    wkt : str or None
        Coordinate system as OGC WKT, where the file tells it.
    """

    points: np.ndarray
    wkt: str | None = None

    @property
    def places(self) -> np.ndarray:
        """x, y and z (n, 3)."""
        return np.column_stack([self.points[axis] for axis in "xyz"])


def spacing(points: NDArray[np.float64]) -> float:
    """Root of the area that a point (n, 2 or 3) usually has in plan, m; 1 where that is nothing.

    Usually: over the area, not over the points, of which a wall may have more than the ground.

    Parameters
    ----------
    points : float64 (n, 2 or 3)
        m, finite.
    """
    count = min(NEIGHBOURS, len(points) - 1)
    if count < 1:
        return 1.0
    plan = points[:, :2]
    side = math.sqrt(np.ptp(plan, axis=0).prod() / len(plan))
    cells = np.floor((plan - plan.min(axis=0)) / (side or 1.0))
    _, spread = np.unique(cells, axis=0, return_index=True)
    distance, _ = cKDTree(plan).query(plan[spread], count + 1, workers=-1)
    found = float(np.median(distance[:, count])) * math.sqrt(math.pi / count)
    return found if found > 0 else 1.0


def read(path: Path) -> Cloud:
    """Read points.

    Parameters
    ----------
    path : Path
        ``.csv``, ``.npz``, ``.parquet`` with the columns of `openecho.decompose.COLUMNS`, ``.las`` or ``.laz``.

    Returns
    -------
    Cloud
        Echoes without a place, nan, are among them.

    Raises
    ------
    TableError
        For a file that is none of these or has no positions: which, what was found and what was expected.
    OSError
        If it can't be read.
    """
    suffix = path.suffix.casefold()
    if suffix not in READERS:
        raise TableError(f"{path}: found suffix {path.suffix!r}, expected one of {', '.join(READERS)}")
    return READERS[suffix](path)


def _csv(path: Path) -> Cloud:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.reader(file)
            names = next(reader, [])
            _check(path, names)
            kept = [names.index(name) for name in WANTED if name in names]
            rows = [[row[k] for k in kept] for row in reader]
        table = np.array(rows, np.float64).reshape(len(rows), len(kept))
    except (ValueError, IndexError, csv.Error, UnicodeDecodeError) as error:
        if isinstance(error, TableError):
            raise
        raise TableError(f"{path}: {error}, expected numbers in each row, as many as names in the first") from error
    return Cloud(_points({names[k]: table[:, at] for at, k in enumerate(kept)}))


def _npz(path: Path) -> Cloud:
    try:
        with np.load(path, allow_pickle=False) as file:
            _check(path, file.files)
            columns = {name: file[name] for name in WANTED if name in file.files}
    except (ValueError, EOFError, KeyError) as error:
        if isinstance(error, TableError):
            raise
        raise TableError(f"{path}: {error}, expected an archive of columns") from error
    shapes = {name: column.shape for name, column in columns.items()}
    if len(set(shapes.values())) != 1 or len(shapes["x"]) != 1:
        raise TableError(f"{path}: found columns of shapes {shapes}, expected one dimension, the same for all")
    return Cloud(_points(columns))


def _parquet(path: Path) -> Cloud:
    parquet = require(path)
    import pyarrow as pa

    try:
        names = parquet.read_schema(path).names
        _check(path, names)
        table = parquet.read_table(path, columns=[name for name in WANTED if name in names])
    except (pa.ArrowInvalid, pa.ArrowException) as error:
        raise TableError(f"{path}: {str(error).splitlines()[0]}, expected Parquet") from error
    return Cloud(_points({name: table[name].to_numpy() for name in table.column_names}))


def _las(path: Path) -> Cloud:
    try:
        file = laspy.read(path)
    except (laspy.LaspyException, ValueError, EOFError, RuntimeError) as error:
        raise TableError(f"{path}: {error}, expected LAS or LAZ") from error
    extra = set(file.point_format.extra_dimension_names)
    # Of LAS that others wrote the pulse is not known; of ours the waveform stands in a dimension of its own.
    columns: dict[str, Any] = {axis: np.asarray(file[axis], np.float64) for axis in "xyz"}
    columns |= {name: np.asarray(file[name]) for name in ("waveform", "width", "amplitude") if name in extra}
    columns.setdefault("amplitude", np.asarray(file.intensity))
    columns["number"] = np.asarray(file.return_number).astype(np.int64) - 1
    points = _points(columns)
    points["count"] = np.asarray(file.number_of_returns)
    points["class"] = np.asarray(file.classification)
    system = next((vlr.string for vlr in file.header.vlrs if isinstance(vlr, WktCoordinateSystemVlr)), None)
    return Cloud(points, system or None)


WANTED = (*NEEDED, "waveform", "number", "amplitude", "width")
"""Columns of a table of echoes that a point is made of."""

READERS: Mapping[str, Callable[[Path], Cloud]] = {
    ".csv": _csv,
    ".npz": _npz,
    ".parquet": _parquet,
    ".las": _las,
    ".laz": _las,
}
"""What reads which suffix."""


def _check(path: Path, names: list[str]) -> None:
    missing = [name for name in NEEDED if name not in names]
    if missing:
        raise TableError(f"{path}: no column {', '.join(missing)}, expected echoes with positions")


def _points(columns: Mapping[str, Any]) -> np.ndarray:
    """Points of columns of a table of echoes, in the order of its rows."""
    points = np.zeros(len(columns["x"]), POINT)
    for axis in "xyz":
        points[axis] = columns[axis]
    points["intensity"] = columns.get("amplitude", np.nan)
    points["width"] = columns.get("width", np.nan)
    points["waveform"] = columns.get("waveform", np.arange(len(points)))
    points["number"] = np.asarray(columns.get("number", np.zeros(len(points)))) + 1
    _, waveform, count = np.unique(points["waveform"], return_inverse=True, return_counts=True)
    points["count"] = count[waveform] if len(points) else 0
    points["class"] = UNCLASSIFIED
    return points
