"""Echoes of a way against the truth of a set: how many are found, how many are none, and how far off they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.decompose import Decomposition, Method
from openecho.golden.float64 import FWHM
from openecho.study.score import METRES_PER_NS
from openecho.study.trade.sets import Set
from openecho.study.trade.ways import WAYS

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Row = dict[str, Any]

APART = 1 << 20
"""What parts the positions of one waveform from those of the next where both are one number; above any length."""


def judged(recipe: Callable[[], Set]) -> tuple[Row, list[Row]]:
    """Make a set: its row of the report, and the `score` of every way on it, with the names of ``way`` and ``set``."""
    given = recipe()
    found = {way.bits: score(given, way.prepare(given.longest, given.told)) for way in WAYS if way.dsp}
    return given.described, [{"way": way.name, "set": given.name} | found[way.bits] for way in WAYS]


def score(given: Set, method: Method) -> dict[str, Any]:
    """Decompose a set and judge what was found.

    An echo is found if it and one of the way are each other's nearest, within a true width, and nearer than the middle
    between it and the next that is true: what lies between two is neither. All others of the way are spurious, those of
    waveforms that nobody judged left out.

    Parameters
    ----------
    given : Set
    method : Method
        Of a `Way`, prepared for it.

    Returns
    -------
    dict
        ``detected``: share of the true echoes. ``spurious_per_waveform``. For ``peak``, ``centre``, ``width`` (bins),
        ``amplitude`` (counts) and ``range`` (m, of the peak) over those found: ``rms``, 95th percentile of the
        magnitude ``p95``, ``bias``, and ``bound``, the RMS of errors over the Cramér–Rao bound of each. None where
        there is nothing to take it from.
    """
    found = method(given.samples, given.length, given.bin_ns)
    true, mine = matched(given.truth, found.echoes["waveform"].astype(np.int64), found.echoes["peak"])
    judged = np.ones(len(given.samples), np.bool_) if given.judged is None else given.judged
    answers = np.count_nonzero(judged[found.echoes["waveform"]])
    result: dict[str, Any] = {
        "detected": _ratio(len(true), len(given.truth)),
        "spurious_per_waveform": (answers - len(mine)) / np.count_nonzero(judged),
    }
    return result | _errors(given, found, true, mine)


def matched(truth: np.ndarray, waveform: Ints, position: Floats) -> tuple[Ints, Ints]:
    """Pairs of echoes that are each other's nearest, less than a true width and a quarter of the next distance apart.

    Parameters
    ----------
    truth : structured (k,)
        Of `openecho.stimulus.TRUTH`, by waveform, then centre.
    waveform, position : (e,) arrays
        Of the echoes that were found; bins.

    Returns
    -------
    true, mine : int64 (pairs,)
        Into both.
    """
    ours, theirs = truth["waveform"] * APART + truth["centre"], waveform * APART + position
    if not len(ours) or not len(theirs):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    nearest = _nearest(ours, theirs)
    pairs = np.flatnonzero(_nearest(theirs, ours)[nearest] == np.arange(len(ours)))
    apart = np.diff(ours, prepend=-np.inf, append=np.inf)
    reach = np.minimum(truth["width"], np.minimum(apart[:-1], apart[1:]) / 4)
    pairs = pairs[abs(theirs[nearest[pairs]] - ours[pairs]) <= reach[pairs]]
    return pairs, nearest[pairs]


def _nearest(asked: Floats, among: Floats) -> Ints:
    """Index of the nearest of some numbers to each of others; the lower of two as near."""
    order = np.argsort(among, kind="stable")
    after = np.searchsorted(among[order], asked)
    index = order[np.clip([after - 1, after], 0, len(order) - 1)]
    chosen = abs(among[index] - asked).argmin(axis=0)
    return np.asarray(index[chosen, np.arange(len(asked))])


def _errors(given: Set, found: Decomposition, true: Ints, mine: Ints) -> dict[str, Any]:
    truth, echoes = given.truth[true], found.echoes[mine]
    # Of the core's echoes the width without what its filter adds; of other shapes that of a Gaussian as wide.
    width = echoes["corrected_width"] if "corrected_width" in (echoes.dtype.names or ()) else echoes["fwhm"] / FWHM
    bounds = [None] * 3 if given.bound is None else given.bound[true].T
    metres = given.bin_ns * METRES_PER_NS
    peak = echoes["peak"] - truth["centre"]
    result = {
        "peak": _error(peak, bounds[1]),
        "centre": _error(echoes["centre"] - truth["centre"], bounds[1]),
        "width": _error(width - truth["width"], bounds[2]),
        "amplitude": _error(echoes["amplitude"] - truth["amplitude"], bounds[0]),
        "range": _error(peak * metres, None if bounds[1] is None else bounds[1] * metres),
    }
    if given.kind == "recorded":  # nobody knows these
        result |= dict.fromkeys(("width", "amplitude"), _error(np.zeros(0), None))
    return result


def _error(errors: Floats, bound: Floats | None) -> dict[str, float | None]:
    if not len(errors):
        return dict.fromkeys(("rms", "p95", "bias", "bound"))
    return {
        "rms": _rms(errors),
        "p95": float(np.percentile(abs(errors), 95)),
        "bias": float(errors.mean()),
        "bound": None if bound is None else _rms(errors / bound),
    }


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))


def _ratio(part: int, whole: int) -> float | None:
    return part / whole if whole else None
