"""The page and the picture of the trade-off, of made-up numbers, and the page in a real browser."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page

from openecho.study import page as pages
from openecho.study.trade import page, picture
from tests import browser

TAGGED = "core <b>bold</b> & $x$"
"""A name that is HTML, and mathematics to matplotlib, if nobody takes care."""

WAYS = {
    "core FRAC 4": "core, fixed point",
    "core FRAC 16": "core, fixed point",
    "core float16": "core, floating point",
    TAGGED: "core, floating point",
    "taps blunt": "core, other taps",
    "taps sharp": "core, other taps",
    "float64 software": "inflections in software",
    "Gaussian fit": "fit",
    "laser template": "fit",
    "V–L": "fit",
    "speed unknown": "fit",
}

SHARES = {"taps sharp": 0.9}
"""Share of echoes found; of all others it is a half."""

UNKNOWN = {("Gaussian fit", "land"), ("V–L", "ocean"), ("core FRAC 4", "snr 200")}
"""Of which there are no errors."""

GRIDS = {"snr": (20, 200), "width": (2, 8), "separation": (1, 2, 4), "ratio": (1, 8)}


def ways() -> Iterator[dict[str, Any]]:
    costs = ("lut", "ff", "dsp", "bram36", "path_ns", "fmax_mhz", "cycles_per_waveform", "simulated_per_s")
    for place, (name, group) in enumerate(WAYS.items()):
        rtl = group.startswith("core")
        way: dict[str, Any] = {"name": name, "group": group}
        way |= dict.fromkeys(costs, 1000.0 + 100 * place if rtl else None)
        way["latency_cycles"] = [13, 44] if rtl else None
        way["waveforms_per_s"] = None if name == "speed unknown" else (150_000.0 if rtl else 900.0) * 0.8**place
        yield way | {"software_per_s": 900.0}


def sets() -> Iterator[dict[str, Any]]:
    size = {"waveforms": 400, "echoes": 1800}
    yield from ({"name": name, "kind": "scene", **size} for name in ("ocean", "land"))
    for grid, values in GRIDS.items():
        yield from ({"name": f"{grid} {v}", "kind": "grid", "grid": grid, "value": float(v), **size} for v in values)
    yield {"name": "recorded a1", "kind": "recorded", **size}


def row(way: str, each: dict[str, Any], place: int) -> dict[str, Any]:
    rms = None if (way, each["name"]) in UNKNOWN else 1 + 0.1 * place
    bound = None if each["kind"] == "recorded" else rms
    error = {"rms": rms, "p95": rms, "bias": rms, "bound": bound}
    quantities: dict[str, Any] = dict.fromkeys(("peak", "centre", "width", "amplitude"), error)
    quantities["range"] = None if each["kind"] == "grid" else error
    return {
        "way": way,
        "set": each["name"],
        "detected": SHARES.get(way, 0.5),
        "spurious_per_waveform": 0.0,
    } | quantities


@pytest.fixture(scope="module")
def content() -> dict[str, Any]:
    return {
        "tools": {"python": "3.11.7"},
        "seed": 0,
        "quick": False,
        "date": "2026-11-23",
        "machine": {"processor": "a processor", "cores": 2},
        "ways": list(ways()),
        "sets": list(sets()),
        "accuracy": [row(name, each, place) for place, name in enumerate(WAYS) for each in sets()],
        "paper": {"rows": [["the paper, FPGA", 0.041], ["ours", 0.0067]], "ratios": {"the paper": 292.0, "ours": 15.0}},
        "advice": [{"need": "the smallest core", "way": TAGGED, "because": "so few LUT"}],
        "claims": [f"claim {number}" for number in range(5)],
    }


@pytest.fixture(scope="module")
def path(content: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("trade") / "trade.html"
    page.write(content, path)
    return path


@pytest.fixture
def visit(path: Path) -> Iterator[browser.Visit]:
    with browser.opened(path) as visit:
        yield visit


def points(shown: Page, figure: str = page.SPEED) -> int:
    return shown.locator(f"#{figure} path.point").count()


def expected(content: dict[str, Any], name: str, *keys: str) -> int:
    """Ways of which the speed and a number on a set are known."""
    rows = picture.results(content)
    known = {way["name"] for way in content["ways"] if way["waveforms_per_s"]}
    return sum(picture.pick(rows[way, name], *keys) is not None for way in known)


def choose(shown: Page, menu: int, entry: str) -> None:
    figure = shown.locator(f"#{page.SPEED}")
    figure.locator(".updatemenu-header").nth(menu).click()
    figure.locator(".updatemenu-dropdown-button", has_text=entry).first.click()
    # The figure is there at once, but its menu fades away.
    figure.locator(".updatemenu-dropdown-button").first.wait_for(state="detached")


def hover(shown: Page, group: str, place: int) -> str:
    """What is said of a group's marker when the mouse is on it."""
    style = list(picture.GROUPS).index(group)
    marker = shown.locator(f"#{page.SPEED} .scatterlayer .trace.scatter:has(path.point)").nth(style)
    box = marker.locator("path.point").nth(place).bounding_box()
    assert box is not None
    shown.mouse.move(0, 0)
    shown.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, steps=3)
    said = shown.locator(f"#{page.SPEED} .hoverlayer .hovertext")
    said.first.wait_for()
    return said.first.text_content() or ""


def test_page_shows_every_way_and_needs_nothing_else(content: dict[str, Any], visit: browser.Visit) -> None:
    shown = visit.page
    assert points(shown) == expected(content, "land", "peak", "bound") == len(WAYS) - 2
    assert points(shown, page.AREA) == sum(way["lut"] is not None for way in content["ways"])
    assert shown.locator("ol li").all_text_contents() == content["claims"]
    for figure in (page.BITS, *page.CLOSE):
        assert points(shown, figure) > 0
    assert visit.complaints == []


def test_hover_tells_the_name_as_it_is_and_all_numbers(visit: browser.Visit) -> None:
    visit.page.locator(f"#{page.SPEED}").scroll_into_view_if_needed()
    said = hover(visit.page, "core, floating point", 1)
    assert TAGGED in said
    assert "LUT: 1,300" in said
    assert "latency, cycles: 13–44" in said
    assert "land: 50.0 % found" in said
    assert "peak, bins: 1.3 (1.3; 1.3; 1.3×)" in said
    assert visit.complaints == []


def test_names_are_text_in_tables_and_legends(visit: browser.Visit) -> None:
    assert visit.page.locator("td b").count() == 0
    assert visit.page.locator("td", has_text=TAGGED).count() >= len(picture.GROUPS)
    legend = visit.page.locator(f"#{page.CLOSE[0]} .legendtext").all_text_contents()
    assert sorted(legend) == sorted(WAYS)


def test_menus_change_set_and_quantity_independently(content: dict[str, Any], visit: browser.Visit) -> None:
    shown = visit.page
    shown.locator(f"#{page.SPEED}").scroll_into_view_if_needed()
    title = shown.locator(f"#{page.SPEED} .ytitle")
    choose(shown, 0, "ocean")
    assert points(shown) == expected(content, "ocean", "peak", "bound")
    assert "ocean: 50.0 % found" in hover(shown, "fit", 0)
    choose(shown, 1, "echoes found")
    assert title.text_content() == "echoes found"
    assert points(shown) == expected(content, "ocean", "detected") == len(WAYS) - 1
    choose(shown, 0, "recorded a1")
    assert title.text_content() == "echoes found"
    assert "recorded a1: 50.0 % found" in hover(shown, "fit", 0)
    choose(shown, 1, "peak / bound")
    assert points(shown) == expected(content, "recorded a1", "peak", "bound") == 0
    assert shown.locator(f"#{page.SPEED} .textpoint").text_content() == "not known of recorded a1"
    assert visit.complaints == []


def test_page_fits_a_phone(content: dict[str, Any], path: Path) -> None:
    with browser.opened(path, 400, 800) as visit:
        assert visit.page.evaluate("document.documentElement.scrollWidth") == 400
        assert points(visit.page) == expected(content, "land", "peak", "bound")
        assert visit.complaints == []


def test_quick_run_without_synthesis_has_a_page_and_a_picture(content: dict[str, Any], tmp_path: Path) -> None:
    quick = copy.deepcopy(content) | {"quick": True}
    for way in quick["ways"]:
        way |= dict.fromkeys(page.COSTS)
    quick["paper"] |= {"rows": [["ours", None]], "ratios": {"ours": None}}
    path = tmp_path / "trade.html"
    page.write(quick, path)
    picture.draw(quick)
    with browser.opened(path) as visit:
        assert points(visit.page) == 0
        assert "not known of land" in visit.page.locator(f"#{page.SPEED} .textpoint").all_text_contents()
        assert visit.complaints == []


@pytest.mark.parametrize(
    "fault",
    [
        '<img src="https://example.org/a.png">',
        '<script src="https://example.org/a.js"></script>',
        "<script>missing()</script>",
        "<script>console.warn('careful')</script>",
        "<script>fetch('https://example.org/')</script>",
    ],
)
def test_browser_complains_of_a_page_that_needs_more(fault: str, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    pages.write(path, "title", "lead", [pages.Section("section", "text", (fault,))])
    with browser.opened(path) as visit:
        visit.page.wait_for_timeout(200)
        assert visit.complaints


def test_chosen_are_the_core_its_sharpest_taps_software_and_the_fits(content: dict[str, Any]) -> None:
    expected = ["core FRAC 16", "taps sharp", "float64 software", "Gaussian fit", "laser template", "V–L"]
    assert picture.chosen(content) == expected


@pytest.mark.parametrize(("more_x", "more_y"), list(itertools.product((False, True), repeat=2)))
def test_front_is_what_no_point_dominates(more_x: bool, more_y: bool) -> None:
    # Few values, so that there are equal ones; of points that are the same one is enough.
    x, y = np.random.default_rng(5).integers(0, 12, (2, 60))
    better_x, better_y = (x if more_x else -x), (y if more_y else -y)
    free = {
        (x[i], y[i])
        for i in range(len(x))
        if not any(
            (better_x[j] >= better_x[i] and better_y[j] > better_y[i])
            or (better_x[j] > better_x[i] and better_y[j] >= better_y[i])
            for j in range(len(x))
        )
    }
    found = picture.front(x.tolist(), y.tolist(), more_x=more_x, more_y=more_y)
    assert [(x[i], y[i]) for i in found] == sorted(free)


@pytest.mark.parametrize("values", [(1.0, 2.2), (0.9, 1.3, None), (0.02, 80.0), (1.0, 1e9, 0.0)])
def test_ticks_are_neither_none_nor_too_many(values: tuple[float | None, ...]) -> None:
    most = 10
    known = [value for value in values if value]
    shown = [each for each in picture.ticks(values, most) if min(known) <= each <= max(known)]
    assert 2 <= len(shown) <= most
    assert np.all(np.diff(picture.ticks(values, most)) > 0)


def test_picture_names_every_way_that_it_shows(content: dict[str, Any]) -> None:
    axes = picture.draw(content).axes[0]
    shown = " ".join(text.get_text() for text in axes.texts).replace("\n", " ")
    for name in set(WAYS) - {"Gaussian fit", "speed unknown"}:
        assert name.rstrip("0123456789").replace("$", r"\$") in shown


def test_names_that_only_count_on_are_the_first_and_the_last() -> None:
    assert picture.shortened(["core FRAC 4", "core FRAC 8", "core, taps gedi", "core FRAC 24"]) == (
        "core FRAC 4 to 24\ncore, taps gedi"
    )
    assert picture.shortened(["V–L"]) == "V–L"
