"""Vondrák smoothing: the curve between the data and the parabola that fits them best.

Vondrák 1969 (Bull. Astron. Inst. Czechosl. 20, 349) minimises ε Σ pᵢ (yᵢ′ − yᵢ)² + Σ (y‴)², where the third derivative
between two samples is that of the cubic through these and their neighbours. ε, 1/λ² of the V–L method, is how closely
the data are followed: ∞ returns them, 0 the weighted least-squares parabola, of which the second sum knows nothing.

It is solved as the least-squares problem that it is: Givens rotations make its matrix triangular, row by row, in O(m)
and with half of the digits lost that the normal equations lose. The parabola is taken off first and added again, so
that no ε, however small, can spoil it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.compiled import njit, share

FloatArray = NDArray[np.float64]

MOST = np.finfo(np.float64).max
ORDER = 3
"""Of the derivative that is kept small, and the number of parameters of the parabola that has none."""
BAND = ORDER + 1
"""Samples that a derivative is made of, and so diagonals of the triangular matrix."""


def vondrak(
    samples: ArrayLike, epsilon: float, *, position: ArrayLike | None = None, weight: ArrayLike | None = None
) -> FloatArray:
    """Smooth waveforms, each by itself.

    Vondrák 1969, with the third derivative of section 2 there. At a spacing of 1 bin and weights of 1 it passes a
    period of P bins with ε / (ε + (2 sin(π/P))⁶) of its amplitude, and without a shift.

    Parameters
    ----------
    samples : array_like (..., m)
        Waveforms, in any unit.
    epsilon : float
        How closely the data are followed, from 0 to infinity.
    position : array_like (m,), optional
        Where the samples stand, in bins, rising; 0, 1, 2 … if left out.
    weight : array_like (m,) or (..., m), optional
        Of the samples, at least 0; 1 if left out. A sample of weight 0 has no say: its place is bridged.

    Returns
    -------
    float64 (..., m)
        In the unit of `samples`.

    Raises
    ------
    ValueError
        If an argument is out of range or not finite, or of three or more samples less than three have a weight.
    ModuleNotFoundError
        If numba is not installed.
    """
    rows = np.array(samples, np.float64, ndmin=1)
    shape, count = rows.shape, rows.shape[-1]
    rows = rows.reshape(math.prod(shape[:-1]), count)
    _check(bool(np.isfinite(rows).all()), "samples", "a value that is not finite", "finite values")
    _check(epsilon >= 0, "epsilon", f"{epsilon}", "0 to infinity")
    at = _positions(position, count)
    weights = _weights(weight, shape)
    if count <= ORDER or epsilon == np.inf:
        return rows.reshape(shape)

    # Between -1 and 1, whatever the unit: neither squares nor sums overflow.
    scale = np.abs(rows).max(axis=1, keepdims=True)
    scale[scale == 0] = 1
    rows /= scale
    root = np.sqrt(weights)
    basis = _parabolas(at, root)
    parabola = _projected(rows, basis, root)
    parabola += _projected(rows - parabola, basis, root)
    if epsilon > 0:
        larger = max(1.0, math.sqrt(epsilon))  # of the two sums' roots: over it, squares don't overflow
        follow = np.broadcast_to(math.sqrt(epsilon) / larger * root, rows.shape)
        rest = np.empty_like(rows)
        share(_solve, len(rows), rows - parabola, follow, _derivatives(at) / larger, rest)
        parabola += rest - _projected(rest, basis, root)
    with np.errstate(over="ignore"):  # a smooth curve through ±1.7e308 may leave float64
        return np.asarray(np.clip(parabola * scale, -MOST, MOST)).reshape(shape)


def _positions(position: ArrayLike | None, count: int) -> FloatArray:
    at = np.arange(count, dtype=np.float64) if position is None else np.asarray(position, np.float64)
    _check(at.shape == (count,), "position", f"shape {at.shape}", f"({count},), as many as samples")
    rising = np.isfinite(at).all() and (np.diff(at) > 0).all()
    _check(bool(rising), "position", "values that don't rise", "rising ones")
    return at


def _weights(weight: ArrayLike | None, shape: tuple[int, ...]) -> FloatArray:
    """Weights, (n, m) or for all waveforms the same (1, m)."""
    weights = np.ones(shape[-1:]) if weight is None else np.array(weight, np.float64)
    _check(weights.shape in (shape, shape[-1:]), "weight", f"shape {weights.shape}", f"{shape[-1:]} or {shape}")
    weights = weights.reshape(math.prod(weights.shape[:-1]), shape[-1])
    valid = np.isfinite(weights).all() and (weights >= 0).all()
    _check(bool(valid), "weight", "one below 0", "finite ones from 0")
    enough = np.count_nonzero(weights, axis=1).min(initial=ORDER) >= min(ORDER, shape[-1])
    _check(bool(enough), "weight", "less than three samples with one", "three or more")
    return weights


def _check(good: bool, what: str, found: str, expected: str) -> None:
    if not good:
        raise ValueError(f"{what}: found {found}, expected {expected}")


def _parabolas(at: FloatArray, root: FloatArray) -> FloatArray:
    """1, t and t² made orthonormal under each row of weights, (n, m, 3); `root` is the square root of the weights."""
    t = (at - at[0]) / (at[-1] - at[0]) * 2 - 1
    powers = np.stack([np.ones_like(t), t, t * t], axis=1)
    triangle = np.linalg.qr(root[:, :, None] * powers, mode="r")
    return np.asarray(np.swapaxes(np.linalg.solve(np.swapaxes(triangle, 1, 2), powers.T), 1, 2))


def _projected(rows: FloatArray, basis: FloatArray, root: FloatArray) -> FloatArray:
    """Weighted least-squares parabola of each row."""
    coefficients = (rows * root**2)[:, None] @ basis
    return np.asarray((coefficients @ np.swapaxes(basis, 1, 2))[:, 0])


def _derivatives(at: FloatArray) -> FloatArray:
    """Coefficients of the third derivatives, (m - 3, 4), each times the root of the step that it stands for.

    The cubic through four samples has the third derivative Σ 6 yᵢ / Πⱼ (xᵢ − xⱼ). At a spacing of 1 that is the third
    difference.
    """
    windows = np.lib.stride_tricks.sliding_window_view(at, BAND)
    steps = windows[:, :, None] - windows[:, None, :]
    steps[:, np.arange(BAND), np.arange(BAND)] = 1
    return np.asarray(6 * np.sqrt(windows[:, 2] - windows[:, 1])[:, None] / steps.prod(axis=2))


@njit(nogil=True)
def _solve(
    begin: int, end: int, rows: FloatArray, weight: FloatArray, derivative: FloatArray, solved: FloatArray
) -> None:
    """Least squares of weight (s - row) = 0 and derivative s = 0, for each row."""
    length = rows.shape[1]
    for n in range(begin, end):
        triangle = np.zeros((length, BAND))  # from the diagonal on
        right = np.zeros(length)
        equation = np.empty(BAND)
        for i in range(length):
            if i < length - ORDER:
                equation[:] = derivative[i]
                _insert(triangle, right, i, equation, 0.0)
            equation[:] = 0.0
            equation[0] = weight[n, i]
            _insert(triangle, right, i, equation, weight[n, i] * rows[n, i])
        for i in range(length - 1, -1, -1):
            value = right[i]
            for k in range(1, min(BAND, length - i)):
                value -= triangle[i, k] * solved[n, i + k]
            solved[n, i] = value / triangle[i, 0]


@njit()
def _insert(triangle: FloatArray, right: FloatArray, i: int, equation: FloatArray, value: float) -> None:
    """Rotate an equation that begins in column `i` into the triangle, until nothing is left or a row is still free."""
    while i < len(right):
        if equation[0] != 0.0:
            if triangle[i, 0] == 0.0:
                triangle[i] = equation
                right[i] = value
                return
            length = math.hypot(triangle[i, 0], equation[0])  # of which no square underflows
            cosine, sine = triangle[i, 0] / length, equation[0] / length
            for k in range(BAND):
                above, below = triangle[i, k], equation[k]
                triangle[i, k] = cosine * above + sine * below
                equation[k] = cosine * below - sine * above
            right[i], value = cosine * right[i] + sine * value, cosine * value - sine * right[i]
        for k in range(BAND - 1):
            equation[k] = equation[k + 1]
        equation[BAND - 1] = 0.0
        if not equation.any():
            return
        i += 1
