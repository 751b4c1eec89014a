"""Smoothing that Vondrák's is compared with: moving average, Gaussian, and homomorphic filtering of speckle.

All keep the length of a waveform and a constant one as it is; past its ends a waveform is taken to go on with its last
value, or to turn back where a spectrum is filtered.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, ndimage

FloatArray = NDArray[np.float64]

MOST = np.finfo(np.float64).max
CUT = 6
"""Reach of the Gaussian, σ."""


def moving_average(samples: ArrayLike, width: int) -> FloatArray:
    """Mean of so many samples around each.

    Parameters
    ----------
    samples : array_like (..., m)
        Waveforms.
    width : int
        Samples, odd, so that nothing moves.

    Returns
    -------
    float64 (..., m)

    Raises
    ------
    ValueError
        If `width` is not odd and positive.
    """
    if width < 1 or width % 2 == 0:
        raise ValueError(f"width: found {width}, expected an odd number from 1")
    return _averaged(samples, lambda rows: ndimage.uniform_filter1d(rows, width, mode="nearest"))


def gaussian(samples: ArrayLike, sigma: float) -> FloatArray:
    """Convolution with a Gaussian, cut at `CUT` σ.

    Parameters
    ----------
    samples : array_like (..., m)
        Waveforms.
    sigma : float
        Bins, above 0. An echo of width σₑ gets √(σₑ² + σ²) wide.

    Returns
    -------
    float64 (..., m)

    Raises
    ------
    ValueError
        If `sigma` is not positive and finite.
    """
    _positive("sigma", sigma)
    # Of less than half a bin in `CUT` only the sample itself is left, and a square that doesn't underflow.
    sigma = max(sigma, 0.25 / CUT)
    return _averaged(samples, lambda rows: ndimage.gaussian_filter1d(rows, sigma, mode="nearest", truncate=CUT))


def homomorphic(
    samples: ArrayLike, period: float, *, baseline: ArrayLike = 0.0, floor: float = 1.0, order: int = 2
) -> FloatArray:
    """Low-pass filter of the logarithm, in which speckle, a factor, is a summand (Oppenheim, Schafer & Stockham 1968).

    The frequency response is Butterworth's, 1 / (1 + (P/p)^(2 order)) at a period of p bins, without a shift; the
    answer stays between the least and the greatest signal. What does not stand `floor` above the baseline has no
    logarithm to speak of and counts as `floor`: additive noise is to be taken away before, by accumulation or wavelets.

    Parameters
    ----------
    samples : array_like (..., m)
        Waveforms, counts.
    period : float
        P, bins, above 0: shorter ones are taken away.
    baseline : array_like (...), optional
        Counts that are there without a signal.
    floor : float, optional
        Least signal, counts above the baseline, above 0.
    order : int, optional
        Of the response, from 1.

    Returns
    -------
    float64 (..., m)
        Counts. The mean of a logarithm is below the logarithm of the mean: fully developed speckle of order M comes out
        exp(ψ(M)) / M of its mean high.

    Raises
    ------
    ValueError
        If a number is out of its range.
    """
    _positive("period", period)
    _positive("floor", floor)
    if order < 1:
        raise ValueError(f"order: found {order}, expected 1 or more")
    rows = np.atleast_1d(_finite("samples", samples))
    if rows.size == 0:
        return rows
    offset = _finite("baseline", baseline)[..., None]
    # The cosine transform is that of a waveform that turns back at its ends.
    cycles = np.arange(rows.shape[-1]) / (2 * rows.shape[-1])
    with np.errstate(over="ignore"):  # what float64 doesn't hold is its greatest value, or a response of 0
        logarithm = np.log(np.clip(rows - offset, floor, MOST))
        response = 1 / (1 + (period * cycles) ** (2 * order))
    filtered = fft.idct(fft.dct(logarithm, norm="ortho") * response, norm="ortho")
    # Behind a steep step the filter overshoots, which in a logarithm could be anything.
    inside = np.clip(filtered, logarithm.min(axis=-1, keepdims=True), logarithm.max(axis=-1, keepdims=True))
    with np.errstate(over="ignore"):
        return np.asarray(np.clip(np.exp(inside) + offset, -MOST, MOST))


def _finite(name: str, values: ArrayLike) -> FloatArray:
    found = np.asarray(values, np.float64)
    if not np.isfinite(found).all():
        raise ValueError(f"{name}: found a value that is not finite, expected finite ones")
    return found


def _averaged(samples: ArrayLike, average: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Averages of samples, which are between the least and the greatest of their waveform."""
    rows = np.atleast_1d(_finite("samples", samples))
    if rows.size == 0:
        return rows
    # Powers of two lose no digit, and between -1/2 and 1/2 no sum overflows.
    exponent = np.frexp(np.abs(rows).max(axis=-1, keepdims=True))[1] + 1
    with np.errstate(over="ignore"):  # a rounded average may be past the greatest float64
        averages = np.ldexp(average(np.ldexp(rows, -exponent)), exponent)
    return np.asarray(np.clip(averages, rows.min(axis=-1, keepdims=True), rows.max(axis=-1, keepdims=True)))


def _positive(name: str, value: float) -> None:
    if not 0 < value < np.inf:
        raise ValueError(f"{name}: found {value}, expected a finite number above 0")
