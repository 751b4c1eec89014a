"""The ground filter: a network of triangles that grows from the lowest points, after P. Axelsson.

DEM generation from laser scanner data using adaptive TIN models, Int. Arch. Photogramm. Remote Sens. 33 (B4) (2000)
110-117. The lowest point of each cell is taken for ground. Then, again and again, a point joins the network if it is
near the plane of its triangle, and seen from the nearest corner under a small angle. A point that fails may be on a
ridge or at an edge: it is mirrored at the nearest corner, and joins if its image is near the plane where that falls.

Two things are other than there. The network grows from coarse to fine: in squares that are halved again and again, only
the lowest point of each over the network may join, which among leaves is the ground's if any is. And when it is
complete, what is ground is decided anew for all points, by their distance from it.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from os import sched_getaffinity

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import Delaunay, cKDTree

from openecho.compiled import njit
from openecho.surface.points import GROUND, LOW, NEIGHBOURS, UNCLASSIFIED, spacing

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PASSES = 4
"""At each size of squares, at most."""

ENOUGH = 0.01
"""Share of the corners that a pass has to add for another to be worth it."""

ABYSS = 45.0
"""Angle under which a point that is none sees all its neighbours above it, or all below, degrees."""

HEIGHT_NOISE = 0.5
"""m, by which neighbours differ at no distance at all."""

STEEPEST = 45.0
"""Angle that is allowed where points are sparse, degrees."""

TILE = 200_000
"""Points of a tile, about."""

MARGIN = 3.0
"""Cells around a tile that are looked at with it."""


@dataclass(frozen=True)
class Filter:
    """Settings of the filter.

    Attributes
    ----------
    cell : float
        Side of the squares whose lowest points are ground, m: larger than the largest building.
    angle : float
        Greatest angle between a triangle and the line from its nearest corner to a new point, degrees.
    distance : float
        Greatest distance of a new point from its triangle, m.
    spacing : float
        Side of the smallest squares of which each may give a corner, m; what is nearer to one is judged as if it were
        so far away.
    tolerance : float
        Greatest distance from the complete network of what is ground, m.
    """

    cell: float = 25.0
    angle: float = 8.0
    distance: float = 1.4
    spacing: float = 1.5
    tolerance: float = 0.3

    def __post_init__(self) -> None:
        """Refuse what is out of range."""
        for name, most in (
            ("cell", math.inf),
            ("angle", 90.0),
            ("distance", math.inf),
            ("spacing", math.inf),
            ("tolerance", math.inf),
        ):
            value = getattr(self, name)
            if not 0 < value < most:
                raise ValueError(f"{name}: found {value}, expected a number above 0 and below {most:g}")


def suited(points: Floats) -> Filter:
    """Settings for points (n, 3): those of `Filter` up to a metre or two between them, and wider for sparser ones.

    Between points that are far apart the ground itself rises as much as what stands on it.
    """
    apart, usual = spacing(points[np.isfinite(points).all(axis=1)]), Filter()
    return Filter(
        cell=max(usual.cell, 4 * apart),
        angle=min(max(usual.angle, math.degrees(math.atan(apart / 10))), STEEPEST),
        distance=max(usual.distance, 0.8 * apart),
        spacing=max(usual.spacing, apart / 2),
        tolerance=max(usual.tolerance, apart / 10),
    )


@dataclass(frozen=True)
class Tile:
    """A part of a cloud, with what is around it.

    Attributes
    ----------
    inner : int64 (k,)
        Points of the tile, into the cloud.
    places : float64 (m, 3)
        Points of the tile and around it, m from a corner of the cloud, in which `own` (k,) are the tile's.
    able, seeds : bool (m,)
        Which of them may be corners of the network, and which are to begin with.
    """

    inner: Ints
    places: Floats
    own: Ints
    able: Bools
    seeds: Bools


def ground(points: ArrayLike, settings: Filter | None = None, *, workers: int | None = None) -> Bools:
    """Find the points of the ground.

    Parameters
    ----------
    points : array_like (n, 3)
        m, of any kind: single echoes, last ones, all.
    settings : Filter, optional
        Those of `suited` if left out.
    workers : int, optional
        Threads; as many as processors if left out. The result does not depend on it.

    Returns
    -------
    bool (n,)
        What has no finite place is no ground.

    Raises
    ------
    ValueError
        If the points are no table of three columns.
    """
    at = np.asarray(points, np.float64)
    if at.ndim != 2 or at.shape[1] != 3:
        raise ValueError(f"points: found shape {at.shape}, expected (n, 3)")
    chosen = settings or suited(at)
    found = np.zeros(len(at), np.bool_)
    with ThreadPoolExecutor(workers or len(sched_getaffinity(0))) as pool:
        parts = tiles(at, chosen)
        for tile, classes in zip(parts, pool.map(partial(filtered, settings=chosen), parts), strict=True):
            found[tile.inner] = classes == GROUND
    return found


def tiles(points: Floats, settings: Filter) -> list[Tile]:
    """Cut a cloud (n, 3) into parts that can be filtered one by one, on any machine; what is not finite is in none."""
    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    if not len(known):
        return []
    # Differences are small where coordinates are large.
    places = points[known] - np.floor(points[known].min(axis=0))
    able = _has_company(places)
    seeds = _seeds(places, able, settings.cell)
    return [
        Tile(known[inner], places[outer], np.searchsorted(outer, inner), able[outer], seeds[outer])
        for inner, outer in _tiles(places[:, :2], settings.cell * MARGIN)
    ]


def filtered(tile: Tile, settings: Filter) -> NDArray[np.uint8]:
    """Classes of a tile's own points (k,): `GROUND`, `LOW` for what is far below it, `UNCLASSIFIED`."""
    return _grown(tile, settings)[tile.own]


def _tiles(places: Floats, margin: float) -> list[tuple[Ints, Ints]]:
    """Points of each tile and, ascending, those of it and around it: halved until no half has more than `TILE`."""
    made = []
    waiting = [(np.arange(len(places)), places.min(axis=0), places.max(axis=0))]
    while waiting:
        inner, low, high = waiting.pop()
        side = int(np.argmax(high - low))
        if len(inner) > TILE and high[side] - low[side] > 4 * margin:
            middle = float(np.median(places[inner, side]))
            below = places[inner, side] < middle
            if 0 < np.count_nonzero(below) < len(inner):
                halves = (inner[below], inner[~below])
                waiting += [(half, places[half].min(axis=0), places[half].max(axis=0)) for half in halves]
                continue
        outer = np.flatnonzero(((places >= low - margin) & (places <= high + margin)).all(axis=1))
        made.append((inner, outer))
    return made


def _has_company(places: Floats) -> Bools:
    """Which points see one of their neighbours in plan under a small angle: pits and spikes of one point do not."""
    count = min(NEIGHBOURS, len(places) - 1)
    if count < NEIGHBOURS:
        return np.ones(len(places), np.bool_)
    away, neighbours = cKDTree(places[:, :2]).query(places[:, :2], count + 1, workers=-1)
    rise = abs(places[neighbours, 2] - places[:, 2, None])
    near = rise <= math.tan(math.radians(ABYSS)) * away + HEIGHT_NOISE
    return np.asarray((near & (neighbours != np.arange(len(places))[:, None])).any(axis=1))


def _seeds(places: Floats, able: Bools, cell: float) -> Bools:
    """Lowest point of each cell, of those that may be."""
    chosen = np.zeros(len(places), np.bool_)
    some = np.flatnonzero(able) if able.any() else np.arange(len(places))
    chosen[some[_first_of_each(places[some, :2], places[some, 2], cell)]] = True
    return chosen


def _grown(tile: Tile, chosen: Filter) -> NDArray[np.uint8]:
    """Classes of all points of a tile."""
    order = np.argsort(_curve(tile.places[:, :2], chosen.cell / 4))  # what is near is found from near
    points, able, seeds = tile.places[order], tile.able[order], tile.seeds[order]
    seeds = seeds if seeds.any() else _seeds(points, able, chosen.cell)
    frame = _frame(points, points[seeds], chosen.cell)
    corners = _corners(points, able, seeds, frame, chosen)
    classes = np.empty(len(points), np.uint8)
    classes[order] = _classified(points, points[corners], frame, chosen)
    return classes


def _corners(points: Floats, able: Bools, seeds: Bools, frame: Floats, chosen: Filter) -> Ints:
    """Corners that the network has grown: the seeds, and of each square what is lowest and near enough."""
    some, corner = np.flatnonzero(able), np.flatnonzero(seeds)
    left = np.setdiff1d(some[_first_of_each(points[some, :2], points[some, 2], chosen.spacing)], corner)
    for square in _squares(chosen):
        for _ in range(PASSES):
            network = np.concatenate([points[corner], frame])
            above, near = _joins(points[left], network, _triangulated(network), chosen)
            far = cKDTree(network[:, :2]).query(points[left, :2], distance_upper_bound=square / 2)[0] >= square / 2
            joining = np.flatnonzero(near & far)
            new = joining[_first_of_each(points[left[joining], :2], above[joining], square)]
            corner = np.concatenate([corner, left[new]])
            left = np.delete(left, new)
            if len(new) <= ENOUGH * len(corner):
                break
    return corner


def _classified(points: Floats, corners: Floats, frame: Floats, chosen: Filter) -> NDArray[np.uint8]:
    """Classes of points by their height over the network.

    The corners are the lowest points of their squares, and the noise makes the network too low: it is raised by what
    most points are above it. Where they are sparse, that is less than elsewhere: the means of those points decide, too.
    At a step the means are of no use.
    """
    network = np.concatenate([corners, frame])
    _, above, _, _ = _heights(points, network, _triangulated(network))
    likely = (above >= -chosen.tolerance) & (above <= 2 * chosen.tolerance)
    raised = np.asarray(abs(above - np.median(above[likely])) <= chosen.tolerance)
    means = np.concatenate([_means(points[likely], chosen.spacing), frame])
    distance, _, _, _ = _heights(points, means, _triangulated(means))
    is_ground = raised | (distance <= chosen.tolerance)
    return np.where(is_ground, GROUND, np.where(above < -chosen.distance, LOW, UNCLASSIFIED)).astype(np.uint8)


def _means(points: Floats, side: float) -> Floats:
    """Mean place of the points of each square."""
    _, square, count = np.unique(np.floor(points[:, :2] / side), axis=0, return_inverse=True, return_counts=True)
    sums = [np.bincount(square.ravel(), points[:, k], len(count)) for k in range(3)]
    return np.asarray(np.column_stack(sums) / count[:, None])


def _squares(chosen: Filter) -> list[float]:
    """Sides of the squares of which each may give a corner, from half a cell down to the least spacing."""
    count = max(1, math.ceil(math.log2(chosen.cell / chosen.spacing)))
    return [max(chosen.cell / 2**k, chosen.spacing) for k in range(1, count + 1)]


def _triangulated(network: Floats) -> Delaunay:
    """Triangles of the network, which has an area, for the frame has."""
    return Delaunay(network[:, :2])


def _joins(points: Floats, network: Floats, triangles: Delaunay, chosen: Filter) -> tuple[Floats, Bools]:
    """Height of each point above its triangle, and whether it is near enough to the network, or its image is."""
    distance, above, corner, away = _heights(points, network, triangles)
    near = distance <= _limit(away, chosen)
    again = np.flatnonzero(~near)
    mirrored = 2 * network[corner[again]] - points[again]
    distance, _, _, away = _heights(mirrored, network, triangles)
    near[again] = distance <= _limit(away, chosen)
    return above, near


@njit(nogil=True)
def _locate(points: Floats, corners: Floats, triangles: Ints, neighbours: Ints, found: Ints) -> None:
    """Triangle of each point, -1 outside: from that of the one before, over edges that the point is beyond.

    In a Delaunay triangulation that never goes round in circles (Devillers, Pion & Teillaud 2002).
    """
    at = 0
    for n in range(len(points)):
        x, y = points[n]
        found[n] = -1
        for _ in range(len(triangles) + 1):
            beyond = -1
            for k in range(3):
                a, b = triangles[at, (k + 1) % 3], triangles[at, (k + 2) % 3]
                ax, ay = corners[a, 0], corners[a, 1]
                if (corners[b, 0] - ax) * (y - ay) - (corners[b, 1] - ay) * (x - ax) < 0:  # anticlockwise
                    beyond = k
                    break
            if beyond < 0:
                found[n] = at
                break
            if neighbours[at, beyond] < 0:
                break
            at = neighbours[at, beyond]


def _limit(away: Floats, chosen: Filter) -> Floats:
    """Greatest distance from the plane, so far from the nearest corner."""
    return np.minimum(chosen.distance, math.sin(math.radians(chosen.angle)) * np.maximum(away, chosen.spacing))


def _heights(points: Floats, network: Floats, triangles: Delaunay) -> tuple[Floats, Floats, Ints, Floats]:
    """Distance of each point from the plane of its triangle, its height above it, the nearest corner, how far that is.

    The distance is infinite where there is no triangle.
    """
    simplex = np.empty(len(points), np.int64)
    _locate(points[:, :2].copy(), network[:, :2].copy(), triangles.simplices, triangles.neighbors, simplex)
    corners = triangles.simplices[simplex].astype(np.int64)
    a, b, c = (network[corners[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    with np.errstate(invalid="ignore", divide="ignore"):
        above = ((points - a) * normal).sum(axis=1) / normal[:, 2]
        distance = abs(above * normal[:, 2]) / np.sqrt((normal**2).sum(axis=1))
    away = np.stack([((points - one) ** 2)[:, :2].sum(axis=1) for one in (a, b, c)])
    nearest, rows = away.argmin(axis=0), np.arange(len(points))
    distance = np.where((simplex >= 0) & np.isfinite(distance), distance, np.inf)
    return distance, above, corners[rows, nearest], np.sqrt(away[nearest, rows])


def _first_of_each(places: Floats, heights: Floats, side: float) -> Ints:
    """Which of the points is lowest in each square."""
    square = np.floor(places / side).astype(np.int64)
    order = np.lexsort((places[:, 1], places[:, 0], heights, square[:, 1], square[:, 0]))
    first = np.ones(len(order), np.bool_)
    first[1:] = (np.diff(square[order], axis=0) != 0).any(axis=1)
    return np.asarray(order[first])


def _frame(places: Floats, seeds: Floats, cell: float) -> Floats:
    """Corners around all points, as high as the nearest seed, so that every point has a triangle."""
    low, high = places[:, :2].min(axis=0) - cell, places[:, :2].max(axis=0) + cell
    steps = [np.linspace(low[k], high[k], 2 + min(int((high[k] - low[k]) / cell), 1000)) for k in range(2)]
    x, y = steps
    edges = [
        *(np.column_stack([x, np.full(len(x), side)]) for side in (low[1], high[1])),
        *(np.column_stack([np.full(len(y) - 2, side), y[1:-1]]) for side in (low[0], high[0])),
    ]
    around = np.concatenate(edges)
    _, nearest = cKDTree(seeds[:, :2]).query(around)
    return np.column_stack([around, seeds[nearest, 2]])


def _curve(places: Floats, cell: float) -> Ints:
    """Place of each point on a path through all cells, there in one row and back in the next."""
    column, row = np.floor(places / cell).astype(np.int64).T
    width = int(column.max()) + 1
    return np.asarray(row * width + np.where(row % 2, width - 1 - column, column))
