"""Surfaces as a page to turn and zoom: points by class, height, intensity or error, grids of heights, triangles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.study import page
from openecho.surface import files, terrain
from openecho.surface.points import CLASSES, GROUND, HIGH, LOW, READERS, UNCLASSIFIED, read
from openecho.tables.table import TableError

try:
    from plotly import graph_objects as go
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "plotly is not installed, expected it: pip install 'openecho[study]'", name="plotly"
    ) from error

Floats = NDArray[np.float64]

MOST = 200_000
"""Points, or heights of a grid, that are drawn at most: more make no picture clearer, and browsers slow."""

MOST_FACES = 500_000
"""Triangles that a browser takes."""

COLOURS = {UNCLASSIFIED: "#5a9e4b", GROUND: "#a5713c", LOW: "#d62728", HIGH: "#7b3fa0"}
"""Of the classes of `openecho.surface.points.CLASSES`, in the order in which a scale of colours has them."""

LIKELY = (2, 98)
"""Percentiles between which colours change."""


@dataclass(frozen=True)
class Shown:
    """What a file has to show.

    Attributes
    ----------
    trace : plotly trace
    told : str
        What it is.
    corner : float64 (2,)
        East and north from which its coordinates count, m: a browser's are too short for those of a map.
    key : str
        What plotly calls the trace's colours.
    looks : dict
        Name to colours and their scale, as plotly takes them, the first of which is shown at first.
    """

    trace: Any
    told: str
    corner: Floats
    key: str
    looks: dict[str, dict[str, Any]]


def write(source: Path, output: Path, *, truth: Path | None = None, most: int = MOST) -> str:
    """Write a page that shows a file.

    Parameters
    ----------
    source : Path
        Points of `openecho.surface.points.read`, a GeoTIFF of heights, or triangles, .ply.
    output : Path
        .html; complete or not at all, and in need of nothing else.
    truth : Path, optional
        GeoTIFF of the heights that the file should have, by which it can then be coloured.
    most : int
        Points, or heights of a grid, at most.

    Returns
    -------
    str
        What it shows.

    Raises
    ------
    TableError
        If the file can't be shown: what was found and what was expected.
    OSError
        If it can't be read, or the page not be written.
    """
    suffix = source.suffix.casefold()
    if suffix not in DRAWN:
        raise TableError(f"{source}: found suffix {source.suffix!r}, expected one of {', '.join(DRAWN)}")
    shown = DRAWN[suffix](source, truth, most)
    lead = f"{shown.told}. Turn with the mouse, zoom with its wheel."
    page.write(output, source.name, lead, [page.Section("", "", [("surface", drawn(shown))])])
    return shown.told


def drawn(shown: Shown) -> go.Figure:
    """Figure of what a file has to show, with a menu of its colours."""
    restyled = [{_key(shown, name): value for name, value in look.items()} for look in shown.looks.values()]
    figure = go.Figure(shown.trace)
    figure.update_traces({name.replace(".", "_"): value for name, value in restyled[0].items()})
    east, north = (f"{axis} of {origin:.0f} m" for axis, origin in zip(("east", "north"), shown.corner, strict=True))
    figure.update_layout(
        scene={"aspectmode": "data", "xaxis_title": east, "yaxis_title": north, "zaxis_title": "m"},
        height=800,
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
    )
    if len(restyled) > 1:
        buttons = [
            {"label": name, "method": "restyle", "args": [{key: [value] for key, value in look.items()}]}
            for name, look in zip(shown.looks, restyled, strict=True)
        ]
        figure.update_layout(updatemenus=[{"buttons": buttons, "x": 0, "xanchor": "left", "y": 1, "yanchor": "top"}])
    return figure


def _key(shown: Shown, name: str) -> str:
    """What plotly calls a property of a trace's colours."""
    return shown.key if name == "color" else shown.key.rpartition(".")[0] + "." * ("." in shown.key) + name


def _points(source: Path, truth: Path | None, most: int) -> Shown:
    cloud = read(source)
    known = np.flatnonzero(np.isfinite(cloud.places).all(axis=1))
    if not len(known):
        raise TableError(f"{source}: found {len(cloud.points)} echoes, none with a position, expected some")
    if len(known) > most:  # at random: every third of a scan would be stripes
        known = np.sort(np.random.default_rng(0).choice(known, most, replace=False))
    points, places = cloud.points[known], cloud.places[known]
    looks = {}
    if (points["class"] != points["class"][0]).any():
        looks["class"] = _classes(points["class"])
    looks |= _looks(places, truth)
    if np.isfinite(points["intensity"]).any():
        looks["intensity"] = _scaled(points["intensity"].astype(np.float64), "Cividis", "counts")
    kinds = [CLASSES.get(int(kind), f"class {kind}") for kind in points["class"]]
    axes, corner = _axes(places)
    trace = go.Scatter3d(**axes, mode="markers", marker={"size": 2}, text=kinds, hoverinfo="x+y+z+text")
    return Shown(trace, f"{len(points)} of {len(cloud.points)} points", corner, "marker.color", looks)


def _grid(source: Path, truth: Path | None, most: int) -> Shown:
    heights, grid, _ = files.read_grid(source)
    step = max(1, int(np.ceil(np.sqrt(heights.size / most))))
    z = heights[::step, ::step]
    if min(z.shape) < 2 or not np.isfinite(z).any():
        known = np.isfinite(z).sum()
        raise TableError(f"{source}: found {z.shape[0]} × {z.shape[1]} heights, {known} known, expected more")
    x, y = np.meshgrid(*(places[::step] for places in grid.centres))
    places = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    axes, corner = _axes(places)
    looks = {name: look | {"color": look["color"].reshape(z.shape)} for name, look in _looks(places, truth).items()}
    trace = go.Surface(x=axes["x"][: z.shape[1]], y=axes["y"][:: z.shape[1]], z=axes["z"].reshape(z.shape))
    return Shown(trace, f"{z.shape[0]} × {z.shape[1]} of {heights.size} heights", corner, "surfacecolor", looks)


def _mesh(source: Path, truth: Path | None, _: int) -> Shown:
    corners, faces = files.read_mesh(source)
    if not 0 < len(faces) <= MOST_FACES:
        raise TableError(f"{source}: found {len(faces)} triangles, expected 1 to {MOST_FACES}")
    axes, corner = _axes(corners)
    trace = go.Mesh3d(**axes, **dict(zip("ijk", faces.T, strict=True)), flatshading=True)
    return Shown(trace, f"{len(faces)} triangles", corner, "intensity", _looks(corners, truth))


DRAWN: Mapping[str, Callable[[Path, Path | None, int], Shown]] = {
    **dict.fromkeys(READERS, _points),
    **dict.fromkeys((".tif", ".tiff"), _grid),
    ".ply": _mesh,
}
"""What draws which suffix."""


def _axes(places: Floats) -> tuple[dict[str, NDArray[np.float32]], Floats]:
    """Coordinates (n, 3) as a browser takes them, and from where they count."""
    corner = np.floor(places[:, :2].min(axis=0))
    local = places - np.append(corner, 0)
    return {axis: local[:, k].astype(np.float32) for k, axis in enumerate("xyz")}, corner


def _looks(places: Floats, truth: Path | None) -> dict[str, dict[str, Any]]:
    """Colours by height, and by what that is off."""
    looks = {"height": _scaled(places[:, 2], "Viridis", "m")}
    if truth is None:
        return looks
    heights, grid, _ = files.read_grid(truth)
    error = places[:, 2] - terrain.heights_at(heights, grid, places)
    if not np.isfinite(error).any():
        raise TableError(f"{truth}: found no height where there is something to show, expected some")
    return looks | {"error": _scaled(error, "RdBu", "m off", around=True)}


def _scaled(values: Floats, scale: str, title: str, *, around: bool = False) -> dict[str, Any]:
    """Colours of a scale; around 0, or from the lowest to the highest of likely values."""
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, LIKELY)
    if around:
        high = max(abs(low), abs(high)) or 1.0
        low = -high
    look = {
        "cmin": float(low),
        "cmax": float(high),
        "colorscale": scale,
        "colorbar": {"title": {"text": title}, "tickvals": None, "ticktext": None},
    }
    return {"color": values.astype(np.float32), **look}


def _classes(classes: NDArray[np.uint8]) -> dict[str, Any]:
    """Colours of the classes that there are; any other is as what is above the ground."""
    kinds = np.where(np.isin(classes, list(COLOURS)), classes, UNCLASSIFIED)
    order = [kind for kind in COLOURS if kind in kinds]
    edges = np.repeat(np.arange(len(order) + 1) / len(order), 2)[1:-1]
    colours = [COLOURS[kind] for kind in order for _ in range(2)]
    return {
        "color": np.argmax(kinds[:, None] == order, axis=1).astype(np.float32),
        "cmin": -0.5,
        "cmax": len(order) - 0.5,
        "colorscale": [[float(edge), colour] for edge, colour in zip(edges, colours, strict=True)],
        "colorbar": {
            "tickvals": list(range(len(order))),
            "ticktext": [CLASSES[kind] for kind in order],
            "title": {"text": ""},
        },
    }
