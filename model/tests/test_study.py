"""The golden core is as precise as promised, and as close to float64."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from openecho import golden, report, stimulus
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


def test_figure_is_drawn_with_and_without_echoes(tmp_path: Path) -> None:
    made, config = stimulus.reference_set(0), golden.Config()
    samples, length = made.samples.copy(), made.length
    samples[1] = 20
    records = golden_records(stimulus.Stimulus(samples, length, made.truth), config)
    figure.draw(tmp_path / "core.png", records, samples, length, config, {"land": 0, "nothing": 1})
    assert (tmp_path / "core.png").read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["core.png"]


def test_report_is_whole_or_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path / "reports")
    path = report.write("sample", {"value": np.float64(0.5), "count": np.int64(3)})
    assert json.loads(path.read_text()) == {"value": 0.5, "count": 3}
    with pytest.raises(AttributeError):
        report.write("sample", {"value": object()})
    assert json.loads(path.read_text()) == {"value": 0.5, "count": 3}
    assert [other.name for other in path.parent.iterdir()] == ["sample.json"]
