"""The figures of the V–L paper follow from their seed, and are scored as they say."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from openecho import report
from openecho.enhance import accumulate, snr_db
from openecho.study import enhancement

SMALL = {
    "snr": functools.partial(enhancement.signal_to_noise, count=20),
    "smoothing": functools.partial(enhancement.smoothing, count=4),
    "templates": functools.partial(enhancement.templates, count=10),
    "resolution": functools.partial(enhancement.resolution, repeats=1),
}


@functools.cache
def small(name: str) -> enhancement.Part:
    print("seed 1")
    return SMALL[name](1)


def rows(name: str, key: str) -> dict[Any, dict[str, Any]]:
    return {row[key]: row for row in small(name).report["rows"]}


def test_the_pulse_has_its_height_maximum_and_width() -> None:
    x = np.arange(0, 200, 1e-3)
    echo = enhancement.pulse(x, 60.0)
    assert echo.max() == pytest.approx(1, abs=1e-9)
    assert x[echo.argmax()] == pytest.approx(60, abs=1e-3)
    assert np.ptp(x[echo >= 0.5]) == pytest.approx(enhancement.FWHM, abs=2e-3)
    assert (echo[x < 60 - 2 * enhancement.TAU] == 0).all()


def test_accumulation_of_eight_gains_nine_decibels_of_gaussian_noise() -> None:
    print("seed 2")
    rng = np.random.default_rng(2)
    signal = 200 * enhancement.pulse(np.arange(512), 236)
    single = signal + rng.normal(0, 70, (800, 512))
    gain = snr_db(accumulate(single, 8), signal) - snr_db(single, signal)
    # Of the ratio of two noise powers, from 100 and 800 records of 512 samples, in dB; 4 of them.
    error = 10 / np.log(10) * np.sqrt(2 / (100 * 512) + 2 / (800 * 512))
    assert gain == pytest.approx(10 * np.log10(8), abs=4 * error)


@pytest.mark.parametrize("lasting", [False, True])
def test_cycles_have_the_papers_signal_to_noise_ratio_before_and_the_expected_one_after(lasting: bool) -> None:
    print("seed 3")
    rng = np.random.default_rng(3)
    signal = 200 * enhancement.pulse(np.arange(512), 236)
    single = enhancement.cycles(signal, 300, rng, lasting=lasting)
    assert single.shape == (2400, 512)
    assert snr_db(single, signal) == pytest.approx(-5.95, abs=0.05)
    speckle = 1 / 4
    kept = speckle + (10**0.595 - speckle) / 8 if lasting else 10**0.595 / 8
    assert snr_db(accumulate(single, 8), signal) == pytest.approx(-10 * np.log10(kept), abs=0.15)


def test_each_stage_of_enhancement_gains() -> None:
    for speckle in ("new", "lasting"):
        found = [row["snr_db"] for row in small("snr").report["rows"] if row["speckle"] == speckle]
        assert found == sorted(found)
        assert len(found) == 2 + len(enhancement.DEPTHS)


def test_a_lower_epsilon_is_smoother_and_the_best_is_better_than_the_papers() -> None:
    vondrak = [row for row in small("smoothing").report["rows"] if row["method"] in ("not smoothed", "Vondrák")]
    assert [row["setting"] for row in vondrak[:4]] == [None, 100, 10, 1]
    assert vondrak[4]["setting"] < 1
    for name in ("rms_error", "roughness"):
        values = [row[name] for row in vondrak]
        assert values == sorted(values, reverse=True)


def test_half_of_the_amplitude_passes_at_the_period_of_the_sweep() -> None:
    x = np.arange(4096)
    for period in (8.0, 20.0):
        wave = np.sin(2 * np.pi * x / period)[None]
        methods = enhancement._swept_at(wave, wave, period)
        assert sorted(row["method"] for row in methods) == ["Gaussian", "Vondrák"]
        # What is lost of a sine of RMS √½ is half of it.
        assert [row["rms_error"] for row in methods] == pytest.approx([np.sqrt(0.5) / 2] * 2, rel=5e-3)
    wave = np.sin(2 * np.pi * x / (21 / 0.6034))[None]
    averaged = enhancement._averaged_over(wave, wave, 21)
    assert averaged["half_period_bins"] == pytest.approx(21 / 0.6034)
    assert averaged["rms_error"] == pytest.approx(np.sqrt(0.5) / 2, rel=1e-2)


def test_the_laser_template_explains_its_echo_and_finds_it_where_it_is() -> None:
    found = rows("templates", "template")
    gaussian, laser = found["gaussian"], found["laser"]
    assert laser["r_squared"] == pytest.approx(0.9935, abs=0.001)
    assert laser["windowed"] > 0.999
    assert gaussian["r_squared"] < laser["r_squared"]
    assert gaussian["windowed"] < laser["windowed"]
    assert abs(laser["bias_bins"]) < 0.05 < 1 < gaussian["bias_bins"]


def test_the_laser_template_tells_more_pixels_apart_and_errs_less() -> None:
    found = rows("resolution", "method")
    gaussian, laser = found["moving average, Gaussian"], found["V–L"]
    assert laser["indistinct"] < gaussian["indistinct"] < enhancement.PIXELS
    assert laser["relative_error"] < gaussian["relative_error"]
    assert laser["resolved_error"] < gaussian["resolved_error"]


def test_the_target_has_as_many_steps_as_it_should() -> None:
    depth = enhancement.target()
    steps, counts = np.unique((depth[:, 1] - depth[:, 0]).round(9), return_counts=True)
    np.testing.assert_allclose(steps, np.arange(1, 17) / 8 * enhancement.FWHM)
    np.testing.assert_array_equal(counts, 8)
    assert depth.min() > 5 * enhancement.FWHM
    assert depth.max() < enhancement.GATE - 5 * enhancement.FWHM


def test_the_nearest_echo_is_found_for_each_surface() -> None:
    echoes = {"waveform": np.array([0, 0, 0, 2]), "peak": np.array([11.0, 19.0, 400.0, 14.0])}
    depth = np.array([[10.0, 20.0], [10.0, 20.0], [10.0, 20.0]])
    found = enhancement.nearest_echoes(echoes, depth)
    np.testing.assert_array_equal(found, [[11, 19], [np.nan, np.nan], [14, 14]])


def test_surfaces_are_told_apart_if_each_has_an_echo_within_half_of_the_step() -> None:
    depth = np.array([[10.0, 20.0]] * 5)
    nearest = np.array([[14.9, 15.1], [15.0, 20.0], [10.0, 10.0], [4.9, 20.0], [np.nan, np.nan]])
    assert enhancement.told_apart(nearest, depth).tolist() == [True, False, False, False, False]


@pytest.mark.parametrize("name", SMALL)
def test_legends_are_inside_the_picture_and_outside_the_panels(name: str) -> None:
    drawn = small(name).figure
    FigureCanvasAgg(drawn).draw()  # type: ignore[no-untyped-call]
    legend = drawn.legends[0].get_window_extent()
    assert 0 <= legend.x0 < legend.x1 <= drawn.bbox.width
    panels = [box.y0 for axes in drawn.axes if (box := axes.get_tightbbox()) is not None]
    assert 0 <= legend.y0 < legend.y1 < min(panels)
    labels = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert labels
    assert sorted(labels) == sorted(set(labels))


def test_the_same_seed_writes_the_same_report_and_all_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(enhancement, "PARTS", SMALL)
    written = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        monkeypatch.setattr(report, "FOLDER", folder)
        monkeypatch.setattr("sys.argv", ["enhancement", "--seed", "5"])
        enhancement.main()
        assert "seed 5\n" in capsys.readouterr().out
        written.append((folder / "enhancement.json").read_bytes())
    assert written[0] == written[1]
    content = json.loads(written[0])
    assert list(content) == ["tools", "seed", "paper", *SMALL]
    assert content["seed"] == 5
    assert all(content[name]["rows"] for name in SMALL)
    pictures = {path.name: path.read_bytes() for path in (tmp_path / "first").glob("*.png")}
    assert sorted(pictures) == sorted(f"enhancement_{name}.png" for name in SMALL)
    assert all(picture.startswith(b"\x89PNG") for picture in pictures.values())


def test_another_seed_makes_another_report() -> None:
    assert small("snr").report["rows"] != SMALL["snr"](2).report["rows"]
