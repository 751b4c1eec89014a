"""Wavelet thresholding: an echo is few large coefficients, noise many small ones (Donoho & Johnstone 1994).

The transform is the stationary one (Coifman & Donoho 1995), in which a shift of the waveform shifts the answer; the
decimated one takes a tenth of the time and makes edges where its grid stands. Past its ends a waveform turns back, so
that both ends meet where the transform is circular, and none is bent.
"""

from __future__ import annotations

from itertools import accumulate
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.enhance.autoregression import gain

FloatArray = NDArray[np.float64]

MOST = np.finfo(np.float64).max
MAD = 1.482602218505602
"""σ of a normal distribution in its median absolute deviation, 1 / Φ⁻¹(3/4)."""
LEVELS = 4
"""Levels if none are given."""
TOGETHER = 2**21
"""Samples that are transformed at a time, so that a large batch needs no more memory than a small one."""


def denoise(
    samples: ArrayLike,
    *,
    wavelet: str = "sym8",
    mode: Literal["soft", "hard"] = "hard",
    levels: int | None = None,
    sigma: ArrayLike | None = None,
    correlation: ArrayLike | None = None,
) -> FloatArray:
    """Take away the wavelet coefficients that noise explains.

    The threshold is σⱼ √(2 ln m) (Donoho & Johnstone 1994, universal), with σⱼ the noise of level j (Johnstone &
    Silverman 1997, for coloured noise). If no σ is given, σⱼ is the median absolute deviation of the level's
    coefficients; long echoes fill the coarse levels and raise it. With σ alone the noise is white and σⱼ = σ. With its
    autocorrelation, too, σⱼ² = σ² Σₖ ρₖ aⱼₖ, where aⱼ is the autocorrelation of the level's filter and ρ goes on past
    the last lag as `continued` says.

    Parameters
    ----------
    samples : array_like (n, m)
        A waveform a row, in any unit; m from 1.
    wavelet : str, optional
        An orthogonal wavelet of PyWavelets.
    mode : "soft" or "hard", optional
        Whether coefficients above the threshold are lowered by it, or kept.
    levels : int, optional
        0, which returns the samples, to log₂ m; the lesser of that and `LEVELS` if left out.
    sigma : array_like (n,), optional
        Standard deviation of each waveform's noise, from 0, in the unit of `samples`.
    correlation : array_like (lags + 1,), optional
        Autocorrelation of the noise, such as that of `noise`, 1 at lag 0; only with `sigma`.

    Returns
    -------
    float64 (n, m)
        In the unit of `samples`.

    Raises
    ------
    ValueError
        If an argument is not as above, or a sample is not finite.
    ModuleNotFoundError
        If PyWavelets is not installed.
    """
    pywt = _require()
    rows = np.array(samples, np.float64)
    _check(rows.ndim == 2 and rows.shape[1] > 0, "samples", f"shape {rows.shape}", "(n, m) with m from 1")
    _check(bool(np.isfinite(rows).all()), "samples", "a value that is not finite", "finite ones")
    _check(wavelet in pywt.wavelist(kind="discrete"), "wavelet", repr(wavelet), "one of pywt.wavelist()")
    filters = pywt.Wavelet(wavelet)
    _check(filters.orthogonal, "wavelet", repr(wavelet), "an orthogonal one")
    _check(mode in ("soft", "hard"), "mode", repr(mode), "'soft' or 'hard'")
    most = rows.shape[1].bit_length() - 1
    depth = min(most, LEVELS) if levels is None else levels
    _check(0 <= depth <= most, "levels", str(levels), f"0 to {most}")
    _check(sigma is not None or correlation is None, "correlation", "one without sigma", "both")
    deviation = None if sigma is None else _deviation(sigma, len(rows))
    gains = np.ones(depth) if correlation is None else _gains(filters, depth, correlation)
    if rows.size == 0 or depth == 0:
        return rows

    # Powers of two lose no digit, and between -1 and 1 no sum overflows.
    exponent = np.frexp(np.abs(rows).max(axis=1))[1]
    rows = np.ldexp(rows, -exponent[:, None])
    if deviation is not None:
        mantissa, power = np.frexp(deviation)
        deviation = np.ldexp(mantissa, np.minimum(power - exponent, 60))  # past 2⁶⁰ nothing is left anyhow
    step = max(1, TOGETHER // rows.shape[1])
    for begin in range(0, len(rows), step):
        some = slice(begin, begin + step)
        known = None if deviation is None else deviation[some, None] * gains
        rows[some] = _thresholded(pywt, rows[some], filters, mode, depth, known)
    with np.errstate(over="ignore"):  # a smooth curve through ±1.7e308 may leave float64
        return np.asarray(np.clip(np.ldexp(rows, exponent[:, None]), -MOST, MOST))


def _require() -> Any:
    try:
        import pywt
    except ImportError as error:
        raise ModuleNotFoundError(
            "PyWavelets is not installed, expected it: pip install 'openecho[fit]'", name="pywt"
        ) from error
    return pywt


def _check(good: bool, what: str, found: str, expected: str) -> None:
    if not good:
        raise ValueError(f"{what}: found {found}, expected {expected}")


def _deviation(sigma: ArrayLike, n: int) -> FloatArray:
    deviation = np.asarray(sigma, np.float64)
    _check(deviation.shape == (n,), "sigma", f"shape {deviation.shape}", f"({n},), one of each waveform")
    valid = np.isfinite(deviation) & (deviation >= 0)
    _check(bool(valid.all()), "sigma", f"{deviation[~valid][:1]}", "finite ones from 0")
    return deviation


def _gains(filters: Any, depth: int, correlation: ArrayLike) -> FloatArray:
    """σⱼ/σ (depth,) of noise at each level, finest first."""
    low, high = np.array(filters.dec_lo), np.array(filters.dec_hi)
    smooth = accumulate((_spread(low, 2**j) for j in range(depth - 1)), np.convolve, initial=np.ones(1))
    details = [np.convolve(before, _spread(high, 2**j)) for j, before in enumerate(smooth)]
    return np.array([gain(detail, correlation) for detail in details])


def _spread(taps: FloatArray, step: int) -> FloatArray:
    """Taps with zeros between them, each `step` after the one before."""
    spread = np.zeros((taps.size - 1) * step + 1)
    spread[::step] = taps
    return spread


def _thresholded(
    pywt: Any, rows: FloatArray, filters: Any, mode: str, depth: int, known: FloatArray | None
) -> FloatArray:
    """Waveforms (n, m) without what is below the thresholds of `known` σⱼ (n, depth), finest first."""
    m = rows.shape[1]
    unit = 2 ** (depth - 1)
    half = -(-m // unit) * unit
    there = np.pad(rows, ((0, 0), (0, half - m)), "symmetric")
    around = np.concatenate([there, there[:, ::-1]], axis=1)
    coarse, *details = pywt.swt(around, filters, depth, axis=1, trim_approx=True)
    kept = [coarse]
    for j, detail in zip(range(depth - 1, -1, -1), details, strict=True):
        noise = MAD * np.median(np.abs(detail), axis=1) if known is None else known[:, j]
        kept.append(_shrunk(detail, noise[:, None] * np.sqrt(2 * np.log(m)), mode))
    return np.asarray(pywt.iswt(kept, filters, axis=1)[:, :m])


def _shrunk(detail: FloatArray, threshold: FloatArray, mode: str) -> FloatArray:
    """Coefficients above the threshold, in mode soft lowered by it (Donoho & Johnstone 1994)."""
    if mode == "hard":
        return np.where(np.abs(detail) > threshold, detail, 0.0)
    return np.asarray(np.sign(detail) * np.maximum(np.abs(detail) - threshold, 0))
