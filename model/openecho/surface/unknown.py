"""Points that are none: alone in the air or underground, at heights that can't be, or nowhere."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from openecho.surface.points import HIGH, LOW, NEIGHBOURS, spacing

Floats = NDArray[np.float64]

SPACINGS = 6.0
"""Mean distances of points in plan, within which a point that is one has company."""


def unknown(
    points: ArrayLike,
    *,
    reach: float | None = None,
    company: int = 1,
    lowest: float = -math.inf,
    highest: float = math.inf,
) -> NDArray[np.uint8]:
    """Find points that are none.

    Parameters
    ----------
    points : array_like (n, 3)
        m.
    reach : float, optional
        m, within which others have to be; if left out, `SPACINGS` times the distance that as many points have on
        average where there are any: the root of the area that a point has among its neighbours, of half of them.
    company : int
        How many others, at least.
    lowest, highest : float
        Heights that are believed, m.

    Returns
    -------
    uint8 (n,)
        `LOW` or `HIGH` for those that are none, and 0 for all others. What has no place is `HIGH`.

    Raises
    ------
    ValueError
        If an argument is out of range: what was found and what was expected.
    """
    at = np.asarray(points, np.float64)
    if at.ndim != 2 or at.shape[1] != 3:
        raise ValueError(f"points: found shape {at.shape}, expected (n, 3)")
    if reach is not None and not 0 < reach < math.inf:
        raise ValueError(f"reach: found {reach}, expected a number above 0")
    if not lowest < highest:
        raise ValueError(f"lowest, highest: found {lowest}, {highest}, expected the first below the second")
    if company < 0:
        raise ValueError(f"company: found {company}, expected 0 or more")
    classes = np.zeros(len(at), np.uint8)
    classes[~np.isfinite(at).all(axis=1)] = HIGH
    classes[at[:, 2] < lowest], classes[at[:, 2] > highest] = LOW, HIGH
    left = np.flatnonzero(classes == 0)
    if len(left) > company > 0:
        known = at[left] - at[left].min(axis=0)
        near = spacing(known) * SPACINGS if reach is None else reach
        lonely = np.flatnonzero(_others(known, near, company) < company)
        above = known[lonely, 2] >= _around(known, lonely)
        classes[left[lonely]] = np.where(above, HIGH, LOW)
    return classes


def _others(points: Floats, reach: float, most: int) -> NDArray[np.int64]:
    """How many other points there are within reach, up to `most`."""
    distance, _ = cKDTree(points).query(points, most + 1, distance_upper_bound=reach, workers=-1)
    return np.asarray(np.isfinite(distance).sum(axis=1) - 1)


def _around(points: Floats, which: NDArray[np.int64]) -> Floats:
    """Median height of the neighbours in plan of some of the points, themselves left out."""
    count = min(NEIGHBOURS, len(points) - 1)
    _, neighbours = cKDTree(points[:, :2]).query(points[which, :2], count + 1, workers=-1)
    heights = np.where(neighbours == which[:, None], np.nan, points[neighbours, 2])
    return np.asarray(np.nanmedian(heights, axis=1))
