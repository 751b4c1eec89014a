"""Decomposition on arrays: the golden model's records as a table, and what a recording adds to it."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import openecho
from openecho import golden, stimulus
from openecho.batch.decompose import decompose_block
from openecho.decompose import Decomposition, configure, decompose, dtype, tabulate, troubles
from openecho.decompose.inflection import Inflection
from openecho.formats import Block, Geolocation
from openecho.golden import ARITHMETICS, NO_NOISE, PAPER_TAPS, TAP_SETS, TOO_LONG, TOO_SHORT, Config

REFERENCE = stimulus.reference_set()
SHIFT = 2.0**-16
"""Bins of the last bit of a position in fixed point."""


def flat(length: int) -> NDArray[np.int64]:
    """Noise without an echo: mean 20 and deviation 1, exactly."""
    samples: NDArray[np.int64] = 19 + np.arange(length) % 2 * 2
    return samples


def echo(length: int, *centre: int, amplitude: int = 400) -> NDArray[np.int64]:
    """Noiseless echoes on a baseline of 20; one that stands alone is symmetric, and its peak is its centre, exactly."""
    apart = (np.arange(length)[:, None] - np.array(centre, dtype=int)) / 6
    samples: NDArray[np.int64] = 20 + np.rint(amplitude * np.exp(-(apart**2) / 2)).sum(axis=1).astype(np.int64)
    return samples


def assert_same(found: Decomposition, expected: Decomposition) -> None:
    for one, other in ((found.echoes, expected.echoes), (found.waveforms, expected.waveforms)):
        assert one.dtype == other.dtype
        assert one.tobytes() == other.tobytes()


def test_the_package_offers_the_function() -> None:
    assert openecho.decompose is decompose
    assert_same(openecho.decompose(echo(200, 100)), decompose(echo(200, 100)))


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_echoes_and_waveforms_are_the_golden_models(arithmetic: str) -> None:
    found = decompose(REFERENCE.samples, REFERENCE.length, arithmetic=arithmetic)
    config = Config().in_arithmetic(arithmetic)
    beats = golden.stream(REFERENCE.samples, REFERENCE.length, config)
    decoded = golden.decode_records(golden.core(beats, config)["record"], config)
    echoes, trailers = decoded[~decoded["trailer"]], decoded[decoded["trailer"]]
    assert len(found.echoes) == len(echoes) >= len(REFERENCE.truth)
    assert len(found.waveforms) == len(trailers) == 40
    np.testing.assert_array_equal(found.echoes["waveform"], echoes["sequence"])
    for name in ("number", "centre", "peak", "time", "width", "amplitude", "flags"):
        np.testing.assert_array_equal(found.echoes[name], echoes[name], err_msg=name)
    np.testing.assert_array_equal(found.waveforms["echoes"], trailers["number"])
    np.testing.assert_array_equal(found.waveforms["echoes"], np.bincount(found.echoes["waveform"], minlength=40))
    np.testing.assert_array_equal(found.waveforms["length"], REFERENCE.length)
    for name in ("noise_mean", "noise_deviation", "flags"):
        np.testing.assert_array_equal(found.waveforms[name], trailers[name], err_msg=name)


@pytest.mark.parametrize("settings", [{"n": 4.0}, {"min_interval": 30}, {"min_amplitude": 100}, {"k": 15.5}], ids=str)
def test_every_setting_is_the_golden_models(settings: dict[str, Any]) -> None:
    # Eight counts more on every other of the 50 samples that measure the noise, and k matters among these echoes.
    samples = REFERENCE.samples.copy()
    samples[:, :50:2] += 8
    found = decompose(samples, REFERENCE.length, **settings)
    config = Config(**settings)
    records = golden.core(golden.stream(samples, REFERENCE.length, config), config)["record"]
    assert_same(found, tabulate(records, config, None))
    assert found.echoes.tobytes() != decompose(samples, REFERENCE.length).echoes.tobytes()


@pytest.mark.parametrize("taps", TAP_SETS)
@pytest.mark.parametrize("arithmetic", ["fixed", "float64"])
def test_derived_columns_are_as_defined(arithmetic: str, taps: str) -> None:
    echoes = decompose(REFERENCE.samples, REFERENCE.length, arithmetic=arithmetic, taps=taps).echoes
    assert echoes.dtype == dtype(["core"])
    fwhm = 2 * math.sqrt(2 * math.log(2))
    np.testing.assert_array_equal(echoes["fwhm"], fwhm * echoes["width"])
    # Eq (9), in the core with a divider or shifts that are 1.2e-7 off, and rounded.
    np.testing.assert_allclose(echoes["time"], echoes["centre"] - echoes["fwhm"] / 4, rtol=0, atol=1.5 * SHIFT)
    weights = TAP_SETS[taps]
    offset = [i - (len(weights) - 1) / 2 for i in range(len(weights))]
    variance = sum(tap * x * x for tap, x in zip(weights, offset, strict=True)) / sum(weights)
    corrected = echoes["corrected_width"]
    narrow = echoes["width"] ** 2 < variance
    assert (corrected[narrow] == 0).all()
    np.testing.assert_allclose(corrected[~narrow] ** 2 + variance, echoes["width"][~narrow] ** 2, rtol=1e-14)
    assert 0 < np.count_nonzero(corrected) <= len(echoes)


def test_an_echo_narrower_than_the_filter_has_no_corrected_width() -> None:
    found = decompose(echo(400, 200), n=15.9375).echoes
    assert found["peak"].tolist() == [200]
    assert 0 < found["width"][0] < 5
    assert found["corrected_width"].tolist() == [0]


@pytest.mark.parametrize("bin_ns", [1.0, 0.3, 1 / 3])
def test_nanoseconds_are_bins_times_the_interval(bin_ns: float) -> None:
    found = decompose(REFERENCE.samples, REFERENCE.length, bin_ns=bin_ns)
    without = decompose(REFERENCE.samples, REFERENCE.length)
    assert found.echoes.dtype == dtype(["core", "bin_ns"])
    for name in ("centre", "peak", "time"):
        np.testing.assert_array_equal(found.echoes[f"{name}_ns"], found.echoes[name] * bin_ns)
    for name in without.echoes.dtype.names or ():
        np.testing.assert_array_equal(found.echoes[name], without.echoes[name])
    assert found.waveforms.tobytes() == without.waveforms.tobytes()


def test_one_waveform_may_be_one_dimensional() -> None:
    row, length = REFERENCE.samples[30], REFERENCE.length[30]
    expected = decompose(row[None], [length])
    assert len(expected.waveforms) == 1
    assert len(expected.echoes) >= 1
    assert_same(decompose(row, length), expected)
    assert_same(decompose(row.tolist(), [int(length)]), expected)
    assert_same(decompose(row[:length]), expected)


def test_all_samples_are_taken_where_no_length_is_given() -> None:
    samples = REFERENCE.samples
    assert_same(decompose(samples), decompose(samples, np.full(40, 1024)))
    assert set(decompose(samples).waveforms["length"].tolist()) == {1024}
    assert set(decompose(samples, REFERENCE.length).waveforms["length"].tolist()) == {528, 1024}


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_waveforms_without_echoes_have_their_noise(arithmetic: str) -> None:
    samples = np.stack([flat(300), echo(300, 100, 200), np.full(300, 37), flat(300)])
    found = decompose(samples, [300, 300, 300, 123], arithmetic=arithmetic)
    assert found.waveforms.tolist() == [(300, 0, 20, 1, 0), (300, 2, 20, 0, 0), (300, 0, 37, 0, 0), (123, 0, 20, 1, 0)]
    assert found.echoes["waveform"].tolist() == [1, 1]
    assert found.echoes["number"].tolist() == [0, 1]
    none = decompose(flat(300), arithmetic=arithmetic, bin_ns=1.0)
    assert none.echoes.shape == (0,)
    assert none.echoes.dtype == dtype(["core", "bin_ns"])
    assert none.waveforms.tolist() == [(300, 0, 20, 1, 0)]


@pytest.mark.parametrize("name", TAP_SETS)
@pytest.mark.parametrize("kind", [tuple, list, np.array])
def test_taps_are_a_name_or_the_taps_themselves(name: str, kind: Any) -> None:
    found = decompose(REFERENCE.samples, REFERENCE.length, taps=name)
    assert_same(decompose(REFERENCE.samples, REFERENCE.length, taps=kind(TAP_SETS[name])), found)
    config = Config(taps=TAP_SETS[name])
    records = golden.core(golden.stream(REFERENCE.samples, REFERENCE.length, config), config)["record"]
    assert_same(found, tabulate(records, config, None))


def test_the_papers_taps_in_fixed_point_are_the_default() -> None:
    found = decompose(REFERENCE.samples, REFERENCE.length)
    assert_same(decompose(REFERENCE.samples, REFERENCE.length, taps=PAPER_TAPS, arithmetic="fixed"), found)
    others = [decompose(REFERENCE.samples, REFERENCE.length, taps=name) for name in TAP_SETS if name != "paper"]
    assert all(other.echoes.tobytes() != found.echoes.tobytes() for other in others)
    assert configure() == Config()


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_waveforms_longer_than_the_default_core_are_not_cut(arithmetic: str) -> None:
    assert Config.max_samples < 4800
    found = decompose(echo(5000, 1000, 4800), arithmetic=arithmetic)
    assert found.waveforms.tolist() == [(5000, 2, 20, 0, 0)]
    assert found.echoes["amplitude"].tolist() == [400, 400]
    # binary16 has steps of 4 bins there.
    step = 4 if arithmetic == "float16" else 2**-10
    assert np.abs(found.echoes["peak"] - [1000, 4800]).max() <= step


@pytest.mark.parametrize(("longest", "whole"), [(0, 4096), (22, 4096), (4097, 4097), (65536, 65536)])
def test_a_core_takes_the_longest_waveform_whole(longest: int, whole: int) -> None:
    assert configure(longest).max_samples == whole


def test_the_digitisers_full_scale_saturates() -> None:
    samples = np.minimum(echo(300, 150, amplitude=3000), 2047)
    assert decompose(samples).echoes["flags"].tolist() == [golden.SATURATED]
    assert decompose(samples, sample_w=12).echoes["flags"].tolist() == [0]


HUNDRED = np.full((1, 100), 20)


@pytest.mark.parametrize(
    ("samples", "settings", "message"),
    [
        (HUNDRED, {"arithmetic": "float8"}, "arithmetic: found 'float8', expected one of fixed, float16, float32, .*"),
        (HUNDRED, {"taps": "sharp"}, r"taps: found 'sharp', expected one of paper, gedi, lvis, nasa3\.5, nasa6\.5"),
        (HUNDRED, {"engine": "cpu"}, "engine: found 'cpu', expected one of model, rtl"),
        (HUNDRED, {"taps": (1, -1, -1, 1)}, "taps: found a sum of 0, expected a filter that smooths, .* above 0"),
        (HUNDRED, {"taps": (-1,) * 4}, "taps: found a sum of -4, expected a filter that smooths, .* above 0"),
        (HUNDRED, {"taps": ()}, "taps: found a sum of 0, expected .*"),
        (HUNDRED, {"taps": (1, 2, 1)}, "number of taps: found 3, expected an integer from 4 to 48"),
        (HUNDRED, {"taps": (1, 2, 3, 4)}, r"taps: found \(1, 2, 3, 4\), expected a symmetric set"),
        (HUNDRED, {"taps": (0.5,) * 4}, "tap: found 0.5, expected an integer from .*"),
        (HUNDRED, {"k": 0.1}, "k: found 0.1, expected a multiple of 1/16 from 0 to 15.9375"),
        (HUNDRED, {"n": -1}, "n: found -1, expected a multiple of 1/16 from 0 to 15.9375"),
        (HUNDRED, {"sample_w": 7}, "sample_w: found 7, expected an integer from 8 to 16"),
        (
            HUNDRED,
            {"sample_w": 16, "arithmetic": "float16"},
            "exp_w: found 5, .* expected more bits for an amplitude.*",
        ),
        (np.zeros((1, 100)), {}, "samples: found float64, expected integers"),
        (np.zeros((1, 100), bool), {}, "samples: found bool, expected integers"),
        ([["a", "b"]], {}, "samples: found <U1, expected integers"),
        ([[1, -1, 3]], {}, "samples: found -1 to 3, expected 0 to 2047"),
        ([[1, 2048, 3]], {}, "samples: found 1 to 2048, expected 0 to 2047"),
        ([[1, 256, 3]], {"sample_w": 8}, "samples: found 1 to 256, expected 0 to 255"),
        (np.array([[2**64 - 1]], np.uint64), {"sample_w": 16}, "samples: found .*, expected 0 to 65535"),
        ([], {}, r"samples: found shape \(1, 0\), expected \(waveforms, samples\), neither of them 0"),
        (np.zeros((0, 100), int), {}, r"samples: found shape \(0, 100\), expected \(waveforms, samples\), .*"),
        (np.zeros((2, 3, 100), int), {}, r"samples: found shape \(2, 3, 100\), expected \(waveforms, samples\), .*"),
        (np.zeros((1, 65537), int), {}, "max_samples: found 65537, expected an integer from 22 to 65536"),
        ([[1, 2, 3], [1, 2]], {}, ".*inhomogeneous.*"),
        (HUNDRED, {"length": [100, 100]}, r"length: found int64 of shape \(2,\), expected integers of shape \(1,\)"),
        (HUNDRED, {"length": [[100]]}, r"length: found int64 of shape \(1, 1\), expected integers of shape \(1,\)"),
        (HUNDRED, {"length": []}, r"length: found float64 of shape \(0,\), expected integers of shape \(1,\)"),
        (HUNDRED, {"length": [100.0]}, r"length: found float64 of shape \(1,\), expected integers of shape \(1,\)"),
        (HUNDRED, {"length": [0]}, "length: found 0 to 0, expected 1 to 100"),
        (HUNDRED, {"length": [101]}, "length: found 101 to 101, expected 1 to 100"),
        (HUNDRED, {"length": -1}, "length: found -1 to -1, expected 1 to 100"),
    ],
)
def test_bad_input_is_told_in_one_line(samples: Any, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        decompose(samples, **settings)


def test_troubles_counts_waveforms_by_what_was_the_matter() -> None:
    lengths = [10, 21, 22, 49, 50, 300]
    found = decompose(np.tile(flat(300), (6, 1)), lengths)
    short, silent = TOO_SHORT | NO_NOISE, NO_NOISE
    assert found.waveforms["flags"].tolist() == [short, short, silent, silent, 0, 0]
    assert found.waveforms["length"].tolist() == lengths
    assert troubles(found.waveforms) == {"too short for the filter": 2, "too short for noise": 4}
    assert troubles(found.waveforms[4:]) == {}
    assert troubles(found.waveforms[:0]) == {}


def test_troubles_counts_waveforms_that_a_smaller_core_cuts() -> None:
    config = Config(max_samples=64)
    records = golden.core(golden.stream(np.tile(flat(100), (4, 1)), np.array([100, 64, 65, 30]), config), config)
    found = tabulate(records["record"], config, None)
    assert found.waveforms["flags"].tolist() == [TOO_LONG, 0, TOO_LONG, NO_NOISE]
    assert found.waveforms["length"].tolist() == [64, 64, 64, 30]
    assert troubles(found.waveforms) == {"too long and cut": 2, "too short for noise": 1}


def block_of(rows: Sequence[NDArray[np.int64]], **told: Any) -> Block:
    """Waveforms of any lengths as the first thousand and second waveform of a recording and on."""
    longest = max(len(row) for row in rows)
    samples = np.stack([np.pad(row, (0, longest - len(row))) for row in rows]).astype(np.uint16)
    return Block(1001, samples, np.array([len(row) for row in rows], np.int32), **told)


ROWS = [echo(257, 100), flat(257), echo(129, 80), echo(257, 128, 200)]
"""Peaks at bins 100, 80, 128 and 200; 256 or 128 steps from the first bin to the last."""


def test_an_echo_lies_on_the_line_from_the_first_to_the_last_bin() -> None:
    first = np.array([[1000, -10, 5000], [0, 0, 0], [20, 359.5, 300], [-8, 16, 2.5]], float)
    last = np.array([[1256, -522, 3976], [9, 9, 9], [20, 360.5, 236], [504, 16, -61.5]], float)
    block = block_of(ROWS, geolocation=Geolocation(first, last))
    echoes = decompose_block(block, ["core", "geolocation"], Inflection(Config()), None).echoes
    assert echoes.dtype == dtype(["core", "geolocation"])
    assert echoes["peak"].tolist() == [100, 80, 128, 200]
    assert echoes["x"].tolist() == [1100, 20, 248, 392]
    assert echoes["y"].tolist() == [-210, 360.125, 16, 16]
    assert echoes["z"].tolist() == [4600, 260, -29.5, -47.5]


def test_an_echo_is_where_its_peak_is_and_not_its_centre() -> None:
    samples = REFERENCE.samples[20:, :513]
    where = Geolocation(np.zeros((20, 3)), np.tile([512.0, -1024.0, 2048.0], (20, 1)))
    block = Block(0, samples, np.full(20, 513, np.int32), geolocation=where)
    echoes = decompose_block(block, ["core", "geolocation"], Inflection(Config()), None).echoes
    assert (echoes["peak"] != echoes["centre"]).all()
    for name, slope in (("x", 1), ("y", -2), ("z", 4)):
        np.testing.assert_array_equal(echoes[name], slope * echoes["peak"])


def test_an_echo_without_a_located_waveform_has_no_position() -> None:
    first, last = np.zeros((4, 3)), np.full((4, 3), 256.0)
    first[0, 1], last[2] = np.nan, np.nan
    block = block_of(ROWS, geolocation=Geolocation(first, last))
    echoes = decompose_block(block, ["core", "geolocation"], Inflection(Config()), None).echoes
    np.testing.assert_array_equal(echoes["x"], [100, np.nan, 128, 200])
    np.testing.assert_array_equal(echoes["y"], [np.nan, np.nan, 128, 200])


def test_waveforms_are_counted_through_the_recording() -> None:
    found = decompose_block(block_of(ROWS), ["core"], Inflection(Config()), None)
    assert found.echoes["waveform"].tolist() == [1001, 1003, 1004, 1004]
    assert found.echoes["number"].tolist() == [0, 0, 0, 1]
    assert found.waveforms.tolist() == [(257, 1, 20, 0, 0), (257, 0, 20, 1, 0), (129, 1, 20, 0, 0), (257, 2, 20, 0, 0)]


def test_time_shot_and_beam_are_those_of_the_echos_waveform() -> None:
    time, shot = np.array([0.1, 0.2, np.nan, 0.4]), np.array([2**63 + 5, 6, 2**64 - 1, 0], np.uint64)
    block = block_of(ROWS, time=time, shot=shot, beam="BEAM1011")
    known = ("core", "time", "shot", "beam")
    echoes = decompose_block(block, known, Inflection(Config()), None).echoes
    assert echoes.dtype == dtype(known)
    np.testing.assert_array_equal(echoes["shot_time"], [0.1, np.nan, 0.4, 0.4])
    assert echoes["shot"].tolist() == [2**63 + 5, 2**64 - 1, 0, 0]
    assert echoes["beam"].tolist() == ["BEAM1011"] * 4


def test_a_block_adds_no_column_that_the_recording_does_not_tell() -> None:
    where = Geolocation(np.zeros((4, 3)), np.ones((4, 3)))
    block = block_of(ROWS, time=np.zeros(4), shot=np.ones(4, np.uint64), beam="one", geolocation=where)
    assert decompose_block(block, ["core"], Inflection(Config()), None).echoes.dtype == dtype(["core"])
    assert decompose_block(block, ["core", "beam"], Inflection(Config()), None).echoes.dtype == dtype(["core", "beam"])


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_a_block_has_the_echoes_of_its_arrays(arithmetic: str) -> None:
    config = configure(1024, arithmetic=arithmetic, taps="lvis")
    block = Block(7, REFERENCE.samples, REFERENCE.length)
    found = decompose_block(block, ["core", "bin_ns"], Inflection(config), 0.5)
    expected = decompose(REFERENCE.samples, REFERENCE.length, bin_ns=0.5, arithmetic=arithmetic, taps="lvis")
    expected.echoes["waveform"] += 7
    assert_same(found, expected)


HEAVY = ["click", "distributed", "h5py", "laspy", "matplotlib", "pyarrow", "rich", "scipy"]


def printed(code: str, folder: Path) -> str:
    """What a fresh interpreter, away from the checkout, prints."""
    return subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize(
    ("statement", "loaded"),
    [
        ("import openecho.golden", []),
        ("import openecho; openecho.decompose([[20] * 100])", []),
        # What is looked for would be seen.
        ("import click, scipy", ["click", "scipy"]),
    ],
)
def test_the_golden_model_alone_loads_no_heavy_package(tmp_path: Path, statement: str, loaded: list[str]) -> None:
    code = f"{statement}\nimport sys\nprint(*sorted(set({HEAVY}) & set(sys.modules)))"
    assert printed(code, tmp_path).split() == loaded


@pytest.mark.parametrize("first", ["openecho.decompose.criteria", "openecho.decompose", "openecho.golden"])
def test_the_package_offers_the_function_whatever_is_imported_first(tmp_path: Path, first: str) -> None:
    code = f"import {first}, openecho\nprint(len(openecho.decompose([[20] * 99] * 3).waveforms))"
    assert printed(code, tmp_path) == "3\n"
