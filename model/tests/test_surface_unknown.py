"""Points that are none are found, and only these."""

from __future__ import annotations

import math

import numpy as np
import pytest

from openecho.surface.points import HIGH, LOW
from openecho.surface.unknown import unknown


def terrain(count: int = 5000, seed: int = 0) -> np.ndarray:
    """Points of gentle hills with trees on them, m."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 200, (2, count))
    z = 100 + 5 * np.sin(x / 30) + 3 * np.cos(y / 20) + rng.normal(0, 0.1, count)
    z += np.where(rng.random(count) < 0.3, rng.uniform(2, 12, count), 0)
    return np.asarray(np.column_stack([x + 5e5, y + 4.5e6, z]))


def test_lonely_points_are_told_by_the_side_on_which_they_are() -> None:
    points = terrain()
    points[[10, 20, 30], 2] += [80, -60, 4000]
    found = unknown(points)
    assert found[[10, 20, 30]].tolist() == [HIGH, LOW, HIGH]
    assert np.count_nonzero(found) == 3


def test_neither_place_nor_order_nor_company_far_away_matters() -> None:
    points = terrain()
    points[10, 2] += 80
    order = np.random.default_rng(1).permutation(len(points))
    np.testing.assert_array_equal(unknown(points - [5e5, 4.5e6, 0])[order], unknown(points[order]))
    elsewhere = points + np.array([1e5, 0, 0])
    two = np.concatenate([points, elsewhere])
    np.testing.assert_array_equal(unknown(two), np.tile(unknown(points), 2))


def test_two_beside_each_other_have_company_unless_more_is_asked_for() -> None:
    points = terrain()
    points[11] = points[10] + [0.2, 0, 0]
    points[[10, 11], 2] += 80
    assert unknown(points)[[10, 11]].tolist() == [0, 0]
    assert unknown(points, company=2)[[10, 11]].tolist() == [HIGH, HIGH]


def test_impossible_heights_and_places_are_none() -> None:
    points = terrain()
    points[:4, 2] = [math.nan, math.inf, 3000, -3000]
    found = unknown(points, lowest=0, highest=1000)
    assert found[:4].tolist() == [HIGH, HIGH, HIGH, LOW]
    assert not found[4:].any()


@pytest.mark.parametrize("count", [0, 1])
def test_of_less_than_two_none_is_lonely(count: int) -> None:
    assert unknown(np.zeros((count, 3))).tolist() == [0] * count


def test_points_in_one_place_have_company() -> None:
    assert not unknown(np.zeros((20, 3))).any()


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        (np.zeros((3, 2)), {}, r"^points: found shape \(3, 2\), expected \(n, 3\)$"),
        (np.zeros((3, 3)), {"reach": 0.0}, r"^reach: found 0.0, expected a number above 0$"),
        (np.zeros((3, 3)), {"lowest": 5.0, "highest": 5.0}, r"^lowest, highest: found 5.0, 5.0, expected the first"),
        (np.zeros((3, 3)), {"company": -1}, r"^company: found -1, expected 0 or more$"),
    ],
)
def test_bad_input_is_one_line(points: np.ndarray, options: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        unknown(points, **options)  # type: ignore[arg-type]
