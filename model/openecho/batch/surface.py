"""A table of echoes to terrain: points classified, grids of heights, triangles, each in a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from openecho.batch.decompose import Advance
from openecho.batch.distribute import run
from openecho.surface import files, terrain
from openecho.surface.ground import Tile, filtered, suited, tiles
from openecho.surface.points import GROUND, HIGH, LOW, UNCLASSIFIED, Cloud, read
from openecho.surface.unknown import unknown
from openecho.tables.table import TableError

GRIDS = (".tif", ".tiff")
POINTS = (".las", ".laz")
MESHES = (".ply",)

DEEPEST, TALLEST = -11_000.0, 10_000.0
"""m: no land and no sea floor is lower, none is higher."""


@dataclass(frozen=True)
class Surfacing:
    """What is to be made of which echoes.

    Attributes
    ----------
    source : Path
        As of `openecho.surface.points.read`.
    output : Path
        Elevation model of the ground, GeoTIFF.
    dsm, canopy, hillshade : Path or None
        Model of the highest points; heights over the ground; light on the ground from 0 to 1. GeoTIFF.
    points, mesh : Path or None
        All points with their classes, LAS or LAZ; the ground's triangles, PLY.
    cell : float
        Side of a grid's squares, m.
    smoothing, reach : float
        As of `openecho.surface.terrain.elevation`, m.
    settings : mapping
        Fields of `openecho.surface.ground.Filter` that are not to be as `openecho.surface.ground.suited` has them.
    lowest, highest : float
        Heights that are believed, m.
    system : str or None
        Coordinate system of the results, EPSG:NUMBER or WKT: that of the points where they tell none, else one that
        they are projected into.
    jobs : int
        Processes on this machine.
    scheduler : str or None
        Address of a Dask cluster.
    """

    source: Path
    output: Path
    dsm: Path | None = None
    canopy: Path | None = None
    hillshade: Path | None = None
    points: Path | None = None
    mesh: Path | None = None
    cell: float = 1.0
    smoothing: float = 0.0
    reach: float = np.inf
    settings: Mapping[str, float] = field(default_factory=dict)
    lowest: float = DEEPEST
    highest: float = TALLEST
    system: str | None = None
    jobs: int = 1
    scheduler: str | None = None


@dataclass(frozen=True)
class Surfaced:
    """What became of a job: how many points, how many of them are none and how many ground, and the grid."""

    points: int
    unknown: int
    ground: int
    grid: terrain.Grid


def surface_file(job: Surfacing, advance: Advance = lambda doing, done, total: None) -> Surfaced:
    """Make terrain of a table of echoes.

    Parameters
    ----------
    job : Surfacing
    advance : callable, optional
        Told of the progress.

    Returns
    -------
    Surfaced

    Raises
    ------
    TableError, DistributionError
        One line with what was found and what was expected: in the table, of a result's name, of the coordinate system,
        of the cluster.
    OSError
        If something can't be read or written.
    """
    _check(job)
    advance("reading", 0, None)
    cloud = _projected(read(job.source), job)
    places = cloud.places
    if not np.isfinite(places).all(axis=1).any():
        raise TableError(f"{job.source}: found {len(places)} echoes, none with a position, expected some")
    try:
        grid = terrain.grid_of(places, job.cell)
    except ValueError as error:
        raise TableError(f"{job.source}: {error}") from error
    none = unknown(places, lowest=job.lowest, highest=job.highest)
    classes = _classes(np.where((none > 0)[:, None], np.nan, places), job, advance)
    classes = np.where(none > 0, none, classes)
    cloud.points["class"] = classes
    advance("writing", 0, None)
    _write(job, cloud, grid)
    is_none = (classes == LOW) | (classes == HIGH)
    return Surfaced(len(places), int(is_none.sum()), int((classes == GROUND).sum()), grid)


def _check(job: Surfacing) -> None:
    """Refuse names of results that can't be, before any work is done."""
    wanted = {
        GRIDS: (job.output, job.dsm, job.canopy, job.hillshade),
        POINTS: (job.points,),
        MESHES: (job.mesh,),
    }
    for suffixes, paths in wanted.items():
        for path in paths:
            if path is not None and path.suffix.casefold() not in suffixes:
                raise TableError(f"{path}: found suffix {path.suffix!r}, expected {' or '.join(suffixes)}")
    files.coordinate_system(job.system)


def _projected(cloud: Cloud, job: Surfacing) -> Cloud:
    """The cloud in metres, with the system of the results."""
    given = None if cloud.wkt is None else files.coordinate_system(cloud.wkt)
    if given is None:
        return replace(cloud, wkt=None if job.system is None else files.coordinate_system(job.system).to_wkt())
    if job.system is None:
        if given.is_geographic:
            raise TableError(
                f"{job.source}: found degrees, expected metres, or --system with what to project them into"
            )
        return cloud
    wanted = files.coordinate_system(job.system)
    points = cloud.points.copy()
    points["x"], points["y"] = files.transformed(given, wanted, points["x"], points["y"])
    return Cloud(points, wanted.to_wkt())


def _classes(places: NDArray[np.float64], job: Surfacing, advance: Advance) -> NDArray[np.uint8]:
    """Classes of points, tile by tile."""
    settings = replace(suited(places), **job.settings)
    parts: list[Tile] = tiles(places, settings)
    found, done = np.full(len(places), UNCLASSIFIED, np.uint8), 0
    advance("filtering", done, len(places))
    calls = ((number, (tile, settings)) for number, tile in enumerate(parts))
    for number, classes in run(filtered, calls, job.jobs, job.scheduler):
        found[parts[number].inner] = classes
        done += len(classes)
        advance("filtering", done, len(places))
    return found


def _write(job: Surfacing, cloud: Cloud, grid: terrain.Grid) -> None:
    places, classes = cloud.places, cloud.points["class"]
    ground, known = places[classes == GROUND], places[(classes == GROUND) | (classes == UNCLASSIFIED)]
    heights = terrain.elevation(ground, grid, smoothing=job.smoothing, reach=job.reach)
    files.write_grid(job.output, heights, grid, cloud.wkt)
    if job.dsm is not None or job.canopy is not None:
        highest = terrain.surface(known, grid, reach=job.reach)
        if job.dsm is not None:
            files.write_grid(job.dsm, highest, grid, cloud.wkt)
        if job.canopy is not None:
            files.write_grid(job.canopy, np.maximum(highest - heights, 0), grid, cloud.wkt)
    if job.hillshade is not None:
        files.write_grid(job.hillshade, terrain.hillshade(heights, grid.cell), grid, cloud.wkt)
    if job.points is not None:
        files.write_points(job.points, cloud)
    if job.mesh is not None:
        files.write_mesh(job.mesh, ground)
