"""How many Gaussians a waveform is made of, and values to start their fit from: one after the other, from what is left.

A component more is put where the residual rises highest out of the noise, seen through a matched filter, and all are
fitted again. As two echoes that merge look like a wide one whose residual has two flanks, the component nearest to that
place is also tried as two halves, and the better fit of both is kept. That ends when nothing rises high enough, or when
the extended Bayesian information criterion of Chen & Chen 2008 (Biometrika 95, 759; their γ is 1) finds that a
component does not pay: ln m of the sum of squares over the noise's variance for each of its three parameters, and
2 ln m for having been looked for at m places. So echoes are told apart where the waveform has one maximum.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.compiled import njit, prange
from openecho.decompose.gaussian import FloatArray, borders, minimise

PARAMETERS = 3
"""Of a component."""
CUT = 3
"""σ to either side that a matched filter has."""
NEAR = 3
"""σ from a component within which it may be two."""
APART, NARROWER, LOWER = 0.75, 0.7, 0.75
"""Of the σ and the amplitude of a component: how far its halves are from its centre, and what they are like."""


def find_gaussians(
    samples: ArrayLike,
    length: ArrayLike,
    noise: ArrayLike,
    *,
    width: float = 5.0,
    least: float = 4.0,
    most: int = 16,
) -> tuple[NDArray[np.int64], FloatArray]:
    """Find the components of each waveform.

    Parameters
    ----------
    samples : array_like (n, m)
        Waveforms, counts.
    length : array_like (n,)
        Samples of each.
    noise : array_like (n,)
        Standard deviation of the noise, counts, white, at least 0.
    width : float, optional
        σ of a usual echo, bins, above 0: that of the matched filter.
    least : float, optional
        Height of a residual behind the matched filter, in standard deviations of the noise there, that is worth a
        component's trial.
    most : int, optional
        Components of a waveform, from 0.

    Returns
    -------
    count : int64 (n,)
        Components of each waveform.
    start : float64 (e, 3)
        Their amplitudes, centres and σ, counts and bins, as `fit_gaussians` takes them.

    Raises
    ------
    ValueError
        If shapes do not agree or a value is out of its range.
    ModuleNotFoundError
        If numba is not installed.
    """
    rows, lengths = np.array(samples, np.float64, ndmin=2), np.asarray(length, np.int64)
    deviation = np.asarray(noise, np.float64)
    for name, found in (("length", lengths), ("noise", deviation)):
        if found.shape != (len(rows),):
            raise ValueError(f"{name}: found shape {found.shape}, expected ({len(rows)},)")
    if (lengths < 0).any() or (lengths > rows.shape[1]).any():
        raise ValueError(f"length: found one outside 0 to {rows.shape[1]}, the samples of a row")
    if not (deviation >= 0).all():
        raise ValueError("noise: found one below 0, expected 0 or more")
    if not (0 < width < math.inf and least >= 0 and most >= 0):
        raise ValueError(f"width, least, most: found {width}, {least}, {most}, expected above 0, from 0, from 0")
    rows[np.arange(rows.shape[1]) >= lengths[:, None]] = 0
    if not np.isfinite(rows).all():
        raise ValueError("samples: found a value that is not finite, expected finite ones")

    scale = np.abs(rows).max(axis=1, initial=0)
    scale[scale == 0] = 1
    count, found = np.zeros(len(rows), np.int64), np.zeros((len(rows), most, 3))
    reach = np.arange(-math.ceil(CUT * width), math.ceil(CUT * width) + 1)
    matched = np.exp(-0.5 * (reach / width) ** 2)
    matched /= np.sqrt((matched**2).sum())
    with np.errstate(over="ignore"):  # noise that is infinite beside the waveform: nothing stands out of it
        deviation = deviation / scale
    _peel(rows / scale[:, None], lengths, deviation, matched, width, least, count, found)
    found[:, :, 0] *= scale[:, None]
    return count, found[np.arange(most) < count[:, None]]


@njit(cache=True, parallel=True)
def _peel(
    rows: FloatArray,
    lengths: NDArray[np.int64],
    noise: FloatArray,
    matched: FloatArray,
    width: float,
    least: float,
    count: NDArray[np.int64],
    found: FloatArray,
) -> None:
    for n in prange(len(rows)):
        y = rows[n, : lengths[n]]
        u = np.zeros(1)
        low, high = borders(len(y), 0)
        _, squares, _ = minimise(y, u, low, high)
        price = (PARAMETERS + 2) * np.log(max(len(y), 1)) * noise[n] ** 2
        for components in range(found.shape[1]):
            height, place = _highest(_residual(y, u), matched)
            if height <= least * noise[n]:
                break
            low, high = borders(len(y), components + 1)
            best = _one_more(u, height * matched.max(), place, width)
            _, best_squares, _ = minimise(y, best, low, high)
            nearest = _nearest(u, place)
            if nearest >= 0:
                halves = _in_two(u, nearest)
                _, halves_squares, _ = minimise(y, halves, low, high)
                if halves_squares < best_squares:
                    best, best_squares = halves, halves_squares
            if squares - best_squares <= price:
                break
            u, squares = best, best_squares
            count[n] = components + 1
        for k in range(count[n]):
            found[n, k, 0], found[n, k, 1], found[n, k, 2] = u[3 * k + 1], u[3 * k + 2], np.exp(u[3 * k + 3])


@njit(cache=True)
def _residual(y: FloatArray, u: FloatArray) -> FloatArray:
    residual = np.empty_like(y)
    residual[:] = y - u[0]
    for k in range(1, len(u), 3):
        sigma = np.exp(u[k + 2])
        for x in range(len(y)):
            residual[x] -= u[k] * np.exp(-0.5 * ((x - u[k + 1]) / sigma) ** 2)
    return residual


@njit(cache=True, fastmath={"reassoc", "contract"})
def _highest(residual: FloatArray, matched: FloatArray) -> tuple[float, int]:
    """Greatest value of the residual behind the matched filter, and where."""
    height, place, reach = -np.inf, 0, len(matched) // 2
    for x in range(len(residual)):
        total = 0.0
        for i in range(max(0, x - reach), min(len(residual), x + reach + 1)):
            total += residual[i] * matched[i - x + reach]
        if total > height:
            height, place = total, x
    return height, place


@njit(cache=True)
def _nearest(u: FloatArray, place: float) -> int:
    """Where in `u` the component begins that is nearest to a place, in its own σ; -1 if none is near."""
    nearest, distance = -1, float(NEAR)
    for k in range(1, len(u), 3):
        if abs(place - u[k + 1]) / np.exp(u[k + 2]) < distance:
            nearest, distance = k, abs(place - u[k + 1]) / np.exp(u[k + 2])
    return nearest


@njit(cache=True)
def _one_more(u: FloatArray, amplitude: float, centre: float, sigma: float) -> FloatArray:
    more = np.empty(len(u) + 3)
    more[:-3] = u
    more[-3], more[-2], more[-1] = amplitude, centre, np.log(sigma)
    return more


@njit(cache=True)
def _in_two(u: FloatArray, k: int) -> FloatArray:
    sigma = np.exp(u[k + 2])
    halves = _one_more(u, LOWER * u[k], u[k + 1] + APART * sigma, NARROWER * sigma)
    halves[k], halves[k + 1], halves[k + 2] = LOWER * u[k], u[k + 1] - APART * sigma, np.log(NARROWER * sigma)
    return halves
