"""What a target sends back, a steradian of the light that falls on it; and the grain of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.compiled import njit

Floats = NDArray[np.float64]

GRAZING = 1e-4
"""Cosine below which there is no glint of any facets with a slope: its sixth power would leave the floats."""

LEAVES = 2 / 3
"""Mean of cos²θ over that of cosθ, of leaves that face all directions alike, as what they meet goes with cosθ."""


@njit(nogil=True, inline="always")
def backscatter(diffuse: float, specular: float, facets: float, cosine: float) -> float:
    """Light that comes back, 1/sr: A·cosθ/π + B·exp(-tan²θ/s²)/cos⁶θ.

    Diffuse after Lambert, specular as of X. Fan & Y.-Q. Wang, after O. Steinvall, Appl. Opt. 39, 4381 (2000).

    Parameters
    ----------
    diffuse : float
        A/π, A the albedo.
    specular : float
        B, 1/sr.
    facets : float
        s², the mean square slope of facets.
    cosine : float
        Of the angle θ between the beam and the normal.
    """
    if specular == 0.0 or cosine < GRAZING:
        return diffuse * cosine
    square = cosine * cosine
    return diffuse * cosine + specular * math.exp((1 - 1 / square) / facets) / (square * square * square)


def leaf_backscatter(diffuse: float, specular: float, facets: float) -> float:
    """The same, averaged over leaves that face all directions alike, weighted with the light that they meet.

    ∫ exp(-tan²θ/s²)/cos⁶θ · cosθ sinθ dθ / ∫ cosθ sinθ dθ = s² + s⁴.
    """
    return LEAVES * diffuse + specular * (facets + facets**2)


def sea_facets(wind: float) -> float:
    """Mean square slope of a clean sea, 0.003 + 5.12e-3·W: C. Cox & W. Munk, J. Opt. Soc. Am. 44, 838 (1954).

    Parameters
    ----------
    wind : float
        W, m/s; they measured it 12.5 m above the water.
    """
    return 0.003 + 5.12e-3 * wind


def speckle_order(aperture: float, wavelength: float, distance: ArrayLike, diameter: ArrayLike) -> Floats:
    """Grains of speckle in the aperture, the order M of their gamma law: 1 + area/(λR)² · area of the footprint.

    J. W. Goodman, Statistical Optics, 1985: their correlation area is (λR)² over the lit area.

    Parameters
    ----------
    aperture : float
        Diameter of the telescope, m.
    wavelength, distance : float, array_like
        m.
    diameter : array_like
        Of the footprint, m.
    """
    discs = (math.pi / 4) ** 2 * (aperture * np.asarray(diameter, np.float64)) ** 2
    return np.asarray(1 + discs / (wavelength * np.asarray(distance, np.float64)) ** 2)


def speckle(order: ArrayLike, size: tuple[int, ...], rng: np.random.Generator) -> Floats:
    """Gamma distributed factors of mean 1 and variance 1/M: Goodman 1985."""
    order = np.asarray(order, np.float64)
    return np.asarray(rng.standard_gamma(order, size) / order)
