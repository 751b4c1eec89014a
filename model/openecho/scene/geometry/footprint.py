"""A beam's footprint in rays: a sequence that fills it ever more finely, and a few that tell whether it is smooth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

Floats = NDArray[np.float64]

NODES = 6
"""Of the Gauss–Hermite rule on each axis: exact for the mean and the variance of a surface of fifth degree."""

BITS = 30
THIRD = (2**BITS - 1) // 3
"""Digits of the rays, and those of 1/3."""

RING = 2.0
"""Radius of the ring of guards in those of the footprint: e^-8 of the energy is further out."""

GUARDS = 8
"""On the ring: an edge that none of them sees leaves 1e-4 of the energy on its far side."""


def seen(cut: float) -> float:
    """Share of a Gaussian footprint within `cut` of its radii (to 1/e² of the irradiance): 1 - exp(-2 cut²)."""
    return -math.expm1(-2 * cut**2)


def rays(count: int, cut: float) -> Floats:
    """Points of equal energy in a Gaussian footprint.

    Sobol's sequence, mapped by the inverse of 1 - exp(-2r²): every prefix of a power of two covers all of it. A digital
    shift by 1/3 puts the points of each prefix at a third or two of their cells, where they would be on their edges.

    Parameters
    ----------
    count : int
        A power of two.
    cut : float
        Radius of the field of view in those of the footprint, beyond which nothing is seen.

    Returns
    -------
    float64 (count, 2)
        In radii of the footprint.
    """
    cells = (qmc.Sobol(2, scramble=False, bits=BITS).random(count) * 2**BITS).astype(np.int64)
    share, turn = (((cells ^ THIRD) + 0.5) / 2**BITS).T
    radius = np.sqrt(-0.5 * np.log1p(-share * seen(cut)))
    return np.stack([radius * np.cos(2 * np.pi * turn), radius * np.sin(2 * np.pi * turn)], axis=1)


def probes(cut: float) -> tuple[Floats, Floats]:
    """Points whose weighted mean and variance are those of the footprint, and guards around them without a weight.

    Parameters
    ----------
    cut : float
        As of `rays`.

    Returns
    -------
    points : float64 (k, 2)
        In radii of the footprint; the first in the middle, a guard.
    weights : float64 (k,)
        Their sum is 1.
    """
    node, weight = np.polynomial.hermite_e.hermegauss(NODES)
    # Variance on an axis: 1/4 of the radius squared, and less if the field of view cuts the rim off.
    inside = 1 - 2 * cut**2 * math.exp(-2 * cut**2) / seen(cut)
    x, y = (axis.ravel() * math.sqrt(inside) / 2 for axis in np.meshgrid(node, node))
    angle = 2 * np.pi * np.arange(GUARDS) / GUARDS
    radius = min(RING, cut)
    guards = np.stack([np.r_[0, radius * np.cos(angle)], np.r_[0, radius * np.sin(angle)]], axis=1)
    weights = np.outer(weight, weight).ravel() / weight.sum() ** 2
    return np.concatenate([guards, np.stack([x, y], axis=1)]), np.r_[np.zeros(len(guards)), weights]
