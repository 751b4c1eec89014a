"""Grids of heights: planes are exact, edges are where they should be, and nothing is made up where nothing is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from openecho.surface.terrain import Grid, elevation, grid_of, hillshade, surface

FAR = np.array([512_340.5, 4_512_340.25, 0.0])
"""Where coordinates are as large as those of a map."""


def cloud(seed: int, count: int, side: float = 100.0) -> np.ndarray:
    """Points on a plane that rises 0.3 to the east and 0.1 to the north, m."""
    at = np.random.default_rng(seed).uniform(0, side, (count, 2))
    return np.asarray(np.column_stack([at, 50 + 0.3 * at[:, 0] + 0.1 * at[:, 1]]) + FAR)


def test_a_grid_has_whole_cells_and_every_point_is_in_one() -> None:
    points = np.array([[0.0, 0.0], [10.0, 5.0], [9.999, 0.001], [3.3, 4.9]])
    grid = grid_of(points, 2.5)
    assert (grid.west, grid.north, grid.shape) == (0.0, 7.5, (3, 5))
    row, column = np.divmod(grid.places(points), 5)
    assert row.tolist() == [2, 0, 2, 1]
    assert column.tolist() == [0, 4, 3, 1]
    x, y = grid.centres
    assert x.tolist() == [1.25, 3.75, 6.25, 8.75, 11.25]
    assert y.tolist() == [6.25, 3.75, 1.25]


def test_points_outside_and_without_a_place_are_in_no_cell() -> None:
    grid = Grid(0.0, 10.0, 1.0, (10, 10))
    points = np.array([[-0.1, 5], [10, 5], [5, -0.1], [5, 10], [math.nan, 5], [math.inf, 5], [0, 0]])
    assert grid.places(points).tolist() == [-1, -1, -1, -1, -1, -1, 90]


def test_a_plane_comes_back() -> None:
    points = cloud(0, 2000)
    grid = grid_of(points, 1.0)
    heights = elevation(points, grid)
    x, y = grid.centres
    expected = 50 + 0.3 * (x - FAR[0]) + 0.1 * (y - FAR[1])[:, None]
    known = ~np.isnan(heights)
    assert known.mean() > 0.95
    np.testing.assert_allclose(heights[known], expected[known], atol=1e-6)
    smooth = elevation(points, grid, smoothing=2.0)
    inner = (slice(15, -15), slice(15, -15))
    np.testing.assert_allclose(smooth[inner], expected[inner], atol=1e-6)


def test_smoothing_takes_noise_away() -> None:
    rng = np.random.default_rng(1)
    points = cloud(1, 20_000)
    points[:, 2] = rng.normal(0, 0.1, len(points))
    grid = grid_of(points, 1.0)
    rough, smooth = (np.nanstd(elevation(points, grid, smoothing=sigma)) for sigma in (0.0, 3.0))
    assert smooth < 0.3 * rough


def test_the_surface_is_the_highest_point_of_each_cell() -> None:
    points = np.array([[0.5, 0.5, 1], [0.6, 0.4, 9], [1.5, 0.5, 2], [0.5, 1.5, 3], [2.5, 1.5, 4], [2.5, 0.5, 4]])
    heights = surface(points, Grid(0.0, 2.0, 1.0, (2, 3)))
    # The cell that has no point lies between 3 and 4.
    np.testing.assert_allclose(heights, np.array([[3, 3.5, 4], [9, 2, 4]]))


def test_nothing_is_known_far_from_points() -> None:
    points = cloud(2, 500)
    points = points[(points[:, 0] - FAR[0] < 20) | (points[:, 0] - FAR[0] > 80)]
    grid = grid_of(points, 1.0)
    heights = elevation(points, grid, reach=6.0)
    x = grid.centres[0] - FAR[0]
    assert np.isnan(heights[:, (x > 30) & (x < 70)]).all()
    assert not np.isnan(elevation(points, grid)[:, (x > 30) & (x < 70)]).all()


@pytest.mark.parametrize(
    "points",
    [
        [[5.0, 5.0, 3.0]],
        [[0.0, 0.0, 3.0], [9.0, 9.0, 3.0]],
        [[0.0, 0.0, 3.0], [4.5, 4.5, 3.0], [9.0, 9.0, 3.0]],
        [[5.0, 5.0, 3.0]] * 10,
    ],
    ids=["one", "two", "in a line", "all in one place"],
)
def test_less_than_a_triangle_is_known_where_it_is(points: list[list[float]]) -> None:
    grid = Grid(0.0, 10.0, 1.0, (10, 10))
    for heights in (elevation(points, grid), surface(points, grid)):
        assert (heights[~np.isnan(heights)] == 3).all()
        assert np.count_nonzero(~np.isnan(heights)) == len(np.unique(points, axis=0))


def test_no_points_are_no_heights() -> None:
    grid = Grid(0.0, 10.0, 1.0, (10, 10))
    assert np.isnan(elevation(np.zeros((0, 3)), grid)).all()
    assert np.isnan(surface(np.full((4, 3), math.nan), grid)).all()
    assert np.isnan(hillshade(elevation(np.zeros((0, 3)), grid), 1.0)).all()


def test_light_comes_from_the_north_west() -> None:
    x, y = np.meshgrid(np.arange(50.0), np.arange(50.0))  # row 0 is north
    towards, away = hillshade(x + y, 1.0), hillshade(-(x + y), 1.0)
    assert towards.mean() > 0.9
    assert away.mean() < 0.3


@pytest.mark.parametrize(
    ("points", "cell", "message"),
    [
        (np.zeros((0, 3)), 1.0, r"^points: found none with coordinates, expected one or more$"),
        (np.full((3, 3), math.nan), 1.0, r"^points: found none with coordinates, expected one or more$"),
        (np.zeros((3, 3)), 0.0, r"^cell: found 0.0, expected a number above 0$"),
        (np.array([[0, 0, 0], [1e9, 1e9, 0]]), 1.0, r"^cell: found 1.0 m, of which 1000000001 × 1000000001 are needed"),
    ],
)
def test_bad_input_is_one_line(points: np.ndarray, cell: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        grid_of(points, cell)
