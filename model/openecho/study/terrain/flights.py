"""Scenes that are flown over: waveforms, their echoes by a method, and what is true of each echo and of the ground."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.batch.decompose import Advance, Job, decompose_file
from openecho.batch.simulate import Simulation, simulate_file
from openecho.scene.geometry.world import GROUND, ground_heights
from openecho.scene.schema import Scene, load
from openecho.scene.simulate import Simulator, simulator
from openecho.study.truth import told_of_scene
from openecho.surface.points import Cloud, read

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SHOTS = {"mountain": 100, "forest": 40_000, "roofs": 33_000}
"""Shots over each scene: all of the mountain strip, forest and city from end to end."""

NEAR = 0.5
"""FWHM of the pulse within which light that an echo is of comes back."""


@dataclass(frozen=True)
class Flight:
    """A scene that was flown over.

    Attributes
    ----------
    name : str
    scene : Scene
    waveforms : Path
        Recorded, with truth.
    """

    name: str
    scene: Scene
    waveforms: Path

    @cached_property
    def ready(self) -> Simulator:
        """That of the scene."""
        return simulator(self.scene)

    @cached_property
    def truth(self) -> np.ndarray:
        """Of `openecho.scene.simulate.TRUTH`."""
        with np.load(self.waveforms) as file:
            return np.asarray(file["truth"])

    def ground(self, x: Floats, y: Floats) -> Floats:
        """Heights (n,) of the bare ground, m."""
        return ground_heights(self.scene, self.ready.built.world, x, y)

    def of_ground(self, waveform: NDArray[np.int64], at: Floats) -> Bools:
        """Whether echoes (n,), by waveform and position in bins, are more of ground than of all else.

        An echo where no light comes from is of nothing, and so not of ground.
        """
        truth, near = self.truth, NEAR * self.ready.instrument.fwhm
        target = [one.kind in GROUND for one in self.scene.targets]
        bare = np.array(target)[truth["target"]] & ~np.isnan(truth["incidence"])
        # Both are sorted by waveform and bin: one number for both.
        long = 4.0 * self.scene.digitiser.samples
        place = truth["waveform"] * long + truth["bin"]
        first, last = (np.searchsorted(place, waveform * long + at + side * near) for side in (-1, 1))
        total, ground = (np.append(0, np.cumsum(light)) for light in (truth["energy"], truth["energy"] * bare))
        return np.asarray(ground[last] - ground[first] > 0.5 * (total[last] - total[first]))


def fly(name: str, folder: Path, seed: int, share: float, advance: Advance) -> Flight:
    """Record a share of a flight over a bundled scene, or take it from where it was kept."""
    scene = load(name)
    scene = scene.model_copy(update={"seed": seed, "shots": max(1, round(SHOTS[name] * share))})
    path = folder / f"{name}_{seed}_{scene.shots}.npz"
    if not path.exists():
        simulate_file(Simulation(scene, path), advance)
    return Flight(name, scene, path)


def settings(flight: Flight, method: str) -> dict[str, Any]:
    """What a method is told: the core has its sharpest filter, fits know the pulse and how noise is coloured."""
    if method == "inflection":
        return {"taps": "nasa3.5", "k": 6.0, "sample_w": 16}
    told: Mapping[str, Any] = told_of_scene(flight.ready.instrument)
    return dict(told["gaussian" if method == "gaussian" else "laser"])


def echoes(flight: Flight, method: str, advance: Advance, waveforms: Path | None = None) -> tuple[Cloud, Bools]:
    """Echoes of a flight by a method of `openecho.decompose`, and which are of ground.

    Of other waveforms than were recorded, if so told: those after accumulation, or without their noise.
    """
    source = waveforms or flight.waveforms
    output = source.with_name(f"{source.stem}_{method}.npz")
    if not output.exists():
        decompose_file(Job(source, output, method, None, settings(flight, method)), advance)
    cloud = read(output)
    with np.load(output) as file:
        return cloud, flight.of_ground(file["waveform"], file["peak"])
