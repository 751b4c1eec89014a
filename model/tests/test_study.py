"""The golden core is as precise as promised, and as close to float64."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from openecho import golden, report, stimulus
from openecho.decompose import criteria, decompose
from openecho.study import comparison, figure, precision


def golden_records(made: stimulus.Stimulus, config: golden.Config) -> np.ndarray:
    beats = golden.core(golden.stream(made.samples, made.length, config), config)
    return golden.decode_records(beats["record"], config)


def run(point: precision.Point) -> dict[str, float]:
    made = precision.waveforms(point, precision.COUNT, seed=1)
    return precision.score(point, golden_records(made, point.config), made.truth)


def name(point: precision.Point) -> str:
    return f"{'matched' if point.matched else 'paper'}-{point.width}-{point.amplitude}"


@pytest.mark.parametrize("point", [p for p in precision.POINTS if p.matched], ids=name)
def test_matched_taps_come_close_to_the_bound(point: precision.Point) -> None:
    row = run(point)
    assert row["found"] == row["waveforms"]
    assert 0.95 < row["peak"] <= 1.1
    assert 0.95 < row["centre"] <= 1.6


@pytest.mark.parametrize("point", [p for p in precision.POINTS if not p.matched and p.width <= 8], ids=name)
def test_the_papers_taps_find_the_peak_better_than_the_centre(point: precision.Point) -> None:
    row = run(point)
    assert row["found"] == row["waveforms"]
    assert 1.2 < row["peak"] < 1.95
    assert 3.2 < row["centre"] < 5.5


def test_score_is_the_rms_of_the_strongest_echo_in_units_of_the_bound() -> None:
    point = precision.POINTS[0]
    truth = np.zeros(2, stimulus.TRUTH)
    truth["centre"] = 100
    records = np.zeros(4, golden.decode_records(np.zeros((1, 8), int), point.config).dtype)
    records["sequence"] = [0, 0, 0, 1]
    records["trailer"] = [False, False, True, True]
    records["amplitude"] = [10, 20, 0, 0]
    records["peak"] = [0, 100 + 3 * point.bound, 0, 0]
    records["centre"] = [0, 100 - 4 * point.bound, 0, 0]
    row = precision.score(point, records, truth)
    assert (row["waveforms"], row["found"]) == (2, 1)
    assert row["peak"] == pytest.approx(3)
    assert row["centre"] == pytest.approx(4)


def test_bound_of_a_gaussian_echo_matches_its_fisher_information() -> None:
    point = precision.Point(golden.PAPER_TAPS, matched=False, width=5, amplitude=20)
    x = np.arange(-100, 101)
    slope = point.amplitude * x / point.width**2 * np.exp(-0.5 * (x / point.width) ** 2)
    assert point.bound == pytest.approx(precision.NOISE / np.sqrt(np.sum(slope**2)), rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_core_and_float64_agree_on_the_reference_waveforms(seed: int) -> None:
    made, config = stimulus.reference_set(seed), golden.Config()
    result = comparison.compare(golden_records(made, config), made.samples, made.length, config)
    assert result["differing_waveforms"] == 0
    largest = result["largest_difference"]
    assert 0 < largest["centre"] < 2**-15
    assert 0 < largest["peak"] < 2**-15
    assert 0 < largest["width"] < 2**-15
    assert 0 < largest["time"] < 2**-14
    assert 0 < largest["amplitude"] < 2**-6
    assert [len(row["core"]) for row in result["waveforms"]] == np.bincount(made.truth["waveform"]).tolist()
    assert result["echoes"] == len(made.truth)
    assert 0 < result["lost_by_five_states"] < result["echoes"]


def test_comparison_counts_waveforms_with_other_echoes() -> None:
    made, config = stimulus.reference_set(0), golden.Config()
    records = golden_records(made, config)
    without_first = np.delete(records, np.flatnonzero(~records["trailer"])[0])
    assert comparison.compare(without_first, made.samples, made.length, config)["differing_waveforms"] == 1


def test_figure_shows_the_echoes_their_sum_and_what_they_leave(tmp_path: Path) -> None:
    made, config = stimulus.reference_set(0), golden.Config()
    found = decompose(made.samples, made.length)
    for row in (0, 20):
        raw = made.samples[row, : made.length[row]].astype(float)
        mine, mean = found.echoes[found.echoes["waveform"] == row], found.waveforms["noise_mean"]
        total = criteria.fitted(found.echoes, mean, 1024)[row, : made.length[row]]
        drawn = figure.draw(found, made.samples, made.length, config, {"one": row}, 2.0)
        shown = {line.get_label(): np.asarray(line.get_ydata()) for axes in drawn.axes for line in axes.lines}
        np.testing.assert_array_equal(shown["raw waveform"], raw)
        np.testing.assert_array_equal(shown["their sum"], total)
        np.testing.assert_array_equal(shown["residual"], raw - total)
        np.testing.assert_array_equal(shown["peak, amplitude"], mean[row] + mine["amplitude"])
    (tmp_path / "core.png").write_bytes(b"before")
    figure.save(drawn, tmp_path / "core.png")
    assert (tmp_path / "core.png").read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["core.png"]


@pytest.mark.parametrize("echoes", [0, 1, 20])
def test_the_legend_covers_no_panel(echoes: int) -> None:
    truth = np.zeros(echoes, stimulus.TRUTH)
    truth["centre"], truth["width"], truth["amplitude"] = 80 + 55 * np.arange(echoes), 7, 150
    samples = stimulus.quantise(20 + stimulus.gaussians(1200, truth))[np.newaxis]
    found = decompose(samples)
    assert len(found.echoes) == echoes
    drawn = figure.draw(found, samples, np.array([1200]), golden.Config(), {"one": 0}, 1.0)
    FigureCanvasAgg(drawn).draw()  # type: ignore[no-untyped-call]
    legend = drawn.legends[0].get_window_extent()
    assert 0 <= legend.x0 < legend.x1 <= drawn.bbox.width
    panels = [box.y0 for axes in drawn.axes if (box := axes.get_tightbbox()) is not None]
    assert len(panels) == 3
    assert 0 <= legend.y0 < legend.y1 < min(panels)
    labels = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert sorted(labels) == sorted(set(labels))


@pytest.mark.parametrize("length", [1, 19, 21, 22, 400])
def test_figure_of_a_waveform_without_echoes_shows_all_of_it(tmp_path: Path, length: int) -> None:
    samples, lengths = np.full((1, length), 20), np.array([length])
    found = decompose(samples, lengths)
    drawn = figure.draw(found, samples, lengths, golden.Config(), {"nothing": 0})
    assert drawn.axes[0].get_xlim() == (-0.5, length - 0.5)
    figure.save(drawn, tmp_path / "nothing.svg")
    assert [path.name for path in tmp_path.iterdir()] == ["nothing.svg"]


def test_a_picture_that_cannot_be_made_is_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = decompose(np.full((1, 60), 20))
    drawn = figure.draw(found, np.full((1, 60), 20), np.array([60]), golden.Config(), {"nothing": 0})
    with pytest.raises(figure.FigureError, match=r"a\.txt: found suffix '\.txt', expected one of eps, [^\n]*$"):
        figure.save(drawn, tmp_path / "a.txt")
    monkeypatch.setattr("matplotlib.pyplot.get_backend", lambda: "qtagg")
    monkeypatch.setattr("matplotlib.pyplot.figure", lambda drawn: importlib.import_module("no_such_toolkit"))
    with pytest.raises(figure.FigureError, match=r"^qtagg: found no toolkit for its windows, [^\n]* -o FILE\.png$"):
        figure.show(drawn)
    monkeypatch.setattr("matplotlib.pyplot.get_backend", lambda: "agg")
    with pytest.raises(figure.FigureError, match=r"^found no display for a window, expected one, or -o FILE\.png$"):
        figure.show(drawn)
    assert list(tmp_path.iterdir()) == []


def test_report_is_whole_or_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path / "reports")
    path = report.write("sample", {"value": np.float64(0.5), "count": np.int64(3)})
    assert json.loads(path.read_text()) == {"value": 0.5, "count": 3}
    with pytest.raises(AttributeError):
        report.write("sample", {"value": object()})
    assert json.loads(path.read_text()) == {"value": 0.5, "count": 3}
    assert [other.name for other in path.parent.iterdir()] == ["sample.json"]
