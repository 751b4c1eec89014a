"""The ground filter on terrain whose ground is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from openecho.surface.ground import Filter, filtered, ground, suited, tiles
from openecho.surface.points import GROUND, LOW, UNCLASSIFIED

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

COUNT, SIDE = 15_000, 100.0
"""Points of a scene, and how wide it is, m."""


def scene(kind: str, seed: int = 0, noise: float = 0.1) -> tuple[Floats, Bools]:
    """Points of a scene, and which of them are ground."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, SIDE, (2, COUNT))
    hills = 30 * np.sin(x / 64) * np.cos(y / 80) + 10 * np.sin(x / 23 + 1)
    slopes = {"slope": x * math.tan(math.radians(30)), "terraces": 3.0 * np.floor(x / 40)}
    z = slopes.get(kind, hills if kind in ("hills", "forest") else np.zeros(COUNT))
    trees = {"hills": 0.3, "slope": 0.3, "forest": 0.7}.get(kind, 0.0)
    above = rng.random(COUNT) < trees
    z = z + np.where(above, rng.uniform(0.5, 20, COUNT), 0) + rng.normal(0, noise, COUNT)
    if kind == "houses":
        house = (x % 40 > 8) & (x % 40 < 32) & (y % 40 > 8) & (y % 40 < 28)
        gable = 5 + (10 - abs(y % 40 - 18)) * 0.6
        z = np.where(house, z + np.where(x // 40 % 2 == 0, gable, 8), z)
        above = house
    return np.column_stack([x, y, z]), ~above


@pytest.mark.parametrize(
    ("kind", "lost", "accepted"),
    [
        ("flat", 0.003, 0.0),
        ("slope", 0.005, 0.005),
        ("hills", 0.005, 0.005),
        ("forest", 0.01, 0.01),
        ("terraces", 0.03, 0.0),
        ("houses", 0.003, 0.0),
    ],
)
def test_ground_is_told_from_what_stands_on_it(kind: str, lost: float, accepted: float) -> None:
    points, truth = scene(kind)
    found = ground(points)
    assert (~found & truth).sum() <= lost * truth.sum()
    assert (found & ~truth).sum() <= accepted * max((~truth).sum(), 1)


def test_all_of_a_plane_is_ground_and_nothing_of_a_large_house() -> None:
    points, truth = scene("houses", noise=0.0)
    np.testing.assert_array_equal(ground(points), truth)


def test_neither_place_nor_order_nor_workers_nor_a_quarter_turn_matters() -> None:
    points, _ = scene("forest")
    found = ground(points)
    order = np.random.default_rng(1).permutation(len(points))
    np.testing.assert_array_equal(ground(points[order]), found[order])
    np.testing.assert_array_equal(ground(points, workers=3), found)
    # Where the squares begin moves by parts of them, and so do a few corners.
    for moved in (points + np.array([5e5, 4.5e6, 0.0]), points[:, [1, 0, 2]] * np.array([-1.0, 1, 1])):
        assert (ground(moved) != found).mean() < 0.01


def test_tiles_change_next_to_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    points, _ = scene("forest")
    points[:, :2] *= 10  # wide enough for tiles with margins
    points[:, 2] *= 10
    settings = Filter(distance=14.0, spacing=15.0, tolerance=3.0, cell=50.0)
    whole = ground(points, settings)
    monkeypatch.setattr("openecho.surface.ground.TILE", 4000)
    assert len(tiles(points, settings)) > 2
    assert (ground(points, settings) != whole).mean() < 0.01


def test_wild_points_are_no_ground_and_do_no_harm() -> None:
    points, _ = scene("hills")
    found = ground(points)
    wild = np.random.default_rng(2).choice(len(points), 50, replace=False)
    spoilt = points.copy()
    spoilt[wild, 2] += np.repeat([10_000.0, -10_000.0], 25)
    spoilt[wild[0]], spoilt[wild[1], 2], spoilt[wild[2], 0] = np.nan, np.inf, -np.inf
    after = ground(spoilt)
    assert not after[wild].any()
    others = np.setdiff1d(np.arange(len(points)), wild)
    assert (after[others] != found[others]).mean() < 0.002


def test_two_clouds_far_apart_need_no_room_between() -> None:
    points, _ = scene("hills")
    both = np.concatenate([points, points + np.array([3e6, 2e6, 100.0])])
    found = ground(both)
    alone = ground(points)
    assert (found[: len(points)] != alone).mean() < 0.01
    assert (found[len(points) :] != alone).mean() < 0.01


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.array([[1.0, 2, 3]]),
        np.array([[0.0, 0, 3], [5, 5, 3]]),
        np.column_stack([np.arange(50.0), np.zeros(50), np.zeros(50)]),
        np.zeros((30, 3)),
        np.repeat(np.array([[0.0, 0, 0], [9, 0, 0], [0, 9, 0]]), 10, axis=0),
        np.column_stack([np.random.default_rng(0).uniform(0, 3, (40, 2)), np.zeros(40)]),
    ],
    ids=["none", "one", "two", "in line", "in one place", "three places", "less than a cell"],
)
def test_few_points_of_a_plane_are_ground(points: Floats) -> None:
    assert ground(points).tolist() == [True] * len(points)


def test_a_wall_has_its_foot_on_the_ground() -> None:
    rng = np.random.default_rng(3)
    floor = np.column_stack([rng.uniform(0, 60, (4000, 2)), np.zeros(4000)])
    wall = np.column_stack([np.full(500, 30.0), rng.uniform(0, 60, 500), rng.uniform(1, 15, 500)])
    found = ground(np.concatenate([floor, wall]))
    assert found[:4000].all()
    assert not found[4000:].any()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"cell": 0.0}, r"^cell: found 0.0, expected a number above 0 and below inf$"),
        ({"angle": 90.0}, r"^angle: found 90.0, expected a number above 0 and below 90$"),
        ({"spacing": math.nan}, r"^spacing: found nan, expected a number above 0 and below inf$"),
    ],
)
def test_bad_settings_are_one_line(settings: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Filter(**settings)


def test_points_of_two_columns_are_one_line() -> None:
    with pytest.raises(ValueError, match=r"^points: found shape \(3, 2\), expected \(n, 3\)$"):
        ground(np.zeros((3, 2)))


def mountain(depth: float, seed: int = 0) -> tuple[Floats, Bools]:
    """Points 10 m apart on relief of up to 40°, 40 of them so far above it, m, and which are ground."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0, 600, 10.0), np.arange(0, 600, 10.0)))
    x, y = x + rng.uniform(-2, 2, x.size), y + rng.uniform(-2, 2, x.size)
    z = 60 * np.sin(x / 110) * np.cos(y / 130) + 5 * np.sin(x / 31 + y / 37) + rng.normal(0, 0.1, x.size)
    off = np.zeros(x.size, np.bool_)
    off[rng.choice(x.size, 40, replace=False)] = True
    return np.column_stack([x, y, z + np.where(off, depth, 0)]), ~off


def test_settings_suit_points_however_sparse() -> None:
    assert suited(scene("forest")[0]) == Filter()
    sparse = suited(mountain(0)[0])
    assert sparse.spacing == pytest.approx(5, rel=0.1)
    assert sparse.angle == pytest.approx(45, rel=0.1)


@pytest.mark.parametrize("depth", [-150.0, -60.0, -25.0, 20.0, 100.0])
def test_echoes_far_from_sparse_ground_are_no_ground_and_do_not_move_it(depth: float) -> None:
    points, truth = mountain(depth)
    chosen = suited(points)
    (tile,) = tiles(points, chosen)
    classes = filtered(tile, chosen)[np.argsort(tile.inner)]
    assert (classes[truth] == GROUND).mean() > 0.999
    # Of two side by side each sees the other.
    assert (classes[~truth] == (LOW if depth < 0 else UNCLASSIFIED)).sum() >= 39
