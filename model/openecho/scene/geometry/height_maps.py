"""Heights out of a file: GeoTIFF, ASCII grid or a NumPy array."""

from __future__ import annotations

import importlib
import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from openecho.scene import schema
from openecho.scene.document import MOST_SAID, SceneError
from openecho.scene.units import quoted

Floats = NDArray[np.float64]
Extent = tuple[float, float, float, float]

BYTES = 2 * 8
"""Of a sample while it is read: as the file gives it, and as it is handed on."""

UNEQUAL = 1e-6
"""Share by which the sides of a cell may differ: some files tell them with few digits."""


@dataclass(frozen=True)
class Heights:
    """Heights at the corners of square cells.

    Attributes
    ----------
    z : float64 (ny, nx)
        m; rows from south to north, columns from west to east; NaN where there are none.
    x, y : float
        Where ``z[0, 0]`` is, m.
    cell : float
        Side of a cell, m.
    """

    z: Floats
    x: float
    y: float
    cell: float


@dataclass(frozen=True)
class _Source:
    """A map that is open.

    Attributes
    ----------
    rows, columns : int
        Samples from south to north and from west to east.
    west, south : float
        Outer corner of the south-western sample's cell, m.
    cell : float
        Side of a cell, m.
    read : callable
        Heights, m, of some rows, counted from the south, and columns.
    """

    rows: int
    columns: int
    west: float
    south: float
    cell: float
    read: Callable[[slice, slice], Floats]


def read_map(given: schema.HeightMap, key: str, extent: Extent | None = None) -> Heights:
    """Read a terrain's heights.

    Parameters
    ----------
    given : HeightMap
        The file; each sample is in the middle of its cell.
    key : str
        Of `given` in the scene, for errors.
    extent : tuple of four floats, optional
        Least x, least y, greatest x and greatest y, m: only samples whose cells touch it are read, and one more
        around. Left out: all.

    Returns
    -------
    Heights
        Of shape (0, 0) if there are none within the extent.

    Raises
    ------
    SceneError
        If the file can't be used, or takes more memory than there is: one line with the key, the file, what was found
        and what was expected.
    ModuleNotFoundError
        If rasterio is not installed; a NumPy array does without.
    """
    name = f"{key}.file: {quoted(given.file, MOST_SAID)}"
    bare = given.file.suffix.lower() == ".npy"
    opened = _array(given, name) if bare else _raster(given, name, required("rasterio"))
    with readable(name, "heights"), opened as source:
        rows, columns = _window(source, extent)
        z = _heights(source, rows, columns, name)
    x = source.west + (columns.start + 0.5) * source.cell
    y = source.south + (rows.start + 0.5) * source.cell
    return Heights(z, x, y, source.cell)


def required(module: str) -> Any:
    """A module of a package that only scenes need, or a ModuleNotFoundError that says how to get it."""
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{package} is not installed, expected it: pip install 'openecho[scene]'", name=package
        ) from error


@contextmanager
def readable(name: str, what: str) -> Iterator[None]:
    """Turn whatever a library makes of a damaged file into a SceneError; `name` is the key with the file."""
    try:
        with np.errstate(all="ignore"):  # what is not finite is looked for afterwards
            yield
    except SceneError:
        raise
    except Exception as error:  # each library raises what it happens to stumble over
        reason = " ".join(str(error.__cause__ or error).split()) or type(error).__name__
        raise SceneError(f"{name}: found no {what} ({quoted(reason, MOST_SAID)}), expected some") from error


def enough_memory(name: str, what: str, needed: float) -> None:
    """Raise a SceneError if there is less memory than is needed, bytes; `name` is the key with the file."""
    there = psutil.virtual_memory().available
    if needed > there:
        takes = f"which take {needed / 1e9:.3g} GB"
        raise SceneError(f"{name}: found {what}, {takes}, expected at most {there / 1e9:.3g} GB")


@contextmanager
def _array(given: schema.HeightMap, name: str) -> Iterator[_Source]:
    # Not np.load, which would take an archive, too, and leave it open.
    stored: NDArray[Any] = np.lib.format.open_memmap(given.file, mode="r")
    if stored.ndim != 2 or stored.dtype.kind not in "iuf":
        raise SceneError(f"{name}: found a {stored.ndim}-D array of {stored.dtype}, expected a 2-D one of numbers")
    assert given.cell is not None
    assert given.corner is not None
    rows, columns = stored.shape
    northward = stored[::-1]
    yield _Source(rows, columns, *given.corner, given.cell, lambda *part: np.array(northward[part], np.float64))


@contextmanager
def _raster(given: schema.HeightMap, name: str, rasterio: Any) -> Iterator[_Source]:
    # As float32, an ASCII grid's heights would lose digits.
    grid = given.file.suffix.lower() == ".asc"
    options = {"driver": "AAIGrid", "DATATYPE": "Float64"} if grid else {"driver": "GTiff"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(given.file, **options) as file:
            _check_place(file, name)
            west, south = file.transform.c, file.transform.f + min(file.height * file.transform.e, 0.0)
            yield _Source(file.height, file.width, west, south, file.transform.a, lambda *part: _band(file, *part))


def _check_place(file: Any, name: str) -> None:
    """Raise a SceneError if a raster's cells aren't squares in metres, along x and y."""
    transform, crs = file.transform, file.crs
    if transform.is_identity or not np.isfinite(transform).all():
        raise SceneError(f"{name}: found no transform, expected one that tells the place of its cells")
    if transform.b or transform.d or transform.a <= 0:
        raise SceneError(f"{name}: found a rotated or sheared map, expected rows from west to east")
    if abs(transform.a - abs(transform.e)) > UNEQUAL * transform.a:
        raise SceneError(f"{name}: found cells of {transform.a:.9g} × {abs(transform.e):.9g}, expected square ones")
    if crs and crs.is_geographic:
        raise SceneError(f"{name}: found coordinates in degrees, expected projected ones in metres")
    if crs and crs.is_projected and crs.linear_units_factor[1] != 1:
        raise SceneError(f"{name}: found coordinates in {quoted(crs.linear_units)}, expected ones in metres")


def _band(file: Any, rows: slice, columns: slice) -> Floats:
    """Heights in the first band, with rows counted from the south."""
    southward = file.transform.e < 0
    first, last = (file.height - rows.stop, file.height - rows.start) if southward else (rows.start, rows.stop)
    window = (first, last), (columns.start, columns.stop)
    read = file.read(1, window=window, masked=True, out_dtype=np.float64)
    z: Floats = read.data
    z *= file.scales[0]
    z += file.offsets[0]
    z[np.ma.getmaskarray(read)] = np.nan
    return np.ascontiguousarray(z[::-1]) if southward else z


def _window(source: _Source, extent: Extent | None) -> tuple[slice, slice]:
    """Rows and columns of the samples that are wanted."""
    if extent is None:
        return slice(0, source.rows), slice(0, source.columns)
    rows = _touched(extent[1] - source.south, extent[3] - source.south, source.cell, source.rows)
    columns = _touched(extent[0] - source.west, extent[2] - source.west, source.cell, source.columns)
    return (rows, columns) if rows.stop and columns.stop else (slice(0, 0), slice(0, 0))


def _touched(low: float, high: float, cell: float, count: int) -> slice:
    """Which of a number of cells, the first of which begins at 0, touch an interval, and one more at either end."""
    # An interval may end far away, even at infinity.
    first = math.ceil(min(max(low / cell, -1.0), count + 1.0)) - 1
    last = math.floor(min(max(high / cell, -1.0), count + 1.0))
    return slice(max(first - 1, 0), min(last + 2, count)) if first < count and last >= 0 else slice(0, 0)


def _heights(source: _Source, rows: slice, columns: slice, name: str) -> Floats:
    """Read a part of a map, (0, 0) if there is nothing in it."""
    if min(source.rows, source.columns) < 2:
        raise SceneError(f"{name}: found {source.rows} × {source.columns} samples, expected at least 2 × 2")
    samples = (rows.stop - rows.start) * (columns.stop - columns.start)
    enough_memory(name, f"{samples} samples", BYTES * samples)
    z = source.read(rows, columns) if samples else np.zeros((0, 0))
    infinite = np.count_nonzero(np.isinf(z))
    if infinite:
        raise SceneError(f"{name}: found {infinite} infinite heights, expected finite ones")
    if not np.isnan(z).all():
        return z
    if samples == source.rows * source.columns:
        raise SceneError(f"{name}: found no height in {samples} samples, expected some")
    return np.zeros((0, 0))
