"""The pulse as it is recorded: power over time behind the receiver's response, in steps finer than a sample."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.signal import fftconvolve

Floats = NDArray[np.float64]

STEPS = 32
"""Of a bin, between which energy is shared out: at the peak of an echo of 5 bins FWHM that takes 3e-5 of it away."""

FINER = 8
"""Parts of a step in which pulse and response are convolved: the peak is then known to 1/512 bin."""

NEGLIGIBLE = 1e-7
"""Share of its height below which a pulse is cut: far less than a count of 16 bits."""


def laser(u: ArrayLike) -> Floats:
    """Power u² exp(-u) of a Q-switched laser at the time u τ: Carlsson, Steinvall & Letalick 2001 (FOI-R-0163)."""
    u = np.maximum(np.asarray(u, np.float64), 0)
    return np.asarray(u**2 * np.exp(-u))


def _half(u: float) -> float:
    return u**2 * math.exp(2 - u) / 4 - 0.5


FWHM_TAU = float(brentq(_half, 2, 9) - brentq(_half, 0, 2))
"""FWHM of the laser's pulse in τ, 3.3947; X. Fan & Y.-Q. Wang print 3.5."""

LASTS = 25.0
"""τ after which a laser's pulse is below `NEGLIGIBLE` of its height."""

WIDE = 6.0
"""Deviations at which a normal curve is."""


@dataclass(frozen=True)
class Template:
    """A recorded pulse of unit energy.

    Attributes
    ----------
    power : float64 (k,)
        1/s, at steps of 1/`STEPS` bin.
    peak : int
        Index of its maximum, which is where an echo is said to be.
    """

    power: Floats
    peak: int

    @property
    def deviation(self) -> float:
        """Standard deviation of its energy over time, bins."""
        at = np.arange(len(self.power)) / STEPS
        mean = np.average(at, weights=self.power)
        return float(np.sqrt(np.average((at - mean) ** 2, weights=self.power)))

    @property
    def fwhm(self) -> float:
        """Full width at half maximum, bins."""
        at, half = np.arange(len(self.power)), self.power[self.peak] / 2
        rise = np.interp(half, self.power[: self.peak + 1], at[: self.peak + 1])
        fall = np.interp(-half, -self.power[self.peak :], at[self.peak :])
        return float(fall - rise) / STEPS


def response_deviation(bandwidth: float) -> float:
    """σ of the impulse response of a receiver, which is taken for Gaussian, s.

    |H(f)|² = 2^-(f/B)² is the Fourier transform of a normal curve of σ = √(ln 2)/(2πB). The noise of recorded
    instruments bears it out: GEDI's autocorrelation is that of this response at 71 MHz.

    Parameters
    ----------
    bandwidth : float
        -3 dB, Hz.
    """
    return math.sqrt(math.log(2)) / (2 * math.pi * bandwidth)


def template(pulse: Any, interval: float, bandwidth: float | None) -> Template:
    """A pulse as the digitiser sees it.

    Parameters
    ----------
    pulse : Shaped or Measured
        Of a scene's laser.
    interval : float
        Of the digitiser, s.
    bandwidth : float or None
        Of the receiver, Hz; None: its response is left out.

    Returns
    -------
    Template
    """
    step = interval / STEPS / FINER
    power = transmitted(pulse, step)
    if bandwidth is not None:
        width = response_deviation(bandwidth) / step
        at = np.arange(-math.ceil(WIDE * width), math.ceil(WIDE * width) + 1)
        power = np.maximum(fftconvolve(power, np.exp(-0.5 * (at / width) ** 2)), 0)
    top = int(power.argmax())
    lit = np.flatnonzero(power >= NEGLIGIBLE * power[top])
    before, after = (top - lit[0]) // FINER + 1, (lit[-1] - top) // FINER + 1
    coarse = np.pad(power, (before * FINER, after * FINER))[top::FINER][: before + after + 1]
    return Template(coarse / (coarse.sum() * interval / STEPS), int(before))


def transmitted(pulse: Any, step: float) -> Floats:
    """Power of a pulse before any receiver, at steps of `step` seconds, in any unit."""
    if pulse.shape == "measured":
        samples = measured(pulse)
        at = np.arange(0, (len(samples) - 1) * pulse.interval, step)
        # Monotone between samples: a cubic spline overshoots beside a steep front.
        return np.asarray(PchipInterpolator(np.arange(len(samples)) * pulse.interval, samples)(at))
    if pulse.shape == "laser":
        tau = pulse.fwhm / FWHM_TAU
        return laser(np.arange(0, LASTS * tau, step) / tau)
    sigma = pulse.fwhm / math.sqrt(8 * math.log(2))
    reach = math.ceil(WIDE * sigma / step)
    return np.asarray(np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / sigma) ** 2))


def measured(pulse: Any) -> Floats:
    """Samples of a recorded pulse, none below zero, with a zero at both ends.

    Raises
    ------
    ValueError
        If its file holds none: what was found, and what is expected.
    """
    try:
        samples = np.load(pulse.file, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise ValueError("found no array, expected a pulse (.npy)") from error
    if samples.ndim != 1 or samples.dtype.kind not in "iuf" or not 2 <= len(samples) <= 2**16:
        raise ValueError(f"found shape {samples.shape} of {samples.dtype}, expected 2 to 65536 numbers")
    power = samples.astype(np.float64)
    if not np.isfinite(power).all() or power.max() <= 0:
        raise ValueError("found a value that is not a number, or none above 0, expected a pulse")
    return np.pad(np.maximum(power, 0), 1)
