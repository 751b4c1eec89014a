"""The waveforms that every way is tried on: scenes and grids with known truth, and recorded ones with references."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho import formats, stimulus
from openecho.enhance import noise
from openecho.formats import references
from openecho.scene.physics.receiver import BIN
from openecho.scene.schema import load
from openecho.scene.simulate import blocks, simulate, simulator
from openecho.study import bench
from openecho.study.truth import MISFIT, normal, resolved, told, told_of_scene

Floats = NDArray[np.float64]

ROUNDING = 1 / 12
"""Variance of the rounding to whole counts, counts²; Bennett 1948."""

SCENES = ("forest", "roofs", "mountain")
"""Bundled scenes, besides the land and the ocean set."""

GRIDS = ("snr", "width", "separation", "ratio")
"""Of `openecho.study.bench.GRIDS`."""

BIN_NS = 1.0
"""Sample interval that a range error is told for where nothing else is known of a set, ns."""

RECORDED: Mapping[str, tuple[str, float]] = {
    "gedi_cerrado": ("a1", 4.6),
    "neon_harvard": ("decomposition", 4.0),
}
"""Recorded files with references: which of them is asked, and σ of the transmitted pulse, bins."""

LAGS = 5
"""Of the noise's autocorrelation in recorded files, from 0."""


@dataclass(frozen=True)
class Set:
    """Waveforms, what is true of them, and what is told of them.

    Attributes
    ----------
    name, kind : str
        Kind is ``scene``, ``grid`` or ``recorded``.
    samples : uint16 (n, m)
        Counts.
    length : int (n,)
        Samples of each.
    truth : structured (k,)
        Of `openecho.stimulus.TRUTH`, by waveform, then centre; of a recorded set the reference's modes, whose width and
        amplitude are not judged.
    told : mapping
        Settings of the fits, for ``gaussian`` and ``laser``: what is known of the pulse and of the noise.
    bin_ns : float
        Sample interval, ns.
    bound : float64 (k, 3), optional
        Cramér–Rao bounds of amplitude (counts), centre and width (bins) of each echo.
    judged : bool (n,), optional
        Waveforms of which the truth says anything; all if left out.
    grid, value : str, float
        Of a set of a grid, what is varied and its value.
    """

    name: str
    kind: str
    samples: NDArray[np.uint16]
    length: NDArray[Any]
    truth: np.ndarray
    told: Mapping[str, Mapping[str, Any]]
    bin_ns: float = BIN_NS
    bound: Floats | None = None
    judged: NDArray[np.bool_] | None = None
    grid: str = ""
    value: float = 0.0

    @property
    def longest(self) -> int:
        """Samples of the longest waveform."""
        return int(self.samples.shape[1])

    @property
    def described(self) -> dict[str, Any]:
        """Its row of the report."""
        row = {"name": self.name, "kind": self.kind, "waveforms": len(self.samples), "echoes": len(self.truth)}
        return row | ({"grid": self.grid, "value": self.value} if self.kind == "grid" else {})


def recipes(size: int, seed: int, data: Path | None) -> list[Callable[[], Set]]:
    """What makes each set, for all of them at a time are large.

    Parameters
    ----------
    size : int
        Waveforms of each, about; of a recorded file as many as it has, if `size` is no less.
    seed : int
        Of all that is random.
    data : Path, optional
        Folder with recorded files; those that are not there are left out.
    """
    files = [] if data is None else [data / f"{name}.npz" for name in RECORDED]
    return [
        *(partial(synthetic, name, size, seed) for name in ("land", "ocean")),
        *(partial(scene, name, size, seed) for name in SCENES),
        *(partial(grid, point, size, (seed, n)) for n, point in enumerate(bench.POINTS) if point.grid in GRIDS),
        *(partial(recorded, path, size) for path in files if path.is_file()),
    ]


def synthetic(name: str, size: int, seed: int) -> Set:
    """Land or ocean waveforms as the paper's: Gaussian echoes in white noise."""
    make = {"land": stimulus.land, "ocean": stimulus.ocean}[name]
    parts = [make(seed + number) for number in range(max(1, size // stimulus.WAVEFORMS))]
    truth = np.concatenate([part.truth for part in parts])
    truth["waveform"] += np.repeat(np.arange(len(parts)) * stimulus.WAVEFORMS, [len(part.truth) for part in parts])
    samples = np.concatenate([part.samples for part in parts])
    length = np.concatenate([part.length for part in parts])
    # The noise's deviation is drawn from 0.9 to 1.1 counts for each waveform.
    bound = _bounds(truth, math.hypot(1.0, math.sqrt(ROUNDING)), samples.shape[1])
    return Set(name, "scene", samples, length, truth, _told_of(float(np.median(truth["width"]))), bound=bound)


def scene(name: str, size: int, seed: int) -> Set:
    """Waveforms of a bundled scene."""
    chosen = load(name)
    shots = min(chosen.shots, math.ceil(size / chosen.beams))
    chosen = chosen.model_copy(update={"seed": seed, "shots": shots})
    ready = simulator(chosen)
    made = [simulate(ready, *block) for block in blocks(chosen)]
    samples = np.concatenate([part.samples for part in made])
    truth, _ = resolved(chosen, ready, np.concatenate([part.truth for part in made]))
    told_ones = told_of_scene(ready.instrument)
    length = np.full(len(samples), samples.shape[1])
    return Set(name, "scene", samples, length, truth, told_ones, ready.instrument.bin / BIN * 1e9)


def grid(point: bench.Point, size: int, seed: tuple[int, int]) -> Set:
    """Waveforms of one point of a grid, in whole counts."""
    clean, centres = bench.waveforms(point, size, seed)
    samples = stimulus.quantise(clean)
    count = centres.shape[1]
    truth = np.empty(centres.size, stimulus.TRUTH)
    truth["waveform"], truth["centre"] = np.repeat(np.arange(size), count), centres.ravel()
    truth["width"], truth["amplitude"] = point.sigma, np.tile(point.amplitudes, size)
    bound = np.tile(point.bound * math.hypot(bench.NOISE, math.sqrt(ROUNDING)) / bench.NOISE, (size, 1))
    made = Set(
        f"{point.grid} {point.value:g}", "grid", samples, np.full(size, point.length), truth, _told_of(point.told)
    )
    return replace(made, bound=bound, grid=point.grid, value=point.value)


def recorded(path: Path, size: int) -> Set:
    """Waveforms of a file with those modes that others found in them."""
    name = path.stem
    wanted, sigma = RECORDED[name]
    with np.load(path) as file, formats.open(path) as recording:
        samples, length, bin_ns = file["samples"][:size], file["length"][:size], float(file["bin_ns"])
        (reference,) = (one for one in references(recording) if one.name == wanted)
    among = reference.waveform < len(samples)
    truth = np.zeros(np.count_nonzero(among), stimulus.TRUTH)
    truth["waveform"], truth["centre"] = reference.waveform[among], reference.position[among]
    truth["width"] = sigma
    correlation = tuple(noise(samples.astype(np.float64), length, lags=LAGS - 1).correlation.round(4).tolist())
    told_ones = {shape: known | {"correlation": correlation} for shape, known in _told_of(sigma, MISFIT).items()}
    judged = reference.judged[:size]
    return Set(f"{name} {wanted}", "recorded", samples, length, truth, told_ones, bin_ns, judged=judged)


def _told_of(sigma: float, least: float = 0.0) -> dict[str, dict[str, float]]:
    """What is told of Gaussian echoes of this σ, bins."""
    x = np.linspace(-6 * sigma, 6 * sigma, 1001)
    settings = told(x, normal(x, 1.0, 0.0, sigma), least)
    settings["gaussian"]["misfit"] = least  # the shape is theirs
    return settings


def _bounds(truth: np.ndarray, deviation: float, length: int) -> Floats:
    """Cramér–Rao bounds of all echoes, with those of the same waveform and its baseline unknown."""
    _, first = np.unique(truth["waveform"], return_index=True)
    return np.concatenate(
        [
            bench.cramer_rao(own["amplitude"], own["centre"], own["width"], deviation, length)
            for own in np.split(truth, first[1:])
        ]
    )
