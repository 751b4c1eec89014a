"""How many echoes a waveform is made of, and values to start their fit from.

From the first guess of `starting`, echoes are added one after the other. One more is put where the residual, seen
through a matched filter, rises highest, and all are fitted again. As two echoes that merge look like a wide one, the
one whose residual is most like theirs is also tried as two halves, and the better fit of both is kept. That ends when
the residual stays in the noise, or when an echo does not pay by an information criterion. Last, echoes that do not pay
are taken away, the most doubtful first. So echoes are told apart where the waveform has one maximum.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from openecho.compiled import njit, share
from openecho.decompose.choices import CRITERIA, PARAMETERS, STARTS
from openecho.decompose.fit import GREATEST, deviations, echo_sum, problem, scaled, weight_roots
from openecho.decompose.least_squares import (
    TRIAL_STEPS,
    FloatArray,
    IntArray,
    Problem,
    Waveform,
    borders,
    inverse,
    minimise,
    residual,
)
from openecho.decompose.pulses import Pulse
from openecho.decompose.starting import SMOOTHING, Search, curvature, filtered, guess, smoothing
from openecho.enhance.autoregression import gain

CUT = 3
"""Widths to either side that a matched filter has."""
THIRD, FOURTH = 3 * math.sqrt(math.pi) / 4, 3 * math.sqrt(math.pi) / 2
"""Squares of the norms of (z³ - 3z/2) exp(-z²/2) and (z⁴ - 3z² + 3/4) exp(-z²/2), two of Hermite's functions."""
APART, NARROWER, LOWER = 0.75, 0.7, 0.75
"""Of the width and the amplitude of an echo: how far its halves are from its centre, and what they are like."""
DOUBTFUL = 4
"""Times its price: an echo whose height squared, in its standard errors, is more than that needs no second trial."""
QUIETEST = 1e-6
"""Of the greatest sample: deviation of the noise at least, or the search would find what rounding has left."""
NOISIEST_SEARCH = 1e3
"""Of the greatest sample: deviation at most. Nothing is found in either."""


def find_echoes(
    samples: ArrayLike,
    length: ArrayLike,
    noise: ArrayLike,
    *,
    pulse: Pulse | None = None,
    correlation: ArrayLike = (1.0,),
    width: float = 5.0,
    widths: str = "free",
    least: float = 4.0,
    most: ArrayLike = 16,
    criterion: str = "ebic",
    start: str = "inflection",
    smoothed: ArrayLike | None = None,
    weight: ArrayLike | None = None,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Find the echoes of each waveform.

    Parameters
    ----------
    samples : array_like (n, m)
        Waveforms, counts.
    length : array_like (n,)
        Samples of each.
    noise : array_like (n,)
        Standard deviation of the noise, counts, at least 0.
    pulse : Pulse, optional
        Shape of the echoes; the Gaussian if left out.
    correlation : array_like (lags + 1,), optional
        Autocorrelation of the noise, 1 at lag 0; that of white noise if left out.
    width : float, optional
        Of a usual echo, bins, above 0: half the distance of its inflections, σ of a Gaussian.
    widths : str, optional
        ``free``, ``shared`` by all echoes of a waveform, or ``fixed`` at `width`.
    least : float, optional
        Height of a residual behind the matched filter, in standard deviations of the noise there, that is worth an
        echo's trial.
    most : integer or array_like (n,), optional
        Echoes of a waveform, from 0; never more than its samples can determine.
    criterion : str, optional
        One of `CRITERIA`.
    start : str, optional
        One of `STARTS`.
    smoothed : array_like (n, m), optional
        What the first guess is taken from; the waveforms themselves, which it smooths, if left out.
    weight : array_like (n, m), optional
        Of the samples, as in `fit_echoes`.

    Returns
    -------
    count : int64 (n,)
        Echoes of each waveform.
    start : float64 (e, 3)
        Their amplitudes, maxima and widths, counts and bins, as `fit_echoes` takes them.
    baseline : float64 (n,)
        Counts.

    Raises
    ------
    ValueError
        If shapes do not agree or a value is out of its range.
    ModuleNotFoundError
        If numba is not installed.
    """
    rows, lengths, scale = scaled(samples, length)
    roots = weight_roots(weight, rows)
    with np.errstate(over="ignore"):
        guides = rows if smoothed is None else np.asarray(smoothed, np.float64) / scale[:, None]
    if guides.shape != rows.shape or not np.isfinite(guides).all():
        raise ValueError(f"smoothed: found shape {guides.shape}, expected finite ones of shape {rows.shape}")
    deviation = np.clip(deviations(noise, scale), QUIETEST, NOISIEST_SEARCH)
    limit = np.asarray(most)
    if limit.dtype.kind not in "iu" or limit.shape not in ((), (len(rows),)):
        raise ValueError(f"most: found {limit.dtype} of shape {limit.shape}, expected integers, () or ({len(rows)},)")
    if not (0 < width < math.inf and 0 <= least < math.inf and (limit >= 0).all()):
        raise ValueError(f"width, least, most: found {width}, {least}, {most!r}, expected above 0, from 0, from 0")
    for name, value, known in (("criterion", criterion, CRITERIA), ("start", start, STARTS)):
        if value not in known:
            raise ValueError(f"{name}: found {value!r}, expected one of {', '.join(known)}")

    given = problem(pulse, correlation, widths, width)
    search = _search(start, width, least, given, correlation)
    price = CRITERIA[criterion](np.maximum(lengths, 2).astype(float))
    count = np.zeros(len(rows), np.int64)
    limit = np.minimum(limit, np.maximum(lengths - 1, 0) // PARAMETERS)
    found = np.zeros((len(rows), limit.max(initial=0), PARAMETERS))
    baseline = np.zeros(len(rows))
    guessed = limit if start != "none" else np.zeros_like(limit)
    tables = rows, roots, guides, lengths, deviation, price * deviation**2, guessed, limit
    share(_find, len(rows), *tables, search, given, count, found, baseline)
    with np.errstate(over="ignore"):
        found[:, :, 0] = np.minimum(found[:, :, 0] * scale[:, None], GREATEST)
    return count, found[np.arange(found.shape[1]) < count[:, None]], baseline * scale


def _search(start: str, width: float, least: float, given: Problem, correlation: ArrayLike) -> Search:
    """How echoes so wide are looked for in noise with such an autocorrelation."""
    reach, usual = np.ceil(CUT * width), max(width, given.pulse.narrowest)
    matched = echo_sum(2 * int(reach) + 1, [0.0], [0], [1.0], [reach], [usual], given.pulse)[0]
    matched /= np.linalg.norm(matched)
    first, smoothed = (smoothing(width), 0.0) if start == "maxima" else (curvature(width), SMOOTHING * width)
    return Search(first, least * gain(first, correlation), smoothed, width, matched, least * gain(matched, correlation))


@njit(nogil=True)
def _find(
    begin: int,
    end: int,
    rows: FloatArray,
    roots: FloatArray,
    guides: FloatArray,
    lengths: IntArray,
    noise: FloatArray,
    price: FloatArray,
    guessed: IntArray,
    limit: IntArray,
    search: Search,
    given: Problem,
    count: IntArray,
    found: FloatArray,
    baseline: FloatArray,
) -> None:
    for n in range(begin, end):
        if lengths[n] == 0:
            continue
        y = Waveform(rows[n, : lengths[n]], roots[n, : lengths[n]])
        u = guess(y, guides[n, : lengths[n]], noise[n], search, given, guessed[n])
        normal, squares = fitted(y, u, given)
        u, normal, squares = added(y, u, normal, squares, price[n], noise[n], limit[n], search, given)
        u = thinned(y, u, normal, squares, price[n], given)
        count[n], baseline[n] = len(u) // 3, u[0]
        for k in range(count[n]):
            found[n, k, 0], found[n, k, 1], found[n, k, 2] = u[3 * k + 1], u[3 * k + 2], np.exp(u[3 * k + 3])


@njit()
def fitted(y: Waveform, u: FloatArray, given: Problem) -> tuple[FloatArray, float]:
    """Normal matrix and sum of squares where it is least."""
    low, high = borders(len(y.samples), len(u) // 3, given)
    normal, squares, _ = minimise(y, u, low, high, given, TRIAL_STEPS)
    return normal, squares


@njit()
def added(
    y: Waveform,
    u: FloatArray,
    normal: FloatArray,
    squares: float,
    price: float,
    noise: float,
    most: int,
    search: Search,
    given: Problem,
) -> tuple[FloatArray, FloatArray, float]:
    """Add echoes as long as that pays."""
    threshold = search.threshold * noise
    while len(u) // 3 < most:
        left = residual(y.samples, u, given.pulse)
        if len(y.root) > 0:
            left *= y.root
        seen = filtered(left, search.matched, 0.0, 0.0)
        highest = seen.argmax()
        merged, doubt = most_merged(left, u)
        more, more_normal, more_squares = u, normal, squares
        if seen[highest] > threshold:
            more = one_more(u, seen[highest] * search.matched.max(), highest, search.width)
            more_normal, more_squares = fitted(y, more, given)
        if doubt > threshold:
            halves = in_two(u, merged)
            halves_normal, halves_squares = fitted(y, halves, given)
            if halves_squares < more_squares:
                more, more_normal, more_squares = halves, halves_normal, halves_squares
        if squares - more_squares <= price:
            break
        u, normal, squares = more, more_normal, more_squares
    return u, normal, squares


@njit()
def thinned(y: Waveform, u: FloatArray, normal: FloatArray, squares: float, price: float, given: Problem) -> FloatArray:
    """Take echoes away that do not pay: first the one whose height is least in its standard errors."""
    while len(u) > 1:
        low, high = borders(len(y.samples), len(u) // 3, given)
        _, error = inverse(normal, u, low, high, given.tied)
        worst, least = -1, np.inf
        for k in range(1, len(u), 3):
            height = u[k] / error[k] if error[k] > 0 else 0.0
            if height < least:
                worst, least = k, height
        # The sum of squares rises by its square at least, if the others stay as they are.
        if least**2 > DOUBTFUL * price:
            break
        fewer = np.concatenate((u[:worst], u[worst + 3 :]))
        fewer_normal, fewer_squares = fitted(y, fewer, given)
        if fewer_squares - squares > price:
            break
        u, normal, squares = fewer, fewer_normal, fewer_squares
    return u


@njit()
def most_merged(left: FloatArray, u: FloatArray) -> tuple[int, float]:
    """Where in `u` the echo begins whose residual looks most like that of two that merge, and how much it does.

    In functions of Hermite, a Gaussian that is fitted takes the first three, by its height, centre and width; what two
    that merge have besides is most of all the third and the fourth. How much of these is in the residual has, if their
    norm is 1, the deviation of white noise.
    """
    merged, doubt = 1, 0.0
    for k in range(1, len(u), 3):
        width = np.exp(u[k + 2])
        begin, end = max(int(u[k + 1] - CUT * width), 0), min(int(u[k + 1] + CUT * width) + 1, len(left))
        third = fourth = 0.0
        for x in range(begin, end):
            z = (x - u[k + 1]) / width
            value = left[x] * np.exp(-0.5 * z * z)
            third += value * z * (z * z - 1.5)
            fourth += value * (z * z * (z * z - 3) + 0.75)
        score = max(abs(third) / np.sqrt(THIRD * width), abs(fourth) / np.sqrt(FOURTH * width))
        if score > doubt:
            merged, doubt = k, score
    return merged, doubt


@njit()
def one_more(u: FloatArray, amplitude: float, centre: float, width: float) -> FloatArray:
    """Unknowns with those of one more echo."""
    more = np.empty(len(u) + 3)
    more[:-3] = u
    more[-3], more[-2], more[-1] = amplitude, centre, np.log(width)
    return more


@njit()
def in_two(u: FloatArray, k: int) -> FloatArray:
    """Unknowns with two halves for the echo that begins at k."""
    width = np.exp(u[k + 2])
    halves: FloatArray = one_more(u, LOWER * u[k], u[k + 1] + APART * width, NARROWER * width)
    halves[k], halves[k + 1], halves[k + 2] = LOWER * u[k], u[k + 1] - APART * width, np.log(NARROWER * width)
    return halves
