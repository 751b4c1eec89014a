"""The air on the way: extinction, turbulence, and the sunlight that it lets through."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def extinction(visibility: float, wavelength: float) -> float:
    """Extinction of hazy air, σ = 3.91/V · (λ/0.55 µm)^-q, one way, 1/m.

    P. W. Kruse, L. D. McGlauchlin & R. B. McQuistan, Elements of Infrared Technology, 1962.

    Parameters
    ----------
    visibility : float
        V, m: q is 1.6 above 50 km, 1.3 from 6 to 50 km, and 0.585·V^⅓ below, V in km.
    wavelength : float
        λ, m.
    """
    kilometres = visibility / 1e3
    if kilometres > 50:
        exponent = 1.6
    elif kilometres >= 6:
        exponent = 1.3
    else:
        exponent = 0.585 * kilometres ** (1 / 3)
    return float(3.91 / visibility * (wavelength / 0.55e-6) ** -exponent)


def rytov_variance(cn2: float, wavelength: float, distance: ArrayLike) -> Floats:
    """Rytov's variance of a plane wave, 1.23·Cn²·k^(7/6)·R^(11/6).

    L. C. Andrews & R. L. Phillips, Laser Beam Propagation through Random Media, 2005.

    Parameters
    ----------
    cn2 : float
        Structure constant of the refractive index, m^(-2/3).
    wavelength : float
        m.
    distance : array_like
        R, m.
    """
    k = 2 * math.pi / wavelength
    return np.asarray(1.23 * cn2 * k ** (7 / 6) * np.asarray(distance, np.float64) ** (11 / 6))


def broadening(cn2: float, wavelength: float, distance: ArrayLike, radius: ArrayLike) -> Floats:
    """How much turbulence widens a beam in the long run, √(1 + 1.33·σ_R²·Λ^(5/6)) with Λ = λR/(πω²).

    Andrews & Phillips 2005.

    Parameters
    ----------
    cn2, wavelength, distance
        As of `rytov_variance`.
    radius : array_like
        ω, m: to 1/e² of the irradiance on the axis, at the target, without turbulence.
    """
    fresnel = wavelength * np.asarray(distance, np.float64) / (math.pi * np.asarray(radius, np.float64) ** 2)
    return np.sqrt(1 + 1.33 * rytov_variance(cn2, wavelength, distance) * fresnel ** (5 / 6))


def scintillation(cn2: float, wavelength: float, distance: ArrayLike, diameter: ArrayLike) -> Floats:
    """Variance of the irradiance over its mean squared, averaged over a target.

    exp[0.49 σ²/(1 + 1.11 σ^(12/5))^(7/6) + 0.51 σ²/(1 + 0.69 σ^(12/5))^(5/6)] - 1 for a plane wave in weak to strong
    turbulence, times [1 + 1.062 kD²/(4R)]^(-7/6) for the average over a disc: Andrews & Phillips 2005.

    Parameters
    ----------
    cn2, wavelength, distance
        As of `rytov_variance`.
    diameter : array_like
        D, m, of what is averaged over.
    """
    variance = rytov_variance(cn2, wavelength, distance)
    five = variance ** (6 / 5)
    large = 0.49 * variance / (1 + 1.11 * five) ** (7 / 6)
    small = 0.51 * variance / (1 + 0.69 * five) ** (5 / 6)
    k = 2 * math.pi / wavelength
    fresnel = k * np.asarray(diameter, np.float64) ** 2 / (4 * np.asarray(distance, np.float64))
    return np.asarray(np.expm1(large + small) * (1 + 1.062 * fresnel) ** (-7 / 6))


def scintillated(variance: ArrayLike, rng: np.random.Generator) -> Floats:
    """Log-normal factors of mean 1 and a given variance, one for each."""
    spread = np.log1p(np.asarray(variance, np.float64))
    return rng.lognormal(-spread / 2, np.sqrt(spread))
