"""The whole core in floating point: against float64, against fixed point, and at the ends of each format."""

from collections.abc import Iterator
from math import log, sqrt
from typing import Any

import numpy as np
import pytest

from openecho import golden, stimulus
from openecho.golden import arithmetic, float64
from openecho.golden.floating import BFLOAT16, BINARY16, BINARY32, BINARY64, Format

FIXED = golden.Config()
ODD = Format(6, 17)
FORMATS = [BINARY16, BFLOAT16, ODD, BINARY32, BINARY64]
NUMBERS = ("centre", "peak", "width", "time", "amplitude")
WORST_4 = (32767, -32768, -32768, 32767)


def config_of(form: Format) -> golden.Config:
    return golden.Config(exp_w=form.exp_w, frac=form.frac_w)


def records_of(beats: golden.Beats, config: golden.Config) -> np.ndarray:
    records: np.ndarray = golden.decode_records(golden.core(beats, config)["record"], config)
    return records


def decomposed(made: stimulus.Stimulus, config: golden.Config) -> np.ndarray:
    return records_of(golden.stream(made.samples, made.length, config), config)


def echoes_of(made: stimulus.Stimulus, config: golden.Config) -> np.ndarray:
    records = decomposed(made, config)
    echoes: np.ndarray = records[~records["trailer"]]
    return echoes


def errors(echoes: dict[str, np.ndarray], rights: np.ndarray, form: Format) -> dict[str, np.ndarray]:
    """Bound of the rounding error of each number of an echo, in its unit, for n = 2.

    With u half a place of 1 and x the right bracketing bin of the echo, a position is off by u·x where it is converted.
    The fraction of a bin, a/(a + b), is off by 2.5·u at most: u/2 from each of a and b, u from the sum, u from the
    quotient. The sum of both is rounded by u·x again.
    """
    u = 2.0 ** -(form.frac_w + 1)
    x, width = rights + 1, echoes["width"]
    inflection = u * (2 * x + 2.5)
    centre = inflection + u * x
    sigma = inflection + 2 * u * width
    lead = sqrt(2 * log(2)) / 2
    bounds = {
        "centre": centre,
        "peak": centre,
        "width": sigma,
        "time": centre + lead * (sigma + 2 * u * width) + u * abs(echoes["time"]),
        "amplitude": u * (echoes["amplitude"] + 1) + 2.0 ** -(golden.AMP_FRAC + 1),
    }
    # What is neglected above is of second order; a bound of float64's own errors comes on top.
    return {name: bound * (1 + 8 * u) + 1e-12 for name, bound in bounds.items()}


@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_numbers_are_as_close_to_float64_as_the_format_allows(form: Format) -> None:
    made = stimulus.reference_set(0)
    config = config_of(form)
    wanted = float64.decompose(made.samples, made.length, config)
    echoes = echoes_of(made, config)
    assert len(echoes) > 100
    np.testing.assert_array_equal(echoes["sequence"], wanted["waveform"])
    np.testing.assert_array_equal(echoes["flags"], wanted["flags"])
    for name, bound in errors(wanted, wanted["right"], form).items():
        error = abs(echoes[name] - wanted[name])
        print(f"{form}: {name} off by {error.max():.3g}, at most {(error / bound).max():.2f} of the bound")
        np.testing.assert_array_less(error, bound, err_msg=name)


def test_binary64_is_float64_to_the_bit_up_to_the_constant_of_the_echo_time() -> None:
    made = stimulus.reference_set(0)
    wanted = float64.decompose(made.samples, made.length, FIXED)
    echoes = echoes_of(made, config_of(BINARY64))
    for name in ("centre", "peak", "width"):
        np.testing.assert_array_equal(echoes[name], wanted[name], err_msg=name)
    # Either rounds its constant and its product or quotient, at most six times, and then the difference.
    bound = 2.0**-53 * (6 * echoes["width"] + 2 * abs(echoes["time"]))
    np.testing.assert_array_less(abs(echoes["time"] - wanted["time"]), bound)


def test_binary64_and_fixed_point_find_the_same_echoes() -> None:
    made = stimulus.reference_set(0)
    fixed, echoes = (decomposed(made, config) for config in (FIXED, config_of(BINARY64)))
    for name in ("trailer", "flags", "sequence", "number", "length", "noise_mean", "noise_deviation", "amplitude"):
        np.testing.assert_array_equal(echoes[name], fixed[name], err_msg=name)
    fixed, echoes = fixed[~fixed["trailer"]], echoes[~echoes["trailer"]]
    for name in ("centre", "peak", "width"):
        assert abs(echoes[name] - fixed[name]).max() <= 2.0**-15, name


@pytest.mark.parametrize("form", [BINARY16, BINARY32, BINARY64], ids=str)
def test_numpy_and_the_exact_model_give_the_same_records(form: Format, monkeypatch: pytest.MonkeyPatch) -> None:
    config = golden.Config(exp_w=form.exp_w, frac=form.frac_w, min_interval=1, min_amplitude=0, k=0.0, n=1.3125)
    beats = golden.stream(*extremes(config, length=200), config)
    quick = golden.core(beats, config)["record"]
    monkeypatch.setattr(arithmetic, "DTYPES", {})
    np.testing.assert_array_equal(golden.core(beats, config)["record"], quick)
    assert len(quick) > 400


def extremes(config: golden.Config, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Waveforms with the largest differences, positions and amplitudes that there are; rows and lengths."""
    rows = np.stack([row.astype(int) for row in _extremes(config, length)])
    return rows, np.full(len(rows), length)


def _extremes(config: golden.Config, length: int) -> Iterator[np.ndarray]:
    full = (1 << config.sample_w) - 1
    yield from (waveform for _, waveform in stimulus.directed(config.sample_w, length, config.tap_count))
    rng = np.random.default_rng(1)
    for period in (2, 3, 5, 8, 13, 40):
        yield np.where(np.arange(length) // period % 2, full, 0)
    for _ in range(4):
        yield full * rng.integers(0, 2, length)
        yield rng.integers(0, full + 1, length)
    # Full scale under the taps of one sign gives the greatest of each difference, first one way and then the other.
    for order in (1, 2):
        merged = np.array(config.taps)
        for _ in range(order):
            merged = np.diff(merged, prepend=0, append=0)
        worst = np.concatenate([merged[::-1] > 0, merged[::-1] < 0, merged[::-1] > 0])
        yield full * np.resize(worst, length)


@pytest.mark.parametrize(
    ("form", "settings"),
    [
        (BINARY16, {}),
        (BINARY16, {"sample_w": 15, "max_samples": 16384}),
        (BFLOAT16, {}),
        (BFLOAT16, {"sample_w": 16, "taps": WORST_4}),
        (BINARY32, {}),
        (BINARY32, {"sample_w": 16, "max_samples": 65536, "taps": WORST_4}),
        (BINARY64, {}),
        (BINARY64, {"sample_w": 16, "max_samples": 65536, "taps": WORST_4}),
        (Format(5, 2), {}),
        (Format(6, 17), {"sample_w": 16, "max_samples": 65536, "taps": WORST_4}),
    ],
    ids=str,
)
def test_nothing_overflows_or_is_invalid_on_extreme_waveforms(form: Format, settings: dict[str, Any]) -> None:
    shared: dict[str, Any] = {"n": 0.0, "min_interval": 0, "min_amplitude": 0, "k": 0.0} | settings
    config = golden.Config(exp_w=form.exp_w, frac=form.frac_w, **shared)
    longest = config.max_samples if form in arithmetic.DTYPES else 1024  # the exact model takes its time
    for length in (config.tap_count + 2, 300, longest):
        beats = golden.stream(*extremes(config, length), config)
        found, wanted = records_of(beats, config), records_of(beats, golden.Config(**shared))
        for name in ("trailer", "flags", "sequence", "number", "length", "noise_mean", "noise_deviation"):
            np.testing.assert_array_equal(found[name], wanted[name], err_msg=name)
        for name in NUMBERS:
            assert np.isfinite(found[name][~found["trailer"]]).all(), name


@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_records_of_floats_come_back_from_the_decoder(form: Format) -> None:
    config = config_of(form)
    numbers = {"centre": 24.5, "peak": 25.25, "width": 3.75, "time": -6.5, "amplitude": 12.75}
    trailer = {"centre": 1023, "peak": 2560, "width": 0, "time": 0, "amplitude": 384}
    beats = {
        name: np.append(arithmetic.from_int(int(value * 4), form, -2), trailer[name]) for name, value in numbers.items()
    }
    beats |= {"flags": np.array([3, 2]), "last": np.array([False, True])}
    records = golden.output(beats, config)["record"]
    assert records.dtype.itemsize * 8 == config.word_w
    echo, end = golden.decode_records(records, config)
    assert {name: echo[name] for name in numbers} == numbers
    assert (echo["flags"], echo["length"], end["flags"], end["number"]) == (3, 0, 2, 1)
    assert (end["length"], end["noise_mean"], end["noise_deviation"]) == (1023, 10, 1.5)
    assert all(np.isnan(end[name]) for name in numbers)
    # The words above a number repeat its sign.
    assert records[0, 6] >> np.uint64(form.word_w - 1) == (1 << (config.word_w - form.word_w + 1)) - 1
