"""The golden model against a scalar one in exact fractions, straight from the equations, value for value."""

import math
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest

from openecho import golden
from openecho.golden import arithmetic
from openecho.golden.floating import Format
from openecho.golden.parameters import echo_time
from openecho.golden.rounding import divide

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


def half_up(value: Fraction, bits: int) -> int:
    return math.floor(value * (1 << bits) + Fraction(1, 2))


def rounded(value: Fraction | int, form: Format) -> Fraction:
    """Nearest number of a format without an end, ties to even."""
    value = Fraction(value)
    exponent = value.numerator.bit_length() - value.denominator.bit_length()
    exponent -= abs(value) < Fraction(2) ** exponent
    place = Fraction(2) ** (max(exponent, 1 - form.bias) - form.frac_w)
    return round(value / place) * place


def quarter_fwhm() -> Fraction:
    """0.25·FWHM of a Gaussian of σ = 1, √(2 ln 2)/2, to 2⁻²⁰⁰; the series is Σ 1/(k·2^k) = ln 2."""
    squared = sum(Fraction(1, k << k) for k in range(1, 420)) / 2
    return Fraction(math.isqrt(math.floor(squared * 2**400)), 2**200)


def position(x: Fraction, config: golden.Config) -> Fraction | int:
    return half_up(x, config.frac) if config.form is None else rounded(x, config.form)


def zero(x: Fraction, y: int, y_next: int, config: golden.Config) -> Fraction | int:
    y, y_next = abs(y), abs(y_next)
    if config.form is None:
        return half_up(x + Fraction(y, y + y_next), config.frac)
    fl = partial(rounded, form=config.form)
    value, next_value = fl(Fraction(y, 2**11)), fl(Fraction(y_next, 2**11))
    return fl(fl(x) + fl(value / fl(value + next_value)))


def noise_of(s: list[int]) -> tuple[int, int, int]:
    if len(s) < 50:
        return 0, 0, 1
    head = s[:50]
    variance = sum(v * v for v in head) * 50 - sum(head) ** 2
    root = Fraction(math.isqrt(variance * 2**8), 2**4)
    return half_up(Fraction(sum(head), 50), 8), half_up(root / 50, 8), 0


def components_of(s: list[int], mean: int, deviation: int, config: golden.Config) -> list[dict[str, Any]]:
    t, taps = config.tap_count, config.taps
    filtered = [sum(taps[k] * s[i - k] for k in range(min(t, i + 1))) for i in range(len(s))]
    first = [v - (filtered[i - 1] if i > 0 else 0) for i, v in enumerate(filtered)]
    second = [v - (first[i - 1] if i > 0 else 0) for i, v in enumerate(first)]
    end, components = t, []
    while end + 1 < len(s):
        begin = end + 1
        if second[begin] > 0:
            end = begin
            continue
        end = begin
        while end + 1 < len(s) and second[end + 1] <= 0:
            end += 1
        at_start, at_end = begin == t + 1, end == len(s) - 1
        beats = end - begin + 1
        if (at_start and at_end) or beats <= max(config.min_interval, 1):
            continue
        x = [i - Fraction(t + 1, 2) for i in range(len(s))]
        first_x, last_x = position(x[begin], config), position(x[end], config)
        left = first_x if at_start else zero(x[begin - 1], second[begin - 1], second[begin], config)
        right = last_x if at_end else zero(x[end], second[end], second[end + 1], config)
        falls = [i for i in range(begin, end + 1) if first[i - 1] > 0 >= first[i]]
        assert len(falls) <= 1
        peaks = [zero(i - 1 - Fraction(t, 2), first[i - 1], first[i], config) for i in falls]
        # Strictly between the outer bracketing coordinates, or up to the last sample that a cut run has seen.
        inner = [j for j in range(len(s)) if x[begin] - 1 < j < (x[end] + 1 if not at_end else x[end] + Fraction(1, 4))]
        maximum = max(s[j] for j in inner)
        amplitude = maximum * 256 - mean
        threshold = max(Fraction(config.min_amplitude), Fraction(config.k) * Fraction(deviation, 256))
        if Fraction(amplitude, 256) < threshold:
            continue
        components.append(
            {
                "left": left,
                "right": right,
                "peak": peaks[0] if peaks else None,
                "amplitude": amplitude,
                "length": None,
                "mean": None,
                "flags": (maximum == 2**config.sample_w - 1) + 2 * (at_start or at_end) + 4 * (not peaks),
                "last": False,
                "cause": end if at_end else end + 1,
            }
        )
    return components


def echo_of(component: dict[str, Any], config: golden.Config) -> dict[str, Any]:
    left, right, n = component["left"], component["right"], Fraction(max(config.n, 1.0))
    centre: Fraction | int
    width: Fraction | int
    time: Fraction | int
    amplitude: Fraction | int = component["amplitude"]
    if config.form is None:
        centre = half_up(Fraction(left + right, 2), 0)
        width = half_up(Fraction(right - left) / n, 0)
        time = centre - half_up(width / Fraction(half_up(1 / quarter_fwhm(), config.pos_w), 1 << config.pos_w), 0)
    else:
        fl = partial(rounded, form=config.form)
        centre = fl(left + right) / 2
        width = fl(fl(right - left) / fl(n))
        time = fl(centre - fl(width / fl(1 / quarter_fwhm())))
        amplitude = fl(Fraction(amplitude, 256))
    return {
        "centre": centre,
        "peak": centre if component["peak"] is None else component["peak"],
        "width": width,
        "time": time,
        "amplitude": amplitude,
        "flags": component["flags"],
    }


def decomposed(waveform: np.ndarray, config: golden.Config) -> tuple[tuple[int, int, int], list[Any], list[Any]]:
    s = waveform.tolist()[: config.max_samples]
    mean, deviation, none = noise_of(s)
    found = components_of(s, mean, deviation, config)
    flags = (len(s) < config.tap_count + 2) + 2 * (len(waveform) > config.max_samples) + 4 * none
    trailer = dict.fromkeys(("left", "right", "peak")) | {"amplitude": deviation, "length": len(s), "mean": mean}
    components = [*found, trailer | {"flags": flags, "last": True, "cause": len(s) - 1}]
    end = {"centre": len(s), "peak": mean, "width": 0, "time": 0, "amplitude": deviation, "flags": flags}
    return (mean, deviation, none), components, [*(echo_of(component, config) for component in found), end]


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
