"""What beams bring home without noise: as many rays as a waveform needs, and no more."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openecho.compiled import share
from openecho.scene.geometry import footprint
from openecho.scene.geometry.flight import Beams
from openecho.scene.geometry.trace import NOWHERE
from openecho.scene.geometry.world import Built
from openecho.scene.instrument import Instrument
from openecho.scene.profile import LEAFY, WALLED, fan, fold, lay, probe, settle, smear
from openecho.scene.schema import LEAD, Tolerance

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FEWEST = 64
"""Rays of a footprint that is not smooth, before anybody asks whether they are enough."""

GOLDEN = math.pi * (3 - math.sqrt(5))
"""rad, by which the pattern of rays is turned from one waveform to the next."""

OBJECTS = 32
"""That a beam meets, to begin with."""

STEPS_AT_ONCE = 2**23
"""Of profiles that are held at a time: 64 megabytes."""

RIM = 0.01
"""Share of the energy outside of the weighted probes, which an edge that only guards see can move."""

KINKS = 0.25
"""Error of the mean range over a footprint, by the deviation of what bends in it: the most on bundled relief."""

GLITTER = 0.01
"""Error of the light that comes back, by its relative deviation over the footprint: the most on the bundled sea."""

JUMP = 3.0
"""Radii of the footprint by which no kink bends the range, only an edge."""

SETTLED = 0.35
"""Of the tolerance, by which the second half of the rays may change a waveform, twice: once may be chance."""


@dataclass(frozen=True)
class Rays:
    """How footprints are sampled.

    Attributes
    ----------
    most : int
        Of a beam, a power of two.
    adaptive : bool
        Whether fewer will do: none where a footprint is smooth, and twice as many until a waveform settles.
    tolerance : Tolerance
        By which it may still change.
    """

    most: int
    adaptive: bool
    tolerance: Tolerance


@dataclass(frozen=True)
class Returned:
    """Waveforms of some beams, without noise.

    Attributes
    ----------
    start : float64 (n,)
        Range of the first sample, m.
    waveform : float64 (n, m)
        Counts above the offset.
    speckled : float64 (n, m)
        The same with speckle.
    back : float64 (n,)
        Light that comes back, 1/sr.
    rays : int64 (n,)
        That were laid down: 0 for a footprint that meets nothing, 1 for a smooth one.
    owners : int64 (n, most, 3)
        Target, object, and 1 for leaves, of what each beam met; target `NOWHERE`: no more.
    sums : float64 (n, most, 4)
        What it sends back, 1/sr; and that times the range from the first step of the beam's profile, that range
        squared, and the angle with the normal.
    """

    start: Floats
    waveform: Floats
    speckled: Floats
    back: Floats
    rays: Ints
    owners: Ints
    sums: Floats


def distance(instrument: Instrument, beams: Beams) -> Floats:
    """Range of the level z = 0, or what stands for it near the horizon, for the width of the footprint, m."""
    return instrument.scene.platform.altitude / np.maximum(-beams.direction[:, 2], 0.01)


def returns(built: Built, instrument: Instrument, beams: Beams, rays: Rays, grain: Floats | None = None) -> Returned:
    """Trace beams.

    Parameters
    ----------
    built : Built
    instrument : Instrument
    beams : Beams
    rays : Rays
    grain : float64 (n, grains), optional
        Factors of speckle, for ranges as long as the pulse is wide, from where a beam's light first comes back.

    Returns
    -------
    Returned
        Waveforms.
    """
    tracer = _Tracer(built, instrument, beams, rays, grain)
    most = OBJECTS
    while (found := tracer.traced(most)) is None:
        most *= 2
    return found


class _Tracer:
    """Beams of a block, and what probes say of their footprints."""

    def __init__(self, built: Built, instrument: Instrument, beams: Beams, rays: Rays, grain: Floats | None) -> None:
        self.built, self.instrument, self.beams, self.rays, self.grain = built, instrument, beams, rays, grain
        self.radius = instrument.radius(distance(instrument, beams))
        self.turn = np.mod(beams.waveform * GOLDEN, 2 * math.pi)
        self.points, self.weights = footprint.probes(instrument.cut)
        n, k = len(beams.time), len(self.points)
        self.ranges, self.cosines, self.first = np.empty((n, k)), np.empty((n, k)), np.empty(n)
        self.light, self.owner = np.empty((n, k)), np.empty((n, k, 2), np.int64)
        every = np.arange(n)
        aim = self._fan(every, self.points)
        met = self._triangles(every, aim)
        found = self.ranges, self.cosines, self.light, self.owner, self.first
        share(probe, n, built.world, beams.origin, aim, met, *found)
        self.start = self._starts()
        # That of a profile, whose first pulses end where the waveform begins.
        self.origin = self.start - instrument.before * instrument.bin

    def traced(self, most: int) -> Returned | None:
        """Waveforms of all; None if a beam met more objects than `most`."""
        n, instrument = len(self.start), self.instrument
        waveform = np.zeros((n, instrument.scene.digitiser.samples))
        speckled = waveform if self.grain is None else np.zeros_like(waveform)
        owners, sums = np.full((n, most, 3), NOWHERE), np.zeros((n, most, 4))
        count = np.zeros(n, np.int64)
        rough = (self.owner[:, :, 0] != NOWHERE).any(axis=1)
        if self.rays.adaptive:
            smooth = self._smear(waveform, speckled, owners, sums)
            count[smooth] = 1
            rough &= ~smooth
        rows = np.flatnonzero(rough)
        size = max(1, STEPS_AT_ONCE // instrument.steps)
        for first in range(0, len(rows), size):
            if not self._trace(rows[first : first + size], waveform, speckled, owners, sums, count):
                return None
        waveform *= instrument.light
        if self.grain is not None:
            speckled *= instrument.light
        return Returned(self.start, waveform, speckled, sums[:, :, 0].sum(axis=1), count, owners, sums)

    def _starts(self) -> Floats:
        """Range of the first sample: a clock that runs through, from `LEAD` samples before the first surface."""
        digitiser, bin = self.instrument.scene.digitiser, self.instrument.bin
        if digitiser.start is not None:
            return np.full(len(self.first), digitiser.start)
        level = distance(self.instrument, self.beams)
        return (np.floor(np.where(np.isfinite(self.first), self.first, level) / bin) - LEAD) * bin

    def _smear(self, waveform: Floats, speckled: Floats, owners: Ints, sums: Floats) -> Bools:
        """Fill the rows of smooth footprints, and say which they are.

        Smooth is where all probes meet one object without leaves, and what bends is so little that neither the third
        moment of range nor what lies beyond the weighted probes moves a count by more than the tolerance.
        """
        instrument, owner = self.instrument, self.owner[:, 0]
        alike = self._alike()
        weights = self.light * self.weights
        back = weights.sum(axis=1)
        weights /= np.maximum(back, np.finfo(float).tiny)[:, None]
        ranges = np.where(alike[:, None], self.ranges, 0.0)
        mean = (ranges * weights).sum(axis=1)
        off = ranges - mean[:, None]
        variance = (off**2 * weights).sum(axis=1)
        bent = self._bent(ranges)
        rough = np.sqrt(bent**2 @ self.weights)
        glitter = np.sqrt((self.light - back[:, None]) ** 2 @ self.weights)
        back *= footprint.seen(instrument.cut)
        law = np.exp(-2 * instrument.extinction * mean) / np.maximum(mean, instrument.bin) ** 2
        most = law * instrument.light * instrument.pulse.max()
        peak = back * most
        # Of a normal curve as wide as the pulse, the greatest first and third derivative over its height.
        width = instrument.deviation * instrument.bin
        shifted = 0.61 * (KINKS * rough + RIM * abs(bent).max(axis=1)) / width
        skewed = 1.38 * rough * variance / width**3
        moved = peak * (shifted + skewed) + most * GLITTER * glitter
        smooth: Bools = alike & (moved <= self.rays.tolerance.allowed(instrument.dark + instrument.shot * peak))
        rows = np.flatnonzero(smooth)
        owners[rows, 0, :2], owners[rows, 0, 2] = owner[rows], 0
        angle = np.arccos(np.minimum(self.cosines[:, 0], 1))
        known = rows, mean, np.sqrt(variance), back, angle, self.origin, instrument.shape
        share(smear, len(rows), *known, self._even(), waveform, sums)
        if self.grain is not None:
            share(smear, len(rows), *known, self.grain, speckled, sums)
        return smooth

    def _alike(self) -> Bools:
        """Whether all probes of a footprint meet one object, without leaves before it."""
        same: Bools = (self.owner == self.owner[:, :1]).all(axis=(1, 2))
        return same & (self.owner[:, 0, 0] >= 0)

    def _edged(self) -> Bools:
        """Whether an edge goes through a footprint: how much lies beyond it only all rays can tell."""
        bare = (self.owner[:, :, 0] > LEAFY).all(axis=1)
        walled = self.owner[:, :, 0] == WALLED
        met = np.isfinite(self.ranges).all(axis=1)
        bent = self._bent(np.where(np.isfinite(self.ranges), self.ranges, 0.0))
        jumps = abs(bent).max(axis=1) > JUMP * self.radius * distance(self.instrument, self.beams)
        begins = walled.any(axis=1) & ~walled.all(axis=1)
        return np.asarray(begins | (bare & (~self._alike() | ~met | jumps)), np.bool_)

    def _bent(self, ranges: Floats) -> Floats:
        """How far probes are from the plane through all of them, m."""
        weighted = self.points * self.weights[:, None]
        off = ranges - (ranges @ self.weights)[:, None]
        return np.asarray(off - off @ weighted / (self.points * weighted).sum(axis=0) @ self.points.T)

    def _trace(self, rows: Ints, waveform: Floats, speckled: Floats, owners: Ints, sums: Floats, count: Ints) -> bool:
        """Fill some rows, ray by ray; False if one has no room for what its beam met."""
        instrument, origin, every = self.instrument, self.origin[rows], np.arange(len(rows))
        profile, mine = np.zeros((len(rows), instrument.steps)), np.zeros((len(rows), waveform.shape[1]))
        met, back, full = owners[rows], sums[rows], np.zeros(len(rows), np.bool_)
        place = origin, instrument.step, profile, met, back, full
        points, even = footprint.rays(self.rays.most, instrument.cut), self._even()
        edged, leafy = self._edged()[rows], (self.owner[rows, :, 0] <= LEAFY).any(axis=1)
        left, once = every, np.zeros(len(rows), np.bool_)
        begin, end = 0, min(FEWEST, self.rays.most) if self.rays.adaptive else self.rays.most
        while len(left):
            aim, beam = self._fan(rows[left], points[begin:end]), self.beams.origin[rows[left]]
            triangles = self._triangles(rows[left], aim)
            share(lay, len(left), left, self.built.world, beam, aim, triangles, *place, worth=1)
            if full.any():
                return False
            before = mine.copy()
            share(fold, len(left), left, profile, origin, instrument.shape, even, mine)
            count[rows[left]] = end
            if end == self.rays.most:
                break
            # Leaves that a probe saw are still to come if no ray has met any; and one agreement may be chance.
            unseen = leafy & (met[:, :, 2] != 1).all(axis=1)
            agreed = self._agreed(left, before, mine, end)
            left, once = left[(edged | unseen | ~agreed | ~once)[left]], agreed
            begin, end = end, 2 * end
        each = footprint.seen(instrument.cut) / count[rows]
        waveform[rows] = mine * each[:, None]
        owners[rows], sums[rows] = met, back * each[:, None, None]
        if self.grain is not None:
            share(fold, len(rows), every, profile, origin, instrument.shape, self.grain[rows], mine)
            speckled[rows] = mine * each[:, None]
        return True

    def _even(self) -> Floats:
        """Grain of light without speckle."""
        return np.ones((len(self.start), 1))

    def _fan(self, rows: Ints, points: Floats) -> Floats:
        aim = np.empty((len(rows), len(points), 3))
        share(fan, len(rows), self.beams.direction[rows], self.radius[rows], self.turn[rows], points, aim)
        return aim

    def _triangles(self, rows: Ints, aim: Floats) -> tuple[Floats, Floats, Ints, Ints]:
        """Range, cosine, target and object of the triangle that each ray meets."""
        caster, shape = self.built.caster, aim.shape[:2]
        if not len(caster.normal):
            none = np.broadcast_to(NOWHERE, shape)
            return np.broadcast_to(np.inf, shape), np.broadcast_to(0.0, shape), none, none
        flat = aim.reshape(-1, 3)
        ranges, triangle = caster.nearest(np.repeat(self.beams.origin[rows], shape[1], axis=0), flat)
        cosine = abs((caster.normal[triangle] * flat).sum(axis=1))
        columns = ranges, cosine, caster.target[triangle], caster.object[triangle]
        return tuple(column.reshape(shape) for column in columns)  # type: ignore[return-value]

    def _agreed(self, rows: Ints, before: Floats, now: Floats, count: int) -> Bools:
        """Which waveforms, sums over `count` rays, twice as many rays have left as they were."""
        instrument, tolerance = self.instrument, self.rays.tolerance
        agreed = np.zeros(len(now), np.bool_)
        if count > FEWEST:
            counts = footprint.seen(instrument.cut) * instrument.light / count
            variance = instrument.dark, instrument.shot
            least = SETTLED * tolerance.counts, SETTLED * tolerance.noise
            share(settle, len(rows), rows, before, now, counts, variance, *least, agreed)
        return agreed
