"""Echoes of a recording against references: exact on hand-made echoes, and on recorded waveforms as measured."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console

from openecho import formats, golden
from openecho.decompose import ENGINES, configure, criteria, decompose
from openecho.decompose.inflection import Inflection
from openecho.formats import Reference
from openecho.golden import NO_PEAK
from openecho.study.score import score, tables

CONFIG = configure(300)
NAN = np.nan
Echo = tuple[float, float, int]
"""Peak, centre (bins) and flags."""


def records(echoes: list[list[Echo]], noise_mean: float, length: int) -> NDArray[np.int64]:
    """What the core would say: the echoes of each waveform, 16 bins wide and 64 counts high, and its trailer."""
    rows = []
    for waveform, row in enumerate(echoes):
        for number, (peak, centre, flags) in enumerate(row):
            fields = [round(value * 2**CONFIG.frac) for value in (centre, peak, 16, 0)]
            rows.append([flags, waveform, number, *fields, 64 << golden.AMP_FRAC])
        rows.append([1 << 31, waveform, len(row), length, round(noise_mean * 2**golden.AMP_FRAC), 0, 0, 0])
    return np.array(rows)


def recording(path: Path, samples: NDArray[Any], **arrays: Any) -> formats.Recording:
    np.savez(path / "a.npz", samples=samples, length=np.full(len(samples), samples.shape[1]), **arrays)
    return formats.open(path / "a.npz")


def scored(
    path: Path, monkeypatch: pytest.MonkeyPatch, echoes: list[list[Echo]], *references: Reference, bin_ns: float = 2.0
) -> dict[str, Any]:
    """Score hand-made echoes in constant waveforms of 200 samples of 20 counts, two waveforms at a time."""
    left = list(echoes)

    def made(samples: NDArray[Any], length: NDArray[Any], config: golden.Config) -> NDArray[np.int64]:
        mine = [left.pop(0) for _ in samples]
        return records(mine, 20, samples.shape[1])

    monkeypatch.setitem(ENGINES, "made", made)
    monkeypatch.setattr(formats.recording, "BLOCK", 400)
    with recording(path, np.full((len(echoes), 200), 20), bin_ns=bin_ns) as opened:
        result = score(opened, references, Inflection(CONFIG, "made"))
    json.dumps(result, allow_nan=False)
    return result


def reference(
    modes: list[list[float]], ground: list[float] | None = None, judged: list[bool] | None = None
) -> Reference:
    return Reference(
        "a1",
        np.repeat(np.arange(len(modes)), [len(row) for row in modes]),
        np.array([position for row in modes for position in row], float),
        np.full(len(modes), NAN) if ground is None else np.array(ground),
        np.ones(len(modes), bool) if judged is None else np.array(judged),
    )


def test_modes_are_scored_by_the_nearest_peak(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = scored(
        tmp_path,
        monkeypatch,
        [[(50, 51, 0), (60, 60, 0)], [(99, 97, 0)], [(10, 10, 0), (30, 30, 0), (33.25, 40, 0)]],
        reference([[51, 57], [100.25], [30]]),
    )
    (row,) = result["references"]
    assert (result["waveforms"], result["echoes"], result["echoes_per_waveform"]) == (3, 6, 2)
    assert (row["name"], row["waveforms"], row["modes"]) == ("a1", 3, 4)
    assert (row["within_1"], row["within_3"]) == (2 / 4, 4 / 4)
    # 10 and 33.25 are further than 3 bins from the only mode of their waveform.
    assert row["spurious_per_waveform"] == 2 / 3
    assert row["peak_bias"] == (-1 + 3 - 1.25 + 0) / 4
    assert row["peak_rms"] == ((1 + 9 + 1.25**2 + 0) / 4) ** 0.5
    assert row["centre_rms"] == ((0 + 9 + 3.25**2 + 0) / 4) ** 0.5
    assert row["peak_rms_m"] == row["peak_rms"] * 2 * 0.149896229


def test_echoes_answer_only_modes_of_their_own_waveform(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    echoes: list[list[Echo]] = [[(50, 50, 0)], [], [(199, 199, 0)], [(0, 0, 0)]]
    (row,) = scored(tmp_path, monkeypatch, echoes, reference([[], [50], [0], [199]]))["references"]
    assert (row["modes"], row["within_1"], row["within_3"]) == (3, 0, 0)
    assert row["spurious_per_waveform"] == 3 / 4
    assert (row["peak_rms"], row["peak_bias"], row["centre_rms"], row["peak_rms_m"]) == (None, None, None, None)


def test_bounds_of_1_and_3_bins_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    echoes: list[list[Echo]] = [[(50, 50, 0)], [(50, 50, 0)], [(50, 50, 0)], [(50, 50, 0)]]
    modes = reference([[51], [48.75], [53], [46.75]])
    (row,) = scored(tmp_path, monkeypatch, echoes, modes)["references"]
    assert (row["within_1"], row["within_3"], row["spurious_per_waveform"]) == (1 / 4, 3 / 4, 1 / 4)


def test_shoulders_answer_no_mode_and_are_not_spurious(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    echoes: list[list[Echo]] = [[(50, 50, NO_PEAK), (90, 90, NO_PEAK)], [(50, 50, 0), (90, 90, NO_PEAK)]]
    result = scored(tmp_path, monkeypatch, echoes, reference([[50], [50]], [90.0, 51.0]))
    (row,) = result["references"]
    assert (row["within_3"], row["spurious_per_waveform"]) == (1 / 2, 0)
    assert (row["ground_waveforms"], row["ground_median_error"]) == (1, -1)
    assert result["echoes"] == 4


def test_waveforms_that_are_not_judged_count_for_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    echoes: list[list[Echo]] = [[(50, 50, 0), (90, 90, 0)], [(60, 60, 0), (90, 90, 0)], [(10, 10, 0)]]
    judged = reference([[], [60], []], judged=[False, True, False])
    (row,) = scored(tmp_path, monkeypatch, echoes, judged)["references"]
    assert (row["waveforms"], row["modes"], row["within_1"], row["spurious_per_waveform"]) == (1, 1, 1, 1)


def test_ground_is_the_peak_of_the_last_echo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    echoes: list[list[Echo]] = [[(50, 0, 0), (90, 0, 0)], [(60, 0, 0)], [], [(70, 0, 0)], [(99, 0, 0)]]
    grounds = reference([[]] * 5, [88.0, 59.0, 40.0, NAN, 90.0])
    (row,) = scored(tmp_path, monkeypatch, echoes, grounds)["references"]
    assert (row["ground_waveforms"], row["ground_within_3"]) == (3, 2 / 3)
    assert row["ground_median_error"] == 2
    assert row["ground_median_error_m"] == 2 * 2 * 0.149896229
    assert row["ground_rms_within_3"] == ((4 + 1) / 2) ** 0.5
    assert (row["modes"], row["within_1"], row["peak_rms"]) == (0, None, None)


def test_without_echoes_and_judgements_there_are_no_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = reference([[], []], judged=[False, False])
    result = scored(tmp_path, monkeypatch, [[], []], nothing)
    (row,) = result["references"]
    counts = {name: value for name, value in row.items() if value is not None}
    assert counts == {"name": "a1", "waveforms": 0, "modes": 0, "ground_waveforms": 0}
    assert (result["echoes"], result["echoes_per_waveform"]) == (0, 0)
    assert result["rmse"] == {"5": 0, "50": 0, "95": 0}
    assert result["r_squared"] == {"5": None, "50": None, "95": None}
    assert result["residual"] == {"mean": 0, "deviation": 0, "autocorrelation": None, "largest": 0}


def test_matching_equals_a_search_of_every_pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seed = 1
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    quarter = [np.sort(rng.choice(800, rng.integers(0, 9), replace=False)) / 4 for _ in range(60)]
    modes, peaks = quarter[:30], quarter[30:]
    echoes: list[list[Echo]] = [[(float(peak), float(peak) + 1, 0) for peak in row] for row in peaks]
    (row,) = scored(tmp_path, monkeypatch, echoes, reference([one.tolist() for one in modes]))["references"]
    nearest = [min((abs(row - mode)), default=NAN) for one, row in zip(modes, peaks, strict=True) for mode in one]
    spurious = [not (abs(one - peak) <= 3).any() for one, row in zip(modes, peaks, strict=True) for peak in row]
    assert row["modes"] == len(nearest) > 50
    assert row["within_1"] == np.mean(np.array(nearest) <= 1)
    assert row["within_3"] == np.mean(np.array(nearest) <= 3)
    assert row["spurious_per_waveform"] == sum(spurious) / 30
    hits = np.array([near for near in nearest if near <= 3])
    assert row["peak_rms"] == pytest.approx(np.sqrt(np.mean(hits**2)), rel=1e-12)


def scene(seed: int) -> NDArray[np.int64]:
    """Waveforms of two echoes each, and noise."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    centre = np.array([[90.0], [190.0]])[:, None] + rng.uniform(-9, 9, (2, 12, 1))
    clean: NDArray[np.float64] = 30 + (300 * np.exp(-(((np.arange(300) - centre) / 7) ** 2) / 2)).sum(axis=0)
    return np.rint(clean + rng.normal(0, 1.5, clean.shape)).astype(np.int64)


def test_fit_is_that_of_the_sum_of_the_echoes(tmp_path: Path) -> None:
    samples = scene(seed=2)
    length = np.full(12, 300)
    length[3] = 250
    np.savez(tmp_path / "a.npz", samples=samples, length=length)
    with formats.open(tmp_path / "a.npz") as opened:
        result = score(opened, (), Inflection(CONFIG))
    found = decompose(samples, length)
    fit = criteria.fitted(found.echoes, found.waveforms["noise_mean"], 300)
    rows = [(row - one)[:n] for row, one, n in zip(samples, fit, length, strict=True)]
    flat, mean = np.concatenate(rows), np.concatenate(rows).mean()
    pairs = np.concatenate([(row[:-1] - mean) * (row[1:] - mean) for row in rows])
    assert result["waveforms"] == 12
    assert result["echoes"] == len(found.echoes) >= 24
    for name, values in (
        ("rmse", criteria.rmse(samples, length, fit)),
        ("r_squared", criteria.r_squared(samples, length, fit)),
    ):
        assert list(result[name].values()) == np.percentile(values, [5, 50, 95]).tolist()
    assert result["residual"]["mean"] == pytest.approx(mean, abs=1e-12)
    assert result["residual"]["deviation"] == pytest.approx(flat.std(), rel=1e-12)
    assert result["residual"]["largest"] == abs(flat).max()
    assert result["residual"]["autocorrelation"] == pytest.approx(pairs.mean() / flat.var(), rel=1e-9)


def test_blocks_change_nothing_and_are_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    samples = scene(seed=3)
    modes = reference([[90, 190]] * 12, [190.0] * 12)
    results, told = [], []
    for size in (2**19, 1500):
        monkeypatch.setattr(formats.recording, "BLOCK", size)
        with recording(tmp_path, samples) as opened:
            blocks: list[int] = []
            results.append(score(opened, [modes], Inflection(CONFIG), advance=blocks.append))
            told.append(blocks)
    assert told == [[12], [5, 10, 12]]
    whole, parts = results
    assert parts["references"][0].pop("name") == whole["references"][0].pop("name") == "a1"
    assert parts["references"][0] == pytest.approx(whole["references"][0], rel=1e-12)
    assert parts["residual"] == pytest.approx(whole["residual"], rel=1e-9)
    assert parts["rmse"] == whole["rmse"]
    assert parts["echoes"] == whole["echoes"]


def test_metres_need_a_sample_interval(tmp_path: Path) -> None:
    with recording(tmp_path, scene(seed=4)) as opened:
        (row,) = score(opened, [reference([[90]] * 12)], Inflection(CONFIG))["references"]
    assert not any(name.endswith("_m") for name in row)


def test_counts_that_the_core_has_no_bits_for_are_refused(tmp_path: Path) -> None:
    samples = np.full((3, 100), 20)
    samples[2, 7] = 2048
    with (
        recording(tmp_path, samples) as opened,
        pytest.raises(formats.DataError, match="samples of waveform 2 sample 7 is 2048, expected 0 to 2047"),
    ):
        score(opened, (), Inflection(CONFIG))


def printed(results: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Cells of all tables, row by row."""
    console = Console(file=io.StringIO(), width=200)
    rows = []
    for table in tables(results):
        console.print(table)
        rows += [list(cells) for cells in zip(*(column.cells for column in table.columns), strict=True)]
    return rows


def test_tables_have_a_row_for_each_reference_and_each_tap_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    echoes: list[list[Echo]] = [[(50, 51, 0)], [(60, 61, 0), (80, 80, 0)]]
    result = scored(tmp_path, monkeypatch, echoes, reference([[50.5], []], [50.0, 70.0]))
    empty = scored(tmp_path, monkeypatch, [[], []], reference([[], []]))
    first, second, fit, no_fit = printed({"paper": result, "gedi": empty})
    assert first == ["paper", "a1", "1", "1.000", "1.000", "1.00", "0.50", "0.50", "0.500", "5.00"]
    assert second == ["gedi", "a1", "0", "", "", "0.00", "", "", "", ""]
    residual = [f"{result['residual'][name]:.2f}" for name in ("mean", "deviation")]
    rmse = " ".join(f"{result['rmse'][percentile]:.2f}" for percentile in ("5", "50", "95"))
    assert fit == ["paper", "1.50", rmse, "", *residual]
    assert no_fit == ["gedi", "0.00", "0.00 0.00 0.00", "", "0.00", "0.00"]


def test_without_references_there_is_the_table_of_the_fit_alone(tmp_path: Path) -> None:
    with recording(tmp_path, scene(seed=5)) as opened:
        (table,) = tables({"paper": score(opened, (), Inflection(CONFIG))})
    assert [column.header for column in table.columns][:3] == ["method", "echoes/\nwaveform", "RMSE"]


@pytest.mark.parametrize("name", ["a1", "a4"])
def test_recorded_gedi_modes_are_found_with_the_smoothing_they_were_made_with(name: str, recorded: Path) -> None:
    with formats.open(recorded / "gedi_cerrado.npz") as opened:
        result = score(opened, formats.references(opened), Inflection(configure(opened.longest, taps="nasa6.5")))
    row = next(row for row in result["references"] if row["name"] == name)
    assert (row["waveforms"], row["modes"]) == (688, 697)
    assert row["within_1"] >= 0.99
    assert row["spurious_per_waveform"] < 1.25
