"""Surfaces at random: relief with von Kármán's spectrum, a sea with that of its wind."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.constants import g

from openecho.scene.geometry.height_maps import Heights
from openecho.scene.schema import Relief, Sea

Floats = NDArray[np.float64]
Seed = int | list[int]

APART = 5
"""Correlation lengths after which heights have less than a hundredth in common."""

SIDE = 1024
"""Cells of a side of the sea's tile, which repeats."""

LONGEST = 6
"""Waves of the peak's length in the tile."""

SHORTEST = 12
"""Cells of the shortest wave: between so many, heights and slopes are as smooth as water's."""

CALM = 0.5
"""m/s: below it, a sea is a mirror with waves of less than a millimetre."""


def relief(given: Relief, seed: Seed) -> Heights:
    """Heights of a normal field with the spectrum (1 + k²L²)^-(H + 1), H the Hurst exponent.

    Th. von Kármán, Proc. Natl. Acad. Sci. 34, 530 (1948); in two dimensions J. A. Goff & T. H. Jordan, J. Geophys. Res.
    93, 13589 (1988). Made on a circle wider by `APART` L than what is kept: its opposite edges are as far apart.

    Parameters
    ----------
    given : Relief
        Its deviation is that of the spectrum: a relief not much larger than L has less.
    seed : int or list of int

    Returns
    -------
    Heights
    """
    shape = points(given)
    circle = tuple(2 * math.ceil((side + APART * given.correlation_length / given.cell) / 2) for side in shape)
    k = _wavenumber(circle, given.cell)
    hurst = 1 - given.roughness
    spectrum = (1 + (k * given.correlation_length) ** 2) ** -(hurst + 1)
    spectrum[0, 0] = 0
    field = _field(spectrum / _sum(spectrum, circle) * given.deviation**2, circle, seed)
    east, north = ((count - 1) * given.cell for count in (shape[1], shape[0]))
    x, y, z = given.position
    return Heights(field[: shape[0], : shape[1]] + z, x - east / 2, y - north / 2, given.cell)


def points(given: Relief) -> tuple[int, int]:
    """Points of a relief along y and x."""
    return round(given.size[1] / given.cell) + 1, round(given.size[0] / given.cell) + 1


def sea(given: Sea, seed: Seed) -> tuple[Heights, float]:
    """Waves of a fully developed sea, a square tile that repeats without a seam, and their mean square slope.

    W. J. Pierson & L. Moskowitz, J. Geophys. Res. 69, 5181 (1964): S(k) = α/2 · k^-3 · exp(-0.74·(g/(U²k))²),
    α = 0.0081, U the wind 19.5 m above the water, 1.026 of that at 10 m; spread with cos² to both sides of the wind.
    The waves stand still: a beam has left a footprint after a millisecond. Those shorter than `SHORTEST` are left to
    the facets.

    Parameters
    ----------
    given : Sea
    seed : int or list of int

    Returns
    -------
    heights : Heights
        (SIDE + 1, SIDE + 1): the last row and column are the first again.
    slope : float
    """
    if given.wind < CALM:
        return Heights(np.full((2, 2), given.level), 0.0, 0.0, 1.0), 0.0
    wind = 1.026 * given.wind
    peak = 0.877**2 * g / wind**2
    cell = LONGEST * 2 * math.pi / peak / SIDE
    shape = (SIDE, SIDE)
    north = 2 * math.pi * np.fft.fftfreq(SIDE, cell)[:, None]
    east = 2 * math.pi * np.fft.rfftfreq(SIDE, cell)[None, :]
    k = np.hypot(north, east)
    k[0, 0] = math.inf
    along = (east * math.sin(given.direction) + north * math.cos(given.direction)) / k
    omnidirectional = 0.0081 / 2 * k**-3 * np.exp(-0.74 * (g / (wind**2 * k)) ** 2)
    omnidirectional[k * SHORTEST * cell > 2 * math.pi] = 0
    # Over both halves of the plane, as a still surface does not tell which way a wave runs.
    density = omnidirectional * along**2 / math.pi / k
    variance = density * (2 * math.pi / (SIDE * cell)) ** 2
    slope = _sum(variance * np.where(np.isfinite(k), k, 0) ** 2, shape)
    field = np.pad(_field(variance, shape, seed), ((0, 1), (0, 1)), "wrap")
    return Heights(field + given.level, 0.0, 0.0, cell), slope


def _wavenumber(shape: tuple[int, ...], cell: float) -> Floats:
    north, east = np.fft.fftfreq(shape[0], cell), np.fft.rfftfreq(shape[1], cell)
    return np.asarray(2 * math.pi * np.hypot(north[:, None], east[None, :]))


def _sum(spectrum: Floats, shape: tuple[int, ...]) -> float:
    """Sum over the whole plane of what is known for half of it."""
    both = np.full(spectrum.shape[1], 2.0)
    both[0] = 1
    if shape[1] % 2 == 0:
        both[-1] = 1
    return float((spectrum * both).sum())


def _field(variance: Floats, shape: tuple[int, ...], seed: Seed) -> Floats:
    """Normal field on a circle whose waves have given variances."""
    white = np.random.default_rng(seed).standard_normal(shape)
    points = math.prod(shape)
    return np.asarray(np.fft.irfft2(np.fft.rfft2(white) * np.sqrt(variance * points), shape))
