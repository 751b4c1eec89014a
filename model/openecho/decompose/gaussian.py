"""Least-squares fit of sums of Gaussians and a baseline to batches of waveforms, from given starting values.

y(x) = b + Σ A exp(−(x − c)² / (2σ²)), after Hofton, Minster & Blair 2000 (IEEE Trans. Geosci. Remote Sens. 38, 1989),
by the method of Levenberg and Marquardt with analytic derivatives: of A, of c and of ln σ, so that no width is ever
negative. Amplitudes stay at 0 or above, centres within a width's reach of the record, widths between a third of a bin
and the record's length: a step that leads out ends at the border.

A component is summed over REACH σ to either side of its centre, past which it is below what a float64 of its amplitude
holds. So the time is that of the echoes, not of the record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.compiled import njit, prange

FloatArray = NDArray[np.float64]

REACH = 8.5
"""σ: exp(−REACH² / 2) is 2^-52."""
LEAST_WIDTH = 1 / 3
"""Bins. Of what is narrower all but one sample is about a hundredth at most: its width can't be known."""
GREATEST = 1e300
"""Counts: what is fitted to them may be a thousand times as high."""
STEPS = 60
"""Accepted or not, of one fit."""
LEAST_GAIN = 1e-12
"""Of a step, as a part of the sum of squares: below it the fit has converged."""


@dataclass(frozen=True)
class Fit:
    """Fitted components, in the order of their starting values, and what is known of each waveform.

    Attributes
    ----------
    amplitude, centre, sigma : float64 (e,)
        Counts, bins, bins.
    amplitude_error, centre_error, sigma_error : float64 (e,)
        Standard errors in the same units, of a noise that is white; 0 for what lies on its border, infinite where the
        data do not determine a value.
    baseline, rms : float64 (n,)
        Counts; root of the mean square of the residual.
    converged : bool (n,)
        Whether the last step gained nothing any more.
    """

    amplitude: FloatArray
    centre: FloatArray
    sigma: FloatArray
    amplitude_error: FloatArray
    centre_error: FloatArray
    sigma_error: FloatArray
    baseline: FloatArray
    rms: FloatArray
    converged: NDArray[np.bool_]


def fit_gaussians(
    samples: ArrayLike,
    length: ArrayLike,
    count: ArrayLike,
    start: ArrayLike,
    *,
    baseline: ArrayLike | None = None,
    noise: ArrayLike | None = None,
) -> Fit:
    """Fit a baseline and so many Gaussians to each waveform.

    Parameters
    ----------
    samples : array_like (n, m)
        Waveforms, counts.
    length : array_like (n,)
        Samples of each.
    count : array_like (n,)
        Components of each, from 0.
    start : array_like (e, 3)
        Amplitude, centre and σ of each component to start with, those of the first waveform first.
    baseline : array_like (n,), optional
        To start with; the least sample of each waveform if left out.
    noise : array_like (n,), optional
        Standard deviation of the noise, counts; that of the residual, for as many degrees of freedom, if left out.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        If shapes do not agree or a value is not finite.
    ModuleNotFoundError
        If numba is not installed.
    """
    rows, start_values = np.array(samples, np.float64), np.array(start, np.float64).reshape(-1, 3)
    lengths, counts = np.asarray(length, np.int64), np.asarray(count, np.int64)
    _check_shapes(rows, lengths, counts, start_values)
    inside = np.arange(rows.shape[1]) < lengths[:, None]
    rows[~inside] = 0
    for name, values in (("samples", rows), ("start", start_values)):
        if not (np.abs(values) <= GREATEST).all():
            raise ValueError(f"{name}: found a value that is not finite or beyond {GREATEST:g}, expected none")

    # Fitted in units of the greatest sample, so that no square overflows or vanishes.
    scale = np.abs(rows).max(axis=1, initial=0)
    scale[scale == 0] = 1
    rows /= scale[:, None]
    each = np.repeat(scale, counts)
    with np.errstate(over="ignore"):  # what is too high by far is brought to its border
        start_values[:, 0] /= each
        first = np.min(rows, axis=1, initial=1, where=inside) if baseline is None else np.asarray(baseline) / scale
        deviation = np.full(len(rows), np.nan) if noise is None else np.asarray(noise, np.float64) / scale
    offset = np.concatenate([[0], np.cumsum(counts)])

    fitted, errors = np.empty_like(start_values), np.empty_like(start_values)
    base, rms, converged = np.empty(len(rows)), np.empty(len(rows)), np.empty(len(rows), np.bool_)
    _fit(rows, lengths, offset, start_values, first, deviation, fitted, errors, base, rms, converged)
    fitted[:, 0] *= each
    errors[:, 0] *= each
    amplitude, centre, sigma = fitted.T
    amplitude_error, centre_error, sigma_error = errors.T
    return Fit(
        amplitude, centre, sigma, amplitude_error, centre_error, sigma_error, base * scale, rms * scale, converged
    )


def _check_shapes(rows: FloatArray, lengths: NDArray[np.int64], counts: NDArray[np.int64], start: FloatArray) -> None:
    if rows.ndim != 2:
        raise ValueError(f"samples: found {rows.ndim} dimensions, expected 2, waveforms and samples")
    for name, found in (("length", lengths), ("count", counts)):
        if found.shape != (len(rows),):
            raise ValueError(f"{name}: found shape {found.shape}, expected ({len(rows)},)")
    if (lengths < 0).any() or (lengths > rows.shape[1]).any():
        raise ValueError(f"length: found one outside 0 to {rows.shape[1]}, the samples of a row")
    if (counts < 0).any() or counts.sum() != len(start):
        raise ValueError(f"start: found {len(start)} components, expected {counts.sum()}, the sum of count")


@njit(cache=True, parallel=True)
def _fit(
    rows: FloatArray,
    lengths: NDArray[np.int64],
    offset: NDArray[np.int64],
    start: FloatArray,
    first: FloatArray,
    deviation: FloatArray,
    values: FloatArray,
    errors: FloatArray,
    base: FloatArray,
    rms: FloatArray,
    converged: NDArray[np.bool_],
) -> None:
    for n in prange(len(rows)):
        y = rows[n, : lengths[n]]
        components = offset[n + 1] - offset[n]
        unknowns = 3 * components + 1
        u = np.empty(unknowns)
        u[0] = first[n]
        for k in range(components):
            i = 3 * k + 1
            u[i], u[i + 1] = start[offset[n] + k, 0], start[offset[n] + k, 1]
            u[i + 2] = np.log(max(start[offset[n] + k, 2], LEAST_WIDTH))
        low, high = borders(len(y), components)
        normal, squares, converged[n] = minimise(y, u, low, high)
        freedom = max(len(y) - unknowns, 1)
        noise = np.sqrt(squares / freedom) if np.isnan(deviation[n]) else deviation[n]
        base[n], rms[n] = u[0], np.sqrt(squares / max(len(y), 1))
        spread = _spread(normal, u, low, high)
        for i in range(unknowns):
            if np.isfinite(spread[i]):
                spread[i] *= noise
        for k in range(components):
            i, sigma = 3 * k + 1, np.exp(u[3 * k + 3])
            values[offset[n] + k, 0], values[offset[n] + k, 1], values[offset[n] + k, 2] = u[i], u[i + 1], sigma
            errors[offset[n] + k, 0], errors[offset[n] + k, 1] = spread[i], spread[i + 1]
            errors[offset[n] + k, 2] = spread[i + 2] * sigma


@njit(cache=True)
def borders(length: int, components: int) -> tuple[FloatArray, FloatArray]:
    """Least and greatest baseline, and amplitude, centre and ln σ of each component; the greatest sample is 1."""
    low, high = np.empty(3 * components + 1), np.empty(3 * components + 1)
    low[0], high[0] = -1e3, 1e3
    low[1::3], high[1::3] = 0.0, 1e3
    low[2::3], high[2::3] = -float(length), 2.0 * length
    low[3::3], high[3::3] = np.log(LEAST_WIDTH), np.log(max(1.0, float(length)))
    return low, high


@njit(cache=True)
def minimise(y: FloatArray, u: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, float, bool]:
    """Move `u` to the least sum of squares; return the normal matrix there, the sum, and whether it is the least."""
    unknowns = len(u)
    u[:] = np.minimum(np.maximum(u, low), high)
    normal, gradient = np.empty((unknowns, unknowns)), np.empty(unknowns)
    tried_normal, tried_gradient = np.empty_like(normal), np.empty_like(gradient)
    damped, step, tried = np.empty_like(normal), np.empty(unknowns), np.empty(unknowns)
    slopes, residual = np.empty((unknowns, len(y))), np.empty(len(y))
    squares = _evaluate(y, u, slopes, residual, normal, gradient)
    damping = 1e-3
    for _ in range(STEPS):
        damped[:] = normal
        step[:] = gradient
        for i in range(unknowns):
            damped[i, i] += damping * normal[i, i] + 1e-300
            # On its border, and drawn out of it: stays.
            if (u[i] <= low[i] and gradient[i] < 0) or (u[i] >= high[i] and gradient[i] > 0):
                damped[i, :] = 0.0
                damped[:, i] = 0.0
                damped[i, i] = 1.0
                step[i] = 0.0
        gain = -1.0
        if _solve(damped, step):
            for i in range(unknowns):
                tried[i] = min(max(u[i] + step[i], low[i]), high[i])
            tried_squares = _evaluate(y, tried, slopes, residual, tried_normal, tried_gradient)
            gain = squares - tried_squares
        if gain >= 0:
            u[:] = tried
            normal, tried_normal = tried_normal, normal
            gradient, tried_gradient = tried_gradient, gradient
            small = gain <= LEAST_GAIN * squares
            squares -= gain
            damping = max(0.1 * damping, 1e-12)
            if small:
                return normal, squares, True
        elif damping > 1e8:
            # No way down at any length: the rounding of the sum of squares is all that is left.
            return normal, squares, True
        else:
            damping *= 10
    return normal, squares, False


@njit(cache=True, fastmath={"reassoc", "contract"})
def _evaluate(
    y: FloatArray,
    u: FloatArray,
    slopes: FloatArray,
    residual: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
) -> float:
    """Sum of squares at `u`, and its normal matrix and half of its negative gradient; Hofton 2000, Eq (1)."""
    length, components = len(y), (len(u) - 1) // 3
    residual[:] = y - u[0]
    normal[:] = 0.0
    begins, ends = np.empty(components, np.int64), np.empty(components, np.int64)
    for k in range(components):
        i = 3 * k + 1
        amplitude, centre, sigma = u[i], u[i + 1], np.exp(u[i + 2])
        begin = int(min(max(np.ceil(centre - REACH * sigma), 0.0), float(length)))
        end = int(min(max(np.floor(centre + REACH * sigma) + 1.0, 0.0), float(length)))
        begins[k], ends[k] = begin, max(begin, end)
        for x in range(begin, end):
            z = (x - centre) / sigma
            height = np.exp(-0.5 * z * z)
            slopes[i, x] = height
            slopes[i + 1, x] = amplitude * height * z / sigma
            slopes[i + 2, x] = amplitude * height * z * z
            residual[x] -= amplitude * height
    squares = 0.0
    total = 0.0
    for x in range(length):
        squares += residual[x] * residual[x]
        total += residual[x]
    normal[0, 0], gradient[0] = length, total
    for k in range(components):
        for i in range(3 * k + 1, 3 * k + 4):
            slope, drawn = 0.0, 0.0
            for x in range(begins[k], ends[k]):
                slope += slopes[i, x]
                drawn += slopes[i, x] * residual[x]
            normal[0, i], normal[i, 0], gradient[i] = slope, slope, drawn
        for other in range(k + 1):
            begin, end = max(begins[k], begins[other]), min(ends[k], ends[other])
            for i in range(3 * k + 1, 3 * k + 4):
                for j in range(3 * other + 1, min(3 * other + 4, i + 1)):
                    product = 0.0
                    for x in range(begin, end):
                        product += slopes[i, x] * slopes[j, x]
                    normal[i, j], normal[j, i] = product, product
    return squares


@njit(cache=True)
def _solve(matrix: FloatArray, right: FloatArray) -> bool:
    """Solve by Cholesky's method in place; false if the matrix is not positive definite."""
    size = len(right)
    for i in range(size):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            if i == j:
                if not value > 0.0:
                    return False
                matrix[i, i] = np.sqrt(value)
            else:
                matrix[i, j] = value / matrix[j, j]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    return True


@njit(cache=True)
def _spread(normal: FloatArray, u: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Standard error of each unknown at a noise of 1: roots of the diagonal of the inverse of the normal matrix."""
    size = len(u)
    spread = np.full(size, np.inf)
    held = (u <= low) | (u >= high)
    unseen = np.diag(normal) <= 0.0  # by the data: where and how wide is what has no height?
    free = normal.copy()
    for i in range(size):
        if held[i] or unseen[i]:
            free[i, :] = 0.0
            free[:, i] = 0.0
            free[i, i] = 1.0
    unit, factor = np.empty(size), np.empty_like(free)
    for i in range(size):
        factor[:] = free
        unit[:] = 0.0
        unit[i] = 1.0
        if held[i]:
            spread[i] = 0.0
        elif not unseen[i] and _solve(factor, unit):
            spread[i] = np.sqrt(max(unit[i], 0.0))
    return spread
