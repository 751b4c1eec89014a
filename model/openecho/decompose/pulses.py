"""What an echo looks like: shapes that echoes of one instrument have in common, as tables that compiled code reads.

A shape has its maximum, of height 1, at 0 and its inflections 2 apart, so that the same three numbers describe any
echo: height, position of the maximum, and half the distance of its inflections, its width. For a Gaussian that is σ,
for the laser template √2 τ.

A shape may change with its width: the echo of a rough target is the transmitted pulse convolved with the Gaussian of
the target's heights, σ = s. Its width is √(w₀² + s²), with w₀ that of the pulse alone; from pulse to Gaussian there is
a row for each s² / (w₀² + s²) = 0 … 1. (In between it is not exactly half the distance of the inflections, which does
not even always grow with s.)

Between the nodes of a row, cubics with the values and slopes of both ends (Hermite); between rows, cubics through four.
With DENSITY nodes the Gaussian is so within 4e-12 of its height, about what its cut at REACH leaves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import next_fast_len
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from openecho.enhance.noise import noise

FloatArray = NDArray[np.float64]

REACH = 7.25
"""Widths on either side of the maximum that a Gaussian is tabled: past it it is below 4e-12."""
DENSITY = 256
"""Nodes a width, of a shape with one row; the error of Hermite's cubics is max|f''''| / (384 · DENSITY⁴)."""
TAIL = 40.0
"""τ after its beginning that the laser template is tabled: past it it is below 2e-14."""
ROUGH_DENSITY, ROUGH_ROWS = 64, 65
"""Nodes a width, and rows, of a shape that changes with its width: within 3e-5 of its height, and 1.1e-3 where s is
below w₀ / 8, for there the corner at the template's beginning is rounded within two rows."""
FINE = 16
"""Samples a bin at which a measured pulse is convolved."""
LASER_BINS = 8.0
"""τ, bins, at which the laser template is convolved; the result knows no bins."""


class Pulse(NamedTuple):
    """A shape of echoes.

    Attributes
    ----------
    table : float64 (rows, nodes, 2)
        Height and slope at each node, in units of the maximum and of the width.
    first, density : float
        Where the first node is, widths from the maximum; nodes a width.
    narrowest : float
        Least width of an echo, bins; 0 for a shape of one row, which may have any.
    midpoint, fwhm : float64 (rows,)
        Of the inflections, relative to the maximum; full width at half maximum: both in widths.
    """

    table: FloatArray
    first: float
    density: float
    narrowest: float
    midpoint: FloatArray
    fwhm: FloatArray

    def described(self, width: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Midpoint of the inflections relative to the maximum, and FWHM, of echoes so wide (e,), in the same unit."""
        width = np.asarray(width, np.float64)
        row = 1 - (self.narrowest / width) ** 2
        rows = np.linspace(0, 1, len(self.fwhm))
        return np.interp(row, rows, self.midpoint) * width, np.interp(row, rows, self.fwhm) * width


def gaussian() -> Pulse:
    """Shape exp(-z²/2); Hofton, Minster & Blair 2000 (IEEE Trans. Geosci. Remote Sens. 38, 1989), Eq (1)."""
    z = np.arange(-REACH, REACH + 0.5 / DENSITY, 1 / DENSITY)
    height = np.exp(-(z**2) / 2)
    return _one_row(z, height, -z * height, 2 * np.sqrt(2 * np.log(2)))


def laser() -> Pulse:
    """Shape (t/τ)² exp(-t/τ), t ≥ 0, of a Q-switched laser's pulse; Carlsson, Steinvall & Letalick 2001, FOI-R--0163.

    Its maximum is at 2 τ, its inflections at (2 ± √2) τ, so its width is √2 τ and their midpoint is the maximum. Its
    FWHM is 3.3947 τ; Fan & Wang say 3.5.
    """
    t = np.arange(0, TAIL, np.sqrt(2) / DENSITY)
    low, high = (brentq(lambda t: _laser(t) - 0.5, *ends, xtol=1e-14) for ends in ((0, 2), (2, 8)))
    slope = (t / 2 - t**2 / 4) * np.exp(2 - t)
    return _one_row((t - 2) / np.sqrt(2), _laser(t), slope * np.sqrt(2), (high - low) / np.sqrt(2))


def rough(narrowest: float) -> Pulse:
    """Laser template convolved with a Gaussian: echoes of rough or inclined targets.

    Parameters
    ----------
    narrowest : float
        Width of the transmitted pulse, √2 τ, bins, above 0: that of the echo of a smooth target.

    Returns
    -------
    Pulse

    Raises
    ------
    ValueError
        If the width is not a positive number.
    """
    if not 0 < narrowest < np.inf:
        raise ValueError(f"narrowest: found {narrowest}, expected a width in bins above 0")
    t = np.arange(0, TAIL * LASER_BINS, 1 / FINE) / LASER_BINS
    return _many_rows(_laser(t))._replace(narrowest=float(narrowest))


def measured(samples: ArrayLike) -> Pulse:
    """Transmitted pulse as it was recorded, convolved with a Gaussian.

    Between samples it is the cubic spline through them; its baseline is taken off.

    Parameters
    ----------
    samples : array_like (m,)
        The pulse, counts, at the sample interval of the waveforms; the mean of many recorded ones is less noisy.

    Returns
    -------
    Pulse

    Raises
    ------
    ValueError
        If there is no pulse in the samples: fewer than 8, one not finite, no inflection before and after a maximum.
    """
    pulse = np.asarray(samples, np.float64)
    if pulse.ndim != 1 or len(pulse) < 8:
        raise ValueError(f"pulse: found shape {pulse.shape}, expected (m,) with m from 8")
    if not np.isfinite(pulse).all() or (pulse == pulse[0]).all():
        raise ValueError("pulse: found a value that is not finite or the same everywhere, expected a pulse")
    pulse = pulse / np.abs(pulse).max()
    pulse = pulse - noise(pulse[None]).baseline[0]
    x = np.arange(0, len(pulse) - 1 + 0.5 / FINE, 1 / FINE)
    return _many_rows(np.asarray(CubicSpline(np.arange(len(pulse)), pulse)(x)))


PULSES: dict[str, Callable[..., Pulse]] = {"gaussian": gaussian, "laser": laser, "rough": rough, "measured": measured}
"""Shapes by name; `rough` and `measured` want to know the transmitted pulse."""


def _laser(t: FloatArray) -> FloatArray:
    """Height of the laser template at times in τ, from 0."""
    return np.asarray(t**2 / 4 * np.exp(2 - t))


def _one_row(z: FloatArray, height: FloatArray, slope: FloatArray, fwhm: float) -> Pulse:
    density = (len(z) - 1) / (z[-1] - z[0])
    return Pulse(np.stack([height, slope], axis=-1)[None], z[0], density, 0.0, np.zeros(1), np.full(1, fwhm))


def _many_rows(pulse: FloatArray) -> Pulse:
    """Shapes of a pulse, sampled FINE times a bin, convolved with Gaussians of ever greater width."""
    alone = _Outline(pulse)
    narrowest = alone.width
    z = np.arange(
        min(-REACH, -alone.peak / narrowest), max(REACH, (len(pulse) - alone.peak) / narrowest), 1 / ROUGH_DENSITY
    )
    margin = int(np.ceil(REACH * narrowest * np.sqrt(ROUGH_ROWS)))  # of the last row but one
    padded = np.pad(pulse, (margin, next_fast_len(len(pulse) + 2 * margin, real=True) - len(pulse) - margin))
    spectrum, frequency = np.fft.rfft(padded), 2 * np.pi * np.fft.rfftfreq(len(padded))
    limit = np.exp(-(z**2) / 2)
    rows, midpoint, fwhm = [], [], []
    for share in np.linspace(0, 1, ROUGH_ROWS)[:-1]:
        width = narrowest / np.sqrt(1 - share)
        roughness = np.sqrt(share) * width
        one = _Outline(np.fft.irfft(spectrum * np.exp(-((frequency * roughness) ** 2) / 2), len(padded)))
        rows.append(one.row(z, width))
        midpoint.append(one.midpoint / width)
        fwhm.append(one.fwhm / width)
    return Pulse(
        np.array([*rows, np.stack([limit, -z * limit], axis=-1)]),
        z[0],
        float(ROUGH_DENSITY),
        narrowest / FINE,
        np.array([*midpoint, 0.0]),
        np.array([*fwhm, 2 * np.sqrt(2 * np.log(2))]),
    )


class _Outline:
    """Maximum, inflections and half-maximum points of a pulse, in its samples."""

    def __init__(self, pulse: FloatArray) -> None:
        self._spline = CubicSpline(np.arange(len(pulse)), pulse)
        highest = int(pulse.argmax())
        if not 0 < highest < len(pulse) - 1:
            raise ValueError("pulse: found the maximum at an end, expected a whole pulse")
        self.peak = _root(self._spline.derivative(), highest - 1, highest + 1)
        self.height = float(self._spline(self.peak))
        left, right = self._about(self._spline.derivative(2))
        self.width, self.midpoint = (right - left) / 2, (right + left) / 2 - self.peak
        low, high = self._about(lambda x: self._spline(x) - self.height / 2)
        self.fwhm = high - low

    def _about(self, curve: Callable[[ArrayLike], ArrayLike]) -> tuple[float, float]:
        """Where a curve changes its sign nearest before and after the maximum."""
        change = np.flatnonzero(np.diff(np.signbit(curve(self._spline.x))))
        before, after = change[change + 1 <= self.peak], change[change >= self.peak]
        if not (before.size and after.size):
            raise ValueError("pulse: found no inflection or half height on both sides, expected a whole pulse")
        return _root(curve, before[-1], before[-1] + 1), _root(curve, after[0], after[0] + 1)

    def row(self, z: FloatArray, width: float) -> FloatArray:
        """Height and slope (nodes, 2) in units of the maximum and of a width; 0 where nothing was recorded."""
        x = self.peak + z * width
        inside = (x >= 0) & (x <= self._spline.x[-1])
        height, slope = self._spline(x) / self.height, self._spline(x, 1) * width / self.height
        return np.stack([np.where(inside, height, 0.0), np.where(inside, slope, 0.0)], axis=-1)


def _root(curve: Callable[[ArrayLike], ArrayLike], low: int, high: int) -> float:
    if np.signbit(curve(low)) == np.signbit(curve(high)):
        raise ValueError("pulse: found more than one maximum where it is highest, expected a whole pulse")
    return float(brentq(curve, low, high, xtol=1e-13))
