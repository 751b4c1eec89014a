"""A scene's laser, receiver and digitiser in the few numbers that its waveforms need."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.scene.document import SceneError
from openecho.scene.physics import atmosphere, receiver, reflection
from openecho.scene.physics.pulse import STEPS, template
from openecho.scene.schema import Scene

Floats = NDArray[np.float64]

NOISES = ("surface dark current", "bulk dark current", "thermal noise", "shot noise")
EFFECTS = (
    *("extinction", "turbulence spread", "scintillation", "speckle"),
    *("background light", "receiver response", "field of view"),
    *NOISES,
)
"""What may be left out where it can't be seen."""

WIDEST = 4.0
"""Radii of a footprint, e^-32 of whose energy is further out."""


@dataclass(frozen=True)
class Instrument:
    """What makes counts of what a scene sends back.

    Attributes
    ----------
    scene : Scene
    bin : float
        Range of a sample, m.
    light : float
        Counts of 1/(sr m² s), which is what a joule sent out makes in a `openecho.scene.profile.fold`.
    cut : float
        Radius of the field of view in those of the footprint.
    extinction : float
        One way, 1/m.
    pulse : float64 (STEPS, k)
        At steps of a bin, 1/s, for each part of a bin by which it may be late.
    peak : int
        Bins before its maximum.
    fwhm, deviation : float
        Of the pulse, bins.
    dark, shot : float
        Variance of the noise without light, counts², and for a count of light.
    kept : frozenset of str
        Effects that are modelled.
    """

    scene: Scene
    bin: float
    light: float
    cut: float
    extinction: float
    pulse: Floats
    peak: int
    fwhm: float
    deviation: float
    dark: float
    shot: float
    kept: frozenset[str]

    @property
    def step(self) -> float:
        """Range of a step of a profile, m."""
        return self.bin / STEPS

    @property
    def shape(self) -> tuple[float, float, Floats, int, int, int]:
        """What `openecho.scene.profile.fold` needs; a grain of speckle is as long as the pulse is wide."""
        return self.step, self.extinction, self.pulse, self.peak, self.before, max(round(self.fwhm * STEPS), 1)

    @property
    def before(self) -> int:
        """Bins of a profile before the first sample, whose pulses reach into it."""
        return int(self.pulse.shape[1]) - self.peak

    @property
    def steps(self) -> int:
        """Of a profile."""
        return (self.before + self.scene.digitiser.samples + self.peak) * STEPS

    @property
    def energy(self) -> float:
        """On the detector of 1/(sr m²), which is what a joule sent out leaves after the range law, J sr m²."""
        return self.light / self.scene.digitiser.gain

    def radius(self, distance: ArrayLike) -> Floats:
        """Of the footprint, to 1/e² of the irradiance in its middle, rad."""
        distance = np.asarray(distance, np.float64)
        angle = math.tan(self.scene.laser.divergence / 2)
        air = self.scene.atmosphere
        if "turbulence spread" not in self.kept or air is None or not air.cn2:
            return np.full(distance.shape, angle)
        wavelength = self.scene.laser.wavelength
        return angle * atmosphere.broadening(air.cn2, wavelength, distance, angle * distance)

    def scintillation(self, distance: Floats) -> Floats:
        """Variance of the light on the footprint over its mean squared."""
        air = self.scene.atmosphere
        if "scintillation" not in self.kept or air is None or not air.cn2:
            return np.zeros(distance.shape)
        diameter = 2 * self.radius(distance) * distance
        return atmosphere.scintillation(air.cn2, self.scene.laser.wavelength, distance, diameter)

    def speckle_order(self, distance: Floats) -> Floats | None:
        """Order M of the gamma law of speckle; None without speckle."""
        scene = self.scene
        if "speckle" not in self.kept or scene.speckle is False:
            return None
        if scene.speckle is not True:
            return np.full(distance.shape, float(scene.speckle))
        diameter = 2 * self.radius(distance) * distance
        return reflection.speckle_order(scene.receiver.aperture, scene.laser.wavelength, distance, diameter)

    def background(self, backscatter: Floats, distance: Floats) -> Floats:
        """Sunlight, counts, from ground that sends back so much light, 1/sr."""
        air = self.scene.atmosphere
        if "background light" not in self.kept or air is None or not air.background:
            return np.zeros(distance.shape)
        # Diffuse white is the most that sunlight makes of a target, however bright its glint.
        diffuse = np.minimum(backscatter, 1 / math.pi)
        light = receiver.background(air.background, self.scene.receiver, diffuse, self.extinction * distance)
        return light * self.scene.digitiser.gain


def instrument(scene: Scene, kept: Collection[str] = EFFECTS) -> Instrument:
    """Work out a scene's instrument.

    Parameters
    ----------
    scene : Scene
    kept : collection of str
        Effects that are modelled, of `EFFECTS`.

    Returns
    -------
    Instrument

    Raises
    ------
    SceneError
        If its pulse is none.
    """
    air, chain, counts = scene.atmosphere, scene.receiver, scene.digitiser.gain
    interval = 1 / scene.digitiser.rate
    try:
        shape = template(scene.laser.pulse, interval, chain.bandwidth if "receiver response" in kept else None)
    except ValueError as error:
        raise SceneError(f"laser.pulse.file: {error}") from error
    visibility = air.visibility if air is not None and "extinction" in kept else None
    # No wider than a field of view whose edge can't be told from none.
    cut = chain.field_of_view / scene.laser.divergence if "field of view" in kept else math.inf
    dark = zip(NOISES, receiver.dark_noise(chain, scene.laser.wavelength), strict=False)
    shot = receiver.shot_noise(chain, scene.laser.wavelength) if "shot noise" in kept else 0.0
    return Instrument(
        scene=scene,
        bin=receiver.BIN * interval,
        light=counts * scene.laser.energy * receiver.collected(chain.aperture, chain.optics_efficiency),
        cut=min(cut, WIDEST),
        extinction=atmosphere.extinction(visibility, scene.laser.wavelength) if visibility else 0.0,
        pulse=_parts(shape.power, shape.peak),
        peak=-(-shape.peak // STEPS),
        fwhm=shape.fwhm,
        deviation=shape.deviation,
        dark=counts**2 * sum(variance for name, variance in dark if name in kept),
        shot=counts * shot,
        kept=frozenset(kept),
    )


def _parts(power: Floats, peak: int) -> Floats:
    """A pulse at steps of a bin, one row for each part of a bin that it comes late; its peak in column ceil(peak)."""
    ahead = -(-peak // STEPS)
    behind = -(-(len(power) - peak) // STEPS) + 1
    padded = np.zeros((ahead + behind + 1) * STEPS)
    at = ahead * STEPS - peak
    padded[at : at + len(power)] = power
    # Row r, column j: the pulse (j - ahead) bins after its peak, less r steps.
    rows = np.zeros((STEPS, ahead + behind + 1))
    for late in range(STEPS):
        shifted = np.concatenate([np.zeros(late), padded])[: len(padded)]
        rows[late] = shifted[::STEPS]
    return rows
