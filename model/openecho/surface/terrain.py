"""Elevation models: grids of heights from points, of the ground and of all that stands on it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import LightSource
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates
from scipy.spatial import Delaunay, QhullError

Floats = NDArray[np.float64]

MOST_CELLS = 2**28
"""Of a grid: a gigabyte of heights."""

SUN = (315.0, 45.0)
"""Azimuth and altitude of the light on a hillshade, degrees: from the north-west, as maps have it."""


@dataclass(frozen=True)
class Grid:
    """Squares over an area; row 0 is the northernmost.

    Attributes
    ----------
    west, north : float
        Of the outer edges, m.
    cell : float
        Side of a square, m.
    shape : (int, int)
        Rows and columns.
    """

    west: float
    north: float
    cell: float
    shape: tuple[int, int]

    @property
    def centres(self) -> tuple[Floats, Floats]:
        """East of the columns and north of the rows, m."""
        rows, columns = self.shape
        x = self.west + (np.arange(columns, dtype=np.float64) + 0.5) * self.cell
        return x, self.north - (np.arange(rows, dtype=np.float64) + 0.5) * self.cell

    def places(self, points: ArrayLike) -> NDArray[np.int64]:
        """Index into the flat grid of points (n, 2 or 3); -1 outside."""
        at = np.asarray(points, np.float64)
        rows, columns = self.shape
        with np.errstate(invalid="ignore"):
            column = np.floor((at[:, 0] - self.west) / self.cell)
            row = rows - 1 - np.floor((at[:, 1] - self.north) / self.cell + rows)
            inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        return np.where(inside, np.where(inside, row, 0) * columns + np.where(inside, column, 0), -1).astype(np.int64)


def grid_of(points: ArrayLike, cell: float) -> Grid:
    """The least grid of whole cells over points, its edges at multiples of the cell.

    Parameters
    ----------
    points : array_like (n, 2 or 3)
        m; n from 1. Those that are not finite don't count.
    cell : float
        m.

    Raises
    ------
    ValueError
        If there are no points or the grid is too large: what was found and what was expected.
    """
    if not 0 < cell < math.inf:
        raise ValueError(f"cell: found {cell}, expected a number above 0")
    at = np.asarray(points, np.float64)[:, :2]
    at = at[np.isfinite(at).all(axis=1)]
    if not len(at):
        raise ValueError("points: found none with coordinates, expected one or more")
    (west, south), (east, north) = np.floor(at.min(axis=0) / cell), np.floor(at.max(axis=0) / cell) + 1
    rows, columns = north - south, east - west
    if rows * columns > MOST_CELLS:
        raise ValueError(f"cell: found {cell} m, of which {rows:.0f} × {columns:.0f} are needed, expected larger ones")
    return Grid(float(west * cell), float(north * cell), cell, (int(rows), int(columns)))


def elevation(ground: ArrayLike, grid: Grid, *, smoothing: float = 0.0, reach: float = math.inf) -> Floats:
    """Elevation model: heights of the triangulated ground at the centres of the cells.

    Parameters
    ----------
    ground : array_like (n, 3)
        Points of the ground, m.
    grid : Grid
    smoothing : float
        σ of a Gaussian over the heights, m; 0: linear in each triangle.
    reach : float
        How far from a point of the ground the model goes, m.

    Returns
    -------
    float64 (rows, columns)
        m; nan outside the triangles, and beyond `reach`.
    """
    points = np.asarray(ground, np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    heights = _interpolated(points, grid)
    if smoothing > 0:
        heights = _smoothed(heights, smoothing / grid.cell)
    if np.isfinite(reach):
        heights[_away(points, grid) > reach] = np.nan
    return heights


def surface(points: ArrayLike, grid: Grid, *, reach: float = math.inf) -> Floats:
    """Surface model: the highest point of each cell, and between them linear.

    Parameters
    ----------
    points : array_like (n, 3)
        m.
    grid, reach
        As of `elevation`.

    Returns
    -------
    float64 (rows, columns)
        m; nan where `elevation` has it.
    """
    at = np.asarray(points, np.float64)
    at = at[np.isfinite(at).all(axis=1)]
    place = grid.places(at)
    at, place = at[place >= 0], place[place >= 0]
    highest = np.full(grid.shape[0] * grid.shape[1], -np.inf)
    np.maximum.at(highest, place, at[:, 2])
    heights = np.where(np.isfinite(highest), highest, np.nan).reshape(grid.shape)
    x, y = grid.centres
    row, column = np.nonzero(np.isfinite(heights))
    known = np.column_stack([x[column], y[row], heights[row, column]])
    heights = np.where(np.isfinite(heights), heights, _interpolated(known, grid))
    if np.isfinite(reach):
        heights[_away(at, grid) > reach] = np.nan
    return heights


def heights_at(heights: Floats, grid: Grid, points: ArrayLike) -> Floats:
    """Heights (n,) of a grid at points (n, 2 or 3), linear between the centres of its cells; nan beyond those."""
    at = np.asarray(points, np.float64)
    column = (at[:, 0] - grid.west) / grid.cell - 0.5
    row = (grid.north - at[:, 1]) / grid.cell - 0.5
    return np.asarray(map_coordinates(heights, [row, column], order=1, cval=np.nan, prefilter=False))


def hillshade(heights: Floats, cell: float) -> Floats:
    """Light on the heights, from 0 to 1, under `SUN`; nan where there are none."""
    filled = _filled(heights)
    if filled.size < 4 or min(filled.shape) < 2:
        return np.where(np.isnan(heights), np.nan, 0.5)
    shaded = LightSource(*SUN).hillshade(filled, dx=cell, dy=cell)
    return np.where(np.isnan(heights), np.nan, shaded)


def _interpolated(points: Floats, grid: Grid) -> Floats:
    """Heights of the triangulated points at the centres of the cells; of less than a triangle, at the points' own."""
    heights = np.full(grid.shape, np.nan)
    try:
        # Coordinates are large, differences are small: Qhull likes to begin at 0.
        triangles = Delaunay(points[:, :2] - (grid.west, grid.north))
    except (QhullError, ValueError):
        place = grid.places(points)
        heights.ravel()[place[place >= 0]] = points[place >= 0, 2]
        return heights
    x, y = grid.centres
    east, north = np.meshgrid(x - grid.west, y - grid.north)
    return np.asarray(LinearNDInterpolator(triangles, points[:, 2])(east, north))


def _smoothed(heights: Floats, sigma: float) -> Floats:
    """Gaussian mean of those heights that there are."""
    known = ~np.isnan(heights)
    weight = gaussian_filter(known.astype(np.float64), sigma, mode="constant")
    total = gaussian_filter(np.where(known, heights, 0.0), sigma, mode="constant")
    return np.where(known, total / np.where(known, weight, 1), np.nan)


def _away(points: Floats, grid: Grid) -> Floats:
    """Distance of each cell from the next that has a point, m."""
    empty = np.ones(grid.shape[0] * grid.shape[1], np.bool_)
    place = grid.places(points)
    empty[place[place >= 0]] = False
    return np.asarray(distance_transform_edt(empty.reshape(grid.shape)) * grid.cell)


def _filled(heights: Floats) -> Floats:
    """Heights with those of the nearest cell where there are none."""
    missing = np.isnan(heights)
    if missing.all():
        return np.zeros_like(heights)
    row, column = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(heights[row, column])
