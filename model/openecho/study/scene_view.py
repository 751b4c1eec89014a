"""The picture of a scene: its heights from above, beams from the side, and waveforms with the truth about them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LightSource, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec, GridSpecFromSubplotSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from numpy.typing import NDArray

from openecho.compiled import share
from openecho.scene.geometry.flight import Beams, beams
from openecho.scene.geometry.trace import crowns
from openecho.scene.geometry.world import HIGHEST, Built, build
from openecho.scene.profile import probe
from openecho.scene.returns import distance
from openecho.scene.schema import Platform, Raster, Scene, Zigzag
from openecho.scene.simulate import BLOCK, Simulator, simulate, simulator
from openecho.study.figure import FILTERED, FOUND, RAW, SUM

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAVES, GROUND = "#4f7a32", "#8c7355"

RASTER = 300
"""Points along the longer side of the map."""

DOTS, LINES, PROFILE = 2000, 50, 800
"""Beams on the map and in the side view, and points of its surface."""

LONGEST, NARROWEST, FEWEST = 6.0, 20.0, 12
"""Of the flight that is shown: swaths, metres that a narrower swath is taken for, and the least shots."""

SQUARE = 1.5
"""The map's longer side over the other; at least, so that there is something around the beams."""

FAR = 1e6
"""m: from where all that is on the map is within reach of one beam."""

FAINT, CLEAR = 0.01, 0.03
"""Shares of a waveform's energy below which an object is not told of, and from which on a waveform is chosen for it."""

BRIGHT = 0.02
"""Share of a waveform's greatest height from which on it is shown."""

LEAST_HEIGHT = 10.0
"""m, that the side view shows: flat ground is to look flat."""

COLUMNS = 4
"""Waveforms beside one another."""

COLOURS = ListedColormap(colormaps["gist_earth"](np.linspace(0.42, 0.95, 256)), "heights")
"""Of heights: the part of the map that is land."""

EMPTY = "nothing below the beams"

BADGE: dict[str, Any] = {
    "color": "white",
    "fontsize": 8,
    "fontweight": "bold",
    "zorder": 6,
    "bbox": {"boxstyle": "circle,pad=0.25", "fc": FOUND, "ec": "white", "lw": 0.8},
}
"""Of the number of a waveform."""


class Box(NamedTuple):
    """Part of the ground, m."""

    west: float
    south: float
    east: float
    north: float


@dataclass(frozen=True)
class Relief:
    """Heights seen from above.

    Attributes
    ----------
    box : Box
        That the cells fill.
    top : float64 (ny, nx)
        Of the highest thing in the middle of each cell, leaves or solid, m; NaN where there is none. Rows from south to
        north, columns from west to east.
    cell : float
        Side of a cell, m.
    """

    box: Box
    top: Floats
    cell: float


@dataclass(frozen=True)
class Chosen:
    """A waveform that is shown.

    Attributes
    ----------
    waveform : int
        Its number in the scene.
    samples, noiseless : (m,)
        Counts, as recorded and without noise.
    place : float64 (3,)
        Where its beam is at the last sample, m.
    truth : `openecho.scene.simulate.TRUTH` (k,)
        Objects that sent back at least a share `FAINT` of its energy.
    """

    waveform: int
    samples: NDArray[np.uint16]
    noiseless: NDArray[np.float32]
    place: Floats
    truth: np.ndarray

    @property
    def clear(self) -> int:
        """Objects that sent back at least a share `CLEAR` of its energy."""
        return int(np.count_nonzero(self.truth["energy"] >= CLEAR * self.truth["energy"].sum()))


def draw(scene: Scene, count: int) -> Figure:
    """Draw a scene: map, side view, and waveforms.

    Parameters
    ----------
    scene : Scene
    count : int
        Waveforms, at most.

    Returns
    -------
    Figure

    Raises
    ------
    SceneError
        As of `openecho.scene.simulate.simulator`.
    """
    ready = simulator(scene)
    shown = stretch(ready)
    waveforms = choose(ready, shown, count)
    chart = _charted(ready, shown)
    rows = -(-len(waveforms) // COLUMNS)
    figure = Figure(figsize=(12, 5 + 2.7 * rows), layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08))
    outer = GridSpec(2, 1, figure, height_ratios=[5, 2.7 * rows])
    pair = GridSpecFromSubplotSpec(1, 2, outer[0], width_ratios=[chart.share, 1 - chart.share])
    _map(figure.add_subplot(pair[0]), ready, chart, waveforms)
    halves = GridSpecFromSubplotSpec(2, 1, pair[1], height_ratios=[1, 2.4], hspace=0.04)
    lower = figure.add_subplot(halves[1])
    slices = [_sliced(ready, shown, one.waveform) for one in waveforms]
    best = max(range(len(slices)), key=lambda i: slices[i].relief)
    _side(figure.add_subplot(halves[0], sharex=lower), lower, ready, slices[best], best + 1)
    panels = GridSpecFromSubplotSpec(rows, min(len(waveforms), COLUMNS), outer[1])
    for number, chosen in enumerate(waveforms):
        _waveform(figure.add_subplot(panels[divmod(number, COLUMNS)]), scene, number + 1, chosen)
    _legend(figure, any(target.kind in ("tree", "stand") for target in scene.targets))
    figure.suptitle(scene.description, fontsize=13)
    return figure


def stretch(ready: Simulator) -> tuple[int, int]:
    """First of the shots that are shown, and how many: of a long flight a part, lest its swath become a line."""
    scene = ready.scene
    middle = _thinned(scene, scene.shots // 2, max(min(_period(scene), scene.shots - scene.shots // 2), 1), DOTS)
    place, radius = _places(ready, beams(scene, middle))
    swath = max(float(np.ptp(place[:, :2], axis=0).max() + 4 * radius.max()), NARROWEST)
    forward = scene.platform.speed / scene.laser.rate
    most = LONGEST * swath / forward if forward else math.inf
    count = scene.shots if most >= scene.shots else min(max(int(most), FEWEST), scene.shots)
    return (scene.shots - count) // 2, count


def choose(ready: Simulator, shown: tuple[int, int], count: int) -> list[Chosen]:
    """Waveforms from all over some shots: of each part of them the one that met the most objects.

    Parameters
    ----------
    ready : Simulator
    shown : (int, int)
        First shot, and how many.
    count : int
        Waveforms, at most.

    Returns
    -------
    list of Chosen
        At least one, in order.
    """
    scene = ready.scene
    found = [one for first, shots in _runs(scene, shown, count) for one in _simulated(ready, first, shots)]
    within = [one for one in found if shown[0] <= one.waveform // scene.beams < sum(shown)]
    edges = np.linspace(0, len(within), min(count, len(within)) + 1).astype(int)
    chosen: list[Chosen] = []
    for first, last in pairwise(edges):
        part = _from_the_middle(within[first:last])
        most = max(one.clear for one in part)
        # One object less, if it is still several, for not showing the same tree again.
        rich = [one for one in part if one.clear >= (max(most - 1, min(most, 2)) if chosen else most)]
        chosen.append(max(rich, key=lambda one: _apart(one, chosen)))
    return chosen


def relief(scene: Scene, box: Box) -> Relief:
    """Heights of a scene's targets, from above, whether its beams reach them or not."""
    built = build(_in_reach(scene, box))
    cell = max(box.east - box.west, box.north - box.south) / RASTER
    columns, rows = (max(math.ceil(side / cell - 1e-6), 1) for side in (box.east - box.west, box.north - box.south))
    x, y = box.west + (np.arange(columns) + 0.5) * cell, box.south + (np.arange(rows) + 0.5) * cell
    top, _ = from_above(built, np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    filled = Box(box.west, box.south, box.west + columns * cell, box.south + rows * cell)
    return Relief(filled, top.reshape(rows, columns), cell)


def from_above(built: Built, place: Floats) -> tuple[Floats, Floats]:
    """Heights at some places.

    Parameters
    ----------
    built : Built
    place : float64 (n, 2)
        x and y, m.

    Returns
    -------
    top, solid : float64 (n,)
        Of the highest thing, and of the highest that is not leaves, m; NaN where there is none.
    """
    origin = np.column_stack([place, np.full(len(place), HIGHEST)])
    first, solid = _met(built, origin, np.broadcast_to([0.0, 0.0, -1.0], origin.shape))
    return _known(HIGHEST - first), _known(HIGHEST - solid)


def _met(built: Built, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Ranges where rays (n, 3) meet the first thing, and the first that is not leaves, m; infinite where nothing."""
    n, caster = len(origin), built.caster
    ranges, triangle = caster.nearest(origin, np.ascontiguousarray(direction))
    target = caster.target[triangle] if len(caster.target) else triangle
    triangles = tuple(column[:, None] for column in (ranges, np.ones(n), target, np.zeros(n, np.int64)))
    first, solid = np.empty(n), np.empty((n, 1))
    rest = np.empty((n, 1)), np.empty((n, 1)), np.empty((n, 1, 2), np.int64)
    aim = np.ascontiguousarray(direction)[:, None]
    share(probe, n, built.world, np.ascontiguousarray(origin), aim, triangles, solid, *rest, first)
    return first, solid[:, 0]


def _known(heights: Floats) -> Floats:
    return np.where(np.isfinite(heights), heights, np.nan)


def _places(ready: Simulator, beam: Beams) -> tuple[Floats, Floats]:
    """Where beams meet the first thing, or else the level z = 0, (n, 3), and their footprints' radii there, m."""
    first, _ = _met(ready.built, beam.origin, beam.direction)
    away = np.where(np.isfinite(first), first, distance(ready.instrument, beam))
    return beam.origin + away[:, None] * beam.direction, ready.instrument.radius(away) * away


def _period(scene: Scene) -> int:
    """Shots of a line, or half a swing; 1 without a scan."""
    scan = scene.platform.scan
    if scan is None or isinstance(scan, Raster):
        return 1
    return max(round(scene.laser.rate / scan.rate / (2 if isinstance(scan, Zigzag) else 1)), 1)


def _thinned(scene: Scene, first: int, count: int, most: int) -> Ints:
    """Some of consecutive shots, from all over them, and without a rhythm that might be the scan's."""
    most = max(most // scene.beams, 1)
    if count <= most:
        return np.arange(first, first + count)
    if _period(scene) == 1 or count <= _period(scene):
        return first + np.linspace(0, count - 1, most).round().astype(np.int64)
    turn = np.mod(np.arange(most) * (math.sqrt(5) - 1) / 2, 1)
    return np.unique(first + (turn * count).astype(np.int64))


def _runs(scene: Scene, shown: tuple[int, int], count: int) -> list[tuple[int, int]]:
    """First shot and shots of what is simulated: all if that is one block, as it is recorded; or short runs."""
    if scene.shots * scene.beams <= BLOCK:
        return [(0, scene.shots)]
    first, shots = shown
    runs = max(min(count, shots, BLOCK // scene.beams), 1)
    size = max(min(BLOCK // scene.beams, shots) // runs, 1)
    starts = first + ((np.arange(runs) + 0.5) * shots / runs - size / 2).astype(np.int64)
    return [(int(start), size) for start in starts]


def _simulated(ready: Simulator, first: int, shots: int) -> list[Chosen]:
    """All waveforms of some shots."""
    made = simulate(ready, first, shots)
    numbers = first * ready.scene.beams + np.arange(len(made.samples))
    edges = np.searchsorted(made.truth["waveform"], [numbers, numbers + 1])
    found = []
    for row, (number, begin, end) in enumerate(zip(numbers, *edges, strict=True)):
        truth = made.truth[begin:end]
        told = truth[truth["energy"] >= FAINT * truth["energy"].sum()]
        found.append(Chosen(int(number), made.samples[row], made.noiseless[row], made.last[row], told))
    return found


def _from_the_middle(part: list[Chosen]) -> list[Chosen]:
    """Those in the middle first, which are taken where all are alike."""
    middle = (len(part) - 1) / 2
    return [part[i] for i in sorted(range(len(part)), key=lambda i: abs(i - middle))]


def _apart(one: Chosen, others: list[Chosen]) -> float:
    """Distance from the nearest of others, m, in whole ones, so that rounding decides nothing; 0 without others."""
    return min((float(np.linalg.norm(one.place - other.place).round()) for other in others), default=0.0)


def _in_reach(scene: Scene, box: Box) -> Scene:
    """The scene from so far above that one beam reaches all of a box: what is out of reach is not built."""
    west, south, east, north = box
    platform = Platform.model_construct(altitude=FAR, speed=0.0, start=((west + east) / 2, (south + north) / 2))
    # A footprint to each side, and one for turbulence, are in reach.
    laser = scene.laser.model_copy(update={"divergence": max(east - west, north - south) / FAR})
    return scene.model_copy(update={"platform": platform, "laser": laser, "shots": 1})


def _around(place: Floats, radius: Floats) -> Box:
    """Ground around some places, not narrower than it may be."""
    least = (place[:, :2] - 2 * radius[:, None]).min(axis=0)
    most = (place[:, :2] + 2 * radius[:, None]).max(axis=0)
    half = 0.52 * np.maximum(most - least, (most - least).max() / SQUARE)
    middle = (least + most) / 2
    west, south, east, north = (float(edge) for edge in (*(middle - half), *(middle + half)))
    return Box(west, south, east, north)


@dataclass(frozen=True)
class _Chart:
    """What the map shows.

    Attributes
    ----------
    land : Relief
    box : Box
        The part of it where there is something.
    place : float64 (n, 3)
        Where beams hit, m.
    note : str
        Which shots they are, if not all.
    """

    land: Relief
    box: Box
    place: Floats
    note: str

    @property
    def share(self) -> float:
        """Of the picture's width that the map takes."""
        west, south, east, north = self.box
        return min(max(0.1 + 0.3 * (east - west) / (north - south), 0.25), 0.5)


def _charted(ready: Simulator, shown: tuple[int, int]) -> _Chart:
    scene = ready.scene
    place, radius = _places(ready, beams(scene, _thinned(scene, *shown, DOTS)))
    land = relief(scene, _around(place, radius))
    note = f"shots {shown[0]} to {sum(shown) - 1} of {scene.shots}" if shown[1] < scene.shots else ""
    return _Chart(land, _filled(land, place), place[:: -(-len(place) // DOTS)], note)


def _map(axes: Axes, ready: Simulator, chart: _Chart, waveforms: list[Chosen]) -> None:
    """Heights from above, where beams hit, and the footprints of the waveforms."""
    box, x, y = chart.box, chart.place[:, 0], chart.place[:, 1]
    _shade(axes, chart.land, box)
    axes.scatter(x, y, s=1.2, color="black", alpha=0.6, lw=0)
    upright = np.ptp(x) >= np.ptp(y)
    for number, chosen in enumerate(waveforms, 1):
        place, radius = _places(ready, _beam(ready.scene, chosen.waveform))
        spot = float(place[0, 0]), float(place[0, 1])
        axes.add_patch(Circle(spot, float(radius[0]), ec=FOUND, fc="none", lw=1.3))
        up, aside = _beside(number, spot[1], box.south, box.north), _beside(number, spot[0], box.west, box.east)
        # Two and two side by side, for where several are at one place.
        turn = -10.0 + 22 * ((number - 1) // 2 % 3)
        _number(axes, number, spot, (turn, 32.0 * up) if upright else (32.0 * aside, turn))
    axes.set(aspect="equal", xlabel="x (east), m", ylabel="y (north), m")
    axes.set_xlim(box.west, box.east)
    axes.set_ylim(box.south, box.north)
    axes.set_title(chart.note, fontsize=9)


def _filled(land: Relief, place: Floats) -> Box:
    """What there is of a map: heights and beams."""
    known, box = np.isfinite(land.top), land.box
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return box
    (west, south), (east, north) = place[:, :2].min(axis=0), place[:, :2].max(axis=0)
    edge = 0.03 * max(box.east - box.west, box.north - box.south)
    return Box(
        min(box.west + columns[0] * land.cell, max(west - edge, box.west)),
        min(box.south + rows[0] * land.cell, max(south - edge, box.south)),
        max(box.west + (columns[-1] + 1) * land.cell, min(east + edge, box.east)),
        max(box.south + (rows[-1] + 1) * land.cell, min(north + edge, box.north)),
    )


def _beside(number: int, at: float, low: float, high: float) -> int:
    """To which side of a place its number is written: in turns, but not over the map's edge."""
    share = (at - low) / (high - low)
    if 0.25 < share < 0.75:
        return 1 if number % 2 else -1
    return 1 if share <= 0.25 else -1


def _shade(axes: Axes, land: Relief, box: Box) -> None:
    """Heights in colours, lit from the north-west; of the part in `box`, beside which the colours are told."""
    known = np.isfinite(land.top)
    if not known.any():
        axes.text(0.5, 0.5, EMPTY, transform=axes.transAxes, ha="center", va="center", color=RAW)
        return
    low, high = float(np.nanmin(land.top)), float(np.nanmax(land.top))
    room = max(0.5 - (high - low) / 2, 0)
    norm = Normalize(low - room, high + room)
    colours = _lit(np.where(known, land.top, low), land.cell, norm)
    colours[~known] = 1.0
    west, south, east, north = land.box
    axes.imshow(colours, extent=(west, east, south, north), origin="lower", interpolation="bilinear")
    # As an inset it is as high as the map, whatever that is cut to.
    wide = 0.03 * max(box.east - box.west, box.north - box.south) / (box.east - box.west)
    bar = axes.figure.colorbar(ScalarMappable(norm, COLOURS), cax=axes.inset_axes((1 + wide, 0, wide, 1)))
    bar.set_label("height, m")


def _lit(top: Floats, cell: float, norm: Normalize) -> Floats:
    """Colours (ny, nx, 4) of heights."""
    if min(top.shape) < 2:
        return np.asarray(COLOURS(norm(top)))
    steep = float(np.percentile(np.hypot(*np.gradient(top, cell)), 90))
    # Gentle ground is drawn steeper, walls less steep, so that both have a lit and a dark side.
    steeper = min(max(0.7 / steep, 0.3), 8) if steep > 0 else 1.0
    light = LightSource(azdeg=315, altdeg=45)
    # Negative, for it takes the first row for the northern one.
    return np.asarray(light.shade(top, COLOURS, norm, "soft", vert_exag=steeper, dx=cell, dy=-cell))


def _number(axes: Axes, number: int, spot: tuple[float, float], off: tuple[float, float]) -> None:
    """The number of a waveform, beside a place by some points."""
    arrow = {"arrowstyle": "-", "color": FOUND, "lw": 1.1, "shrinkA": 0, "shrinkB": 0}
    axes.annotate(
        str(number), spot, off, textcoords="offset points", ha="center", va="center", arrowprops=arrow, **BADGE
    )


def _beam(scene: Scene, waveform: int) -> Beams:
    """That of a waveform."""
    shot, number = divmod(waveform, scene.beams)
    return _only(beams(scene, np.array([shot])), np.array([number]))


def _only(beam: Beams, rows: Ints) -> Beams:
    return Beams(beam.waveform[rows], beam.time[rows], beam.origin[rows], beam.direction[rows])


def _line(scene: Scene, shown: tuple[int, int], waveform: int) -> Beams:
    """Beams beside that of a waveform: of its row of an array, its line of a scan, or of the flight."""
    scan, (shot, number) = scene.platform.scan, divmod(waveform, scene.beams)
    if scan is None:
        return beams(scene, _thinned(scene, *shown, DOTS))
    if isinstance(scan, Raster):
        row, column = divmod(number, scan.columns)
        across = row * scan.columns + np.arange(scan.columns)
        along = column + scan.columns * np.arange(scan.rows)
        return _only(beams(scene, np.array([shot])), across if scan.columns >= scan.rows else along)
    period = scene.laser.rate / scan.rate / (2 if isinstance(scan, Zigzag) else 1)
    line = math.floor(shot / period)
    first, last = math.ceil(line * period), min(math.ceil((line + 1) * period), scene.shots)
    return beams(scene, _thinned(scene, first, max(last - first, 1), DOTS))


@dataclass(frozen=True)
class _Slice:
    """Beams in an upright plane, about.

    Attributes
    ----------
    way : str
        How the plane stands to the flight: across or along.
    leave, at : float64 (n,)
        Where beams leave the platform and where they end, in the plane, m.
    origin, hit, end : float64 (n, 3)
        The same in the scene, and what each meets first, NaN for nothing, m.
    own : int
        Row of the beam that the others are beside.
    """

    way: str
    leave: Floats
    at: Floats
    origin: Floats
    hit: Floats
    end: Floats
    own: int

    @property
    def relief(self) -> float:
        """Between the lowest and the highest that is met, m, to a millimetre; 0 if nothing is."""
        heights = self.hit[np.isfinite(self.hit[:, 2]), 2]
        return round(float(np.ptp(heights)), 3) if len(heights) else 0.0


def _sliced(ready: Simulator, shown: tuple[int, int], waveform: int) -> _Slice:
    """Beams beside that of a waveform, and where they end: at what is solid, behind all leaves."""
    beam, heading = _line(ready.scene, shown, waveform), ready.scene.platform.heading
    first, solid = _met(ready.built, beam.origin, beam.direction)
    away = np.where(np.isfinite(solid), solid, distance(ready.instrument, beam))
    end = beam.origin + away[:, None] * beam.direction
    sine, cosine = math.sin(heading), math.cos(heading)
    ways = {"across": np.array([cosine, -sine]), "along": np.array([sine, cosine])}
    way = max(ways, key=lambda name: float(np.ptp(end[:, :2] @ ways[name])))
    middle = beam.origin[len(beam.origin) // 2, :2]
    leave, at = ((places[:, :2] - middle) @ ways[way] for places in (beam.origin, end))
    hit = beam.origin + _known(first)[:, None] * beam.direction
    return _Slice(way, leave, at, beam.origin, hit, end, int(np.argmax(beam.waveform == waveform)))


def _side(upper: Axes, lower: Axes, ready: Simulator, cut: _Slice, number: int) -> None:
    """Platform above, and below it what beams hit; heights out of scale."""
    low, high = _surface(lower, ready.built, cut)
    some = np.unique(np.linspace(0, len(cut.at) - 1, LINES).round().astype(int))
    ends = np.stack(
        [np.stack([cut.leave, cut.origin[:, 2]], axis=1), np.stack([cut.at, cut.end[:, 2]], axis=1)], axis=1
    )
    for axes in (upper, lower):
        axes.add_collection(LineCollection(list(ends[some]), color=FILTERED, lw=0.6, alpha=0.5), autolim=False)
        axes.add_collection(LineCollection([ends[cut.own]], color=FOUND, lw=1.2), autolim=False)
    met = cut.at + (cut.leave - cut.at) * (cut.hit[:, 2] - ends[:, 1, 1]) / (ends[:, 0, 1] - ends[:, 1, 1])
    lower.plot(met[some], cut.hit[some, 2], ".", color=FILTERED, ms=4, zorder=4)
    _number(lower, number, (float(cut.at[cut.own]), float(cut.end[cut.own, 2])), (0, -14))
    # Of a scan's line, the platform is in one place as far as the eye can tell.
    still = cut.way == "across"
    leave = cut.leave[cut.own : cut.own + 1] if still else cut.leave[some]
    upper.plot(leave, np.full(len(leave), cut.origin[0, 2]), "o-", color="black", ms=7 if still else 3, clip_on=False)
    upper.set_title(f"beams around waveform {number}; heights in two scales", fontsize=9)
    _broken(upper, lower, low, high, ready.scene.platform.altitude)
    both = np.concatenate([cut.at, cut.leave])
    edge = max(0.03 * float(np.ptp(both)), 1.0)
    lower.set_xlim(both.min() - edge, both.max() + edge)
    lower.set_xlabel(f"{cut.way} the flight, m")
    lower.set_ylabel("height, m")


def _surface(axes: Axes, built: Built, cut: _Slice) -> tuple[float, float]:
    """Ground and crowns below a line of beams; the least and the greatest height that is shown."""
    order = np.argsort(cut.at, kind="stable")
    x = np.linspace(cut.at.min(), cut.at.max(), PROFILE)
    path = np.column_stack([np.interp(x, cut.at[order], cut.end[order, axis]) for axis in (0, 1)])
    top, solid = from_above(built, path)
    heights = np.concatenate([top, solid, cut.hit[:, 2]])
    heights = heights[np.isfinite(heights)]
    if not len(heights):
        axes.text(0.5, 0.5, EMPTY, transform=axes.transAxes, ha="center", va="center", color=RAW)
    least, most = (heights.min(), heights.max()) if len(heights) else (0.0, 0.0)
    room = max(float(most - least), LEAST_HEIGHT)
    low, high = float(least) - 0.2 * room, float(least) + 1.15 * room
    for column, base, crest in _crowns(built, path, solid):
        axes.fill_between(x[column], base, crest, color=LEAVES, alpha=0.4, lw=0)
    axes.fill_between(x, solid, low - room, color=GROUND, alpha=0.35, lw=0)
    axes.plot(x, solid, color=GROUND, lw=1.2)
    return low, high


def _crowns(built: Built, path: Floats, solid: Floats) -> Iterator[tuple[Ints, Floats, Floats]]:
    """Of each crown above a path: places of it, and the heights where it begins and ends there."""
    world = built.world
    trees = len(world.crowns)
    tables = world.crowns, world.frame, world.cells, world.members
    seen, which = np.full(trees, -1), np.empty(trees, np.int64)
    enters, leaves = np.empty(trees), np.empty(trees)
    far = np.where(np.isfinite(solid), HIGHEST - solid, 2 * HIGHEST)
    rows = []
    for i, (x, y) in enumerate(path):
        count = crowns(*tables, x, y, HIGHEST, 0.0, 0.0, -1.0, far[i], i, seen, enters, leaves, which)
        rows.append(np.stack([np.full(count, i), which[:count], leaves[:count], enters[:count]], axis=1))
    found = np.concatenate(rows)
    for tree in np.unique(found[:, 1]):
        column, _, base, crest = found[found[:, 1] == tree].T
        yield column.astype(np.int64), HIGHEST - base, HIGHEST - crest


def _broken(upper: Axes, lower: Axes, low: float, high: float, altitude: float) -> None:
    """One axis of heights in two scales."""
    lower.set_ylim(low, high)
    top = max(altitude, high)
    upper.set_ylim(high, top + 0.12 * max(top - high, 1.0))
    upper.spines[["bottom", "right", "top"]].set_visible(False)
    lower.spines[["top", "right"]].set_visible(False)
    upper.tick_params(bottom=False, labelbottom=False)
    upper.set_yticks([altitude], [f"{altitude:.6g} m" if altitude < 10_000 else f"{altitude / 1000:.6g} km"])
    slash = [(-1.0, -0.6), (1.0, 0.6)]
    for axes, end in ((upper, 0), (lower, 1)):
        axes.plot([0], [end], transform=axes.transAxes, marker=slash, ms=9, mew=1, color="black", clip_on=False)


def _waveform(axes: Axes, scene: Scene, number: int, chosen: Chosen) -> None:
    """Recorded samples, what they are without noise, and what the beam met."""
    x = np.arange(len(chosen.samples))
    axes.plot(x, chosen.samples, ".", color=RAW, ms=3)
    axes.plot(x, chosen.noiseless, color=SUM, lw=1.3)
    first, last = _window(chosen)
    axes.set_xlim(first, last)
    seen = chosen.samples[(x >= first) & (x <= last)].astype(float)
    low, high = float(seen.min()), float(max(seen.max(), chosen.noiseless.max()))
    room = max(high - low, 1.0)
    axes.set_ylim(low - 0.36 * room, high + 0.08 * room)
    _truth(axes, scene, chosen.truth)
    shot, beam = divmod(chosen.waveform, scene.beams)
    axes.set_title(f"shot {shot}" + (f", beam {beam}" if scene.beams > 1 else ""), fontsize=9)
    axes.text(0.97, 0.91, str(number), transform=axes.transAxes, ha="center", va="center", **BADGE)
    axes.set_xlabel("bin")
    axes.set_ylabel("counts" if number % COLUMNS == 1 else "")


def _window(chosen: Chosen) -> tuple[float, float]:
    """First and last bin to show: the signal and a margin; all of a waveform without one."""
    height = chosen.noiseless - chosen.noiseless.min()
    bright = np.flatnonzero(height > BRIGHT * height.max())
    if not len(bright):
        return 0, len(height) - 1
    edge = max(15.0, 0.15 * float(np.ptp(bright)))
    return max(float(bright[0]) - edge, 0), min(float(bright[-1]) + edge, len(height) - 1)


def _truth(axes: Axes, scene: Scene, truth: np.ndarray) -> None:
    """A tick for each object, and the kind of target at the brightest of each."""
    low, high = axes.get_ylim()
    colours = np.where(np.isnan(truth["incidence"]), LEAVES, FOUND)
    foot, tall = low + 0.02 * (high - low), low + 0.1 * (high - low)
    axes.vlines(truth["bin"], foot, tall, colors=list(colours), lw=1.3)
    kinds = np.array([scene.targets[target].kind for target in truth["target"]])
    brightest = [int(np.argmax(np.where(kinds == kind, truth["energy"], -1.0))) for kind in dict.fromkeys(kinds)]
    near, before = 0.2 * float(np.ptp(axes.get_xlim())), -math.inf
    level = 0
    for one in sorted(brightest, key=lambda row: float(truth["bin"][row])):
        level = 1 - level if truth["bin"][one] - before < near else 0
        before = float(truth["bin"][one])
        up = tall + (0.01 + 0.065 * level) * (high - low)
        axes.text(before, up, kinds[one], color=colours[one], fontsize=8, ha="center", va="bottom", clip_on=True)


def _legend(figure: Figure, leaves: bool) -> None:
    """Below all panels."""
    tick: dict[str, Any] = {"marker": "|", "ls": "none", "ms": 9, "mew": 1.5}
    handles = [
        Line2D([], [], color="black", marker=".", ls="none", ms=3, label="beams"),
        Line2D([], [], color=FOUND, marker="o", mfc="none", ls="none", ms=6, label="footprints of the waveforms"),
        Line2D([], [], color=RAW, marker=".", ls="none", ms=5, label="recorded"),
        Line2D([], [], color=SUM, lw=1.3, label="without noise"),
        Line2D([], [], color=FOUND, label="surfaces met", **tick),
        *([Line2D([], [], color=LEAVES, label="leaves met", **tick)] if leaves else []),
    ]
    figure.legend(handles=handles, loc="outside lower center", frameon=False, fontsize=8, ncols=len(handles))
