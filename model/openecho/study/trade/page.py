"""The page of the trade-off: every way to decompose a waveform, what it costs and how well it does."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from plotly.graph_objects import Figure, Scatter
from plotly.subplots import make_subplots

from openecho.study import page
from openecho.study.trade.picture import (
    DASHES,
    GROUPS,
    LAND,
    MOST_TICKS,
    Content,
    chosen,
    front,
    grid,
    names,
    number,
    pick,
    results,
    shade,
    ticks,
)
from openecho.study.trade.ways import FIXED, FLOATING

SPEED, AREA, BITS, CLOSE = "speed", "area", "bits", ("grids-found", "grids-peak")
"""Ids of the figures' elements."""


@dataclass(frozen=True)
class Quantity:
    """What can be asked of a way on a set.

    Attributes
    ----------
    label, title : str
        In the menu and, with its unit, on the axis.
    keys : tuple of str
        Where it is in a row of ``accuracy``.
    more : bool
        Whether more of it is better; such a share has a linear axis that shows per cent.
    log : bool
        Whether the axis is logarithmic.
    """

    label: str
    title: str
    keys: tuple[str, ...]
    more: bool = False
    log: bool = True


FOUND = Quantity("echoes found", "echoes found", ("detected",), more=True, log=False)

QUANTITIES = (
    Quantity("peak / bound", "RMS error of the peak / Cramér–Rao bound", ("peak", "bound")),
    Quantity("peak", "RMS error of the peak, bins", ("peak", "rms")),
    Quantity("centre", "RMS error of the centre, bins", ("centre", "rms")),
    Quantity("width", "RMS error of the width, bins", ("width", "rms")),
    Quantity("amplitude", "RMS error of the amplitude, counts", ("amplitude", "rms")),
    Quantity("range", "RMS error of the range, m", ("range", "rms")),
    FOUND,
    Quantity("spurious echoes", "spurious echoes a waveform", ("spurious_per_waveform",), log=False),
)
"""In the order of the menu; the first is shown first."""

ERRORS = {"peak": "bins", "centre": "bins", "width": "bins", "amplitude": "counts", "range": "m"}
"""Quantities that have an RMS, a 95th percentile, a bias and perhaps a bound, with their units."""

COSTS = {
    "lut": "LUT",
    "ff": "FF",
    "dsp": "DSP",
    "bram36": "BRAM36",
    "path_ns": "longest path, ns",
    "fmax_mhz": "estimated clock, MHz",
    "cycles_per_waveform": "cycles a waveform",
    "latency_cycles": "latency, cycles",
    "waveforms_per_s": "waveforms/s",
    "simulated_per_s": "in simulation, 1/s",
    "software_per_s": "in software, 1/s",
}
"""What a way costs and how fast it is, as the table heads it."""

GRIDS = {
    "separation": "separation of two echoes, σ",
    "snr": "height / deviation of the noise",
    "width": "width, σ in bins",
    "ratio": "ratio of two heights",
}
"""What is varied, by the axis's title."""

SNRS = (20, 200)
"""Heights over the noise in the figure of FRAC."""

BITS_NAMED = re.compile(r"\bFRAC (\d+)$")
"""How the fixed-point ways that differ in nothing but FRAC are named."""

FEW_TICKS = 5
"""On an axis where numbers stand beside each other, or of a low panel."""

PLOTLY_DASHES = dict(zip(DASHES, ("solid", "dash", "dot", "dashdot"), strict=True))

LOOK: Mapping[str, Any] = {
    "template": "simple_white",
    "hoverlabel": {"align": "left", "bgcolor": "white", "font": {"size": 12, "color": "#222"}},
    "dragmode": False,  # a finger that drags scrolls the page
}
"""Of all figures."""


def write(content: Content, path: Path) -> None:
    """Write the page, complete or not at all.

    Parameters
    ----------
    content : mapping
        Of the report ``trade``.
    path : Path

    Raises
    ------
    ModuleNotFoundError
        If plotly is not installed.
    OSError
        If the file can't be written.
    """
    machine = content["machine"]
    count = {kind: sum(each["kind"] == kind for each in content["sets"]) for kind in ("scene", "grid", "recorded")}
    lead = (
        f"{len(content['ways'])} ways to decompose lidar waveforms, each on {count['scene']} simulated scenes, "
        f"{count['recorded']} sets of recorded waveforms and {count['grid']} points of four grids: "
        "how fast, how large, how accurate."
    )
    tools = ", ".join(f"{name} {version}" for name, version in content["tools"].items())
    quick = " A quick run: few waveforms, nothing synthesised." if content["quick"] else ""
    note = (
        f"{content['date']}, seed {content['seed']}, {machine['processor']}, {machine['cores']} cores; {tools}.{quick}"
    )
    sections = (*_first(content), *_figures(content), *_tables(content), _notes())
    page.write(path, "Speed, area and accuracy", lead, sections, note)


def _first(content: Content) -> Iterable[page.Section]:
    """What most came for."""
    yield page.Section("In short", "", (page.ranked(content["claims"]),))
    rows = ((each["need"], each["way"], each["because"]) for each in content["advice"])
    yield page.Section("Which one should I use?", "", (page.table(("I need", "take", "because"), rows, prose=True),))


def _figures(content: Content) -> Iterable[page.Section]:
    yield page.Section(
        "Speed against error",
        "A marker is a way; right is faster, and the line is the Pareto front: no way is both faster and better than "
        "one on it. Point at a marker, or tap it, for all its figures. The menus choose the data and what is compared. "
        "The core's speed is that at its estimated clock, that of software is on one core of this machine. Only ways "
        "of which both numbers are known are shown; recorded waveforms have no bound, as nobody knows their truth.",
        ((SPEED, _pareto(content, "waveforms_per_s", "waveforms a second", more=True)),),
    )
    yield page.Section(
        "Area against error",
        "The same for the core alone: left is smaller.",
        ((AREA, _pareto(content, "lut", "LUT", more=False)),),
    )
    yield page.Section(
        "How many fractional bits?",
        "Error of the peak against the bits after the binary point of a position, in multiples of what the noise alone "
        "allows. Where a curve is level, more bits change nothing. Dashes at the right are the floating-point formats.",
        ((BITS, _bits(content)),),
    )
    yield page.Section(
        "Where each way gives up",
        "One thing is varied at a time. First the share of echoes found, then the error of the peak. Click a name to "
        "hide or show its curve, twice to see it alone; those in grey are hidden.",
        ([(name, _grids(content, which)) for name, which in zip(CLOSE, (FOUND, QUANTITIES[0]), strict=True)],),
    )


def _pareto(content: Content, cost: str, title: str, *, more: bool) -> Figure:
    """Every way's cost against a quantity on a set, with a menu of sets and one of quantities.

    Menus of plotly know nothing of each other. So there are traces of all quantities: one menu shows those of one
    quantity, and the other gives all of them another set's numbers.
    """
    sets = [each["name"] for each in content["sets"] if each["kind"] != "grid"]
    sets.sort(key=lambda name: name != LAND)
    shown = {name: _numbers(content, name, cost, more=more) for name in sets}
    costs = ticks((way[cost] for way in content["ways"]), FEW_TICKS)
    axes = {which.label: _axis(which, _all(content, sets, which)) for which in QUANTITIES}
    drawn = Figure([_trace(place, which, more=more) for which in QUANTITIES for place in range(len(GROUPS) + 2)])
    for trace, numbers in zip(drawn.data, shown[sets[0]], strict=True):
        trace.update(numbers)
    drawn.update_layout(
        **LOOK,
        height=640,
        margin={"l": 60, "r": 15, "t": 100, "b": 60},
        legend={"orientation": "h", "yanchor": "top", "y": -0.14, "x": 0},
        xaxis={"type": "log", "title": {"text": title}, "showgrid": True, **_ticks(costs)},
        # Where a set has no numbers of a quantity a sentence stands in the middle, on axes of its own.
        xaxis2={"overlaying": "x", "range": [0, 1], "visible": False, "fixedrange": True},
        yaxis2={"overlaying": "y", "range": [0, 1], "visible": False, "fixedrange": True},
        yaxis={"showgrid": True, **axes[QUANTITIES[0].label]},
        updatemenus=[_menu(58, _sets(shown)), _menu(8, _quantities(axes))],
    )
    return drawn


def _trace(place: int, which: Quantity, *, more: bool) -> Scatter:
    """Trace without numbers: of a group's markers, of the front, or of the sentence where there are no numbers."""
    look: dict[str, Any] = {"visible": which is QUANTITIES[0]}
    if place == len(GROUPS):
        # Up, then right where more is better: beyond a point's own speed the least error is the next one's.
        line = {"color": "#444", "width": 1, "shape": "vh" if more else "hv"}
        return Scatter(mode="lines", name="Pareto front", hoverinfo="skip", line=line, **look)
    if place > len(GROUPS):
        return Scatter(mode="text", xaxis="x2", yaxis="y2", showlegend=False, hoverinfo="skip", **look)
    group, style = list(GROUPS.items())[place]
    marker = {"color": style.color, "symbol": style.symbol, "size": 11, "line": {"color": "white", "width": 1}}
    return Scatter(mode="markers", name=group, marker=marker, hovertemplate="%{text}<extra></extra>", **look)


def _numbers(content: Content, name: str, cost: str, *, more: bool) -> list[dict[str, Any]]:
    """What a set gives each of `_trace`: coordinates and texts."""
    rows, numbers = results(content), []
    texts = {way["name"]: _hover(way, rows.get((way["name"], name)), name) for way in content["ways"]}
    for which in QUANTITIES:
        points = []
        for way in content["ways"]:
            error = pick(rows.get((way["name"], name)), *which.keys)
            # Neither cost nor error has a place on a logarithmic axis if it is 0.
            if way[cost] and error is not None and (error > 0 or not which.log):
                points.append((way["group"], way[cost], error, texts[way["name"]]))
        groups = [[point[1:] for point in points if point[0] == group] for group in GROUPS]
        numbers += [_columns(each) for each in groups]
        best = front([p[1] for p in points], [p[2] for p in points], more_x=more, more_y=which.more)
        # One point that is nowhere, not none: plotly complains of axes without any.
        line = {key: [points[i][place] for i in best] or [None] for place, key in ((1, "x"), (2, "y"))}
        numbers.append(line | {"text": []})
        numbers.append({"x": [0.5], "y": [0.5], "text": ["" if points else f"not known of {_shown(name)}"]})
    return numbers


def _columns(points: Sequence[tuple[float, float, str]]) -> dict[str, Any]:
    return {key: [point[place] for point in points] for place, key in enumerate(("x", "y", "text"))}


def _hover(way: Mapping[str, Any], row: Mapping[str, Any] | None, name: str) -> str:
    """Everything that is known of a way, with its errors on a set."""
    lines = [f"<b>{_shown(way['name'])}</b> · {_shown(way['group'])}"]
    lines += [f"{head}: {_cost(way[key])}" for key, head in COSTS.items() if way[key] is not None]
    lines.append(f"<b>{_shown(name)}</b>: {_share(pick(row, 'detected'))} found, {_spurious(row)} spurious a waveform")
    lines += [f"{key}, {unit}: {_error(row, key)}" for key, unit in ERRORS.items()]
    return "<br>".join(lines)


def _sets(shown: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """Entries of the menu of sets."""
    return [
        {
            "label": _shown(name),
            "method": "restyle",
            "args": [{key: [each[key] for each in numbers] for key in ("x", "y", "text")}],
        }
        for name, numbers in shown.items()
    ]


def _all(content: Content, sets: Sequence[str], which: Quantity) -> list[float | None]:
    """A quantity of all ways on some sets."""
    rows = results(content)
    return [pick(rows.get((way["name"], name)), *which.keys) for way in content["ways"] for name in sets]


def _quantities(axes: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Entries of the menu of quantities, each with its axis."""
    traces = [which for which in QUANTITIES for _ in range(len(GROUPS) + 2)]
    return [
        {
            "label": which.label,
            "method": "update",
            "args": [
                {"visible": [each is which for each in traces]},
                {f"yaxis.{key}": value for key, value in axes[which.label].items()},
            ],
        }
        for which in QUANTITIES
    ]


def _axis(which: Quantity, values: Iterable[float | None], most: int = MOST_TICKS) -> dict[str, Any]:
    """Attributes of an axis that depend on the quantity and on its values."""
    look = {"type": "log", **_ticks(ticks(values, most))} if which.log else {"type": "linear", "tickmode": "auto"}
    percent = {"tickformat": ".0%" if which.more else ""}
    return look | percent | {"title": {"text": which.title}, "autorange": True}


def _ticks(values: Sequence[float]) -> dict[str, Any]:
    return {"tickmode": "array", "tickvals": values, "ticktext": [number(value) for value in values]}


def _menu(above: int, entries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """A menu so many pixels above the figure: beside each other two have no room on a phone."""
    place = {"x": 0, "xanchor": "left", "y": 1, "yanchor": "bottom", "pad": {"b": above, "l": 0}}
    return {**place, "buttons": entries, "bgcolor": "white", "font": {"size": 13}}


def _bits(content: Content) -> Figure:
    """Error of the peak against FRAC, with a dash for each floating-point format."""
    rows = results(content)
    fixed = {int(found[1]): name for name in names(content, FIXED) if (found := BITS_NAMED.search(name))}
    floating = names(content, FLOATING)
    bits = sorted(fixed)
    beyond = [max(bits, default=0) + 4 * (1 + place) for place in range(len(floating))]
    curves = {f"height {value} × noise": _snr(content, value) for value in SNRS} | {"land": LAND}
    drawn = Figure()
    for (label, name), color in zip(curves.items(), ("#e08214", "#c0392b", "#1f4e79"), strict=True):
        look: dict[str, Any] = {
            "name": label,
            "legendgroup": label,
            "line": {"color": color},
            "marker": {"color": color},
        }
        errors = [pick(rows.get((fixed[each], name)), "peak", "bound") for each in bits]
        drawn.add_scatter(x=bits, y=errors, mode="lines+markers", **look)
        errors = [pick(rows.get((each, name)), "peak", "bound") for each in floating]
        look["marker"] = {"color": color, "symbol": "line-ew-open", "size": 14, "line": {"width": 3}}
        texts = [_shown(each) for each in floating]
        hover = "%{text}: %{y:.4g}<extra></extra>"
        drawn.add_scatter(x=beyond, y=errors, text=texts, mode="markers", showlegend=False, hovertemplate=hover, **look)
    labels = [*map(str, bits), *(_shown(name.removeprefix("core ")) for name in floating)]
    drawn.update_layout(
        **LOOK,
        height=460,
        margin={"l": 60, "r": 15, "t": 20, "b": 60},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.02, "x": 0},
        xaxis={"title": {"text": "FRAC, bits"}, "tickvals": bits + beyond, "ticktext": labels},
        yaxis={"showgrid": True, **_axis(QUANTITIES[0], [each for trace in drawn.data for each in trace.y])},
    )
    return drawn


def _snr(content: Content, value: float) -> str:
    """The set of a height over the noise; nothing where there is none."""
    return next((str(each["name"]) for each in grid(content, "snr") if each["value"] == value), "")


def _grids(content: Content, which: Quantity) -> Figure:
    """A panel for each grid, a curve for each way; those that are not `chosen` wait in the legend."""
    rows, few = results(content), chosen(content)
    drawn = make_subplots(len(GRIDS), 1, vertical_spacing=0.08)
    for way in sorted(content["ways"], key=lambda way: way["name"] not in few):
        name = way["name"]
        for row, key in enumerate(GRIDS, 1):
            points = grid(content, key)
            drawn.add_scatter(
                x=[each["value"] for each in points],
                y=[pick(rows.get((name, each["name"])), *which.keys) for each in points],
                mode="lines+markers",
                name=_shown(name),
                legendgroup=name,
                showlegend=row == 1,
                visible=True if name in few else "legendonly",
                **_curve(content, way, few),
                row=row,
                col=1,
            )
    for row, (key, title) in enumerate(GRIDS.items(), 1):
        values = [each["value"] for each in grid(content, key)]
        scale = {} if key in ("separation", "width") else {"type": "log", **_ticks(values)}
        drawn.update_xaxes(title={"text": title, "standoff": 5}, **scale, row=row)
        axis = _axis(which, _all(content, [each["name"] for each in grid(content, key)], which), FEW_TICKS)
        # The label, as the title is longer than a panel is high.
        drawn.update_yaxes(**axis | {"title": {"text": which.label}}, showgrid=True, row=row)
    if which.more:
        drawn.update_yaxes(range=[-0.03, 1.03], autorange=False)
    drawn.update_layout(
        **LOOK,
        height=1350,
        margin={"l": 60, "r": 10, "t": 35, "b": 60},
        legend={"orientation": "h", "yanchor": "top", "y": -0.06, "x": 0, "groupclick": "togglegroup"},
    )
    return drawn


def _curve(content: Content, way: Mapping[str, Any], few: Sequence[str]) -> dict[str, Any]:
    """Line and marker of a way: its group's, in a shade of its own; first those that are shown at once."""
    members = sorted(names(content, way["group"]), key=lambda name: name not in few)
    place, style = members.index(way["name"]), GROUPS[way["group"]]
    color = shade(style.color, place, len(members))
    marker = {"color": color, "symbol": style.symbol, "size": 7}
    if way["name"] in few[:1]:
        # The core lies below float64's, which finds the same: only the broadest can be seen there.
        return {"line": {"color": color, "width": 6}, "marker": marker | {"size": 11}, "opacity": 0.5}
    return {"line": {"color": color, "dash": PLOTLY_DASHES[DASHES[place % len(DASHES)]]}, "marker": marker}


def _tables(content: Content) -> Iterable[page.Section]:
    """All numbers."""
    head = ("way", "group", *COSTS.values())
    costs = [(way["name"], way["group"], *(_cost(way[key]) for key in COSTS)) for way in content["ways"]]
    text = (
        "Waveforms/s is at the estimated clock for the core, and on one core of this machine for software. Of the core "
        "there are two more speeds: of its RTL in simulation, and of its bit-exact model in software on one core."
    )
    yield page.Section("All ways and what they cost", text, (page.table(head, costs),))
    yield page.Section(
        "All errors",
        "Errors are RMS (95th percentile; bias; RMS as a multiple of the Cramér–Rao bound where it is known). "
        "Click a set to see its table.",
        [_errors(content, each) for each in content["sets"] if each["kind"] != "grid"],
    )
    yield _paper(content)


def _errors(content: Content, each: Mapping[str, Any]) -> str:
    """Table of a set."""
    rows, body = results(content), []
    for way in content["ways"]:
        row = rows.get((way["name"], each["name"]))
        found = _share(pick(row, "detected")), _spurious(row)
        body.append((way["name"], *found, *(_error(row, key) for key in ERRORS)))
    head = ("way", "found", "spurious a waveform", *(f"{key}, {unit}" for key, unit in ERRORS.items()))
    title = f"{each['name']}: {each['kind']}, {each['waveforms']:,} waveforms, {each['echoes']:,} echoes"
    return page.folded(title, page.table(head, body), unfolded=each["name"] == LAND)


def _paper(content: Content) -> page.Section:
    """The paper's times beside ours."""
    paper, machine = content["paper"], content["machine"]
    times = [(label, number(ms), number(1000 / ms if ms else None)) for label, ms in paper["rows"]]
    ratios = [(whose, number(ratio, 4)) for whose, ratio in paper["ratios"].items()]
    return page.Section(
        "Beside the paper",
        "The paper's two times are its own, on a PC and an FPGA that we do not have. Our software's is on one core of "
        f"{machine['processor']}; our core's is that of its cycles at its estimated clock, not of a board.",
        (
            page.table(("", "ms a waveform", "waveforms a second"), times),
            page.table(("", "times as fast as software"), ratios),
        ),
    )


def _notes() -> page.Section:
    return page.Section(
        "What is not here",
        "Energy a waveform is not estimated: no open tool has a power model of the xc7, and the counters of this "
        "machine's processor can't be read.",
    )


def _shown(text: str) -> str:
    """Text that plotly shows as it is: it takes some of HTML, in names too."""
    return escape(text, quote=False)


def _cost(value: float | Sequence[float] | None) -> str:
    """A number, or the two ends of a range."""
    return "–".join(map(number, value)) if isinstance(value, Sequence) else number(value)


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"


def _spurious(row: Mapping[str, Any] | None) -> str:
    return number(pick(row, "spurious_per_waveform"), 2)


def _error(row: Mapping[str, Any] | None, key: str) -> str:
    """RMS, 95th percentile, bias and multiple of the bound."""
    rms, p95, bias, bound = (pick(row, key, kind) for kind in ("rms", "p95", "bias", "bound"))
    if rms is None:
        return "–"
    multiple = "" if bound is None else f"; {number(bound)}×"
    return f"{number(rms)} ({number(p95, 2)}; {number(bias, 2)}{multiple})"
