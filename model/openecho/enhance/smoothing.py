"""Smoothing that Vondrák's is compared with: moving average, Gaussian, and homomorphic filtering of speckle.

All keep the length of a waveform and a constant one as it is; past its ends a waveform is taken to go on with its last
value, or to turn back where a spectrum is filtered.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, ndimage

FloatArray = NDArray[np.float64]


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
    return np.asarray(ndimage.uniform_filter1d(_rows(samples), width, mode="nearest"))


def gaussian(samples: ArrayLike, sigma: float) -> FloatArray:
    """Convolution with a Gaussian, cut at 6 σ.

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
    return np.asarray(ndimage.gaussian_filter1d(_rows(samples), sigma, mode="nearest", truncate=6))


def homomorphic(
    samples: ArrayLike, period: float, *, baseline: ArrayLike = 0.0, floor: float = 1.0, order: int = 2
) -> FloatArray:
    """Low-pass filter of the logarithm, in which speckle, a factor, is a summand (Oppenheim, Schafer & Stockham 1968).

    The frequency response is Butterworth's, 1 / (1 + (P/p)^(2 order)) at a period of p bins, without a shift; the
    answer stays between the least and the greatest signal. What does
    not stand `floor` above the baseline has no logarithm to speak of and counts as `floor`: additive noise is to be
    taken away before, by accumulation or wavelets.

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
    rows = _rows(samples)
    if rows.size == 0:
        return rows
    offset = np.asarray(baseline, np.float64)[..., None]
    logarithm = np.log(np.maximum(rows - offset, floor))
    # The cosine transform is that of a waveform that turns back at its ends.
    cycles = np.arange(rows.shape[-1]) / (2 * rows.shape[-1])
    response = 1 / (1 + (period * cycles) ** (2 * order))
    filtered = fft.idct(fft.dct(logarithm, norm="ortho") * response, norm="ortho")
    # Behind a steep step the filter overshoots, which in a logarithm could be anything.
    inside = np.clip(filtered, logarithm.min(axis=-1, keepdims=True), logarithm.max(axis=-1, keepdims=True))
    return np.asarray(np.exp(inside) + offset)


def _rows(samples: ArrayLike) -> FloatArray:
    rows = np.array(samples, np.float64, ndmin=1)
    if not np.isfinite(rows).all():
        raise ValueError("samples: found a value that is not finite, expected finite ones")
    return rows


def _positive(name: str, value: float) -> None:
    if not 0 < value < np.inf:
        raise ValueError(f"{name}: found {value}, expected a finite number above 0")
