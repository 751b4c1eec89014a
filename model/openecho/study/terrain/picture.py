"""Pictures of the study: 128 pixels after the paper's Fig 13, terrain after its Fig 14, and what filtering costs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from openecho.study.figure import FILTERED, FOUND, RAW, SUM
from openecho.study.terrain.experiment import CELL, Terrain
from openecho.study.terrain.flights import Flight
from openecho.surface import terrain

Floats = NDArray[np.float64]

PIXELS = 128
"""Fig 13."""

STYLES: Mapping[str, dict[str, Any]] = {
    "core": {"color": FOUND, "marker": "x"},
    "Gaussian": {"color": SUM, "marker": "o", "fillstyle": "none"},
    "V–L": {"color": FILTERED, "marker": "*"},
}
"""Circle and asterisk as in Fig 13."""

ENLARGED = ((8, 20), (56, 68), (104, 116))
"""Pixels that are shown larger, as there."""


def pixels(flight: Flight, made: Mapping[str, Terrain], title: str) -> Figure:
    """Elevation in two lines of the scan, by each method beside the truth."""
    figure = Figure(figsize=(11, 7), layout="constrained")
    axes = figure.subplot_mosaic([["all"] * 3, ["0", "1", "2"]], height_ratios=[1.4, 1])
    first = flight.scene.shots // 2 * flight.scene.beams
    with np.load(flight.waveforms) as file:
        start, end = (file[name][first : first + PIXELS] for name in ("first", "last"))
    true = _met(flight, start, end)
    for name, drawn in axes.items():
        begin, stop = (0, PIXELS) if name == "all" else ENLARGED[int(name)]
        drawn.plot(np.arange(begin, stop), true[begin:stop], "-", color=RAW, label="truth", linewidth=1)
        for method, one in made.items():
            waveform = one.waveform[one.found] - first
            here = (waveform >= begin) & (waveform < stop)
            at, heights = waveform[here], one.places[one.found, 2][here]
            drawn.plot(at, heights, linestyle="none", label=method, markersize=4, **STYLES[method])
        drawn.set_xlabel("pixel")
    axes["all"].set_ylabel("elevation, m")
    axes["all"].set_title(title)
    axes["all"].legend(frameon=False, ncols=4)
    return figure


def _met(flight: Flight, start: Floats, end: Floats) -> Floats:
    """Elevation at which beams (n, 3) meet the bare ground, m: from above, the first change of side."""
    share = np.linspace(0, 1, 4096)
    heights = np.empty(len(start))
    for k, (one, other) in enumerate(zip(start, end, strict=True)):
        ray = one + share[:, None] * (other - one)
        below = ray[:, 2] < flight.ground(ray[:, 0], ray[:, 1])
        heights[k] = ray[np.argmax(below), 2] if below.any() else np.nan
    return heights


def terrains(flight: Flight, made: Terrain, title: str) -> Figure:
    """Triangles of the ground, the elevation model with its light, and what it is off."""
    figure = Figure(figsize=(13, 5), layout="constrained")
    ground = made.places[made.found]
    axes: Any = figure.add_subplot(1, 3, 1, projection="3d")
    axes.plot_trisurf(*ground.T, cmap="terrain", linewidth=0.1, edgecolor="#555555")
    axes.set_box_aspect(np.ptp(ground, axis=0) * (1, 1, 2))
    axes.view_init(45, -70)
    axes.set_title(f"TIN, heights twice as large; {title}")
    x, y = made.grid.centres
    extent = (x[0], x[-1], y[-1], y[0])
    shaded, off = figure.add_subplot(1, 3, 2), figure.add_subplot(1, 3, 3)
    shaded.imshow(terrain.hillshade(made.heights, CELL), cmap="gray", extent=extent)
    heights = shaded.imshow(made.heights, cmap="terrain", extent=extent, alpha=0.6)
    figure.colorbar(heights, ax=shaded, label="m", shrink=0.7)
    shaded.set_title("DEM")
    east, north = np.meshgrid(x, y)
    error = made.heights - flight.ground(east.ravel(), north.ravel()).reshape(east.shape)
    most = float(np.nanpercentile(abs(error), 98))
    drawn = off.imshow(error, cmap="RdBu", extent=extent, vmin=-most, vmax=most)
    figure.colorbar(drawn, ax=off, label="m", shrink=0.7)
    off.set_title("DEM less truth")
    for one in (shaded, off):
        one.set_xlabel("east, m")
    shaded.set_ylabel("north, m")
    return figure


def cost(rows: list[dict[str, Any]]) -> Figure:
    """Seconds against points, and what would be n log n."""
    figure = Figure(figsize=(6, 4.5), layout="constrained")
    axes: Axes = figure.subplots()
    counts = np.array([row["points"] for row in rows], np.float64)
    total = np.zeros(len(rows))
    for part, colour in (("unknown", RAW), ("filter", FOUND), ("grid", FILTERED)):
        seconds = np.array([row[part] for row in rows])
        total += seconds
        axes.loglog(counts, seconds, "o-", color=colour, label=part)
    axes.loglog(counts, total, "o-", color=SUM, label="all")
    steady = counts * np.log(counts)
    axes.loglog(counts, total[-1] * steady / steady[-1], ":", color="black", label="n log n")
    axes.set_xlabel("points")
    axes.set_ylabel("s")
    axes.legend(frameon=False)
    return figure
