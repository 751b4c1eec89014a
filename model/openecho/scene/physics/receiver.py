"""From light at the aperture to counts: telescope, detector, noise, digitiser."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.constants import Boltzmann, c, elementary_charge, h

from openecho.scene.physics.pulse import response_deviation

Floats = NDArray[np.float64]

BIN = c / 2
"""Range of a second, m: the light goes there and back."""


def collected(aperture: float, efficiency: float) -> float:
    """Light on the detector for one watt a steradian, 1 m away: area of the telescope times its efficiency, m²."""
    return math.pi / 4 * aperture**2 * efficiency


def range_law(distance: ArrayLike, extinction: float) -> Floats:
    """exp(-2σR)/R², 1/m²: what is left of the light sent back by a target that the whole beam meets.

    The lidar equation of an extended target: A. V. Jelalian, Laser Radar Systems, 1992.

    Parameters
    ----------
    distance : array_like
        R, m.
    extinction : float
        σ, one way, 1/m.
    """
    distance = np.asarray(distance, np.float64)
    return np.asarray(np.exp(-2 * extinction * distance) / distance**2)


def responsivity(receiver: Any, wavelength: float) -> float:
    """ℜ, current of a power before the gain, A/W: as given, or η·e·λ/(h·c)."""
    if receiver.responsivity is not None:
        return float(receiver.responsivity)
    return float(receiver.quantum_efficiency * elementary_charge * wavelength / (h * c))


def excess_noise(gain: float, ionisation_ratio: float) -> float:
    """F = k·M + (1 - k)·(2 - 1/M): R. J. McIntyre, IEEE Trans. Electron Devices 13, 164 (1966)."""
    return ionisation_ratio * gain + (1 - ionisation_ratio) * (2 - 1 / gain)


def noise_bandwidth(bandwidth: float) -> float:
    """∫|H|² df of the Gaussian response with a -3 dB bandwidth B: B·√(π/ln 2)/2, Hz."""
    return bandwidth * math.sqrt(math.pi / math.log(2)) / 2


def shot_noise(receiver: Any, wavelength: float) -> float:
    """Variance of the noise that a watt of light makes, W: 2eB·F/ℜ, as power on the detector squared over that power.

    2eB·ℜP·M²F of current squared, X. Fan & Y.-Q. Wang, through ℜM.
    """
    factor = excess_noise(receiver.gain, receiver.ionisation_ratio)
    both_ways = 2 * elementary_charge * noise_bandwidth(receiver.bandwidth)
    return float(both_ways * factor / responsivity(receiver, wavelength))


def dark_noise(receiver: Any, wavelength: float) -> tuple[float, float, float]:
    """Variances of the noise without light, as power on the detector, W².

    2eB·I_ds, 2eB·I_db·M²F and 4kTB·N/R_L, X. Fan & Y.-Q. Wang, through ℜM: a third is thermal, and 0 without a load.

    Returns
    -------
    surface, bulk, thermal : float
    """
    per_watt = (responsivity(receiver, wavelength) * receiver.gain) ** 2
    bandwidth = noise_bandwidth(receiver.bandwidth)
    factor = excess_noise(receiver.gain, receiver.ionisation_ratio)
    surface = 2 * elementary_charge * bandwidth * receiver.surface_dark_current
    bulk = 2 * elementary_charge * bandwidth * receiver.bulk_dark_current * receiver.gain**2 * factor
    thermal = 0.0
    if receiver.load_resistance is not None:
        thermal = 4 * Boltzmann * receiver.temperature * bandwidth * receiver.noise_figure / receiver.load_resistance
    return surface / per_watt, bulk / per_watt, thermal / per_watt


def background(irradiance: float, receiver: Any, backscatter: ArrayLike, extinction: ArrayLike) -> Floats:
    """Sunlight on the detector, W: E_λ·Δλ·Ω·A·η·exp(-σR)·ρ/π, of ground that fills the field of view.

    Parameters
    ----------
    irradiance : float
        E_λ on the ground, W/m² for a metre of wavelength.
    receiver : Receiver
        Of a scene; its ``filter_width`` is Δλ.
    backscatter : array_like
        ρ/π, 1/sr.
    extinction : array_like
        σR, one way.
    """
    seen = 2 * math.pi * (1 - math.cos(receiver.field_of_view / 2))
    light = irradiance * receiver.filter_width * seen * collected(receiver.aperture, receiver.optics_efficiency)
    return np.asarray(light * np.asarray(backscatter, np.float64) * np.exp(-np.asarray(extinction, np.float64)))


def correlated(rng: np.random.Generator, shape: tuple[int, ...], interval: float, bandwidth: float) -> Floats:
    """Normal noise of variance 1 behind the receiver's response.

    Its autocorrelation is that of the response, exp(-t²/4σ²); made on a circle, with room at the end so that the first
    samples know nothing of the last.

    Parameters
    ----------
    rng : Generator
    shape : (int, int)
        Waveforms and samples.
    interval : float
        Of the digitiser, s.
    bandwidth : float
        -3 dB, Hz.

    Returns
    -------
    float64 (waveforms, samples)
    """
    width = response_deviation(bandwidth) / interval
    waveforms, samples = shape
    circle = samples + math.ceil(12 * width)
    white = rng.standard_normal((waveforms, circle))
    if width < 0.1:  # neighbours share exp(-25) of it
        return white[:, :samples]
    lag = np.minimum(np.arange(circle), circle - np.arange(circle))
    power = np.maximum(np.fft.rfft(np.exp(-0.25 * (lag / width) ** 2)).real, 0)
    return np.asarray(np.fft.irfft(np.fft.rfft(white) * np.sqrt(power), circle)[:, :samples])


def digitise(counts: ArrayLike, bits: int) -> NDArray[np.uint16]:
    """Round to the nearest count, ties to even, and clip to what the bits can say."""
    return np.clip(np.rint(counts), 0, 2**bits - 1).astype(np.uint16)
