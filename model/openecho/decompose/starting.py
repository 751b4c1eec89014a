"""First guesses of the echoes of a waveform, and non-negative least squares for their heights; compiled.

The core's own method in floating point: the second derivative of the smoothed waveform is negative between the
inflections of an echo. An interval with several minima, each deeper than noise makes them, is several echoes that merge
(two equal Gaussians make two minima from 1.5 σ apart, but two maxima only from 2 σ). Or, for comparison, the maxima of
the smoothed waveform.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openecho.compiled import njit
from openecho.decompose.least_squares import LEAST_WIDTH, Problem, Waveform, add_slopes, hold, solve, whiten

FloatArray = NDArray[np.float64]

SMOOTHING = 0.5
"""σ of the smoothing, in widths of a usual echo: a wider one merges echoes, a narrower one lets noise through."""
CUT = 4
"""σ of the smoothing on either side that its filter has."""
RISE = 1.5
"""Times the height that counts as an echo, that the curve must rise between two: noise goes both ways."""


class Search(NamedTuple):
    """How echoes are looked for.

    Attributes
    ----------
    filter : float64 (2 r + 1,)
        What the waveform is filtered with; its negative minima are echoes.
    depth : float
        Of a minimum that is worth a trial, in deviations of the noise.
    smoothing : float
        σ, bins, that is taken out of the widths between inflections; 0 if the filter has no inflections to give.
    width : float
        Of a usual echo, bins.
    matched : float64 (2 r + 1,)
        Shape of a usual echo, with norm 1.
    threshold : float
        Height of a residual behind it that is worth a trial, in deviations of the noise.
    """

    filter: FloatArray
    depth: float
    smoothing: float
    width: float
    matched: FloatArray
    threshold: float


def curvature(width: float) -> FloatArray:
    """Second derivative of a Gaussian: smooths, and gives the curvature of what it has smoothed; bins^-2."""
    sigma = SMOOTHING * width
    x = np.arange(-np.ceil(CUT * sigma), np.ceil(CUT * sigma) + 1)
    taps = (x**2 / sigma**2 - 1) * np.exp(-(x**2) / (2 * sigma**2))
    # Cut and sampled, it must still give 0 for a constant and 2 for x².
    taps -= taps.mean()
    return np.asarray(2 * taps / (taps @ x**2))


def smoothing(width: float) -> FloatArray:
    """Gaussian that smooths, turned over: maxima become minima."""
    sigma = SMOOTHING * width
    x = np.arange(-np.ceil(CUT * sigma), np.ceil(CUT * sigma) + 1)
    taps = np.exp(-(x**2) / (2 * sigma**2))
    return np.asarray(-taps / taps.sum())


@njit()
def guess(
    waveform: Waveform, guide: FloatArray, noise: float, search: Search, problem: Problem, most: int
) -> FloatArray:
    """Unknowns of a baseline and up to `most` echoes, the highest, to start with: as `minimise` takes them.

    Places and widths come from the guide, the waveform or a smoothed one; heights from the waveform.
    """
    curve = filtered(guide, search.filter, guide[0], guide[-1])
    threshold = search.depth * noise
    places = minima(curve, RISE * threshold)
    u = np.zeros(3 * len(places) + 1)
    components = 0
    for number in range(len(places)):
        place = places[number]
        if curve[place] >= -threshold:
            continue
        low = places[number - 1] if number > 0 else 0
        high = places[number + 1] if number + 1 < len(places) else len(guide) - 1
        i = 3 * components + 1
        u[i + 1], u[i + 2] = interval(curve, place, low, high, search)
        components += 1
    u = u[: 3 * components + 1]
    heights(waveform, u, problem)
    best: FloatArray = highest(u, most)
    return best


@njit(fastmath={"reassoc", "contract"})
def filtered(y: FloatArray, taps: FloatArray, before: float, after: float) -> FloatArray:
    """Waveform behind a filter, and what it is before its beginning and after its end."""
    length, reach = len(y), len(taps) // 2
    padded = np.empty(length + 2 * reach)
    padded[:reach], padded[reach : length + reach], padded[length + reach :] = before, y, after
    curve = np.empty(length)
    for x in range(length):
        total = 0.0
        for i in range(len(taps)):
            total += padded[x + i] * taps[i]
        curve[x] = total
    return curve


@njit()
def minima(curve: FloatArray, rise: float) -> NDArray[np.int64]:
    """Places of the minima between which, and at whose sides, the curve rises by more than `rise`."""
    places, found = np.empty(len(curve), np.int64), 0
    falling = True
    lowest, greatest, place = curve[0], curve[0], 0
    for x in range(len(curve)):
        value = curve[x]
        if falling:
            if value < lowest:
                lowest, place = value, x
            if lowest < greatest - rise and value > lowest + rise:
                places[found] = place
                found += 1
                falling, greatest = False, value
            elif value > greatest:
                greatest, lowest, place = value, value, x
        elif value > greatest:
            greatest = value
        elif value < greatest - rise:
            falling, lowest, place = True, value, x
    if falling and lowest < greatest - rise:
        places[found] = place
        found += 1
    return places[:found]


@njit()
def interval(curve: FloatArray, place: int, low: int, high: int, search: Search) -> tuple[float, float]:
    """Centre and ln w of the echo about a minimum, by its inflections if they come before the neighbours `low`, `high`.

    Where there is no inflection on either side, for another echo is too near, it is as wide as a usual one.
    """
    left, right = crossing(curve, place, low, -1), crossing(curve, place, high, 1)
    if search.smoothing == 0 or (left < 0 and right < 0):
        return float(place), np.log(search.width)
    centre, half = float(place), max(place - left, right - place)
    if left < 0:
        half = right - place
    elif right < 0:
        half = place - left
    else:
        centre, half = (left + right) / 2, (right - left) / 2
    # The smoothed echo's variance is the sum of both; noise can make it less than that, and its inflections one.
    return centre, 0.5 * np.log(max(half**2 - search.smoothing**2, half**2 / 16, LEAST_WIDTH**2))


@njit()
def crossing(curve: FloatArray, place: int, last: int, step: int) -> float:
    """Where the curve becomes positive on the way from a minimum to `last`; -1 if it does not."""
    x = place
    while x != last:
        if curve[x + step] >= 0:
            return float(x + step * curve[x] / (curve[x] - curve[x + step]))
        x += step
    return -1.0


@njit()
def heights(waveform: Waveform, u: FloatArray, problem: Problem) -> None:
    """Set baseline and amplitudes to the non-negative least squares for the other unknowns (Lawson & Hanson 1974)."""
    size, length = len(u) // 3 + 1, len(waveform.samples)
    shapes, wanted = np.zeros((size, length)), waveform.samples.copy()
    shapes[0] = 1.0
    slopes = np.empty((3, length))
    for k in range(1, size):
        begin, end = add_slopes(1.0, u[3 * k - 1], np.exp(u[3 * k]), problem.pulse, slopes)
        shapes[k, begin:end] = slopes[0, begin:end]
    if len(waveform.root) > 0:
        wanted *= waveform.root
        shapes *= waveform.root
    if len(problem.white) > 1:
        whiten(wanted, 0, length, problem.white)
        for k in range(size):
            whiten(shapes[k], 0, length, problem.white)
    value = non_negative(*products(shapes, wanted))
    u[0] = value[0]
    u[1::3] = value[1:]


@njit(fastmath={"reassoc", "contract"})
def products(shapes: FloatArray, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normal matrix and right side: BLAS takes longer to call than so few products."""
    size = len(shapes)
    matrix, right = np.empty((size, size)), np.empty(size)
    for i in range(size):
        total = 0.0
        for x in range(len(wanted)):
            total += shapes[i, x] * wanted[x]
        right[i] = total
        for j in range(i + 1):
            total = 0.0
            for x in range(len(wanted)):
                total += shapes[i, x] * shapes[j, x]
            matrix[i, j] = matrix[j, i] = total
    return matrix, right


@njit()
def non_negative(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Least squares from their normal equations, with all but the first unknown 0 or above."""
    size = len(right)
    value, free = np.zeros(size), np.ones(size, np.bool_)
    for _ in range(4 * size):
        system, wanted = matrix.copy(), right.copy()
        for i in range(size):
            system[i, i] *= 1 + 1e-12  # two echoes in one place share the height
            if not free[i] or matrix[i, i] <= 0.0:
                hold(system, i)
                wanted[i] = 0.0
        if not solve(system, wanted):
            break
        share, first = 1.0, 0
        for i in range(1, size):
            if free[i] and wanted[i] <= 0.0 and value[i] <= share * (value[i] - wanted[i]):
                share, first = value[i] / (value[i] - wanted[i]) if value[i] > 0 else 0.0, i
        value += share * (wanted - value)
        if first > 0:
            free[first], value[first] = False, 0.0
            continue
        pull = right - matrix @ value
        pull[0] = 0.0
        pull[free] = 0.0
        strongest = pull.argmax()
        if pull[strongest] <= 1e-10 * np.abs(right).max():
            break
        free[strongest] = True
    return value


@njit()
def highest(u: FloatArray, most: int) -> FloatArray:
    """Without echoes of no height, and no more than `most`: the highest, in the order in which they were."""
    amplitude = u[1::3]
    kept = np.argsort(-amplitude)[:most]
    better = np.empty_like(u)
    better[0] = u[0]
    size = 1
    for k in np.sort(kept):
        if amplitude[k] > 0:
            better[size : size + 3] = u[3 * k + 1 : 3 * k + 4]
            size += 3
    return better[:size]
