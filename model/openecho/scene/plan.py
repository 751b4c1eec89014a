"""What a scene requires: which effects can move a recorded count, how many rays a footprint takes, what is in reach."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openecho.scene.geometry.flight import beams
from openecho.scene.geometry.world import Built
from openecho.scene.instrument import EFFECTS, NOISES, Instrument, instrument
from openecho.scene.physics import receiver
from openecho.scene.returns import Rays, Returned, distance, returns
from openecho.scene.schema import Scene

FIDELITIES = ("plan", "full")
"""As much as the scene requires; or every effect and all rays, to see what the first leaves out."""

MOST_RAYS = 2**12
"""Of a beam: an edge through a footprint then shares its light out to 2e-3, which only brighter echoes show."""

PILOTS = 64
"""Shots, from all over the flight, that tell how bright its echoes are."""

PILOT_RAYS = 256

DARK = {*NOISES[:3], "background light"}
"""Effects that are as great without an echo."""

MARGIN = 2.0
"""The scene's brightest echo over the brightest that the pilots saw."""


@dataclass(frozen=True)
class Effect:
    """One effect on the recorded counts.

    Attributes
    ----------
    name : str
        Of `openecho.scene.instrument.EFFECTS`.
    counts : float
        As much as it can move a count: the greatest shift, or the deviation of what is random.
    share : float
        That over the tolerance where it does so: an echo's own noise hides more than the darkness before it.
    cost : str
        Of modelling it.
    kept : bool
        Whether it is modelled.
    """

    name: str
    counts: float
    share: float
    cost: str
    kept: bool


@dataclass(frozen=True)
class Plan:
    """What is modelled.

    Attributes
    ----------
    effects : tuple of Effect
        Those that matter most first.
    rays : Rays
        How footprints are sampled.
    tolerance : float
        Counts that all that is left out comes to at most where there is no light.
    noise : float
        Its deviation without light, counts.
    peak : float
        Counts above the offset that the brightest echo may have.
    """

    effects: tuple[Effect, ...]
    rays: Rays
    tolerance: float
    noise: float
    peak: float

    @property
    def kept(self) -> frozenset[str]:
        """Names of the effects that are modelled."""
        return frozenset(effect.name for effect in self.effects if effect.kept)


@dataclass(frozen=True)
class Pilot:
    """What a few shots from all over a flight cost and take.

    Attributes
    ----------
    rays : int64 (n,)
        Of each beam.
    lit : float
        Share of the samples that have light, a tenth of the tolerance or more.
    milliseconds : float
        A waveform, on this machine and at this moment.
    """

    rays: NDArray[np.int64]
    lit: float
    milliseconds: float


def plan(scene: Scene, built: Built, fidelity: str = "plan", rays: int | None = None) -> Plan:
    """Work out what a scene requires.

    Effects are left out from those that matter least on, as long as all that are left out come to no more than the
    tolerance together.

    Parameters
    ----------
    scene : Scene
    built : Built
        Its targets.
    fidelity : str
        One of `FIDELITIES`.
    rays : int, optional
        Of every beam that meets anything, a power of two; left out: as many as it takes, up to `MOST_RAYS`.

    Returns
    -------
    Plan
        What is modelled.
    """
    whole = instrument(scene)
    few = Rays(PILOT_RAYS, True, scene.tolerance)
    seen = returns(built, whole, beams(scene, _pilots(scene)), few)
    peak = min(MARGIN * float(seen.waveform.max()), 2.0**scene.digitiser.bits - 1 - scene.digitiser.offset)
    dim, bright = scene.tolerance.allowed(whole.dark + whole.shot * np.array([0, peak])).tolist()
    effects, left_out = [], 0.0
    # What grows with the light grows faster than its noise: where an echo is brightest, it matters most.
    estimates = _estimates(whole, seen, peak)
    shares = {name: counts / (dim if name in DARK else bright) for name, (counts, _) in estimates.items()}
    for name, share in sorted(shares.items(), key=lambda item: item[1]):
        counts, cost = estimates[name]
        left_out += share
        effects.append(Effect(name, counts, share, cost, fidelity == "full" or left_out > 1))
    sampling = Rays(rays or MOST_RAYS, fidelity == "plan" and rays is None, scene.tolerance)
    return Plan(tuple(reversed(effects)), sampling, dim, math.sqrt(whole.dark), peak)


def pilot(scene: Scene, built: Built, chosen: Plan) -> Pilot:
    """Trace a few shots as a plan says, and see what that takes."""
    chain, aimed = instrument(scene, chosen.kept), beams(scene, _pilots(scene))
    returns(built, chain, aimed, chosen.rays)  # the first pays for the compiler
    begun = time.perf_counter()
    seen = returns(built, chain, aimed, chosen.rays)
    taken = time.perf_counter() - begun
    lit = float((seen.waveform >= 0.1 * chosen.tolerance).mean())
    return Pilot(seen.rays, lit, 1e3 * taken / len(seen.rays))


def _pilots(scene: Scene) -> NDArray[np.int64]:
    """Shots from all over the flight; of arrays of beams fewer will do."""
    return np.unique(np.linspace(0, scene.shots - 1, max(2, PILOTS // scene.beams)).astype(np.int64))


def _estimates(whole: Instrument, seen: Returned, peak: float) -> dict[str, tuple[float, str]]:
    """As much as each effect can move a count, and what modelling it takes."""
    scene = whole.scene
    aimed = distance(whole, beams(scene, _pilots(scene)))
    far = float(aimed.max())
    narrow = instrument(scene, set(EFFECTS) - {"turbulence spread"})
    spread = float((whole.radius(aimed) / narrow.radius(aimed)).max())
    order = whole.speckle_order(aimed)
    surface, bulk, thermal = (
        scene.digitiser.gain * math.sqrt(variance)
        for variance in receiver.dark_noise(scene.receiver, scene.laser.wavelength)
    )
    sharp = instrument(scene, set(EFFECTS) - {"receiver response"})
    number = "a random number a sample, for all noise together"
    return {
        "extinction": (peak * -math.expm1(-2 * whole.extinction * far), "an exponential a step of range"),
        "turbulence spread": (peak * (1 - spread**-2), "none"),
        "scintillation": (peak * math.sqrt(whole.scintillation(aimed).max()), "a random number a waveform"),
        "speckle": (
            0.0 if order is None else peak / math.sqrt(order.min()),
            "a random number a pulse length, and folding twice",
        ),
        "background light": (float(whole.background(seen.back, aimed).max()), "none"),
        "receiver response": (peak * _response(whole, sharp), "none"),
        "field of view": (peak * math.exp(-2 * whole.cut**2), "none"),
        "surface dark current": (surface, number),
        "bulk dark current": (bulk, number),
        "thermal noise": (thermal, number),
        "shot noise": (math.sqrt(whole.shot * peak), number),
    }


def _response(slow: Instrument, sharp: Instrument) -> float:
    """How much of a pulse's height the receiver moves: it widens it and lowers it."""
    return 1 - min(float(slow.pulse.max() / sharp.pulse.max()), 1.0)
