"""The bundled scenes on trial: methods against the truth, the plan against full fidelity, speed, and a recorded set.

Run as ``python -m openecho.study.scenes``; the report is ``build/reports/scenes.json``, with a picture beside it.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table

from openecho import formats, report
from openecho.batch.simulate import Simulation, simulate_file
from openecho.decompose import Method, prepare
from openecho.formats.references import Reference
from openecho.scene.geometry.flight import beams
from openecho.scene.plan import MOST_RAYS
from openecho.scene.returns import Rays, returns
from openecho.scene.schema import bundled, load
from openecho.scene.simulate import Simulator, blocks, simulate, simulator
from openecho.study.figure import FILTERED, FOUND, save
from openecho.study.score import score
from openecho.study.truth import LAGS, MISFIT, resolved, told_of_scene

Floats = NDArray[np.float64]

METHODS = {"core": "inflection", "Gaussian": "gaussian", "V–L": "vl"}
"""What `openecho.decompose` calls each."""

TRIED = 2000
"""Waveforms of each scene that the methods are tried on."""

COMPARED = 512
"""Waveforms of each scene that are traced as planned and in full."""

REPEATS = 3
"""Pairs of timings, of which the median ratio is taken."""

FOREST_RAYS = 512
"""Of each beam where the forest's speed is measured: the next power of two above 400."""

RECORDED, LIKE = "gedi_cerrado.npz", "savanna"
"""Recorded waveforms over land, and the scene that is to look like them."""

NARROW = 4.0
"""σ of a pulse, bins, up to which the core's sharpest filter suits it; above, that for GEDI's does."""

NOISE_SAMPLES = 50

PERCENTILES = (5, 25, 50, 75, 95)


def judge(name: str, folder: Path, seed: int) -> dict[str, Any]:
    """Simulate a bundled scene into a file, and score the methods on it."""
    scene = load(name)
    shots = min(scene.shots, math.ceil(TRIED / scene.beams))
    scene = scene.model_copy(update={"seed": seed, "shots": shots})
    path = folder / f"{name}.npz"
    simulate_file(Simulation(scene, path))
    ready = simulator(scene)
    with np.load(path) as file:
        echoes, ground = resolved(scene, ready, file["truth"])
    waveforms = scene.shots * scene.beams
    reference = Reference("truth", echoes["waveform"], echoes["centre"], ground, np.ones(waveforms, np.bool_))
    row: dict[str, Any] = {"scene": name, "waveforms": waveforms, "echoes": len(echoes)}
    with formats.open(path) as recording:
        for method, own in METHODS.items():
            found = score(recording, [reference], _method(own, ready, recording.longest))
            row[method] = found["references"][0] | {"echoes_per_waveform": found["echoes_per_waveform"]}
    return row


def _method(name: str, ready: Simulator, longest: int) -> Method:
    """A method that is told of the pulse; the fits also how far that is from their shape, and how noise is coloured."""
    chain = ready.instrument
    if name == "inflection":
        return prepare(name, longest, {"taps": "nasa3.5" if chain.deviation < NARROW else "gedi", "k": 4.0})
    return prepare(name, longest, told_of_scene(chain)["gaussian" if name == "gaussian" else "laser"])


def fidelity(name: str) -> dict[str, Any]:
    """Trace waveforms of a bundled scene as planned and in full: how far they differ, and how much longer it takes."""
    scene = load(name)
    ready = simulator(scene)
    shots = np.unique(np.linspace(0, scene.shots - 1, max(2, COMPARED // scene.beams)).astype(np.int64))
    aimed = beams(scene, shots)

    def timed(rays: Rays) -> tuple[float, Any]:
        begun = time.perf_counter()
        made = returns(ready.built, ready.instrument, aimed, rays)
        return time.perf_counter() - begun, made

    planned, full = (Rays(MOST_RAYS, adaptive, scene.tolerance) for adaptive in (True, False))
    timed(planned)  # the first pays for the compiler
    pairs = [(timed(full), timed(planned)) for _ in range(REPEATS)]
    (_, all_rays), (_, as_planned) = pairs[0]
    allowed = scene.tolerance.allowed(ready.instrument.dark + ready.instrument.shot * all_rays.waveform)
    share = (abs(as_planned.waveform - all_rays.waveform) / allowed).max(axis=1)
    return {
        "scene": name,
        "waveforms": len(share),
        "rays": float(as_planned.rays.mean()),
        "smooth": float((as_planned.rays == 1).mean()),
        "largest_difference": float(share.max()),
        "over_tolerance": float((share > 1).mean()),
        "ratio": statistics.median(slow / quick for (slow, _), (quick, _) in pairs),
    }


def speed(name: str, rays: int | None = None) -> dict[str, Any]:
    """Waveforms a second, with noise and truth, of a bundled scene."""
    scene = load(name)
    ready = simulator(scene, rays=rays)
    simulate(ready, *blocks(scene)[0])
    begun = time.perf_counter()
    made = [len(simulate(ready, *block).samples) for _ in range(REPEATS) for block in blocks(scene)]
    taken = time.perf_counter() - begun
    cores = len(os.sched_getaffinity(0))
    return {"scene": name, "rays": rays, "processors": cores, "waveforms_per_second": sum(made) / taken}


def looks(samples: NDArray[np.uint16], length: NDArray[np.int32], width: float) -> dict[str, Floats]:
    """What a set of waveforms looks like.

    Parameters
    ----------
    samples : uint16 (n, m)
    length : int32 (n,)
    width : float
        σ of the pulse, bins.

    Returns
    -------
    dict
        ``baseline`` and ``noise deviation``, counts, of the first 50 samples of each; ``autocorrelation`` of the noise
        at lags from 1; ``peak``, counts above the baseline; ``echo width``, σ in bins, and ``echo amplitude``, counts,
        of Gaussians that are fitted.
    """
    first = samples[:, :NOISE_SAMPLES].astype(np.float64)
    baseline = first.mean(axis=1)
    off = first - baseline[:, None]
    products = [(off[:, lag:] * off[:, : NOISE_SAMPLES - lag]).mean() for lag in range(LAGS + 1)]
    echoes = prepare("gaussian", samples.shape[1], {"width": width, "misfit": MISFIT})(samples, length, 1.0).echoes
    return {
        "baseline": baseline,
        "noise deviation": off.std(axis=1),
        "autocorrelation": np.array(products[1:]) / products[0],
        "peak": samples.max(axis=1) - baseline,
        "echo width": echoes["width"],
        "echo amplitude": echoes["amplitude"],
    }


def alike(folder: Path, recorded: Path) -> tuple[list[dict[str, Any]], Figure]:
    """Put the simulated land set beside the recorded one."""
    ready = simulator(load(LIKE))
    with np.load(folder / f"{LIKE}.npz") as ours, np.load(recorded) as theirs:
        sides = {
            "recorded": looks(theirs["samples"], theirs["length"], ready.instrument.deviation),
            "simulated": looks(ours["samples"], ours["length"], ready.instrument.deviation),
        }
    rows = []
    for quantity in sides["recorded"]:
        for side, found in sides.items():
            values = found[quantity]
            spread = values if quantity == "autocorrelation" else np.percentile(values, PERCENTILES)
            rows.append({"quantity": quantity, "set": side, "values": [round(float(value), 3) for value in spread]})
    return rows, draw(sides)


def draw(sides: dict[str, dict[str, Floats]]) -> Figure:
    """Draw both sets: distributions, and the autocorrelation of their noise."""
    figure = Figure(figsize=(12, 6), layout="constrained")
    panels = figure.subplots(2, 3).ravel()
    units = {"echo width": "bins"}
    for axes, quantity in zip(panels, sides["recorded"], strict=True):
        for (side, found), colour in zip(sides.items(), (FILTERED, FOUND), strict=True):
            values = found[quantity]
            if quantity == "autocorrelation":
                axes.plot(np.arange(1, LAGS + 1), values, "o-", color=colour, label=side)
                axes.set_xlabel("lag, bins")
                continue
            both = np.concatenate([one[quantity] for one in sides.values()])
            edges = np.linspace(float(np.percentile(both, 0.5)), float(np.percentile(both, 99)), 40)
            axes.hist(values, edges, density=True, histtype="step", color=colour, label=side, linewidth=1.5)
            axes.set_xlabel(units.get(quantity, "counts"))
        axes.set_title(quantity)
    panels[0].legend(frameon=False)
    return figure


def tables(content: dict[str, Any]) -> Iterator[Table]:
    """Tables of the report for a terminal."""
    table = Table(title="echoes within 3 bins of the truth, RMS error of their peaks (bins), ground within 3 bins")
    for name in ("scene", "echoes", *METHODS):
        table.add_column(name, justify="right")
    for row in content["methods"]:
        table.add_row(row["scene"], str(row["echoes"]), *(told(row[method]) for method in METHODS))
    yield table
    for title, key in (
        ("plan against full fidelity", "fidelity"),
        ("speed", "speed"),
        (f"{LIKE} and {RECORDED}", "alike"),
    ):
        rows = content[key]
        if rows:
            table = Table(*(name.replace("_", " ") for name in rows[0]), title=title)
            for row in rows:
                table.add_row(*(f"{value:.4g}" if isinstance(value, float) else str(value) for value in row.values()))
            yield table


def told(found: dict[str, Any]) -> str:
    """One method on one scene: share of echoes found, their error in bins, share of the grounds found."""
    error, ground = found["peak_rms"], found["ground_within_3"]
    return f"{found['within_3']:.1%}, {error:.2f}, {ground:.1%}" if error is not None else "0.0%"


def main() -> None:
    """Run the study, print its tables, and write its report and picture."""
    parser = argparse.ArgumentParser(prog="openecho.study.scenes", description=main.__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of scenes, noise and all else (1)")
    seed = parser.parse_args().seed
    folder = report.FOLDER.parent / "scenes"
    folder.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    names = list(bundled())
    content: dict[str, Any] = {"tools": report.tools("numpy", "numba", "embreex"), "seed": seed}
    content["methods"] = [
        judge(name, folder, seed) for name in track(names, "methods", console=console, transient=True)
    ]
    content["fidelity"] = [fidelity(name) for name in track(names, "fidelity", console=console, transient=True)]
    content["speed"] = [speed("forest", FOREST_RAYS), *(speed(name) for name in ("forest", "sea", "ice"))]
    recorded = Path(os.environ.get("OPENECHO_DATA", "")) / RECORDED
    content["alike"], picture = alike(folder, recorded) if recorded.is_file() else ([], None)
    print(f"seed {seed}")
    for table in tables(content):
        Console().print(table)
    path = report.write("scenes", content)
    if picture is None:
        print(f"{RECORDED} is not there: set OPENECHO_DATA to its folder to compare {LIKE} with it")
    else:
        save(picture, path.with_suffix(".png"))
    print(path)


if __name__ == "__main__":
    main()
