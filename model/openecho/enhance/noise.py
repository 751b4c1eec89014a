"""Noise of waveforms, wherever in a record it is: baseline, deviation and autocorrelation.

Echoes add to the noise and never take from it, so the search begins at the lowest samples, which are noise even if
echoes fill most of the record or are clipped flat. From there samples are clipped and judged anew until nothing
changes: an echo reaches from where the smoothed record leaves the baseline to where it comes back, and some guard bins
further, for the tails of echoes are what spoils a mean. A threshold high enough that noise rarely crosses it (K) keeps
the clipping from biasing what it leaves, in coloured noise too, whose excursions last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, ndimage

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

K = 3.5
"""Threshold, σ: white noise is above it once in 4300 samples, about every third record."""
KEPT_VARIANCE = 0.9938884
"""Variance of a standard normal that is cut at ±K: 1 - 2 K φ(K) / (2 Φ(K) - 1) (Johnson, Kotz & Balakrishnan 1994)."""
SMOOTH = 5
"""Samples that are averaged to find weak echoes and the ends of strong ones: about a pulse."""
GUARD = 4
"""Bins on either side of an echo that are not noise either: what its tail needs from below the noise."""
START = 5
"""The first guess is this part of a record's samples, 1 / START, counted from the lowest: the noise's median where it
is 40 % of the record, and 0.84 σ too low where it is all."""
ROUNDS = 40
"""Most times that samples are judged. Nearly all records settle in 10; the rest go to and fro over a sample."""


@dataclass(frozen=True)
class Noise:
    """Noise of a batch of waveforms.

    Attributes
    ----------
    baseline : float64 (n,)
        Mean of the noise, counts.
    sigma : float64 (n,)
        Standard deviation of the noise with that of rounding, counts; 0 for a constant record.
    count : int64 (n,)
        Samples that were judged to be noise, 1 or more.
    correlation : float64 (lags + 1,)
        Autocorrelation of all noise together, 1 at lag 0; its Toeplitz matrix is positive semi-definite.
    quiet : bool (n, m)
        Which samples were judged to be noise.
    """

    baseline: FloatArray
    sigma: FloatArray
    count: IntArray
    correlation: FloatArray
    quiet: BoolArray


def noise(samples: ArrayLike, length: ArrayLike | None = None, lags: int = 8) -> Noise:
    """Baseline, deviation and autocorrelation of the noise between, before and after the echoes.

    Mean and variance are those of the samples within ±K σ that are no part of an echo; the variance is corrected for
    the clipping (`KEPT_VARIANCE`) and for the mean, which follows correlated noise: E[s²] = σ² (1 - τ/N) with
    τ = 1 + 2 Σ ρₖ (Bayley & Hammersley 1946), of the record's own ρ. It is at least step²/12, the variance of rounding
    (Bennett 1948); the step is the least difference of two values in the record.

    The autocorrelation at lag k is the mean product of all pairs of noise samples k bins apart, of all records, each in
    its own σ. Gaps don't bias that, but only the mean over all samples instead of all pairs is sure to be positive
    semi-definite. What the mean has taken, σ² τ/N of every product, is given back. Where the least eigenvalue λ of its
    Toeplitz matrix is below 0, all lags are divided by 1 - λ, which is white noise added until it is 0.

    A run of noise that is taken for an echo is never below the baseline: of 256 to 750 samples without echoes σ comes
    out 0.3 to 0.7 % low, the baseline 0.01 σ and the autocorrelation 0.01. Echoes of 1 to 4 σ hide in the noise: one of
    them in 256 samples raises σ of noise as coloured as GEDI's by 2 %, and the baseline by 0.04 σ. Of 64 samples
    σ comes out 1 % low in white noise and 10 % in GEDI's, where one record in ten keeps only its lowest samples.

    Parameters
    ----------
    samples : array_like (n, m)
        A waveform a row, counts; m from 1.
    length : integer array_like (n,), optional
        Samples that were recorded in each row, from 1; m if left out.
    lags : int, optional
        Greatest lag of the autocorrelation, bins, from 0; 0 at lags that no two noise samples have.

    Returns
    -------
    Noise
        All but `correlation` depends on a record alone.

    Raises
    ------
    ValueError
        If a shape or number is not as above, or a recorded sample is not finite.
    """
    recorded = _recorded(np.shape(samples), length)
    _check(lags >= 0, "lags", str(lags), "0 or more")
    rows = np.where(recorded, np.asarray(samples, np.float64), 0.0)
    _check(bool(np.isfinite(rows).all()), "samples", "a value that is not finite", "finite ones")

    # Powers of two lose no digit, and between -1 and 1 no square overflows.
    exponent = np.frexp(np.abs(rows).max(axis=1))[1]
    rows = np.ldexp(rows, -exponent[:, None])
    ordered = np.sort(np.where(recorded, rows, rows.max(axis=1, initial=-1, where=recorded, keepdims=True)), axis=1)
    least = _step(ordered) / np.sqrt(12)
    quiet = _settled(rows, recorded, *_start(ordered, np.count_nonzero(recorded, axis=1), least), least)
    baseline, spread = _moments(rows, quiet, least)

    varies = quiet & (least[:, None] > 0)
    residual = np.divide(rows - baseline[:, None], spread[:, None], out=np.zeros(rows.shape), where=varies)
    product, pairs = _lagged(residual, varies, lags)
    count = np.count_nonzero(quiet, axis=1)
    correction = _correction(product, pairs, count)
    product += (correction**2 - 1)[:, None] * pairs
    with np.errstate(over="ignore"):  # the deviation of ±1.7e308 has no float64
        sigma = np.minimum(np.ldexp(spread * correction, exponent), np.finfo(np.float64).max)
    return Noise(
        baseline=np.ldexp(baseline, exponent),
        sigma=np.where(least > 0, sigma, 0.0),
        count=count,
        correlation=_valid(_ratio(product.sum(axis=0), pairs.sum(axis=0))),
        quiet=quiet,
    )


def _check(good: bool, what: str, found: str, expected: str) -> None:
    if not good:
        raise ValueError(f"{what}: found {found}, expected {expected}")


def _recorded(shape: tuple[int, ...], length: ArrayLike | None) -> BoolArray:
    """Which samples (n, m) were recorded."""
    _check(len(shape) == 2 and shape[1] > 0, "samples", f"shape {shape}", "(n, m) with m from 1")
    counts = np.full(shape[0], shape[1]) if length is None else np.asarray(length)
    _check(counts.shape == shape[:1], "length", f"shape {counts.shape}", f"({shape[0]},), one of each waveform")
    _check(counts.size == 0 or counts.dtype.kind in "iu", "length", f"{counts.dtype}", "whole numbers")
    wrong = counts[(counts < 1) | (counts > shape[1])]
    _check(wrong.size == 0, "length", f"{wrong[:1]}", f"1 to {shape[1]}")
    return np.asarray(np.arange(shape[1]) < counts[:, None])


def _step(ordered: FloatArray) -> FloatArray:
    """Least difference (n,) of two values of each row, 0 if all are equal; rows rise."""
    rise = np.diff(ordered, axis=1)
    least = np.min(rise, axis=1, initial=np.inf, where=rise > 0)
    return np.where(np.isinf(least), 0.0, least)


def _start(ordered: FloatArray, size: IntArray, least: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First guess of baseline and σ, each (n,), from rows that rise.

    From the quantile of `START` to a quarter of it are 0.8 σ where all is noise, and 1.2 σ where 40 % is.
    """
    row = np.arange(len(ordered))
    baseline = ordered[row, size // START]
    return baseline, np.maximum(baseline - ordered[row, size // (4 * START)], least)


def _settled(
    rows: FloatArray, recorded: BoolArray, baseline: FloatArray, spread: FloatArray, least: FloatArray
) -> BoolArray:
    """Which samples (n, m) are noise, judged again and again until nothing changes."""
    quiet = recorded & (np.abs(rows - baseline[:, None]) <= K * spread[:, None])
    changing = np.arange(len(rows))
    for _ in range(ROUNDS):
        some, before = rows[changing], quiet[changing]
        baseline, spread = _moments(some, before, least[changing])
        after = _judged(some, recorded[changing], before, baseline, spread)
        quiet[changing] = after
        changing = changing[(after != before).any(axis=1)]
        if changing.size == 0:
            break
    return quiet


def _moments(rows: FloatArray, quiet: BoolArray, least: FloatArray | float) -> tuple[FloatArray, FloatArray]:
    """Mean and deviation (n,) of the noise samples, corrected for the clipping."""
    count = np.count_nonzero(quiet, axis=1)
    mean = np.sum(rows, axis=1, where=quiet) / count
    variance = np.sum((rows - mean[:, None]) ** 2, axis=1, where=quiet) / count / KEPT_VARIANCE
    return mean, np.maximum(np.sqrt(variance), least)


def _judged(
    rows: FloatArray, recorded: BoolArray, quiet: BoolArray, baseline: FloatArray, spread: FloatArray
) -> BoolArray:
    """Which samples are within ±K σ and no part of an echo."""
    residual = np.where(recorded, rows - baseline[:, None], 0.0)
    smooth = ndimage.uniform_filter1d(residual, SMOOTH, axis=1, mode="nearest")
    level = K * spread[:, None]
    smooth_level = K * _moments(smooth, quiet, 0.0)[1][:, None]
    echo = _touched(recorded & (smooth > 0), (residual > level) | (smooth > smooth_level))
    inside = recorded & (np.abs(residual) <= level)
    guarded = inside & ~ndimage.maximum_filter1d(echo, 2 * GUARD + 1, axis=1, mode="constant")
    # Where all seems to be echo, the lowest samples stay.
    return np.where(np.count_nonzero(guarded, axis=1)[:, None] > 1, guarded, inside | quiet)


def _touched(above: BoolArray, high: BoolArray) -> BoolArray:
    """Runs of `above` along each row that have a `high` sample, and all high ones."""
    begin = above.copy()
    begin[:, 1:] &= ~above[:, :-1]
    run = np.cumsum(begin).reshape(above.shape)
    touched = np.zeros(above.size + 1, np.bool_)
    touched[run[above & high]] = True
    return high | (above & touched[run])


def _lagged(residual: FloatArray, quiet: BoolArray, lags: int) -> tuple[FloatArray, IntArray]:
    """Sums of products of noise samples 0 … lags bins apart, and the number of pairs, each (n, lags + 1)."""
    m = residual.shape[1]
    product = np.zeros((len(residual), lags + 1))
    pairs = np.zeros((len(residual), lags + 1), np.int64)
    for k in range(min(lags + 1, m)):
        product[:, k] = np.einsum("ij,ij->i", residual[:, : m - k], residual[:, k:])
        pairs[:, k] = np.count_nonzero(quiet[:, : m - k] & quiet[:, k:], axis=1)
    return product, pairs


def _ratio(product: FloatArray, pairs: IntArray) -> FloatArray:
    """Autocorrelation (…, lags + 1) of sums of products; of white noise where there is nothing."""
    mean = np.divide(product, pairs, out=np.zeros(product.shape), where=pairs > 0)
    correlation = np.divide(mean, mean[..., :1], out=np.zeros(mean.shape), where=mean[..., :1] > 0)
    correlation[..., 0] = 1
    return correlation


def _correction(product: FloatArray, pairs: IntArray, count: IntArray) -> FloatArray:
    """Factor (n,) from the deviation about the noise samples' own mean to that about the true one."""
    tau = 2 * _ratio(product, pairs).sum(axis=1) - 1
    # Of a few samples the sum can be anything: no more than half of them may be lost to the mean.
    lost = np.clip(tau, 1, np.maximum(count / 2, 1)) / np.maximum(count, 2)
    return np.asarray(1 / np.sqrt(1 - lost))


def _valid(correlation: FloatArray) -> FloatArray:
    """The autocorrelation with as much white noise added as makes it positive semi-definite."""
    least = linalg.eigvalsh(linalg.toeplitz(correlation))[0]
    correlation[1:] /= max(1.0, 1.0 - least)
    return correlation
