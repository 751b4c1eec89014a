"""The golden model against a scalar one in exact fractions, straight from the equations, value for value."""

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from openecho import golden
from openecho.golden import arithmetic
from openecho.golden.parameters import echo_time
from openecho.golden.rounding import divide
from openecho.study.extremes.exact import decomposed, half_up, quarter_fwhm

SMOOTH_47 = tuple(round(1000 * math.exp(-(((k - 23) / 8) ** 2) / 2)) for k in range(47))
EXTREME_48 = tuple(32767 if k % 2 else -32768 for k in range(24))
WORST_48 = EXTREME_48 + EXTREME_48[::-1]

CONFIGS = {
    "default": golden.Config(),
    "narrow": golden.Config(sample_w=8, frac=4, max_samples=64, min_interval=2, min_amplitude=0, k=0.0),
    "wide": golden.Config(sample_w=16, frac=24, max_samples=65536, n=1.0),
    "4_taps": golden.Config(taps=(1, 2, 2, 1), frac=24, max_samples=200, n=1.0, min_interval=0, min_amplitude=0, k=0.0),
    "5_taps": golden.Config(taps=(1, 2, 3, 2, 1), max_samples=128, min_interval=1, min_amplitude=1, k=0.5),
    "47_taps": golden.Config(taps=SMOOTH_47, sample_w=12, frac=11, n=15.9375, max_samples=300),
    "48_worst_taps": golden.Config(taps=WORST_48, sample_w=16, frac=24, min_interval=0, min_amplitude=0, k=0.0),
    "negative_taps": golden.Config(taps=tuple(-tap for tap in golden.PAPER_TAPS), n=0.0, min_interval=3, k=1.0),
    "odd_and_signed": golden.Config(taps=(-3, 5, 0, 7, 0, 5, -3), sample_w=9, frac=7, n=0.5, min_interval=0),
    "zero_taps": golden.Config(taps=(0,) * 6, max_samples=100),
    "strict": golden.Config(min_amplitude=2047, k=15.9375, min_interval=4095),
    "too_short_for_noise": golden.Config(taps=(2, 3, 3, 2), max_samples=6, min_interval=0),
    "49_samples_at_most": golden.Config(max_samples=49),
    "50_samples_at_most": golden.Config(max_samples=50),
    "binary16": golden.Config(exp_w=5, frac=10),
    "binary16_and_widest": golden.Config(exp_w=5, frac=10, sample_w=15, max_samples=16384, n=1.0, min_interval=0),
    "bfloat16": golden.Config(exp_w=8, frac=7, taps=(1, 2, 2, 1), min_interval=0, min_amplitude=0, k=0.0),
    "binary32": golden.Config(exp_w=8, frac=23, sample_w=16, max_samples=65536, n=15.9375, min_interval=1),
    "binary64": golden.Config(exp_w=11, frac=52, taps=WORST_48, sample_w=16, min_interval=0, min_amplitude=0, k=0.0),
    "odd_float": golden.Config(exp_w=6, frac=17, taps=(-3, 5, 0, 7, 0, 5, -3), n=0.5, min_interval=0),
    "coarsest_float": golden.Config(exp_w=5, frac=2, sample_w=8, n=2.3125, min_interval=1, min_amplitude=1, k=0.5),
}


def waveforms(config: golden.Config, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Yield waveforms of every kind and length that a module treats on its own."""
    t, longest, full = config.tap_count, min(config.max_samples, 400), (1 << config.sample_w) - 1
    for length in (1, t, t + 1, t + 2, t + 3, 49, 50, 51, longest - 1, longest, config.max_samples + 3):
        yield rng.integers(0, full + 1, min(length, 500))
    x = np.arange(longest)
    yield np.zeros(longest, int)
    yield np.full(longest, full)
    yield np.where(x % 2, full, 0)
    yield np.where(x < longest // 2, 0, full)
    yield np.where(x < longest // 2, full, 0)
    yield x * full // longest
    yield np.where(x == longest // 2, full, 0)
    yield np.where(abs(x - longest // 2) < t, full, 0)
    for centre, sigma in ((0, 4), (longest - 2, 4), (longest / 2, 3), (longest / 2, 12), (longest / 2, longest)):
        yield np.rint(0.9 * full * np.exp(-(((x - centre) / sigma) ** 2) / 2)).astype(int)
    for _ in range(6):
        echoes = rng.uniform(0, full, (5, 1)) * np.exp(-(((x - rng.uniform(0, longest, (5, 1))) / 6) ** 2) / 2)
        yield np.clip(np.rint(echoes.sum(axis=0) + 10 + rng.normal(0, 2, longest)), 0, full).astype(int)


def streamed(stimulus: list[np.ndarray], config: golden.Config) -> golden.Beats:
    samples = np.zeros((len(stimulus), max(map(len, stimulus))), int)
    for row, waveform in zip(samples, stimulus, strict=True):
        row[: len(waveform)] = waveform
    return golden.stream(samples, np.array([len(waveform) for waveform in stimulus]), config)


def values(beats: golden.Beats, field: str, config: golden.Config) -> list[Any]:
    """Values of a field, None where masked; what is a float stands for its number."""
    found: list[Any] = beats[field].tolist()
    floats = ("centre", "peak", "width", "time", "amplitude") if "centre" in beats else ("left", "right", "peak")
    if config.form is None or field not in floats:
        return found
    is_number = ~beats["last"] & ~np.ma.getmaskarray(beats[field])
    words = np.ma.getdata(beats[field])[is_number]
    assert (words >> (config.form.word_w - 1) == -(words < 0).astype(int)).all()
    for at, number in zip(np.flatnonzero(is_number), arithmetic.decode(words, config.form).tolist(), strict=True):
        found[at] = Fraction(number)
    return found


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", CONFIGS)
def test_every_module_equals_exact_fractions(name: str, seed: int) -> None:
    print(f"seed {seed}")
    config = CONFIGS[name]
    stimulus = list(waveforms(config, np.random.default_rng(seed)))
    samples, noise = golden.reader(streamed(stimulus, config), config)
    components = golden.inflection(golden.second_difference(golden.filter(samples, config), config), noise, config)
    echoes = golden.parameters(components, config)

    expected = [decomposed(waveform, config) for waveform in stimulus]
    found = zip(noise["mean"].tolist(), noise["deviation"].tolist(), noise["none"].tolist(), strict=True)
    assert list(found) == [noise_beat for noise_beat, _, _ in expected]

    starts = np.cumsum([0] + [min(len(waveform), config.max_samples) for waveform in stimulus]).tolist()
    wanted = [
        beat | {"cause": beat["cause"] + start}
        for start, (_, beats, _) in zip(starts, expected, strict=False)
        for beat in beats
    ]
    for field in components:
        assert values(components, field, config) == [beat[field] for beat in wanted], field

    wanted = [beat for _, _, beats in expected for beat in beats]
    for field in ("centre", "peak", "width", "time", "amplitude", "flags"):
        assert values(echoes, field, config) == [beat[field] for beat in wanted], field


def test_the_stimulus_reaches_every_flag_and_every_kind_of_component() -> None:
    config = CONFIGS["4_taps"]
    stimulus = list(waveforms(config, np.random.default_rng(1)))
    expected = [beat for waveform in stimulus for beat in decomposed(waveform, config)[2]]
    assert {beat["flags"] for beat in expected} >= {0, 1, 2, 4, 5, 6}
    assert any(beat["time"] < 0 for beat in expected)


@pytest.mark.parametrize("frac", [0, 4, 16, 24])
def test_division_is_exact_where_int64_would_overflow(frac: int) -> None:
    seed = 3
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    denominator = np.append(rng.integers(1, 1 << 39, 500), [1, 3, (1 << 39) - 1])
    numerator = np.append(rng.integers(0, denominator[:-3] + 1), [1, 1, (1 << 39) - 2])
    expected = [half_up(Fraction(a, b), frac) for a, b in zip(numerator.tolist(), denominator.tolist(), strict=True)]
    assert divide(numerator, denominator, frac).tolist() == expected


@pytest.mark.parametrize("frac", [4, 16, 24])
def test_echo_time_is_a_quarter_fwhm_before_the_centre(frac: int) -> None:
    config = golden.Config(taps=(1, 2, 2, 1), frac=frac, min_interval=0, min_amplitude=0, k=0.0)
    stimulus = list(waveforms(config, np.random.default_rng(4)))
    records = golden.decode_records(golden.core(streamed(stimulus, config), config)["record"], config)
    echoes = records[~records["trailer"]]
    expected = echoes["centre"] - math.sqrt(2 * math.log(2)) / 2 * echoes["width"]
    assert len(echoes) > 100
    # The quotient's rounding, and what is constantly off with the divisor; float64 adds its own.
    np.testing.assert_array_less(abs(echoes["time"] - expected), (0.501 + 0.18) * 2.0**-frac)


@pytest.mark.parametrize("pos_w", [11, 28, 40])
def test_fixed_echo_time_is_within_its_bound_of_the_equation(pos_w: int) -> None:
    seed = 6
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    width = np.append(rng.integers(0, 1 << rng.integers(1, pos_w + 1, 3000)), [0, 1, 2, (1 << pos_w) - 1])
    centre = width // 2 + rng.integers(0, 1 << pos_w, width.size)
    for c, w, time in zip(centre.tolist(), width.tolist(), echo_time(centre, width, pos_w).tolist(), strict=True):
        off = Fraction(w, 1 << pos_w) * Fraction("0.18")
        assert abs(time - (c - w * quarter_fwhm())) <= Fraction(1, 2) + off, (c, w)
