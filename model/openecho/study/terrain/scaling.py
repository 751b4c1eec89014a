"""What filtering and gridding cost, from ten thousand points to a million."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.surface import terrain
from openecho.surface.ground import ground
from openecho.surface.unknown import unknown

Floats = NDArray[np.float64]

COUNTS = (10_000, 30_000, 100_000, 300_000, 1_000_000)
DENSITY = 4.0
"""Points of a square metre."""
TREES = 0.4
"""Share of points above the ground, up to `TALL`."""
TALL = 15.0
"""m."""
CELL = 1.0
"""Of the grid, m."""


def points(count: int, seed: int) -> Floats:
    """Points (count, 3) of hills with trees."""
    rng = np.random.default_rng([seed, count])
    side = np.sqrt(count / DENSITY)
    x, y = rng.uniform(0, side, (2, count))
    z = 12 * np.sin(x / 40) * np.cos(y / 55) + 3 * np.sin(x / 11 + y / 17) + rng.normal(0, 0.05, count)
    above = rng.random(count) < TREES
    return np.column_stack([x, y, z + np.where(above, rng.uniform(1, TALL, count), 0)])


def costs(counts: tuple[int, ...], seed: int) -> list[dict[str, Any]]:
    """Seconds for points that are none, for the filter and for the grid."""
    ground(points(2000, seed))  # compiled
    rows = []
    for count in counts:
        at = points(count, seed)
        clock = [time.perf_counter()]
        known = at[unknown(at) == 0]
        clock.append(time.perf_counter())
        found = ground(known)
        clock.append(time.perf_counter())
        terrain.elevation(known[found], terrain.grid_of(known, CELL))
        clock.append(time.perf_counter())
        rows.append({"points": count, **dict(zip(("unknown", "filter", "grid"), np.diff(clock), strict=True))})
    return rows
