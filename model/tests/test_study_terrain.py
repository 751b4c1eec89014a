"""The terrain study: what is true of echoes, how filters are judged, and a small flight from beams to its report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from openecho.study.terrain import experiment, filters, picture, scaling
from openecho.study.terrain.flights import Flight, echoes, fly
from openecho.surface import terrain
from openecho.surface.ground import ground


def quiet(doing: str, done: int, total: int | None) -> None:
    """Tell nobody of the progress."""


@pytest.fixture(scope="module")
def forest(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    """A few lines over the forest."""
    return fly("forest", tmp_path_factory.mktemp("flights"), 1, 0.02, quiet)


def test_light_of_the_ground_comes_from_where_the_ground_is(forest: Flight) -> None:
    truth = forest.truth
    with np.load(forest.waveforms) as file:
        first, last = file["first"], file["last"]
    bare = np.array([one.kind == "terrain" for one in forest.scene.targets])[truth["target"]]
    solid = bare & (truth["energy"] > 0)
    row = truth["waveform"][solid]
    share = truth["bin"][solid] / (forest.scene.digitiser.samples - 1)
    place = first[row] + share[:, None] * (last[row] - first[row])
    # A footprint of 50 cm on slopes of a few degrees; half of it behind a crown.
    assert abs(place[:, 2] - forest.ground(place[:, 0], place[:, 1])).max() < 0.1


def test_echo_is_of_ground_if_most_of_the_light_about_it_is(forest: Flight) -> None:
    truth = forest.truth
    bare = np.array([one.kind == "terrain" for one in forest.scene.targets])[truth["target"]]
    others = np.bincount(truth["waveform"][~bare], minlength=len(truth))
    lonely = bare & (others[truth["waveform"]] == 0)
    assert lonely.any()
    assert forest.of_ground(truth["waveform"][lonely], truth["bin"][lonely]).all()
    ground = np.full(truth["waveform"].max() + 1, np.inf)
    ground[truth["waveform"][bare]] = truth["bin"][bare]
    high = ~bare & (truth["bin"] < ground[truth["waveform"]] - 10)
    assert high.any()
    assert not forest.of_ground(truth["waveform"][high], truth["bin"][high]).any()


def test_echo_where_no_light_comes_from_is_of_nothing(forest: Flight) -> None:
    waveform = np.unique(forest.truth["waveform"])
    assert not forest.of_ground(waveform, np.full(len(waveform), -50.0)).any()
    last = np.full(len(waveform), forest.scene.digitiser.samples + 50.0)
    assert not forest.of_ground(waveform, last).any()


def test_errors_are_shares_of_their_kind() -> None:
    truth = np.array([1, 1, 1, 1, 0, 0, 0, 0, 0, 0], np.bool_)
    found = np.array([1, 1, 1, 0, 1, 1, 0, 0, 0, 0], np.bool_)
    assert filters.errors(found, truth) == {"type_1": 0.25, "type_2": pytest.approx(1 / 3), "total": 0.3}


def test_model_through_true_ground_is_right_and_one_on_crowns_is_not(forest: Flight) -> None:
    cloud, of_ground = echoes(forest, "gaussian", quiet)
    grid = terrain.grid_of(cloud.places, 1.0)
    right = filters.model_error(forest, cloud.places[of_ground], grid, 3.0)
    wrong = filters.model_error(forest, cloud.places[~of_ground], grid, 3.0)
    assert right["model_rms"] < 0.2 < 5 < wrong["model_rms"]


def test_cloth_simulation_finds_the_ground_of_a_plane_with_a_house() -> None:
    pytest.importorskip("CSF", reason="cloth-simulation-filter not installed (pip install 'openecho[bench]')")
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0, 60, 0.5), np.arange(0, 60, 0.5)))
    house = (abs(x - 30) < 5) & (abs(y - 30) < 5)
    points = np.column_stack([x, y, np.where(house, 8.0, 0.01 * x)])
    found = filters.cloth(points, rigidness=3, resolution=1.0, threshold=0.5, step=0.65)
    assert filters.errors(found, ~house)["total"] < 0.02
    assert filters.errors(ground(points), ~house)["total"] == 0


def test_settings_of_the_cloth_fit_into_memory() -> None:
    strip = np.array([[0.0, 0, 0], [5000, 2000, 0]])
    tried = filters.cloths(strip, quick=False)
    assert {chosen["resolution"] for chosen in tried} == {5.0}
    assert len(filters.cloths(strip, quick=True)) <= 5


def test_mountain_becomes_terrain_by_every_method_and_is_drawn(tmp_path: Path) -> None:
    flight = fly("mountain", tmp_path, 1, 0.03, quiet)
    told: list[str] = []
    made = {(variant, method): one for variant, method, one in experiment.terrains(flight, 1, quiet, told.append)}
    assert len(made) == len(told) == 4 * len(experiment.METHODS)
    full = made["full energy", "Gaussian"]
    assert full.row["echoes_of_ground"] > 0.95
    assert full.row["ground_rms"] < 0.3
    assert made["weak pulse", "Gaussian"].row["echoes_of_ground"] < 0.9
    assert made["16 weak pulses", "Gaussian"].row["echoes_of_ground"] > 0.95
    shown = {method: made["16 weak pulses", method] for method in experiment.METHODS}
    pixels = picture.pixels(flight, shown, "title")
    assert [len(axes.lines) for axes in pixels.axes] == [4] * 4
    assert len(picture.terrains(flight, full, "title").axes) == 5


def test_cost_counts_every_part() -> None:
    rows = scaling.costs((1000, 2000), 1)
    assert [row["points"] for row in rows] == [1000, 2000]
    assert all(row[part] > 0 for row in rows for part in ("unknown", "filter", "grid"))
    assert len(picture.cost(rows).axes[0].lines) == 5
