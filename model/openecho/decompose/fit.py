"""Least-squares fit of a baseline and sums of echoes to batches of waveforms, from given starting values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.compiled import njit, share
from openecho.decompose.choices import WIDTHS
from openecho.decompose.least_squares import (
    LEAST_WIDTH,
    STEPS,
    FloatArray,
    IntArray,
    Problem,
    Waveform,
    add_slopes,
    borders,
    inverse,
    minimise,
    residual,
)
from openecho.decompose.pulses import Pulse, gaussian
from openecho.enhance.autoregression import whitening

GREATEST = 1e300
"""Counts: what is fitted to them may be a thousand times as high."""

NOISIEST = 1e100
"""Deviation of the noise at most, in units of the greatest sample."""
GREATEST_WIDTH = 1e5
"""Of a usual echo, bins: longer than any record."""


@dataclass(frozen=True)
class Fit:
    """Fitted echoes, in the order of their starting values, and what is known of each waveform.

    Attributes
    ----------
    amplitude, centre, width : float64 (e,)
        Height, counts; position of the maximum and half the distance of the inflections, bins: σ of a Gaussian. For
        `pulses.rough` and `pulses.measured` the width is √(w₀² + s²).
    amplitude_error, centre_error, width_error : float64 (e,)
        Standard errors in the same units; 0 for what lies on its border or was given, infinite where the data do not
        determine a value.
    baseline, rms : float64 (n,)
        Counts; root of the mean square of the residual.
    converged : bool (n,)
        Whether the last step gained nothing any more.
    count : int64 (n,)
        Echoes of each waveform.
    """

    amplitude: FloatArray
    centre: FloatArray
    width: FloatArray
    amplitude_error: FloatArray
    centre_error: FloatArray
    width_error: FloatArray
    baseline: FloatArray
    rms: FloatArray
    converged: NDArray[np.bool_]
    count: IntArray
    _covariances: FloatArray

    def covariance(self, waveform: int) -> FloatArray:
        """Covariance of a waveform's baseline, and amplitude, centre and width of its k echoes, in their order.

        Parameters
        ----------
        waveform : int
            From 0.

        Returns
        -------
        float64 (3 k + 1, 3 k + 1)
            Counts and bins. Rows of what lies on its border, was given or is not determined are 0.
        """
        size = 3 * self.count[: waveform + 1] + 1
        end = int((size**2).sum())
        return self._covariances[end - size[-1] ** 2 : end].reshape(size[-1], size[-1])


def fit_echoes(
    samples: ArrayLike,
    length: ArrayLike,
    count: ArrayLike,
    start: ArrayLike,
    *,
    pulse: Pulse | None = None,
    correlation: ArrayLike = (1.0,),
    widths: str = "free",
    width: float = 5.0,
    baseline: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    weight: ArrayLike | None = None,
) -> Fit:
    """Fit a baseline and so many echoes to each waveform.

    Parameters
    ----------
    samples : array_like (n, m)
        Waveforms, counts.
    length : array_like (n,)
        Samples of each.
    count : array_like (n,)
        Echoes of each, from 0.
    start : array_like (e, 3)
        Amplitude, centre and width of each echo to start with, those of the first waveform first.
    pulse : Pulse, optional
        Shape of the echoes; the Gaussian if left out.
    correlation : array_like (lags + 1,), optional
        Autocorrelation of the noise, 1 at lag 0; that of white noise if left out.
    widths : str, optional
        One of `WIDTHS`.
    width : float, optional
        If widths are ``fixed``, bins, above 0.
    baseline : array_like (n,), optional
        To start with; the least sample of each waveform if left out.
    noise : array_like (n,), optional
        Standard deviation of the noise, counts; that of the residual, for as many degrees of freedom, if left out.
    weight : array_like (n, m), optional
        Of the samples, from 0: the variance of the noise is its square over the weight. All 1 if left out.

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
    rows, lengths, scale = scaled(samples, length)
    counts, first_values = np.asarray(count, np.int64), np.array(start, np.float64).reshape(-1, 3)
    if counts.shape != (len(rows),):
        raise ValueError(f"count: found shape {counts.shape}, expected ({len(rows)},)")
    if (counts < 0).any() or counts.sum() != len(first_values):
        raise ValueError(f"start: found {len(first_values)} echoes, expected {counts.sum()}, the sum of count")
    check_finite("start", first_values)
    given = problem(pulse, correlation, widths, width)
    roots = weight_roots(weight, rows)
    inside = np.arange(rows.shape[1]) < lengths[:, None]
    with np.errstate(over="ignore"):  # what is too high by far is brought to its border
        first_values[:, 0] /= np.repeat(scale, counts)
        first = np.min(rows, axis=1, initial=1, where=inside) if baseline is None else np.asarray(baseline) / scale
        deviation = np.full(len(rows), np.nan) if noise is None else deviations(noise, scale)
    size = 3 * counts + 1
    echo, unknown, block = (np.append(0, np.cumsum(sizes)) for sizes in (counts, size, size**2))
    values, errors, covariance = np.empty(unknown[-1]), np.empty(unknown[-1]), np.empty(block[-1])
    rms, converged = np.empty(len(rows)), np.empty(len(rows), np.bool_)
    if first.shape != (len(rows),):
        raise ValueError(f"baseline: found shape {first.shape}, expected ({len(rows)},)")
    share(
        _fit,
        len(rows),
        rows,
        roots,
        lengths,
        scale,
        first,
        deviation,
        given,
        first_values,
        echo,
        unknown,
        block,
        values,
        errors,
        covariance,
        rms,
        converged,
    )
    of_echo = np.ones(len(values), np.bool_)
    of_echo[unknown[:-1]] = False
    amplitude, centre, fitted = values[of_echo].reshape(-1, 3).T
    amplitude_error, centre_error, fitted_error = errors[of_echo].reshape(-1, 3).T
    return Fit(
        amplitude,
        centre,
        fitted,
        amplitude_error,
        centre_error,
        fitted_error,
        baseline=values[unknown[:-1]],
        rms=rms,
        converged=converged,
        count=counts,
        _covariances=covariance,
    )


def echo_sum(
    samples: int,
    baseline: ArrayLike,
    waveform: ArrayLike,
    amplitude: ArrayLike,
    centre: ArrayLike,
    width: ArrayLike,
    pulse: Pulse | None = None,
) -> FloatArray:
    """Waveforms of a baseline and echoes.

    Parameters
    ----------
    samples : int
        m, of each waveform.
    baseline : array_like (n,)
        Of each waveform, counts.
    waveform : integer array_like (e,)
        Of each echo, from 0.
    amplitude, centre, width : array_like (e,)
        As in `Fit`.
    pulse : Pulse, optional
        Their shape; the Gaussian if left out.

    Returns
    -------
    float64 (n, m)
        Counts.
    """
    total = np.repeat(np.asarray(baseline, np.float64)[:, None], samples, axis=1)
    numbers = (np.ascontiguousarray(column, np.float64) for column in (amplitude, centre, width))
    _add(total, np.ascontiguousarray(waveform, np.int64), *numbers, gaussian() if pulse is None else pulse)
    return total


def scaled(samples: ArrayLike, length: ArrayLike) -> tuple[FloatArray, IntArray, FloatArray]:
    """Waveforms (n, m) in units of the greatest sample of each, 0 past their lengths (n,), and these units (n,)."""
    rows, lengths = np.array(samples, np.float64), np.asarray(length)
    if lengths.dtype.kind not in "iu" and lengths.size:
        raise ValueError(f"length: found {lengths.dtype}, expected whole numbers")
    lengths = lengths.astype(np.int64)
    if rows.ndim != 2:
        raise ValueError(f"samples: found {rows.ndim} dimensions, expected 2, waveforms and samples")
    if lengths.shape != (len(rows),):
        raise ValueError(f"length: found shape {lengths.shape}, expected ({len(rows)},)")
    if (lengths < 0).any() or (lengths > rows.shape[1]).any():
        raise ValueError(f"length: found one outside 0 to {rows.shape[1]}, the samples of a row")
    rows[np.arange(rows.shape[1]) >= lengths[:, None]] = 0
    check_finite("samples", rows)
    scale = np.abs(rows).max(axis=1, initial=0)
    scale[scale == 0] = 1
    rows /= scale[:, None]
    return rows, lengths, scale


def deviations(noise: ArrayLike, scale: FloatArray) -> FloatArray:
    """Deviation of the noise of each waveform (n,) in units of `scale`, checked, and nothing that products overflow."""
    deviation = np.asarray(noise, np.float64)
    if deviation.shape != scale.shape:
        raise ValueError(f"noise: found shape {deviation.shape}, expected {scale.shape}")
    if not (deviation >= 0).all():
        raise ValueError("noise: found one below 0, expected 0 or more")
    with np.errstate(over="ignore"):
        return np.minimum(deviation / scale, NOISIEST)


def weight_roots(weight: ArrayLike | None, rows: FloatArray) -> FloatArray:
    """Square roots of the weights of samples (n, m), checked; (n, 0) if there are none."""
    if weight is None:
        return np.empty((len(rows), 0))
    weights = np.asarray(weight, np.float64)
    if weights.shape != rows.shape or not ((weights >= 0) & np.isfinite(weights)).all():
        raise ValueError(f"weight: found shape {weights.shape}, expected finite ones from 0 of shape {rows.shape}")
    return np.sqrt(weights)


def problem(pulse: Pulse | None, correlation: ArrayLike, widths: str, width: float) -> Problem:
    """What all waveforms have in common, checked."""
    if widths not in WIDTHS:
        raise ValueError(f"widths: found {widths!r}, expected one of {', '.join(WIDTHS)}")
    if not LEAST_WIDTH <= width <= GREATEST_WIDTH:
        raise ValueError(f"width: found {width}, expected {LEAST_WIDTH:.3g} to {GREATEST_WIDTH:g} bins")
    shape = gaussian() if pulse is None else pulse
    if widths == "fixed" and width < shape.narrowest:
        raise ValueError(f"width: found {width}, expected at least the pulse's, {shape.narrowest:g}")
    return Problem(shape, whitening(correlation), widths == "shared", float(width) if widths == "fixed" else 0.0)


def check_finite(name: str, values: FloatArray) -> None:
    """Refuse values that squares or sums would overflow with."""
    if not (np.abs(values) <= GREATEST).all():
        raise ValueError(f"{name}: found a value that is not finite or beyond {GREATEST:g}, expected none")


@njit(nogil=True)
def _fit(
    begin: int,
    end: int,
    rows: FloatArray,
    roots: FloatArray,
    lengths: IntArray,
    scale: FloatArray,
    first: FloatArray,
    deviation: FloatArray,
    given: Problem,
    start: FloatArray,
    echo: IntArray,
    unknown: IntArray,
    block: IntArray,
    values: FloatArray,
    errors: FloatArray,
    covariance: FloatArray,
    rms: FloatArray,
    converged: NDArray[np.bool_],
) -> None:
    for n in range(begin, end):
        y = Waveform(rows[n, : lengths[n]], roots[n, : lengths[n]])
        u = values[unknown[n] : unknown[n + 1]]
        size, heard = len(u), np.count_nonzero(y.root) if len(y.root) else lengths[n]
        u[0] = first[n]
        for k in range(echo[n + 1] - echo[n]):
            u[3 * k + 1], u[3 * k + 2] = start[echo[n] + k, 0], start[echo[n] + k, 1]
            u[3 * k + 3] = np.log(max(start[echo[n] + k, 2], LEAST_WIDTH))
        low, high = borders(lengths[n], size // 3, given)
        normal, squares, converged[n] = minimise(y, u, low, high, given, STEPS)
        noise = np.sqrt(squares / max(heard - size, 1)) if np.isnan(deviation[n]) else deviation[n]
        spread, error = inverse(normal, u, low, high, given.tied)
        rms[n] = np.sqrt(squares_left(y, u, squares, given) / max(heard, 1)) * scale[n]
        unit = np.empty(size)
        for i in range(size):
            unit[i] = 1.0 if i % 3 == 2 else scale[n]
            if i % 3 == 0 and i > 0:
                u[i] = unit[i] = given.width if given.width > 0 else np.exp(u[i])
            else:
                u[i] *= unit[i]
            errors[unknown[n] + i] = error[i] * noise * unit[i] if error[i] < np.inf else np.inf
        square = covariance[block[n] : block[n + 1]].reshape((size, size))
        for i in range(size):
            for j in range(size):
                square[i, j] = spread[i, j] * noise * unit[i] * (noise * unit[j])


@njit()
def _add(
    total: FloatArray,
    waveform: IntArray,
    amplitude: FloatArray,
    centre: FloatArray,
    width: FloatArray,
    pulse: Pulse,
) -> None:
    slopes = np.empty((3, total.shape[1]))
    for k in range(len(waveform)):
        begin, end = add_slopes(amplitude[k], centre[k], width[k], pulse, slopes)
        for x in range(begin, end):
            total[waveform[k], x] += amplitude[k] * slopes[0, x]


@njit()
def squares_left(y: Waveform, u: FloatArray, squares: float, given: Problem) -> float:
    """Sum of the squares of what the echoes leave, where there is a weight; the fit knows it in plain noise only."""
    if len(given.white) == 1 and len(y.root) == 0:
        return squares
    left = residual(y.samples, u, given.pulse)
    if len(y.root) > 0:
        left *= y.root > 0
    return float(left @ left)
