"""The V–L paper's experiment: a mountain strip from its waveforms to its terrain, method by method.

After X. Fan and Y.-Q. Wang: weak pulses, their accumulation, wavelet denoising, decomposition, ground filter, elevation
model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.batch.decompose import Advance
from openecho.batch.simulate import Simulation, simulate_file
from openecho.enhance import denoise
from openecho.scene.physics.receiver import correlated
from openecho.study.terrain import filters
from openecho.study.terrain.flights import Flight, echoes
from openecho.surface import terrain
from openecho.surface.ground import ground
from openecho.surface.points import spacing
from openecho.surface.unknown import unknown

Floats = NDArray[np.float64]

METHODS = {"core": "inflection", "Gaussian": "gaussian", "V–L": "vl"}
"""What `openecho.decompose` calls each."""

WEAK = 0.02
"""Share of the laser's energy that a weak pulse has."""

PULSES = 16
"""That are accumulated: at 10,000 a second and 60 m/s they are within 10 cm."""

CELL = 5.0
"""Of the elevation model, m."""

ROWS = 512
"""Waveforms that are enhanced at a time."""


@dataclass(frozen=True)
class Terrain:
    """What a method makes of waveforms.

    Attributes
    ----------
    row : dict
        Its errors.
    places : float64 (n, 3)
        Of its echoes.
    waveform : int64 (n,)
        That they are of.
    found : bool (n,)
        Which the filter takes for ground.
    heights : float64 (rows, columns)
        Elevation model on `grid`.
    grid : Grid
    """

    row: dict[str, Any]
    places: Floats
    waveform: NDArray[np.int64]
    found: NDArray[np.bool_]
    heights: Floats
    grid: terrain.Grid


def variants(flight: Flight, seed: int, advance: Advance) -> Iterator[tuple[str, Path]]:
    """Waveforms of a flight as recorded, and of weak pulses: one of them, several, those without their noise."""
    yield "full energy", flight.waveforms
    folder, stem = flight.waveforms.parent, flight.waveforms.stem
    paths = {kind: folder / f"{stem}_{kind}.npz" for kind in ("weak", "one", "accumulated", "denoised")}
    if not paths["denoised"].exists():
        _enhance(flight, paths, seed, advance)
    yield "weak pulse", paths["one"]
    yield f"{PULSES} weak pulses", paths["accumulated"]
    yield f"{PULSES} weak pulses, denoised", paths["denoised"]


def _enhance(flight: Flight, paths: dict[str, Path], seed: int, advance: Advance) -> None:
    laser = flight.scene.laser.model_copy(update={"energy": flight.scene.laser.energy * WEAK})
    weak = flight.scene.model_copy(update={"laser": laser})
    simulate_file(Simulation(weak, paths["weak"], noiseless=True), advance)
    chain, digitiser = flight.ready.instrument, flight.scene.digitiser
    with np.load(paths["weak"]) as file:
        kept = {name: file[name] for name in file.files if name not in ("samples", "noiseless", "scene", "truth")}
        noiseless = file["noiseless"].astype(np.float64)
    made = {kind: np.empty(noiseless.shape, np.uint16) for kind in ("one", "accumulated", "denoised")}
    rng, interval, most = np.random.default_rng([seed, 3]), 1 / digitiser.rate, 2**digitiser.bits - 1
    for first in range(0, len(noiseless), ROWS):
        rows = slice(first, first + ROWS)
        clean = noiseless[rows]
        deviation = np.sqrt(chain.dark + chain.shot * np.maximum(clean - digitiser.offset, 0))
        total = np.zeros(clean.shape)
        for pulse in range(PULSES):
            noise = correlated(rng, clean.shape, interval, flight.scene.receiver.bandwidth)
            recorded = np.rint(clean + deviation * noise).clip(0, most)
            total += recorded
            if pulse == 0:
                made["one"][rows] = recorded
        made["accumulated"][rows] = total
        made["denoised"][rows] = np.rint(denoise(total)).clip(0, PULSES * most)
        advance("accumulating", first, len(noiseless))
    for kind, samples in made.items():
        np.savez(paths[kind], samples=samples, **kept)


def terrains(
    flight: Flight, seed: int, advance: Advance, told: Callable[[str], object]
) -> Iterator[tuple[str, str, Terrain]]:
    """Terrain by every method of every variant of the waveforms: variant, method and what became of them."""
    for variant, path in variants(flight, seed, advance):
        for name, method in METHODS.items():
            told(f"{variant}, {name}")
            yield variant, name, made(flight, variant, name, method, path, advance)


def made(flight: Flight, variant: str, name: str, method: str, path: Path, advance: Advance) -> Terrain:
    """Terrain by a method."""
    cloud, of_ground = echoes(flight, method, advance, path)
    places = cloud.places
    known = unknown(places) == 0
    found = np.zeros(len(places), np.bool_)
    found[known] = ground(places[known])
    off = places[:, 2] - flight.ground(places[:, 0], places[:, 1])
    grid = terrain.grid_of(places[found], CELL)
    reach = 3 * spacing(places[found])
    waveforms = flight.scene.shots * flight.scene.beams
    row = {
        "waveforms": variant,
        "method": name,
        "echoes": len(places),
        "echoes_of_ground": float(of_ground.sum() / waveforms),
        "ground_rms": float(np.sqrt((off[of_ground] ** 2).mean())),
        "ground_bias": float(np.median(off[of_ground])),
        **filters.errors(found, of_ground),
        **filters.model_error(flight, places[found], grid, reach),
    }
    return Terrain(
        row, places, cloud.points["waveform"], found, terrain.elevation(places[found], grid, reach=reach), grid
    )
