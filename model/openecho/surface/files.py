"""Files of surfaces: grids as GeoTIFF, triangles as PLY, classified points as LAS."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError

from openecho.surface.points import Cloud
from openecho.surface.terrain import Grid
from openecho.tables.table import TableError

Floats = NDArray[np.float64]

NOWHERE = -9999.0
"""Height that stands for none in a GeoTIFF."""

LOCAL = 'LOCAL_CS["metres of a scene",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'
"""Coordinate system of what tells none: a map's axes, from a place that nobody knows."""

OFFSET = "comment offset"
"""Before x, y and z of what a mesh's coordinates count from: single, they are too short for those of a map."""

STEP = 1e-3
"""Of LAS coordinates, m."""

MOST_AWAY = STEP * (2**31 - 2**10)
"""Of a point of LAS from its offset, m."""


def coordinate_system(text: str | None) -> Any:
    """A coordinate system of rasterio from OGC WKT or EPSG:NUMBER; a local one if there is none.

    Raises
    ------
    TableError
        If it can't be understood.
    """
    rasterio = _rasterio()
    try:
        return rasterio.crs.CRS.from_user_input(LOCAL if text is None else text)
    except rasterio.errors.CRSError as error:
        raise TableError(f"coordinate system: found {text!r}, expected EPSG:NUMBER or WKT") from error


def transformed(given: Any, wanted: Any, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Coordinates (n,) of one system of rasterio in another; nan where there are none."""
    _rasterio()
    from rasterio.warp import transform

    # PROJ gives infinity for what is nowhere.
    east, north = (np.asarray(column, np.float64) for column in transform(given, wanted, x, y))
    return np.where(np.isfinite(east), east, np.nan), np.where(np.isfinite(north), north, np.nan)


def write_grid(path: Path, heights: Floats, grid: Grid, system: str | None) -> None:
    """Write heights as a GeoTIFF, float32, tiled and compressed, complete or not at all.

    Parameters
    ----------
    path : Path
    heights : float64 (rows, columns)
        m; nan becomes `NOWHERE`, the file's own value for no data.
    grid : Grid
    system : str or None
        As of `coordinate_system`.

    Raises
    ------
    TableError
        If the coordinate system can't be understood.
    OSError
        If the file can't be written.
    """
    rasterio = _rasterio()
    profile = {
        "driver": "GTiff",
        "dtype": "float32",
        "count": 1,
        "height": grid.shape[0],
        "width": grid.shape[1],
        "crs": coordinate_system(system),
        "transform": rasterio.transform.from_origin(grid.west, grid.north, grid.cell, grid.cell),
        "nodata": NOWHERE,
        "compress": "deflate",
        "predictor": 3,
        "tiled": True,
    }

    def write(partial: Path) -> None:
        with rasterio.open(partial, "w", **profile) as file:
            file.write(np.where(np.isnan(heights), NOWHERE, heights).astype(np.float32), 1)

    _whole(path, write)


def read_grid(path: Path) -> tuple[Floats, Grid, str | None]:
    """Read heights from a GeoTIFF.

    Parameters
    ----------
    path : Path
        North up, its cells squares, heights in the first band.

    Returns
    -------
    heights : float64 (rows, columns)
        nan where there are none.
    grid : Grid
    wkt : str or None
        Coordinate system, if it tells one.

    Raises
    ------
    TableError
        If it is none: what was found and what was expected.
    OSError
        If it can't be read.
    """
    rasterio = _rasterio()
    try:
        with path.open("rb") as file, rasterio.open(file) as image:
            band = image.read(1, masked=True).astype(np.float64)
            east, tilt, west, lean, north, top = image.transform[:6]
            system = image.crs
    except rasterio.errors.RasterioError as error:
        raise TableError(f"{path}: {str(error).splitlines()[0]}, expected a GeoTIFF") from error
    if tilt or lean or east <= 0 or not np.isclose(east, -north):
        raise TableError(f"{path}: found cells of {east:g} × {north:g}, expected squares, north up")
    return band.filled(np.nan), Grid(west, top, east, band.shape), None if system is None else system.to_wkt()


def write_mesh(path: Path, ground: Floats) -> None:
    """Write triangulated points (n, 3) as PLY, complete or not at all.

    Its coordinates count from a corner that a comment tells, `OFFSET`.

    Raises
    ------
    TableError
        If they make no triangle.
    """
    import trimesh  # optional

    points = ground[np.isfinite(ground).all(axis=1)]
    try:
        faces = Delaunay(points[:, :2] - points[:, :2].min(axis=0)).simplices
    except (QhullError, ValueError) as error:
        raise TableError(
            f"{path}: found {len(points)} points of the ground, expected three or more, not in line"
        ) from error
    corner = np.floor(points.min(axis=0))
    content = trimesh.exchange.ply.export_ply(trimesh.Trimesh(points - corner, faces, process=False))
    head, rest = content.split(b"\nelement", 1)
    told = f"\n{OFFSET} {corner[0]:.0f} {corner[1]:.0f} {corner[2]:.0f}".encode()
    _whole(path, lambda partial: partial.write_bytes(head + told + b"\nelement" + rest))


def read_mesh(path: Path) -> tuple[Floats, NDArray[np.int64]]:
    """Read triangles from PLY: corners (n, 3), m, and which three each has (k, 3).

    Raises
    ------
    TableError
        If it is none.
    OSError
        If it can't be read.
    """
    import trimesh  # optional

    content = path.read_bytes()
    try:
        loaded = trimesh.load_mesh(io.BytesIO(content), file_type="ply", process=False)
        corners, faces = np.array(loaded.vertices, np.float64), np.array(loaded.faces, np.int64)
        head = content.partition(b"end_header")[0].decode().splitlines()
        corner = [line.removeprefix(OFFSET).split() for line in head if line.startswith(OFFSET)]
        corners += np.array(corner[0] if corner else (0, 0, 0), np.float64)
    except (ValueError, IndexError, KeyError, AttributeError, TypeError) as error:
        raise TableError(f"{path}: {error}, expected triangles as PLY") from error
    return corners, faces


def write_points(path: Path, cloud: Cloud) -> None:
    """Write points with their classes as LAS 1.4, or LAZ, complete or not at all.

    Width and waveform are dimensions of their own. Points for which LAS has no place are left out: those without one,
    and those more than two thousand kilometres from the middle of all.
    """
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams("waveform", "i8", "waveform of the file, from 0"),
            laspy.ExtraBytesParams("width", "f4", "bins, sigma of the echo"),
        ]
    )
    points = cloud.points[np.isfinite(cloud.places).all(axis=1)]
    header.scales = np.full(3, STEP)
    header.offsets = np.array([np.floor(np.median(points[axis])) if len(points) else 0 for axis in "xyz"])
    away = np.stack([abs(points[axis] - middle) for axis, middle in zip("xyz", header.offsets, strict=True)])
    points = points[(away < MOST_AWAY).all(axis=0)]
    header.generating_software = "OpenEcho"
    header.global_encoding.wkt = True
    if cloud.wkt is not None:
        header.vlrs.append(WktCoordinateSystemVlr(cloud.wkt))
    las = laspy.LasData(header)
    las.x, las.y, las.z = (points[axis] for axis in "xyz")
    las.intensity = np.rint(np.nan_to_num(points["intensity"])).clip(0, 2**16 - 1).astype(np.uint16)
    las.return_number = points["number"].clip(0, 15)
    las.number_of_returns = points["count"].clip(0, 15)
    las.classification = points["class"]
    las["waveform"], las["width"] = points["waveform"], points["width"]

    def write(partial: Path) -> None:
        with partial.open("wb") as file:
            las.write(file, do_compress=path.suffix.casefold() == ".laz")

    _whole(path, write)


def _whole(path: Path, write: Callable[[Path], object]) -> None:
    """Write beside a file, then put it in its place."""
    partial = path.with_name(f"partial_{path.name}")
    try:
        write(partial)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _rasterio() -> Any:
    try:
        import rasterio
        import rasterio.errors
        import rasterio.transform
    except ImportError as error:
        raise TableError("rasterio is not installed, expected it: pip install 'openecho[surface]'") from error
    return rasterio
