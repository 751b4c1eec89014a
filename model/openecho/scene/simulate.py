"""Waveforms of a scene, block by block: from the beams of some shots to counts and truth."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openecho.scene.geometry.flight import Beams, beams
from openecho.scene.geometry.trace import NOWHERE
from openecho.scene.geometry.world import Built, build
from openecho.scene.instrument import Instrument, instrument
from openecho.scene.physics import atmosphere, receiver, reflection
from openecho.scene.plan import Plan, plan
from openecho.scene.returns import Returned, distance, returns
from openecho.scene.schema import Scene

Floats = NDArray[np.float64]

TRUTH = np.dtype(
    [
        ("waveform", np.int64),
        ("target", np.int32),
        ("object", np.int64),
        ("range", np.float64),
        ("bin", np.float64),
        ("spread", np.float64),
        ("incidence", np.float64),
        ("energy", np.float64),
    ]
)
"""One entry for each object that a beam met: number of the waveform; of the target in the scene's list; of the object
within it (tree, house, step of terraces and then its riser; else 0); mean range, m, and where that is in the waveform,
bins; deviation of the range over the footprint, m; angle with the normal, rad, nan for leaves; and energy on the
detector, J. Ordered by waveform, then range."""

SPECKLE, SCINTILLATION, NOISE = range(3)
"""Streams of random numbers, so that leaving one out changes nothing of the others."""

BLOCK = 2**11
"""Waveforms that are made at a time; a block's random numbers follow from the scene's seed and its first shot."""


@dataclass(frozen=True)
class Simulator:
    """A scene, ready to be simulated.

    Attributes
    ----------
    scene : Scene
    built : Built
        Its targets.
    plan : Plan
        What is modelled.
    instrument : Instrument
    """

    scene: Scene
    built: Built
    plan: Plan
    instrument: Instrument


@dataclass(frozen=True)
class Simulated:
    """Recorded waveforms with their truth.

    Attributes
    ----------
    samples : uint16 (n, m)
        Counts.
    noiseless : float32 (n, m)
        Counts before noise, speckle, rounding and clipping.
    time : float64 (n,)
        Since the first shot, s.
    first, last : float64 (n, 3)
        Where the beam was at the first and the last sample, m.
    truth : `TRUTH` (k,)
    """

    samples: NDArray[np.uint16]
    noiseless: NDArray[np.float32]
    time: Floats
    first: Floats
    last: Floats
    truth: np.ndarray


def simulator(scene: Scene, fidelity: str = "plan", rays: int | None = None) -> Simulator:
    """Make a scene ready.

    Parameters
    ----------
    scene : Scene
    fidelity, rays
        As of `openecho.scene.plan.plan`.

    Returns
    -------
    Simulator
        With its targets, and a plan.

    Raises
    ------
    SceneError
        If a file of the scene can't be used, or there is not enough memory: the key, what was found and what was
        expected.
    """
    built = build(scene)
    chosen = plan(scene, built, fidelity, rays)
    return Simulator(scene, built, chosen, instrument(scene, chosen.kept))


def blocks(scene: Scene) -> list[tuple[int, int]]:
    """First shot of each block, and shots in it."""
    size = max(1, BLOCK // scene.beams)
    return [(first, min(size, scene.shots - first)) for first in range(0, scene.shots, size)]


def simulate(ready: Simulator, first: int, shots: int) -> Simulated:
    """Record one block.

    Parameters
    ----------
    ready : Simulator
    first, shots : int
        Of `blocks`.

    Returns
    -------
    Simulated
        n is shots times the beams of each.
    """
    chain, digitiser = ready.instrument, ready.scene.digitiser
    beam = beams(ready.scene, np.arange(first, first + shots))
    away = distance(chain, beam)
    back = returns(ready.built, chain, beam, ready.plan.rays, _grain(chain, away, first))
    light = atmosphere.scintillated(chain.scintillation(away), _random(ready.scene, first, SCINTILLATION))
    sun = chain.background(back.back, away)[:, None]
    power = back.speckled * light[:, None] + sun
    counts = digitiser.offset + power
    if chain.dark or chain.shot:
        rng, interval = _random(ready.scene, first, NOISE), 1 / digitiser.rate
        unit = receiver.correlated(rng, power.shape, interval, ready.scene.receiver.bandwidth)
        counts += unit * np.sqrt(chain.dark + chain.shot * np.maximum(power, 0))
    ends = (back.start[:, None] + np.array([0, digitiser.samples - 1]) * chain.bin)[:, :, None]
    place = beam.origin[:, None] + ends * beam.direction[:, None]
    return Simulated(
        samples=receiver.digitise(counts, digitiser.bits),
        noiseless=(digitiser.offset + back.waveform + sun).astype(np.float32),
        time=beam.time,
        first=place[:, 0],
        last=place[:, 1],
        truth=_truth(chain, beam, back),
    )


def _random(scene: Scene, first: int, stream: int) -> np.random.Generator:
    """Random numbers of a block; those of targets have a 1 where these have a 2."""
    return np.random.default_rng([scene.seed, 2, first, stream])


def _grain(chain: Instrument, away: Floats, first: int) -> Floats | None:
    """Factors of speckle, one for each range as long as the pulse is wide: further apart, light does not interfere."""
    order = chain.speckle_order(away)
    if order is None:
        return None
    grains = math.ceil(chain.scene.digitiser.samples / chain.fwhm) + 1
    return reflection.speckle(order[:, None], (len(away), grains), _random(chain.scene, first, SPECKLE))


def _truth(chain: Instrument, beam: Beams, back: Returned) -> np.ndarray:
    """What each beam met."""
    row, column = np.nonzero(back.owners[:, :, 0] != NOWHERE)
    owner, (energy, *moments) = back.owners[row, column], back.sums[row, column].T
    lit = energy > 0
    row, owner, energy, moments = row[lit], owner[lit], energy[lit], [moment[lit] for moment in moments]
    mean, square, angle = (moment / energy for moment in moments)
    truth = np.empty(len(row), TRUTH)
    start = back.start - chain.before * chain.bin
    truth["waveform"] = beam.waveform[row]
    truth["target"], truth["object"] = owner[:, 0], owner[:, 1]
    truth["range"] = start[row] + mean
    truth["bin"] = mean / chain.bin - chain.before
    truth["spread"] = np.sqrt(np.maximum(square - mean**2, 0))
    truth["incidence"] = np.where(owner[:, 2] == 1, np.nan, angle)
    truth["energy"] = energy * chain.energy * receiver.range_law(truth["range"], chain.extinction)
    return truth[np.lexsort((truth["range"], truth["waveform"]))]
