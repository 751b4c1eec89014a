"""The float64 form of the method: against the fixed point, against the truth, and as the paper printed it."""

import itertools
import math
import re

import numpy as np
import pytest

from openecho import golden
from openecho.golden import float64

CONFIG = golden.Config()


def gaussians(x: np.ndarray, centre: np.ndarray, sigma: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    total: np.ndarray = (amplitude * np.exp(-(((x - centre) / sigma) ** 2) / 2)).sum(axis=0)
    return total


def scene(seed: int, rows: int = 60, row: int = 528) -> tuple[np.ndarray, np.ndarray]:
    """Waveforms of up to six echoes over a noisy baseline, digitised in 11 bits."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    x = np.arange(row)
    echoes = rng.uniform((-5, 2, 5), (row + 5, 15, 700), (6, rows, 1, 3))
    clean = 15 + gaussians(x, *np.moveaxis(echoes, -1, 0))
    samples = np.clip(np.rint(clean + rng.normal(0, 1.5, clean.shape)), 0, 2047).astype(int)
    return samples, rng.integers(row // 2, row + 1, rows)


def test_worked_example_of_the_paper() -> None:
    x, y, y_next = np.array([[536, 0.1464, -0.0005684], [570, -0.05633, 0.05664]]).T
    found = float64.zero_crossing(x, y, y_next)
    # The paper's five decimals are cut, not rounded: the second is 570.498628.
    assert (np.floor(found * 1e5) / 1e5).tolist() == [536.99613, 570.49862]


def test_published_equation_5_swaps_the_two_sides_of_the_crossing() -> None:
    x, y, y_next = np.array([[570, -0.05633, 0.05664]]).T
    assert float64.zero_crossing(x, y, y_next, published=True)[0] == pytest.approx(570.501372, abs=1e-6)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_core_finds_the_same_echoes_within_its_last_bits(seed: int) -> None:
    samples, length = scene(seed)
    wanted = float64.decompose(samples, length, CONFIG)
    records = golden.decode_records(golden.core(golden.stream(samples, length, CONFIG), CONFIG)["record"], CONFIG)
    echoes, trailers = records[~records["trailer"]], records[records["trailer"]]
    assert len(echoes) > 100
    np.testing.assert_array_equal(echoes["sequence"], wanted["waveform"])
    np.testing.assert_array_equal(echoes["flags"], wanted["flags"])
    for field, bound in (("centre", 2**-15), ("peak", 2**-15), ("width", 2**-15), ("time", 2**-14)):
        assert abs(echoes[field] - wanted[field]).max() <= bound, field
    assert abs(echoes["amplitude"] - wanted["amplitude"]).max() <= 2**-6
    assert abs(trailers["noise_mean"] - wanted["noise_mean"]).max() <= 2**-9
    assert abs(trailers["noise_deviation"] - wanted["noise_deviation"]).max() <= 2**-8


def test_flags_and_their_booleans_agree() -> None:
    echoes = float64.decompose(*scene(4), CONFIG)
    for name, bit in (("saturated", golden.SATURATED), ("truncated", golden.TRUNCATED), ("no_peak", golden.NO_PEAK)):
        np.testing.assert_array_equal(echoes[name], echoes["flags"] & bit != 0)
    assert {1, 2, 4} & set(echoes["flags"].tolist())


def single_echoes(seed: int, rows: int = 1000, sigma: float = 8) -> tuple[np.ndarray, np.ndarray]:
    """One Gaussian of amplitude 200 a row, whole counts, no noise; and where it is."""
    print(f"seed {seed}")
    centre = np.random.default_rng(seed).uniform(100, 101, (rows, 1))
    clean = 20 + gaussians(np.arange(200), centre[np.newaxis], np.array(sigma), np.array(200))
    return np.rint(clean).astype(int), centre[:, 0]


def test_corrected_equation_5_is_at_least_five_times_better_than_the_published() -> None:
    samples, truth = single_echoes(seed=5)
    length = np.full(len(samples), samples.shape[1])
    rms = []
    for published in (False, True):
        echoes = float64.decompose(samples, length, CONFIG, published=published)
        np.testing.assert_array_equal(echoes["waveform"], np.arange(len(samples)))
        rms.append(math.sqrt(np.mean((echoes["centre"] - truth) ** 2)))
    corrected, as_published = rms
    print(f"centre RMS {corrected:.4f} bin, as published {as_published:.4f} bin")
    assert corrected < 0.03
    assert 0.2 < as_published < 0.4
    assert as_published > 5 * corrected


def test_peak_width_and_amplitude_of_a_single_echo_are_near_the_truth() -> None:
    samples, truth = single_echoes(seed=6, rows=100)
    echoes = float64.decompose(samples, np.full(100, 200), CONFIG)
    assert math.sqrt(np.mean((echoes["peak"] - truth) ** 2)) < 0.01
    assert abs(float64.corrected_width(echoes["width"], CONFIG) - 8).max() < 0.35
    assert abs(echoes["amplitude"] - 200).max() < 1


@pytest.mark.parametrize(("sigma", "tap_count"), [(3, 20), (5, 32), (8, 48)])
def test_corrected_width_is_the_truth_for_taps_that_match_the_pulse(sigma: int, tap_count: int) -> None:
    offset = np.arange(tap_count) - (tap_count - 1) / 2
    taps = tuple(np.rint(1000 * np.exp(-((offset / sigma) ** 2) / 2)).astype(int).tolist())
    config = golden.Config(taps=taps)
    samples, _ = single_echoes(seed=8, rows=100, sigma=sigma)
    echoes = float64.decompose(samples, np.full(100, 200), config)
    assert echoes["width"].min() > 1.35 * sigma
    assert abs(float64.corrected_width(echoes["width"], config) / sigma - 1).max() < 0.03


@pytest.mark.parametrize(("sigma", "corrected"), [(3, 5.68), (5, 6.00), (8, 8.29), (16, 16.04)])
def test_corrected_width_stays_too_wide_for_taps_cut_short(sigma: int, corrected: float) -> None:
    samples, _ = single_echoes(seed=9, rows=100, sigma=sigma)
    echoes = float64.decompose(samples, np.full(100, 200), CONFIG)
    assert float64.corrected_width(echoes["width"], CONFIG).mean() == pytest.approx(corrected, abs=0.03)


def test_corrected_width_takes_off_the_variance_of_the_taps() -> None:
    assert float64.corrected_width(np.array([4.0, 8.0]), CONFIG) == pytest.approx(
        [0, math.sqrt(64 - 4.775**2)], abs=1e-3
    )
    even = golden.Config(taps=(1, 1, 1, 1))
    assert float64.corrected_width(np.array([3.0]), even) == pytest.approx([math.sqrt(9 - 1.25)])


def five_state_machine(signs: str) -> list[tuple[int, int]]:
    """Begin and end of each run of 0 that the machine of Zhou 2022 finds, looking at pair after pair of signs."""
    state, begin, found = "idle", 0, []
    for i, pair in enumerate(map("".join, itertools.pairwise(signs))):
        if state == "idle" and pair == "11":
            state = "positive"
        elif state == "positive" and pair == "10":
            state, begin = "inflection 1", i + 1
        elif state == "inflection 1":
            state = "negative" if pair == "00" else "idle"
        elif state == "negative" and pair == "01":
            state = "inflection 2"
            found.append((begin, i + 1))
        elif state == "inflection 2":
            state = "idle"
    return found


def direct_paths(signs: str) -> list[tuple[int, int]]:
    """Begin and end of each run of 0 between two 1."""
    return [run.span() for run in re.finditer("(?<=1)0+(?=1)", signs)]


def crest(raw: np.ndarray) -> int:
    """First local maximum by the paper's pattern, or the greatest sample."""
    at = bits(np.diff(raw) > 0).find("1100")
    return int(raw.max() if at < 0 else raw[at + 2])


def bits(values: np.ndarray) -> str:
    return "".join(f"{value:d}" for value in values.tolist())


@pytest.mark.parametrize("min_interval", [0, 2, 4])
def test_published_form_follows_the_five_state_machine_and_the_pattern_1100(min_interval: int) -> None:
    seed = 7
    print(f"seed {seed}")
    # Less than 50 samples have no noise, so every component is an echo; four taps leave signs that change fast.
    config = golden.Config(taps=(1, 2, 2, 1), min_interval=min_interval, min_amplitude=0)
    rng = np.random.default_rng(seed)
    samples, length = rng.integers(0, 2048, (400, 49)), rng.integers(20, 50, 400)
    found, saved, maximum = [], [], []
    for waveform, (row, n) in enumerate(zip(samples, length, strict=True)):
        signs = bits(np.convolve(row[:n], [1, 0, -1, -1, 0, 1])[5:n] > 0)
        runs, all_runs = (
            [run for run in machine(signs) if run[1] - run[0] > max(min_interval, 1)]
            for machine in (five_state_machine, direct_paths)
        )
        found += [waveform] * len(runs)
        saved.append(len(all_runs) - len(runs))
        # Sign 0 belongs to raw bin 2½, so the run's outer bracketing coordinates to bins begin + 1½ and end + 2½.
        maximum += [crest(row[begin + 2 : end + 3]) for begin, end in runs]
    echoes = float64.decompose(samples, length, config, published=True)
    assert echoes["waveform"].tolist() == found
    assert echoes["maximum"].tolist() == maximum
    assert float64.saved_echoes(samples, length, config).tolist() == saved
    assert sum(saved) > 10
