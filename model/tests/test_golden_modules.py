"""Each golden module by a second way of computing it, with numpy."""

import dataclasses
import itertools
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from openecho import golden

CONFIG = golden.Config()
MERGED = [43, -31, 2, 1, 0, 0, -2, -2, -3, -4, -4, -4, -4, -3, -2, -2, 0, 0, 1, 2, -31, 43]


def noisy(seed: int, rows: int = 30, row: int = 200) -> tuple[np.ndarray, np.ndarray]:
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    return rng.integers(0, 2048, (rows, row)), rng.integers(1, row + 1, rows)


def split(values: np.ndarray, length: np.ndarray) -> list[np.ndarray]:
    return np.split(values, np.cumsum(length)[:-1])


def test_stream_joins_the_recorded_samples_end_to_end() -> None:
    beats = golden.stream(np.array([[1, 2, 0], [3, 4, 5], [6, 0, 0]]), np.array([2, 3, 1]))
    assert beats["sample"].tolist() == [1, 2, 3, 4, 5, 6]
    assert beats["last"].tolist() == [False, True, False, False, True, True]


@pytest.mark.parametrize(
    ("samples", "length", "message"),
    [
        (np.zeros(4, int), np.array([4]), r"samples: found shape \(4,\), expected \(waveforms, samples\), .*"),
        (np.zeros((0, 4), int), np.zeros(0, int), r"samples: found shape \(0, 4\), expected .*"),
        (np.zeros((1, 4)), np.array([4]), "samples: found float64, expected integers"),
        (np.array([[0, -1]]), np.array([2]), "samples: found -1 to 0, expected 0 to 2047"),
        (np.array([[7, 2048]]), np.array([2]), "samples: found 7 to 2048, expected 0 to 2047"),
        (np.zeros((2, 4), int), np.array([4]), r"length: found int64 of shape \(1,\), expected .* of shape \(2,\)"),
        (np.zeros((1, 4), int), np.array([4.0]), r"length: found float64 of shape \(1,\), expected integers of .*"),
        (np.zeros((2, 4), int), np.array([4, 0]), "length: found 0 to 4, expected 1 to 4"),
        (np.zeros((2, 4), int), np.array([5, 4]), "length: found 4 to 5, expected 1 to 4"),
    ],
)
def test_stream_names_what_is_wrong_in_one_line(samples: np.ndarray, length: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        golden.stream(samples, length, CONFIG)


def test_reader_cuts_long_waveforms_and_leaves_the_next_one_whole() -> None:
    config = golden.Config(taps=(1, 1, 1, 1), max_samples=6)
    beats = golden.stream(np.arange(24).reshape(3, 8), np.array([6, 8, 3]), config)
    samples, _ = golden.reader(beats, config)
    assert samples["sample"].tolist() == [0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13, 16, 17, 18]
    assert samples["index"].tolist() == [0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 0, 1, 2]
    assert np.flatnonzero(samples["last"]).tolist() == [5, 11, 14]
    assert np.flatnonzero(samples["overlong"]).tolist() == [11]
    assert beats["sample"][samples["cause"] - 1].tolist()[6:12] == [5, 8, 9, 10, 11, 12]


@pytest.mark.parametrize("spread", [0.2, 1.0, 30.0])
def test_noise_is_numpys_mean_and_deviation_within_the_rounding(spread: float) -> None:
    seed = 5
    print(f"seed {seed}")
    samples = np.rint(np.random.default_rng(seed).normal(200, spread, (200, 70))).astype(int)
    length = np.tile([50, 51, 70, 49], 50)
    _, noise = golden.reader(golden.stream(samples, length, CONFIG), CONFIG)
    measured = length >= 50
    assert noise["none"].tolist() == (~measured).tolist()
    mean_error = noise["mean"] / 256 - np.where(measured, samples[:, :50].mean(axis=1), 0)
    deviation_error = noise["deviation"] / 256 - np.where(measured, samples[:, :50].std(axis=1), 0)
    # Half of 2⁻⁸ for the rounding; the root is cut to 2⁻⁴ before it is divided by 50.
    assert abs(mean_error).max() <= 2**-9
    assert deviation_error.max() <= 2**-9
    assert deviation_error.min() >= -(2**-9) - 2**-4 / 50


def test_noise_is_caused_by_the_50th_sample_or_the_last() -> None:
    beats = golden.stream(np.zeros((3, 60), int), np.array([60, 20, 50]), CONFIG)
    _, noise = golden.reader(beats, CONFIG)
    assert noise["cause"].tolist() == [49, 79, 129]


@pytest.mark.parametrize("taps", [golden.PAPER_TAPS, (1, -2, -2, 1), (5, 4, 3, 4, 5), tuple([32767] * 47)])
def test_filter_is_the_convolution_of_each_waveform(taps: tuple[int, ...]) -> None:
    config = golden.Config(taps=taps)
    rows, length = noisy(seed=6)
    samples, _ = golden.reader(golden.stream(rows, length, config), config)
    filtered = golden.filter(samples, config)
    for row, n, total in zip(rows, length, split(filtered["sum"], length), strict=True):
        np.testing.assert_array_equal(total, np.convolve(row[:n], taps)[:n])


@pytest.mark.parametrize(("taps", "delay"), [(golden.PAPER_TAPS, 11), ((1, 1, 1, 1), 3), ((1, 1, 1, 1, 1), 3)])
def test_filter_delays_the_raw_sample_and_masks_what_it_does_not_have(taps: tuple[int, ...], delay: int) -> None:
    config = golden.Config(taps=taps)
    rows, length = noisy(seed=7)
    samples, _ = golden.reader(golden.stream(rows, length, config), config)
    raw = golden.filter(samples, config)["raw"].tolist()
    expected = [([None] * delay + row.tolist())[:n] for row, n in zip(rows, length, strict=True)]
    assert raw == list(itertools.chain(*expected))


def test_second_difference_is_the_merged_22_tap_filter() -> None:
    rows, length = noisy(seed=8)
    samples, _ = golden.reader(golden.stream(rows, length, CONFIG), CONFIG)
    differences = golden.second_difference(golden.filter(samples, CONFIG), CONFIG)
    first_taps = np.convolve(golden.PAPER_TAPS, [1, -1])
    for row, n, first, second in zip(
        rows, length, split(differences["first"], length), split(differences["second"], length), strict=True
    ):
        np.testing.assert_array_equal(first, np.convolve(row[:n], first_taps)[:n])
        np.testing.assert_array_equal(second, np.convolve(row[:n], MERGED)[:n])


def worked_example(raw: int = 0) -> tuple[golden.Beats, golden.Config]:
    """Second differences of the paper's Figure 3, times 10⁷; five taps put the difference at beat i on bin i − 3."""
    config = golden.Config(taps=(1, 2, 3, 2, 1), sample_w=16, frac=24, min_amplitude=0, k=0.0)
    index = np.arange(600)
    second = np.where((index < 540) | (index > 573), 1_000_000, -1_000_000)
    second[[539, 540, 573, 574]] = 1464000, -5684, -563300, 566400
    zero = np.zeros_like(index)
    beats = {"second": second, "first": zero, "raw": zero + raw, "index": index, "overlong": zero, "last": index == 599}
    return beats, config


def one_noise(mean: int, deviation: int, none: int = 0) -> golden.Beats:
    return {"mean": np.array([mean]), "deviation": np.array([deviation]), "none": np.array([none])}


def test_worked_example_of_the_paper_through_inflection() -> None:
    beats, config = worked_example()
    found = golden.inflection(beats, one_noise(0, 0), config)
    assert found["last"].tolist() == [False, True]
    assert found["cause"].tolist() == [574, 599]
    bins = [found[name][0] / 2**24 for name in ("left", "right")]
    # The paper's five decimals are cut, not rounded: the second is 570.498628.
    assert [np.floor(x * 1e5) / 1e5 for x in bins] == [536.99613, 570.49862]
    np.testing.assert_allclose(bins, [536 + 1464000 / 1469684, 570 + 563300 / 1129700], rtol=0, atol=2**-25)


@pytest.mark.parametrize(
    ("min_amplitude", "k", "deviation"),
    [(5, 3.0, 100), (5, 0.0, 65535), (0, 0.0, 9), (0, 15.9375, 1600), (7, 0.0625, 28672), (9, 1.5, 1537)],
)
def test_inflection_drops_what_does_not_rise_out_of_the_noise(min_amplitude: int, k: float, deviation: int) -> None:
    raw, threshold = 20_000, max(Fraction(min_amplitude), Fraction(k) * Fraction(deviation, 256))
    beats, config = worked_example(raw)
    config = dataclasses.replace(config, min_amplitude=min_amplitude, k=k)
    edge = raw * 256 - math.ceil(threshold * 256)
    for mean in (edge - 1, edge, edge + 1):
        found = golden.inflection(beats, one_noise(mean, deviation), config)
        risen = raw - Fraction(mean, 256) >= threshold
        assert risen == (mean <= edge)
        assert found["amplitude"].tolist() == [raw * 256 - mean] * risen + [deviation]
        assert found["mean"].tolist() == [None] * risen + [mean]


def test_inflection_takes_each_waveforms_own_noise_and_flags_where_there_is_none() -> None:
    beats, config = worked_example(raw=100)
    beats = {name: np.tile(values, 3) for name, values in beats.items()}
    noise = {"mean": np.array([0, 101, 99]) << 8, "deviation": np.array([0, 7, 8]), "none": np.array([1, 0, 0])}
    found = golden.inflection(beats, noise, config)
    assert found["last"].tolist() == [False, True, True, False, True]
    assert found["amplitude"].tolist() == [100 << 8, 0, 7, 1 << 8, 8]
    assert found["flags"][found["last"]].tolist() == [golden.NO_NOISE, 0, 0]


@pytest.mark.parametrize(("n", "width"), [(2.0, 4.0), (1.0, 8.0), (0.0, 8.0), (15.9375, 8 / 15.9375)])
def test_width_is_the_interval_over_n_and_n_below_one_counts_as_one(n: float, width: float) -> None:
    config = golden.Config(n=n)
    beats = {"left": 9 << 16, "right": 17 << 16, "peak": 0, "amplitude": 50 << 8, "length": 0, "mean": 0, "flags": 0}
    fields = {name: np.array([value]) for name, value in beats.items()}
    found = golden.parameters(fields | {"last": np.array([False])}, config)
    assert abs(found["width"][0] / 2**16 - width) <= 2**-17


def echo_fields(**values: Any) -> golden.Beats:
    last = np.array([False, True, False, False, True])
    fields = {name: np.zeros(5, np.int64) for name in ("centre", "peak", "width", "time", "amplitude", "flags")}
    return fields | {"last": last} | {name: np.array(value) for name, value in values.items()}


@pytest.mark.parametrize("config", [CONFIG, golden.Config(frac=24, max_samples=65536)], ids=["32_bit", "64_bit"])
def test_records_come_back_from_the_decoder(config: golden.Config) -> None:
    one = 1 << config.frac
    greatest = (1 << config.pos_w) - 1
    beats = echo_fields(
        centre=[greatest, 22, one, 3 * one, 1024],
        peak=[one // 2, 2560, 2 * one, 4 * one, 128],
        width=[greatest, 0, one, 5 * one, 0],
        time=[-one // 4, 0, greatest, -greatest, 0],
        amplitude=[(1 << config.amp_w) - 1, 384, 256, 0, 64],
        flags=[5, 6, 0, 2, 1],
    )
    records = golden.output(beats, config)["record"]
    assert records.dtype.itemsize * 8 == config.word_w
    found = golden.decode_records(records, config)
    trailer, echo = found[found["trailer"]], found[~found["trailer"]]
    assert found["trailer"].tolist() == beats["last"].tolist()
    assert found["flags"].tolist() == [5, 6, 0, 2, 1]
    assert found["sequence"].tolist() == [0, 0, 1, 1, 1]
    assert found["number"].tolist() == [0, 1, 0, 1, 2]
    assert echo["centre"].tolist() == [greatest / one, 1, 3]
    assert echo["peak"].tolist() == [0.5, 2, 4]
    assert echo["width"].tolist() == [greatest / one, 1, 5]
    assert echo["time"].tolist() == [-0.25, greatest / one, -greatest / one]
    assert echo["amplitude"].tolist() == [((1 << config.amp_w) - 1) / 256, 1, 0]
    assert trailer["length"].tolist() == [22, 1024]
    assert trailer["noise_mean"].tolist() == [10, 0.5]
    assert trailer["noise_deviation"].tolist() == [1.5, 0.25]
    assert np.isnan(trailer["centre"]).all()
    assert np.isnan(echo["noise_mean"]).all()


def test_core_is_the_six_modules_and_its_causes_are_samples() -> None:
    config = golden.Config(max_samples=150)
    rows, length = noisy(seed=9)
    beats = golden.stream(rows, length, config)
    samples, noise = golden.reader(beats, config)
    components = golden.inflection(golden.second_difference(golden.filter(samples, config), config), noise, config)
    expected = golden.output(golden.parameters(components, config), config)
    found = golden.core(beats, config)
    np.testing.assert_array_equal(found["record"], expected["record"])
    np.testing.assert_array_equal(found["last"], expected["last"])
    starts = np.cumsum(length) - length
    np.testing.assert_array_equal(found["cause"][found["last"]], starts + np.minimum(length, 150) - 1)


def test_a_waveform_does_not_depend_on_its_neighbours() -> None:
    rows, length = noisy(seed=10)
    together = golden.core(golden.stream(rows, length, CONFIG), CONFIG)
    ends = np.flatnonzero(together["last"])[:-1] + 1
    for row, n, records in zip(rows, length, np.split(together["record"], ends), strict=True):
        alone = golden.core(golden.stream(row[np.newaxis], np.array([n]), CONFIG), CONFIG)["record"]
        np.testing.assert_array_equal(np.delete(records, 1, axis=1), np.delete(alone, 1, axis=1))
