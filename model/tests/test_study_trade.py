"""The trade-off: what is compared on what, how it is scored, and what is concluded."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from openecho import report, stimulus
from openecho.decompose import Decomposition, dtype, prepare
from openecho.decompose.decomposition import WAVEFORM
from openecho.golden.float64 import FWHM
from openecho.study import bench
from openecho.study.trade import accuracy, advice, cost, sets, ways
from openecho.study.trade.sets import Set
from openecho.study.trade.ways import FRACS, USUAL, WAYS

SNR = next(point for point in bench.POINTS if (point.grid, point.value) == ("snr", 100))


def truth(*echoes: tuple[int, float, float]) -> np.ndarray:
    """Echoes of waveform, centre and width; 100 counts high."""
    made = np.empty(len(echoes), stimulus.TRUTH)
    made["waveform"], made["centre"], made["width"] = np.transpose(echoes)
    made["amplitude"] = 100
    return made


def answering(echoes: list[tuple[int, float, float, float]]) -> Any:
    """A method that finds these: waveform, peak, width and amplitude."""
    table = np.zeros(len(echoes), dtype(("fit",)))
    table["waveform"], table["peak"], table["width"], table["amplitude"] = np.transpose(echoes)
    table["centre"], table["fwhm"] = table["peak"] + 1, FWHM * table["width"]
    return lambda samples, length, bin_ns: Decomposition(table, np.zeros(len(samples), WAVEFORM))


def given(*echoes: tuple[int, float, float], waveforms: int = 2, **more: Any) -> Set:
    """A set of empty waveforms with these true echoes."""
    samples = np.zeros((waveforms, 200), np.uint16)
    return Set("tried", "grid", samples, np.full(waveforms, 200), truth(*echoes), {}, **more)


def pairs(true: np.ndarray, waveform: list[int], position: list[float]) -> list[tuple[int, int]]:
    """Pairs that are matched."""
    found = accuracy.matched(true, np.array(waveform, np.int64), np.array(position, np.float64))
    return list(zip(*(side.tolist() for side in found), strict=True))


def test_an_echo_stands_for_one_alone_and_the_nearer_has_it() -> None:
    # 51 is nearest to both of the first two; 60 is left for nobody though the second is within its width.
    assert pairs(truth((0, 50, 9), (0, 54, 9), (0, 90, 5)), [0, 0, 0], [51, 60, 88]) == [(0, 0), (2, 2)]


def test_what_lies_between_two_is_neither() -> None:
    assert pairs(truth((0, 50, 9), (0, 58, 9)), [0], [54.1]) == []
    assert pairs(truth((0, 50, 9), (0, 58, 9)), [0, 0], [52, 57]) == [(0, 0), (1, 1)]
    assert pairs(truth((0, 50, 9), (0, 58, 9)), [0, 0], [52.1, 57]) == [(1, 1)]


def test_an_echo_further_than_its_width_is_not_found() -> None:
    assert pairs(truth((0, 50, 4), (0, 90, 4)), [0, 0], [54, 94.001]) == [(0, 0)]


def test_echoes_of_other_waveforms_are_none() -> None:
    assert pairs(truth((0, 50, 4), (2, 50, 4)), [1, 2], [50, 50]) == [(1, 1)]
    assert pairs(truth((0, 50, 4)), [], []) == []
    assert pairs(truth((0, 50, 4))[:0], [0], [50.0]) == []


def test_errors_are_those_of_echoes_that_are_found() -> None:
    tried = given((0, 50, 4), (1, 60, 4), (1, 90, 4), bin_ns=2.0, bound=np.array([[2, 0.5, 1], [1, 1, 1], [1, 1, 1]]))
    found = accuracy.score(tried, answering([(0, 51, 5, 104), (0, 80, 4, 9), (1, 57, 4, 100)]))
    assert found["detected"] == pytest.approx(2 / 3)
    assert found["spurious_per_waveform"] == 0.5
    # Peaks are off by 1 and -3 bins, of bounds 0.5 and 1; centres by a bin more; half of 2 ns of light a bin.
    assert found["peak"] == pytest.approx({"rms": 5**0.5, "p95": 2.9, "bias": -1.0, "bound": 6.5**0.5})
    assert found["centre"]["bias"] == pytest.approx(0)
    assert found["width"]["rms"] == pytest.approx(0.5**0.5)
    assert found["amplitude"] == pytest.approx({"rms": 8**0.5, "p95": 3.8, "bias": 2.0, "bound": 2**0.5})
    assert found["range"]["rms"] == pytest.approx(5**0.5 * 2 * 0.149896229)


def test_nothing_found_has_no_errors() -> None:
    found = accuracy.score(given((0, 50, 4)), answering([(0, 99, 5, 104)]))
    assert (found["detected"], found["spurious_per_waveform"]) == (0, 0.5)
    assert set(found["peak"].values()) == {None}


def test_waveforms_that_nobody_judged_have_no_spurious_echoes() -> None:
    tried = given((0, 50, 4), judged=np.array([True, False]))
    assert accuracy.score(tried, answering([(0, 50, 4, 9), (1, 70, 4, 9)]))["spurious_per_waveform"] == 0


def test_every_way_that_was_asked_for_is_compared_once() -> None:
    names = [way.name for way in WAYS]
    assert len(set(names)) == len(names)
    assert {way.config.frac for way in WAYS if way.group == ways.FIXED and way.config} == {4, 8, 12, 16, 20, 24}
    forms = {(way.config.exp_w, way.config.frac) for way in WAYS if way.group == ways.FLOATING and way.config}
    assert forms == {(5, 10), (8, 7), (8, 23), (11, 52)}
    assert {way.method for way in WAYS if way.group == ways.FIT} == {"gaussian", "laser", "vl"}


def test_inflections_in_software_are_those_of_the_core_but_for_its_rounding() -> None:
    land = sets.synthetic("land", 20, 0)
    named = {way.name: way for way in WAYS}
    software, core = (
        named[name].prepare(land.longest, land.told)(land.samples, land.length, 1.0).echoes
        for name in ("inflections, float64", "core FRAC 24")
    )
    assert software["waveform"].tolist() == core["waveform"].tolist()
    assert software["number"].tolist() == core["number"].tolist()
    for name in ("centre", "peak", "width", "time", "corrected_width", "peak_ns"):
        np.testing.assert_allclose(software[name], core[name], atol=2e-6, rtol=0)


def test_equations_as_printed_are_worse() -> None:
    tried = sets.grid(SNR, 200, (0, 0))
    named = {way.name: way for way in WAYS}
    printed, right = (
        accuracy.score(tried, named[name].prepare(tried.longest, tried.told))["centre"]["rms"]
        for name in ("inflections, as printed", "inflections, float64")
    )
    assert printed > 3 * right


def test_a_seed_gives_the_same_figures_again() -> None:
    for recipe in (partial(sets.grid, SNR, 30, (3, 1)), partial(sets.scene, "roofs", 30, 3)):
        assert json.dumps(accuracy.judged(recipe)) == json.dumps(accuracy.judged(recipe))
    assert (sets.synthetic("land", 40, 1).samples != sets.synthetic("land", 40, 2).samples).any()


def test_all_sets_are_there_and_known_to_the_fits(tmp_path: Path) -> None:
    made = [recipe() for recipe in sets.recipes(20, 0, tmp_path)]
    assert [one.name for one in made[:5]] == ["land", "ocean", "forest", "roofs", "mountain"]
    grids = [point for point in bench.POINTS if point.grid in ("snr", "width", "separation", "ratio")]
    assert [(one.grid, one.value) for one in made[5:]] == [(point.grid, point.value) for point in grids]
    for one in made:
        assert (one.truth["waveform"] < len(one.samples)).all()
        assert one.bound is None or one.bound.shape == (len(one.truth), 3)
        assert one.told["gaussian"]["width"] > 0


def test_recorded_sets_are_those_with_references(recorded: Path) -> None:
    made = [recipe() for recipe in sets.recipes(100, 0, recorded)[-2:]]
    assert [one.name for one in made] == ["gedi_cerrado a1", "neon_harvard decomposition"]
    for one in made:
        assert one.judged is not None
        assert one.judged[one.truth["waveform"]].all()
        assert accuracy.score(one, prepare("gaussian", one.longest, one.told["gaussian"]))["width"]["rms"] is None


def test_bound_of_a_set_counts_noise_and_rounding() -> None:
    one = sets.grid(SNR, 5, (0, 0))
    assert one.bound is not None
    np.testing.assert_allclose(one.bound, np.tile(SNR.bound * (1 + 1 / 12) ** 0.5, (5, 1)))


def test_speed_at_a_clock_needs_the_clock() -> None:
    row: dict[str, Any] = {"fmax_mhz": 150.0, "cycles_per_waveform": 1000.0}
    assert cost.at_its_clock(row) == 150_000
    assert cost.at_its_clock(row | {"fmax_mhz": None}) is None


def test_the_papers_ratio_is_the_papers() -> None:
    rows = [
        {"name": USUAL, "waveforms_per_s": 100_000.0, "software_per_s": 5000.0},
        {"name": "inflections, float64", "waveforms_per_s": 5000.0, "software_per_s": 5000.0},
    ]
    found = cost.comparison(rows)
    assert int(found["ratios"]["the paper"]) == 292
    assert found["ratios"]["ours"] == pytest.approx(20)
    assert [round(value, 6) for _, value in found["rows"]] == [12.0, 0.041, 0.2, 0.01]


def content(rms: dict[tuple[str, str], float], detected: dict[tuple[str, str], float]) -> dict[str, Any]:
    """A report of all ways on the sets that advice looks at; 1 bin and all found where nothing else is said."""
    named = [
        *(("scene", name) for name in ("land", "ocean", "roofs")),
        *(("grid", f"snr {n}") for n in (5, 20, 200, 1000)),
    ]
    rows: list[dict[str, Any]] = [{"name": name, "kind": kind, "grid": "snr"} for kind, name in named]
    rows += [{"name": f"separation {x}", "kind": "grid", "grid": "separation", "value": x} for x in (1, 2, 3)]
    scored = []
    for way in WAYS:
        for row in rows:
            at = way.name, row["name"]
            error = {"rms": rms.get(at, 1.0), "bound": rms.get(at, 1.0)}
            found = {"detected": detected.get(at, 1.0), "spurious_per_waveform": 0.0, "peak": error, "centre": error}
            scored.append({"way": way.name, "set": row["name"]} | found)
    hardware = {"waveforms_per_s": 1e5, "software_per_s": 1e3, "lut": 1000, "fmax_mhz": 100.0}
    return {
        "ways": [{"name": way.name, "group": way.group} | hardware for way in WAYS],
        "sets": rows,
        "accuracy": scored,
    }


def test_enough_bits_are_the_fewest_that_cost_a_hundredth_at_most() -> None:
    known = {(f"core FRAC {frac}", "land"): rms for frac, rms in zip(FRACS, (2, 1.02, 1.009, 1, 1, 1), strict=True)}
    assert advice.Numbers(content(known, {})).enough("land") == 12


def test_echoes_are_told_apart_from_where_all_wider_ones_are() -> None:
    known = {(USUAL, "separation 2"): 0.9, ("Gaussian", "separation 1"): 0.94}
    numbers = advice.Numbers(content({}, known))
    assert numbers.apart(USUAL) == 3
    assert numbers.apart("Gaussian") == 2
    assert numbers.apart("V–L") == 1
    assert advice.Numbers(content({}, {(USUAL, "separation 3"): 0.5})).apart(USUAL) is None


def test_advice_follows_the_numbers() -> None:
    best = {("core, taps gedi", "land"): 0.5, ("V–L", "roofs"): 0.1, ("Gaussian", "land"): 0.3}
    found = {row["need"]: row["way"] for row in advice.advice(content(best, {}))}
    assert found["best peaks in hardware"] == "core, taps gedi"
    assert found["an asymmetric pulse"] == "V–L"
    assert found["the last digit, and error bars"] == "Gaussian"
    assert found["least area without loss of precision"] == "core FRAC 4"


def test_five_sentences_each_with_a_number() -> None:
    said = advice.claims(content({}, {}))
    assert len(said) == 5
    assert all(any(letter.isdigit() for letter in sentence) for sentence in said)


def test_an_unknown_clock_is_no_advice() -> None:
    known = content({}, {})
    for row in known["ways"]:
        row |= {"fmax_mhz": None, "lut": None, "waveforms_per_s": None if "core" in row["name"] else 1.0}
    assert "most waveforms a second" not in [row["need"] for row in advice.advice(known)]
    assert len(advice.claims(known)) == 5


def test_costs_have_a_row_for_each_way(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    monkeypatch.setattr(cost, "SLICE", 0.001)
    measured = {"name": USUAL, "lut": 999, "fmax_mhz": 150.0, "cycles_per_waveform": 1024.0}
    report.write("ways", {"rows": [measured]})
    rows = cost.costs(True, 0)
    assert [row["name"] for row in rows] == [way.name for way in WAYS]
    usual = next(row for row in rows if row["name"] == USUAL)
    assert (usual["lut"], usual["waveforms_per_s"]) == (999, 150e6 / 1024)
    assert all(row["software_per_s"] > 0 for row in rows)
