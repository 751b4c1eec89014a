"""The picture of a scene: the heights, the waveforms and the beams that it shows, and what is told of wrong usage."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from openecho.scene.geometry.world import build
from openecho.scene.schema import Scene
from openecho.scene.simulate import BLOCK, simulate, simulator
from openecho.study import figure, scene_view
from openecho.study.scene_view import Box
from tests.test_cli import Run, refused, run
from tests.test_scene_returns import GREY, PLANE, scene

__all__ = ["run"]

BOX = Box(-10.0, -10.0, 10.0, 10.0)
HOUSE = {
    "kind": "roofs",
    "size": ["8 m", "6 m"],
    "house": ["8 m", "6 m"],
    "street": "2 m",
    "heights": ["5 m", "5 m"],
    "reflectance": GREY,
}
TREE = {
    "kind": "tree",
    "position": ["0 m", "0 m", "0 m"],
    "height": "12 m",
    "crown": "ellipsoid",
    "crown_width": "6 m",
    "crown_base": "4 m",
    "leaf_area_density": "0.4 m^2/m^3",
    "reflectance": GREY,
}
WOOD = {
    "kind": "stand",
    "size": ["80 m", "80 m"],
    "density": "300 /ha",
    "height": "12 m",
    "crown": "cone",
    "crown_width": "50 %",
    "crown_base": "30 %",
    "leaf_area_density": "0.4 m^2/m^3",
    "reflectance": GREY,
}
SWEEP = {"kind": "line", "half_angle": "3 deg", "rate": "250 Hz"}


def middles(land: scene_view.Relief) -> tuple[np.ndarray, np.ndarray]:
    """X and y of the cells' middles."""
    rows, columns = land.top.shape
    x, y = np.arange(columns) + 0.5, np.arange(rows) + 0.5
    east, north = np.meshgrid(land.box.west + x * land.cell, land.box.south + y * land.cell)
    return east, north


def drawn(given: Scene, tmp_path: Path, count: int = 4) -> Any:
    """The picture, which can be written."""
    picture = scene_view.draw(given, count)
    figure.save(picture, tmp_path / "scene.png")
    assert (tmp_path / "scene.png").stat().st_size > 10_000
    return picture


def titles(picture: Any) -> list[str]:
    return [axes.get_title() for axes in picture.axes if axes.get_title().startswith("shot ")]


def test_heights_are_those_of_a_house_on_a_plane() -> None:
    land = scene_view.relief(scene(PLANE, HOUSE), BOX)
    x, y = middles(land)
    house = (abs(x) < 4) & (abs(y) < 3)
    assert max(land.top.shape) == scene_view.RASTER
    np.testing.assert_allclose(land.top, np.where(house, 5.0, 0.0), atol=1e-6)


def test_heights_are_those_of_a_crown_and_none_beside_it() -> None:
    land = scene_view.relief(scene(TREE), BOX)
    x, y = middles(land)
    inside = 1 - (x**2 + y**2) / 3**2
    expected = np.where(inside > 0, 8 + 4 * np.sqrt(np.maximum(inside, 0)), math.nan)
    np.testing.assert_allclose(land.top, expected, atol=1e-6)


def test_rows_go_north_and_columns_east() -> None:
    land = scene_view.relief(scene({**PLANE, "slope": "45 deg", "azimuth": "30 deg"}), Box(0, 0, 20, 5))
    x, y = middles(land)
    assert land.top.shape == (75, 300)
    np.testing.assert_allclose(land.top, -(x * math.sin(math.pi / 6) + y * math.cos(math.pi / 6)), atol=1e-6)


def test_a_map_shows_what_no_beam_reaches() -> None:
    given = scene(PLANE, WOOD, platform__start=["1 km", "0 m"])
    assert len(build(given).world.crowns) == 0
    assert np.nanmax(scene_view.relief(given, Box(-40, -40, 40, 40)).top) == pytest.approx(12, abs=0.3)


def test_leaves_are_above_what_is_solid() -> None:
    top, solid = scene_view.from_above(build(scene(PLANE, TREE)), np.array([[0.0, 0.0], [20.0, 0.0]]))
    np.testing.assert_allclose(top, [12, 0], atol=1e-9)
    np.testing.assert_allclose(solid, [0, 0], atol=1e-9)


def test_waveforms_are_the_recorded_ones_of_all_parts_of_the_flight() -> None:
    given = scene(PLANE, WOOD, platform__scan=SWEEP)
    ready = simulator(given)
    found, again = (scene_view.choose(ready, (0, 100), 4) for _ in range(2))
    assert [one.waveform // 25 for one in found] == [0, 1, 2, 3]
    assert [one.waveform for one in found] == [one.waveform for one in again]
    made = simulate(ready, 0, 100)
    for one in found:
        np.testing.assert_array_equal(one.samples, made.samples[one.waveform])
        assert set(one.truth["waveform"]) == {one.waveform}


def test_the_first_waveform_met_the_most() -> None:
    ready = simulator(scene(PLANE, HOUSE, TREE, platform__scan=SWEEP))
    (found,) = scene_view.choose(ready, (0, 100), 1)
    everything = scene_view._simulated(ready, 0, 100)
    assert found.clear == max(one.clear for one in everything) > 1


@pytest.mark.parametrize("scan", [None, {"kind": "raster", "rows": 20, "columns": 30, "spacing": "1 mrad"}])
def test_no_more_than_a_block_is_simulated(scan: dict[str, Any] | None) -> None:
    more = {} if scan is None else {"platform__scan": scan, "digitiser__channels": 600}
    given = scene(PLANE, shots=10_000, **more)
    runs = scene_view._runs(given, (2000, 6000), 4)
    assert sum(shots for _, shots in runs) * given.beams <= BLOCK
    assert all(first >= 2000 and first + shots <= 8000 for first, shots in runs)
    assert runs == sorted(runs)


def test_of_a_long_flight_the_middle_is_shown() -> None:
    first, count = scene_view.stretch(simulator(scene(PLANE, shots=10_000_000)))
    assert count == pytest.approx(6 * 20 / 0.006, rel=0.01)  # six swaths, and a shot every 6 mm
    assert abs(first + count / 2 - 5_000_000) <= 1


@pytest.mark.parametrize(
    "changes",
    [
        {"platform__scan": SWEEP},
        {"platform__scan": {"kind": "zigzag", "half_angle": "3 deg", "rate": "200 Hz"}, "platform__heading": "60 deg"},
        {
            "platform__scan": {"kind": "raster", "rows": 2, "columns": 8, "spacing": "1 deg"},
            "digitiser__channels": 16,
            "laser__rate": "20 Hz",
            "shots": 10,
        },
        {"laser__rate": "20 Hz", "shots": 12},
        {"platform__speed": "0 m/s", "shots": 3},
        {"platform__attitude": {"roll": "120 deg"}, "shots": 2},
    ],
    ids=["line", "zigzag", "array", "nadir", "hovering", "sky"],
)
def test_a_picture_is_written(changes: dict[str, Any], tmp_path: Path) -> None:
    given = scene(PLANE, {**HOUSE, "position": ["12 m", "0 m", "0 m"]}, WOOD, **changes)
    picture = drawn(given, tmp_path)
    assert len(titles(picture)) == min(4, given.shots * given.beams)


@pytest.mark.parametrize("targets", [(), ({**PLANE, "size": ["1 m", "1 m"], "position": ["1 km", "0 m", "0 m"]},)])
def test_a_scene_that_beams_do_not_meet_is_drawn_empty(targets: tuple[dict[str, Any], ...], tmp_path: Path) -> None:
    picture = drawn(scene(*targets, shots=5, platform__scan=SWEEP), tmp_path, 2)
    notes = [text.get_text() for axes in picture.axes for text in axes.texts]
    assert notes.count(scene_view.EMPTY) == 2
    assert len(titles(picture)) == 2


def test_the_command_says_what_it_wrote(run: Run, tmp_path: Path) -> None:
    status, out, _ = run("scene", "view", "ice", "--waveforms", 1, "-o", tmp_path / "ice.svg")
    assert status == 0
    assert out.startswith(f"{tmp_path}/ice.svg: ")
    assert out.count("\n") == 1
    assert (tmp_path / "ice.svg").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["ice", "-o", "{folder}/no/ice.png"], ["no/ice.png: no folder"]),
        (["ice", "-o", "{folder}/ice.txt"], ["ice.txt", "txt", "png"]),
        (["moon", "-o", "{folder}/moon.png"], ["moon", "no such scene"]),
        (["ice", "--waveforms", "0", "-o", "{folder}/ice.png"], ["--waveforms", "0 is not in the range"]),
        (["ice"], ["found no display for a window, expected one, or -o FILE.png"]),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(
    arguments: list[str], parts: list[str], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    refused(run("scene", "view", *(argument.format(folder=tmp_path) for argument in arguments)), *parts)
    assert not list(tmp_path.iterdir())
