"""Ground filters on the same points: ours, and the cloth simulation filter from its package."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.study.terrain.flights import Flight
from openecho.surface import terrain
from openecho.surface.ground import ground
from openecho.surface.points import spacing
from openecho.surface.unknown import unknown

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

RIGIDNESS = (1, 2, 3)
"""Of the cloth: steep slopes, gentle ones, flat land, as its authors say."""

RESOLUTIONS = (0.5, 1.0, 2.0, 5.0)
"""Of the cloth, m."""

THRESHOLDS = (0.3, 0.5, 1.0, 2.0)
"""Distance from the cloth of what is ground, m."""

STEPS = (0.65, 1.3)
"""Time steps of the cloth's fall."""

CELLS = 2**21
"""Of a cloth, at most: more take minutes."""


def cloth(points: Floats, *, rigidness: int, resolution: float, threshold: float, step: float) -> Bools:
    """Ground by the cloth simulation filter.

    W. Zhang et al., An easy-to-use airborne lidar data filtering method based on cloth simulation, Remote Sens. 8
    (2016) 501; its slope post-processing is on.
    """
    import CSF  # only to compare

    run = CSF.CSF()
    run.params.bSloopSmooth = True
    run.params.rigidness, run.params.cloth_resolution = rigidness, resolution
    run.params.class_threshold, run.params.time_step = threshold, step
    run.setPointCloud((points - points.min(axis=0)).tolist())
    inside, outside = CSF.VecInt(), CSF.VecInt()
    with _silence():
        run.do_filtering(inside, outside, False)
    found = np.zeros(len(points), np.bool_)
    found[np.array(inside, np.int64)] = True
    return found


def compare(
    flight: Flight, places: Floats, of_ground: Bools, cell: float, advance: Callable[[], object], *, quick: bool
) -> list[dict[str, Any]]:
    """Judge both filters on the echoes of a flight: ours as it is, the other with those settings that suit it best.

    Parameters
    ----------
    flight : Flight
    places : float64 (n, 3)
    of_ground : bool (n,)
        What is true of them.
    cell : float
        Of the elevation model, m.
    advance : callable
        Told when a filter has run.
    quick : bool
        Whether to try the other filter with a few settings only.
    """
    known = unknown(places) == 0
    grid = terrain.grid_of(places, cell)
    reach = 3 * spacing(places[of_ground])

    def judged(name: str, filtered: Callable[[Floats], Bools], **settings: float) -> dict[str, Any]:
        begun = time.perf_counter()
        found = np.zeros(len(places), np.bool_)
        found[known] = filtered(places[known])
        taken = time.perf_counter() - begun
        advance()
        return {"filter": name, "settings": settings, "seconds": taken, **errors(found, of_ground)} | model_error(
            flight, places[found], grid, reach
        )

    tried = [
        judged("cloth simulation", lambda at, chosen=chosen: cloth(at, **chosen), **chosen)  # type: ignore[misc]
        for chosen in cloths(places, quick=quick)
    ]
    best = min(tried, key=lambda row: row["total"])
    perfect = {"filter": "truth", "settings": {}, "seconds": 0.0, **errors(of_ground, of_ground)}
    rows = [
        judged("progressive densification", ground),
        best | {"tried": len(tried)},
        perfect | model_error(flight, places[of_ground], grid, reach),
    ]
    described = {"scene": flight.name, "points": len(places), "ground": int(of_ground.sum()), "cell": cell}
    return [{**described, **row} for row in rows]


def cloths(places: Floats, *, quick: bool) -> list[dict[str, Any]]:
    """Settings of the cloth that are tried: no finer than the memory and patience of two cores allow."""
    extent = np.ptp(places[:, :2], axis=0).prod()
    fine = [resolution for resolution in RESOLUTIONS if extent / resolution**2 < CELLS]
    names = ("rigidness", "resolution", "threshold", "step")
    every = itertools.product(RIGIDNESS, fine, THRESHOLDS, STEPS)
    chosen = [dict(zip(names, values, strict=True)) for values in every]
    return chosen[:: len(chosen) // 4] if quick else chosen


def errors(found: Bools, of_ground: Bools) -> dict[str, float]:
    """Shares of the ground that is lost, type I, of all else that is taken for it, type II, and of all that is wrong.

    After G. Sithole and G. Vosselman, Experimental comparison of filter algorithms, ISPRS J. 59 (2004) 85-101.
    """
    return {
        "type_1": float((of_ground & ~found).sum() / max(of_ground.sum(), 1)),
        "type_2": float((~of_ground & found).sum() / max((~of_ground).sum(), 1)),
        "total": float((found != of_ground).mean()),
    }


def model_error(flight: Flight, points: Floats, grid: terrain.Grid, reach: float) -> dict[str, float]:
    """Errors of the elevation model through points, m: root mean square and 95th percentile of the magnitude."""
    x, y = np.meshgrid(*grid.centres)
    true = flight.ground(x.ravel(), y.ravel()).reshape(grid.shape)
    off = terrain.elevation(points, grid, reach=reach) - true
    known = np.isfinite(off)
    if not known.any():
        return {"model_rms": np.inf, "model_95": np.inf, "covered": 0.0}
    return {
        "model_rms": float(np.sqrt((off[known] ** 2).mean())),
        "model_95": float(np.percentile(abs(off[known]), 95)),
        "covered": float(known.mean()),
    }


@contextmanager
def _silence() -> Iterator[None]:
    """Keep what a library prints from within C++ away from the terminal."""
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
