"""Autoregression of noise: its autocorrelation past the last lag that is known, and the filter that makes it white.

Of all noise that has the autocorrelation at p lags, the autoregression of order p presumes least about the others: it
has the greatest entropy (J. P. Burg, Maximum entropy spectral analysis, 1975). A correlation that is cut off instead,
and zero from there, may belong to no noise at all.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, signal

FloatArray = NDArray[np.float64]

RIDGE = 1e-3
"""Least eigenvalue of an autocorrelation's matrix: what rounding to counts, which is white, adds to noise of 9 counts.
With less, as rounded figures may have, whitening would magnify their last digit.
"""


def continued(correlation: ArrayLike, size: int) -> FloatArray:
    """Autocorrelation of the autoregression that has the given one at the first lags.

    Past the last lag p it follows ρₖ = -Σ aⱼ ρₖ₋ⱼ, j = 1 … p, with a the predictor of order p (Burg 1975).

    Parameters
    ----------
    correlation : array_like (lags + 1,)
        Autocorrelation of noise, 1 at lag 0, such as that of `noise`. Rounded figures that no noise has get as much
        white noise added as makes the least eigenvalue of their Toeplitz matrix `RIDGE`.
    size : int
        Lags that are asked for, with lag 0; from 0.

    Returns
    -------
    float64 (size,)

    Raises
    ------
    ValueError
        If an argument is not as above.
    """
    if size < 0:
        raise ValueError(f"size: found {size}, expected 0 or more")
    rho = _definite(correlation)
    order = rho.size - 1
    if order == 0 or size <= rho.size:
        return np.append(rho, np.zeros(max(0, size - rho.size)))[:size]
    predictor = _predictors(rho)[0][order]
    state = signal.lfiltic([1.0], predictor, rho[:0:-1])
    return np.append(rho, signal.lfilter([1.0], predictor, np.zeros(size - rho.size), zi=state)[0])


def whitening(correlation: ArrayLike) -> FloatArray:
    """Filter W that makes noise white, with z[t] = Σ W[min(t, p), j] r[t - j], j = 0 … min(t, p).

    Each sample is divided from what those before it predict, by as many as there are and p at most, and by the
    deviation of what is left. That is the inverse of the Cholesky factor of the noise's covariance, which has no more
    than p + 1 different rows.

    Parameters
    ----------
    correlation : array_like (p + 1,)
        Autocorrelation of the noise r, which has variance 1; the rest as in `continued`.

    Returns
    -------
    float64 (p + 1, p + 1)
        Row i is the predictor of order i, 0 past the diagonal; the first row is 1, 0 …

    Raises
    ------
    ValueError
        If the correlation is not as above.
    """
    filters, power = _predictors(_definite(correlation))
    return np.asarray(filters / np.sqrt(power)[:, None])


def gain(taps: ArrayLike, correlation: ArrayLike) -> float:
    """Deviation of what a filter leaves of noise of deviation 1: √(Σₖ ρₖ aₖ), with a the autocorrelation of the filter.

    Parameters
    ----------
    taps : array_like (n,)
        Of the filter.
    correlation : array_like (lags + 1,)
        Of the noise; the rest as in `continued`.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the correlation is not as above.
    """
    across = signal.correlate(taps, taps, "full", "direct")[np.size(taps) - 1 :]
    variance = 2 * across @ continued(correlation, np.size(taps)) - across[0]
    return float(np.sqrt(max(0.0, variance)))


def _definite(correlation: ArrayLike) -> FloatArray:
    """The autocorrelation with as much white noise added as makes it positive definite."""
    rho = np.array(correlation, np.float64)
    if rho.ndim != 1 or rho.size == 0:
        raise ValueError(f"correlation: found shape {rho.shape}, expected (lags + 1,)")
    if rho[0] != 1 or not (np.abs(rho) <= 1).all():
        raise ValueError("correlation: found one that is not 1 at lag 0 and -1 to 1 elsewhere, expected such")
    least = linalg.eigvalsh(linalg.toeplitz(rho))[0]
    rho[1:] /= 1 + max(0.0, RIDGE - least)
    return rho


def _predictors(rho: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Filters that leave the prediction errors of order 0 … p, (p + 1, p + 1), and their variances (p + 1,).

    Levinson-Durbin recursion (J. Durbin, The fitting of time-series models, 1960).
    """
    filters, power = np.zeros((rho.size, rho.size)), np.ones(rho.size)
    filters[0, 0] = 1
    for i in range(1, rho.size):
        before = filters[i - 1, : i + 1]
        reflection = -(before[:i] @ rho[i:0:-1]) / power[i - 1]
        filters[i, : i + 1] = before + reflection * before[::-1]
        power[i] = power[i - 1] * (1 - reflection) * (1 + reflection)
    return filters, power
