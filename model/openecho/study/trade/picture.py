"""The picture of the trade-off: speed against error on land, and what is found of two echoes close to each other.

What it shares with `openecho.study.trade.page`, which shows the same numbers: how groups look, which ways are shown
where there is no room for all, what a set's numbers are, and the Pareto front.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from adjustText import adjust_text
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator, PercentFormatter
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from openecho.study.figure import CURVATURE, FILTERED, FOUND, RAW, SUM
from openecho.study.trade.ways import FIT, FIXED, FLOATING, SOFTWARE, TAPS, USUAL

FloatArray = NDArray[np.float64]
Content = Mapping[str, Any]


@dataclass(frozen=True)
class Style:
    """How a group's ways are drawn.

    Attributes
    ----------
    color : str
    marker, symbol : str
        The same to matplotlib and to plotly.
    """

    color: str
    marker: str
    symbol: str


GROUPS: Mapping[str, Style] = {
    FIXED: Style(FOUND, "o", "circle"),
    FLOATING: Style(SUM, "s", "square"),
    TAPS: Style(FILTERED, "D", "diamond"),
    SOFTWARE: Style(RAW, "^", "triangle-up"),
    FIT: Style(CURVATURE, "v", "triangle-down"),
}
"""Of each group, in the order in which they are listed."""

LAND = "land"
"""The scene that is shown first."""

FITS = ("gaussian", "laser", "vl")
"""Fits of `chosen`, by a word of their names."""

DASHES = ("-", "--", ":", "-.")
"""Of the ways of one group, in turn."""

SCALES = (
    (1, 1.1, 1.2, 1.35, 1.5, 1.65, 1.8, 2, 2.2, 2.5, 2.8, 3.2, 3.6, 4, 4.5, 5, 5.6, 6.3, 7, 8, 9),
    (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 7),
    (1, 1.5, 2, 3, 5, 7),
    (1, 2, 5),
    (1,),
)
"""What may be written at each decade of a logarithmic axis, from much to little."""

MOST_TICKS = 10
"""On an axis as high as a picture."""

ROOM = 30
"""Times the greatest speed up to where the axis goes, so that there is room for the names of the many cores."""

HEAP = 12
"""Pixels between markers that are listed together: they are as wide as that."""

WHOLE_FROM = 1000
"""Numbers from here on are shown without decimals."""


def number(value: float | None, digits: int = 3) -> str:
    """A number in so many significant digits, or a dash for what isn't known."""
    if value is None:
        return "–"
    return f"{value:,.0f}" if abs(value) >= WHOLE_FROM else f"{value:.{digits}g}"


def results(content: Content) -> dict[tuple[str, str], Mapping[str, Any]]:
    """Rows of ``accuracy`` by way and set."""
    return {(row["way"], row["set"]): row for row in content["accuracy"]}


def pick(row: Mapping[str, Any] | None, *keys: str) -> float | None:
    """A number within a row, or None where it, or what it is in, isn't known."""
    value: Any = row
    for key in keys:
        if value is None:
            return None
        value = value.get(key)
    return None if value is None or not math.isfinite(value) else float(value)


def names(content: Content, group: str) -> list[str]:
    """Ways of a group."""
    return [way["name"] for way in content["ways"] if way["group"] == group]


def chosen(content: Content) -> list[str]:
    """The ways to compare where there is no room for all: the core, its sharpest taps, float64 in software, three fits.

    The sharpest taps are those that find the most of two echoes over all separations.
    """
    rows = results(content)
    apart = [each["name"] for each in grid(content, "separation")]

    def found(way: str) -> float:
        return sum(pick(rows.get((way, name)), "detected") or 0 for name in apart)

    sharpest = max(names(content, TAPS), key=found, default=None)
    candidates = [
        _with(names(content, FIXED), USUAL),
        sharpest,
        _with(names(content, SOFTWARE), "float64"),
        *(_with(names(content, FIT), word) for word in FITS),
    ]
    return list(dict.fromkeys(name for name in candidates if name is not None))


def _with(candidates: Iterable[str], word: str) -> str | None:
    """The first name with a word in it, whatever its case and hyphens."""
    plain = str.maketrans("", "", "-–")
    return next((name for name in candidates if word.casefold() in name.casefold().translate(plain)), None)


def grid(content: Content, name: str) -> list[Mapping[str, Any]]:
    """Sets of a grid by ascending value."""
    return sorted((each for each in content["sets"] if each.get("grid") == name), key=lambda each: float(each["value"]))


def front(x: Sequence[float], y: Sequence[float], *, more_x: bool, more_y: bool) -> list[int]:
    """Pareto front: the points that none is better than in one quantity and at least as good as in the other.

    Parameters
    ----------
    x, y : sequences of float
    more_x, more_y : bool
        Whether more of it is better, not less.

    Returns
    -------
    list of int
        Indices by ascending x.
    """
    cost_x = -np.asarray(x) if more_x else np.asarray(x)
    cost_y = -np.asarray(y) if more_y else np.asarray(y)
    best, kept = math.inf, []
    for index in np.lexsort((cost_y, cost_x)):
        if cost_y[index] < best:
            best = float(cost_y[index])
            kept.append(int(index))
    return kept[::-1] if more_x else kept


def ticks(values: Iterable[float | None], most: int) -> list[float]:
    """Ticks of a logarithmic axis for such values: as many as may be, where a decade would have one or a dozen.

    Parameters
    ----------
    values : iterable of float or None
        What the axis has to hold; what is not positive does not count.
    most : int
        Ticks within the values.

    Returns
    -------
    list of float
        Also beyond the values, where an axis with a margin shows some of them.
    """
    known = [value for value in values if value is not None and value > 0]
    low, high = min(known, default=1.0), max(known, default=1.0)
    decades = range(math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 2)
    for digits in SCALES:
        made = [digit * 10.0**decade for decade in decades for digit in digits]
        if sum(low <= each <= high for each in made) <= most:
            return made
    return [10.0**decade for decade in decades]


def shade(color: str, place: int, count: int) -> str:
    """A group's colour for one of its ways: the first has it, the last is half as far from white."""
    part = 0.5 * place / max(count - 1, 1)
    channels = (int(color[start : start + 2], 16) for start in (1, 3, 5))
    return "#" + "".join(f"{round(each + part * (255 - each)):02x}" for each in channels)


def draw(content: Content) -> Figure:
    """Draw the picture.

    Parameters
    ----------
    content : mapping
        Of the report ``trade``.

    Returns
    -------
    Figure
        Left: waveforms a second against the RMS of the peak on land, a marker for each way of which both are known.
        Right: the share of echoes found against the separation of two, for the ways of `chosen`.
    """
    drawn = Figure(figsize=(12, 5.8), dpi=120, layout="constrained")
    speed, close = drawn.subplots(1, 2, width_ratios=(1.45, 1))
    points = _speed(speed, content)
    _close(close, content)
    drawn.draw_without_rendering()  # the layout, which names are placed by, is made only then
    _label(speed, points)
    return drawn


def _speed(axes: Axes, content: Content) -> list[tuple[float, float, str]]:
    """Left panel without names; where they belong."""
    rows, points = results(content), []
    for group, style in GROUPS.items():
        members = [way for way in content["ways"] if way["group"] == group]
        both = [(w["waveforms_per_s"], pick(rows.get((w["name"], LAND)), "peak", "bound"), w["name"]) for w in members]
        known = [(float(x), y, name) for x, y, name in both if x and y]
        x, y = [point[0] for point in known], [point[1] for point in known]
        axes.plot(x, y, style.marker, color=style.color, ms=7, mec="white", mew=0.6, ls="", label=group, zorder=3)
        points += known
    if points:
        x, y, _ = map(list, zip(*points, strict=True))
        best = front(x, y, more_x=True, more_y=False)
        # Up, then right: beyond a point's own speed the least error is the next one's.
        steps = np.repeat([x[i] for i in best], 2)[:-1], np.repeat([y[i] for i in best], 2)[1:]
        axes.plot(*steps, color="black", lw=1.0, alpha=0.7, label="Pareto front", zorder=2)
        axes.set(xscale="log", yscale="log")  # which axes with nothing on them can't be
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
        axes.yaxis.set_major_locator(FixedLocator(ticks(y, MOST_TICKS)))
        axes.yaxis.set_minor_locator(NullLocator())
    axes.set(xlabel="waveforms a second", title="speed against error on land")
    axes.set_ylabel("RMS error of the peak / Cramér–Rao bound")
    axes.margins(0.12)
    if points:
        axes.set_xlim(right=ROOM * max(x for x, _, _ in points))
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False, ncols=3, fontsize=9)
    return points


def _close(axes: Axes, content: Content) -> None:
    """Right panel."""
    rows, apart = results(content), grid(content, "separation")
    groups = {way["name"]: way["group"] for way in content["ways"]}
    drawn: list[str] = []
    for name in chosen(content):
        group, style = groups[name], GROUPS[groups[name]]
        place = drawn.count(group)
        values = [each["value"] for each in apart]
        shares = [pick(rows.get((name, each["name"])), "detected") for each in apart]
        # None is a gap of the curve, as nan is.
        share = np.array(shares, np.float64)
        look: dict[str, Any] = {"ls": DASHES[place % len(DASHES)], "color": shade(style.color, place, len(FITS))}
        if not drawn:
            # The core lies below float64's, which finds the same: only the broadest can be seen there.
            look |= {"lw": 4, "ms": 8, "alpha": 0.5}
        axes.plot(values, share, marker=style.marker, label=_plain(name), **({"ms": 5} | look))
        drawn.append(group)
    axes.yaxis.set_major_formatter(PercentFormatter(1))
    axes.set(xlabel="separation of two echoes, σ", ylabel="echoes found", ylim=(-0.03, 1.03))
    axes.set_title("two echoes close to each other")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False, ncols=2, fontsize=9)


def _plain(text: str) -> str:
    """Text in which a dollar is a dollar: two of them would be matplotlib's mathematics."""
    return text.replace("$", r"\$")


def _label(axes: Axes, points: Sequence[tuple[float, float, str]]) -> None:
    """Write names beside their points, one for those that lie on one another, where they cover nothing."""
    places = axes.transData.transform([(x, y) for x, y, _ in points]) if points else np.empty((0, 2))
    near = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) < HEAP
    count, heap = connected_components(near, directed=False)
    texts = []
    for each in range(count):
        members = [points[i] for i in np.flatnonzero(heap == each).tolist()]
        x, y, _ = members[0]
        texts.append(axes.text(x, y, _plain(shortened([name for _, _, name in members])), fontsize=8))
    adjust_text(
        texts,
        [x for x, _, _ in points],
        [y for _, y, _ in points],
        ax=axes,
        expand=(1.05, 1.4),
        ensure_inside_axes=True,
        iter_lim=2000,
        arrowprops={"arrowstyle": "-", "color": "#909090", "lw": 0.6},
    )


def shortened(names: Sequence[str]) -> str:
    """Names of ways that lie on one another, a line each; of those that only count on, the first and the last."""
    stems = [name.rstrip("0123456789") for name in names]
    lines = []
    for stem in dict.fromkeys(stems):
        same = [name for name, own in zip(names, stems, strict=True) if own == stem]
        lines.append(same[0] if len(same) == 1 else f"{same[0]} to {same[-1].removeprefix(stem)}")
    return "\n".join(lines)
