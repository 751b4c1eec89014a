"""Extremes of the core: whatever the waveform, every record is the exact one."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho import golden, stimulus
from openecho.golden import NO_NOISE, SATURATED, TOO_LONG, TOO_SHORT, TRUNCATED, Config
from openecho.golden.rounding import divide
from openecho.study.extremes import exact
from openecho.study.extremes.case import Case, Outcome, Trial, bounded, equal, planted

Waveform = NDArray[np.int64]
Floats = NDArray[np.float64]

AREA = "core"

# Functions of the package hide the modules of their names.
CORE, INFLECTION, READER = (
    importlib.import_module(f"openecho.golden.{name}") for name in ("core", "inflection", "reader")
)

EVERYTHING = Config(min_interval=0, min_amplitude=0, k=0.0)
"""The core when it drops nothing."""

EXACT = "every field of every record is that of the equations in exact fractions"

QUIET = 60
"""Samples before the first echo: the noise is measured on 50."""


def records(waveforms: Sequence[Waveform], config: Config) -> np.ndarray:
    """Decoded records of waveforms of any lengths."""
    samples = np.zeros((len(waveforms), max(map(len, waveforms))), np.int64)
    for row, waveform in zip(samples, waveforms, strict=True):
        row[: len(waveform)] = waveform
    beats = golden.stream(samples, np.array([len(waveform) for waveform in waveforms]), config)
    decoded: np.ndarray = golden.decode_records(golden.core(beats, config)["record"], config)
    return decoded


def echoes(waveforms: Sequence[Waveform], config: Config) -> np.ndarray:
    """Echoes alone."""
    found = records(waveforms, config)
    alone: np.ndarray = found[~found["trailer"]]
    return alone


def as_fractions(waveforms: Sequence[Waveform], config: Config) -> tuple[int, int]:
    """Fields of records that are not exact, and records."""
    found = records(waveforms, config)
    return exact.unlike(found, list(waveforms), config), len(found)


def judged(pairs: Iterator[tuple[int, int]]) -> Outcome:
    """Outcome of `as_fractions` for several configurations."""
    differing, checked = np.sum(list(pairs), axis=0)
    return equal(int(differing), int(checked), "records")


def made(signal: Floats, config: Config = EVERYTHING) -> Waveform:
    """Whole counts of a digitiser."""
    return stimulus.quantise(signal, config.sample_w).astype(np.int64)


def gaussian(length: int, centre: float, width: float, amplitude: float) -> Floats:
    """An echo, counts."""
    return np.asarray(amplitude * np.exp(-0.5 * ((np.arange(length) - centre) / width) ** 2))


# --- limits ---------------------------------------------------------------------------------------------------------


def limits(trial: Trial) -> Outcome:
    """Words, lengths, settings and taps at their ends."""
    words = [(8, 4), (16, 24)]
    if trial.full:
        words = [(bits, frac) for bits in range(8, 17) for frac in range(4, 25, 4)]
    configs = [replace(EVERYTHING, sample_w=bits, frac=frac) for bits, frac in words]
    configs += [Config(taps=(1, 2, 2, 1), max_samples=64), Config(taps=(32767,) * 48, sample_w=16, frac=24)]
    configs += [Config(n=0.0), Config(n=15.9375), Config(k=15.9375), Config(min_interval=4095, min_amplitude=2047)]
    return judged(as_fractions(list(at_the_limits(config, trial)), config) for config in configs)


def at_the_limits(config: Config, trial: Trial) -> Iterator[Waveform]:
    """Waveforms of every length that is treated on its own, and of every extreme shape."""
    full, taps = (1 << config.sample_w) - 1, config.tap_count
    for length in (1, taps, taps + 1, taps + 2, 49, 50, 51):
        yield trial.rng.integers(0, full + 1, length)
    length = min(config.max_samples, 300 if trial.full else 120)
    for _, shape in stimulus.directed(config.sample_w, length, taps):
        yield shape.astype(np.int64)
    yield trial.rng.integers(0, full + 1, length)


def lengths(trial: Trial) -> Outcome:
    """Waveforms that are too short, and longer than the core takes."""
    config = replace(EVERYTHING, max_samples=65536 if trial.full else 4096)
    sizes = (1, 21, 22, 49, 50, config.max_samples, config.max_samples + 1, config.max_samples + 300)
    found = records([trial.rng.integers(0, 2048, size) for size in sizes], config)
    ends = found[found["trailer"]]
    expected = [
        TOO_SHORT * (size < config.tap_count + 2) + TOO_LONG * (size > config.max_samples) + NO_NOISE * (size < 50)
        for size in sizes
    ]
    wrong = np.count_nonzero(ends["flags"] != expected)
    wrong += np.count_nonzero(ends["length"] != np.minimum(sizes, config.max_samples))
    return equal(int(wrong), 2 * len(sizes), "flags and lengths")


# --- echoes ---------------------------------------------------------------------------------------------------------


def dynamic_range(trial: Trial) -> Outcome:
    """An echo of 1 count beside one of full scale, nearer and nearer."""
    config = replace(EVERYTHING, min_interval=2)
    apart = np.arange(20, 121, 10 if not trial.full else 2)
    strong = 20 + gaussian(400, 150.0, 5, 2000)
    pairs = [made(strong + gaussian(400, 150.0 + distance, 5, 1), config) for distance in apart]
    alone = echoes([made(strong, config)], config)
    top = alone["peak"][alone["amplitude"].argmax()]
    found = echoes(pairs, config)
    seen = [
        distance
        for row, distance in enumerate(apart)
        if (abs(found["peak"][found["sequence"] == row] - (150 + distance)) < 2).any()
    ]
    of_each = (found[found["sequence"] == row] for row in range(len(pairs)))
    moved = max(abs(own["peak"][own["amplitude"].argmax()] - top) for own in of_each)
    differing, checked = as_fractions(pairs, config)
    told = (
        f"{differing} differences in {checked} records; the strong peak moves {moved:.1e} bin; the weak is seen from "
    )
    return Outcome(differing == 0 and moved <= SLOPE_OF_ONE, f"{told}{min(seen, default=np.inf):g} bins on")


SLOPE_OF_ONE = 0.01
"""Bins. A count more somewhere changes the filtered first difference by at most 30/2048 of it (the steepest step of the
taps), and near its peak an echo of 2000 counts and σ 5 bends by 2000 / (5² + 4.775²) · 0.69 = 29 counts a bin²: with
some 20 changed samples the sum stays below 20 · 15 / 2048 / 29."""


def widths(trial: Trial) -> Outcome:
    """Echoes from one bin to a quarter of the record wide."""
    sigmas = (1, 2, 3, 5, 16, 60, 250) if not trial.full else np.geomspace(1, 256, 30)
    waveforms = [made(20 + gaussian(1024, 512.3, sigma, 1800)) for sigma in sigmas]
    return judged(as_fractions(waveforms, config) for config in (EVERYTHING, replace(EVERYTHING, frac=24)))


def separations(trial: Trial) -> Outcome:
    """Two equal echoes, from far apart to one upon the other."""
    apart = np.linspace(60, 0, 13 if not trial.full else 121)
    waveforms = [made(20 + gaussian(300, 120, 5, 900) + gaussian(300, 120 + distance, 5, 900)) for distance in apart]
    config = Config()
    differing, checked = as_fractions(waveforms, config)
    count = np.bincount(echoes(waveforms, config)["sequence"], minlength=len(waveforms))
    falls = bool((np.diff(count) <= 0).all()) and {count[0], count[-1]} == {2, 1}
    one = apart[count == 1].max(initial=0)
    return Outcome(differing == 0 and falls, f"{differing} differences in {checked} records; two down to {one:g} bins")


def many(trial: Trial) -> Outcome:
    """From no echo to 64 in one record, as near as the filter lets them be told apart."""
    counts = (0, 1, 17, 64) if not trial.full else range(65)
    waveforms = []
    for count in counts:
        signal = np.full(4096, 20.0)
        for number in range(count):
            signal += gaussian(4096, QUIET + 40 + 60 * number, 5, 300)
        waveforms.append(made(signal))
    found = records(waveforms, Config())
    ends, peaks = found[found["trailer"]], found[~found["trailer"]]
    wrong = np.count_nonzero(ends["number"] != list(counts))
    wrong += np.count_nonzero(peaks["number"] != np.concatenate([np.arange(count) for count in counts]))
    return equal(int(wrong), len(found), "numbers")


# --- noise and digitiser --------------------------------------------------------------------------------------------


def noises(trial: Trial) -> Outcome:
    """White, coloured and impulsive noise, from none to more than the signal."""
    signal, config = 200 + gaussian(400, 250, 6, 100), Config()
    waveforms = []
    for deviation in (0, 0.1, 1, 10, 100, 400):
        for _ in range(1 if not trial.full else 20):
            white = trial.rng.normal(0, deviation, 400)
            coloured = np.convolve(trial.rng.normal(0, deviation, 404), np.full(5, 5**-0.5), "valid")
            impulses = np.where(trial.rng.random(400) < 0.03, trial.rng.normal(0, 20 * deviation, 400), 0)
            waveforms += [made(signal + noise) for noise in (white, coloured, impulses)]
    found = records(waveforms, config)
    ends, peaks = found[found["trailer"]], found[~found["trailer"]]
    least = np.maximum(config.min_amplitude, config.k * ends["noise_deviation"])[peaks["sequence"]]
    below = np.count_nonzero(peaks["amplitude"] < least)
    differing = exact.unlike(found, waveforms, config)
    told = f"{differing} differences in {len(found)} records, {below} of {len(peaks)} echoes below the threshold"
    return Outcome(differing == 0 and below == 0 and len(peaks) > 0, told)


def drift(trial: Trial) -> Outcome:
    """A baseline that rises or falls by whole counts a bin."""
    config = replace(Config(sample_w=16), min_amplitude=0, k=0.0)
    signal = made(20_000 + gaussian(500, 200.4, 6, 900) + gaussian(500, 300.2, 9, 500), config)
    slopes = (-1, 1, 10, 30) if not trial.full else range(-1, 31)
    lines = [signal + slope * (np.arange(500) - 250) for slope in slopes]
    known = {name: [_nearest([signal], config, at)[name] for at in (200, 300)] for name in ("centre", "width")}
    wrong = sum(
        _nearest([line], config, at)[name] != known[name][number]
        for line in lines
        for number, at in enumerate((200, 300))
        for name in known
    )
    return equal(int(wrong), 4 * len(lines), "centres and widths")


def _nearest(waveform: Sequence[Waveform], config: Config, at: float) -> np.void:
    """The echo whose centre is nearest to a bin: what is flat has runs of no curvature, too."""
    found = echoes(waveform, config)
    nearest: np.void = found[abs(found["centre"] - at).argmin()]
    return nearest


def even_and_odd(trial: Trial) -> Outcome:
    """Samples with odd indices that are higher than those with even ones, as two interleaved converters make them."""
    signal = made(200 + gaussian(400, 200.4, 6, 900) + trial.rng.normal(0, 1, 400))
    names = ("centre", "peak", "width")
    level = echoes([signal], Config())
    wrong = 0
    for offset in (1, 5, 50):
        uneven = echoes([signal + offset * (np.arange(400) % 2)], Config())
        wrong += sum(int((uneven[name] != level[name]).sum()) for name in names) if len(uneven) == len(level) else 1
    return equal(wrong, 3 * len(names) * len(level), "positions and widths")


def digitiser(trial: Trial) -> Outcome:
    """Bits that are stuck at 0 or 1, and codes that never come."""
    signal = made(300 + gaussian(300, 150.3, 6, 900) + trial.rng.normal(0, 1, 300))
    bits = range(11) if trial.full else (0, 3, 7, 10)
    stuck = [signal & ~(1 << bit) for bit in bits] + [signal | 1 << bit for bit in bits]
    codes = range(300, 1200, 300 if not trial.full else 7)
    missing = [np.where(signal == code, code + 1, signal) for code in codes]
    return judged(iter([as_fractions([*stuck, *missing], EVERYTHING)]))


def missing_code(trial: Trial) -> Outcome:
    """How far a code that never comes moves the peak."""
    signal = 300 + gaussian(300, 150.3, 6, 900) + trial.rng.normal(0, 1, 300)
    codes = range(300, 1200, 10 if not trial.full else 1)
    whole = made(signal)
    step = np.diff(Config().taps, prepend=0, append=0)  # taps of the first difference
    slope = 0.9 * abs(np.convolve(whole, np.diff(step, prepend=0, append=0))[155:167]).max()
    top, worst = _highest(whole), 0.0
    for code in codes:
        moved = abs(_highest(np.where(whole == code, code + 1, whole)) - top)
        count = np.count_nonzero(whole == code)
        worst = max(worst, moved / (count * abs(step).max() / slope)) if count else worst
    return bounded(float(worst), 1.0, "the peak moves, in its bound,")


def _highest(waveform: Waveform) -> float:
    found = echoes([waveform], Config())
    return float(found["peak"][found["amplitude"].argmax()])


def saturation(trial: Trial) -> Outcome:
    """Echoes beyond full scale, with a tail below the baseline after them, and echoes cut by the ends."""
    config = Config(min_amplitude=0, k=0.0)
    waveforms = []
    for height in (500, 1800, 2030, 3000, 8000):
        for centre in (13, 150.0, 287):
            tail = -0.1 * min(height, 2047) * np.exp(-np.maximum(np.arange(300) - centre - 15, 0) / 30)
            tail[np.arange(300) < centre + 15] = 0
            waveforms.append(made(20 + gaussian(300, centre, 6, height) + tail, config))
    found = records(waveforms, config)
    peaks = found[~found["trailer"]]
    full = np.array([(waveform == 2047).any() for waveform in waveforms])
    flagged = np.zeros(len(waveforms), bool)
    flagged[peaks["sequence"][peaks["flags"] & SATURATED > 0]] = True
    cut = np.count_nonzero(peaks["flags"] & TRUNCATED)
    differing = exact.unlike(found, waveforms, config)
    wrong = np.count_nonzero(flagged != full)
    told = f"{differing} differences in {len(found)} records, {wrong} of {len(full)} waveforms"
    held = differing == 0 and bool((flagged == full).all()) and bool(cut)
    return Outcome(held, f"{told} flagged wrongly, {cut} echoes cut by an end")


def undershoot(trial: Trial) -> Outcome:
    """A baseline of 0 counts, below which the digitiser clips."""
    shapes = [gaussian(300, 150, 6, height) - 0.5 + trial.rng.normal(0, 2, 300) for height in (3, 30, 2000)]
    waveforms = [made(shape) for shape in shapes]
    least = echoes(waveforms, EVERYTHING)["amplitude"].min()
    differing, checked = as_fractions(waveforms, EVERYTHING)
    return Outcome(
        differing == 0 and bool(least >= 0),
        f"{differing} differences in {checked} records, least amplitude {least:g} counts",
    )


# --- word length ----------------------------------------------------------------------------------------------------


def word_length(trial: Trial) -> Outcome:
    """Centres with 4 to 24 fractional bits beside those in float64."""
    size = 100 if not trial.full else 2000
    low, high, rms = 0.0, 0.0, {}
    for height in (20, 200):
        centres = 128 + trial.rng.uniform(-0.5, 0.5, size)
        signal = height * np.exp(-0.5 * ((np.arange(256) - centres[:, None]) / 5) ** 2)
        samples = made(20 + signal + trial.rng.normal(0, 1, signal.shape))
        length = np.full(size, 256)
        for frac in range(4, 25, 4):
            config = Config(frac=frac)
            ours = golden.decode_records(golden.core(golden.stream(samples, length, config), config)["record"], config)
            ours = ours[~ours["trailer"]]
            true = golden.float64.decompose(samples, length, config)
            off = (ours["centre"] - true["centre"]) * 2**frac
            low, high = min(low, float(off.min())), max(high, float(off.max()))
            near = abs(ours["peak"] - centres[ours["sequence"]]) < 5
            errors = (ours["peak"] - centres[ours["sequence"]])[near]
            rms[height, frac] = float(np.sqrt((errors**2).mean()))
    enough = [next(f for f in range(4, 25, 4) if rms[h, f] <= 1.01 * rms[h, 24]) for h in (20, 200)]
    told = f"{low:.3f} to {high:.3f} of the last place; FRAC {enough[0]} and {enough[1]} are within 1 % of FRAC 24"
    held = low >= -0.5 - FLOAT64 and high <= 1 + FLOAT64
    return Outcome(held, f"{told} at SNR 20 and 200")


FLOAT64 = 2.0**-12
"""Of FRAC 24's last place: what float64, with 44 bits behind the point of a position, may be off itself."""


# --- numbers --------------------------------------------------------------------------------------------------------


def noise_sums(trial: Trial) -> Outcome:
    """The sums of the noise at their greatest: 50 samples of 16 bits, all at full scale, none, and half and half."""
    config = Config(sample_w=16)
    windows = [np.full(60, 65535), np.zeros(60, np.int64), np.repeat([0, 65535], 30), np.arange(60) % 2 * 65535]
    windows += [trial.rng.integers(0, 65536, 60) for _ in range(20 if not trial.full else 2000)]
    return judged(iter([as_fractions(windows, config)]))


# --- mistakes that somebody could make ------------------------------------------------------------------------------


def _rounded_down(numerator: Any, denominator: Any, frac: int) -> Any:
    return divide(numerator, denominator, frac + 1) - 1 >> 1


def _without(flag: int) -> Callable[..., Any]:
    def wrong(beats: Any, noise: Any, config: Config) -> Any:
        found = golden.inflection(beats, noise, config)
        return found | {"flags": found["flags"] & ~flag}

    return wrong


def _zero_is_positive(second: Any, index: Any, config: Config) -> Any:
    return _RUNS(np.where(second == 0, 1, second), index, config)


def _window_ends_early(end: Any, cut_right: Any, config: Config) -> Any:
    return _RAW_END(end, cut_right, config) - 1


def _whole_counts(beats: Any, config: Config) -> Any:
    found = golden.filter(beats, config)
    total = found["sum"] >> golden.TAP_FRAC
    return found | {"sum": total, "first": np.diff(total, prepend=0)}


def _unfiltered(beats: Any, config: Config) -> Any:
    found = golden.filter(beats, config)
    total = np.roll(beats["sample"], config.delay) * sum(config.taps)
    return found | {"sum": total, "first": np.diff(total, prepend=0)}


def _tap_left_out(beats: Any, config: Config) -> Any:
    found = golden.filter(beats, config)
    return found | {"first": found["first"] - config.taps[0] * np.diff(beats["sample"], prepend=0)}


def _five_bits(beats: Any, config: Config) -> Any:
    packed = golden.output(beats, config)
    packed["record"][:, 2] &= 31
    return packed


def _deaf_to_noise(amplitude: Any, deviation: Any, config: Config) -> Any:
    return _STANDS_OUT(amplitude, 0 * deviation, config)


def _in_float32(window: Any) -> Any:
    single = window.astype(np.float32)
    return tuple(np.rint(256 * value).astype(np.int64) for value in (single.mean(axis=1), single.std(axis=1)))


_RUNS, _RAW_END, _STANDS_OUT = INFLECTION.not_positive_runs, INFLECTION.raw_end, INFLECTION.stands_out

ROUNDED_DOWN = "quotients rounded down", planted(INFLECTION, "divide", _rounded_down)
NOT_SATURATED = "the flag of saturation dropped", planted(CORE, "inflection", _without(SATURATED))
NOT_TOO_LONG = "the flag of a waveform that was cut dropped", planted(CORE, "inflection", _without(TOO_LONG))
ZERO_IS_POSITIVE = (
    "a second difference of 0 counted as positive",
    planted(INFLECTION, "not_positive_runs", _zero_is_positive),
)
EARLY = "raw samples looked at a beat too few", planted(INFLECTION, "raw_end", _window_ends_early)
WHOLE_COUNTS = "the filter's sum rounded to whole counts", planted(CORE, "filter", _whole_counts)
UNFILTERED = "the filter left out", planted(CORE, "filter", _unfiltered)
TAP_LEFT_OUT = "an outer tap left out", planted(CORE, "filter", _tap_left_out)
FIVE_BITS = "numbers of echoes in five bits", planted(CORE, "output", _five_bits)
DEAF = "a threshold that knows nothing of the noise", planted(INFLECTION, "stands_out", _deaf_to_noise)
FLOAT32 = "the noise's sums in binary32", planted(READER, "_mean_and_deviation", _in_float32)

CASES = (
    Case(
        "word sizes, settings, taps",
        AREA,
        "8 to 16 bits, FRAC 4 to 24, 4 to 48 taps, settings at their ends; flat, alternating, impulse, step, ramp, "
        "random",
        EXACT,
        limits,
        *ROUNDED_DOWN,
    ),
    Case(
        "lengths",
        AREA,
        "1 sample to more than the core takes",
        "too short, too long and too short for noise are flagged, the length is right",
        lengths,
        *NOT_TOO_LONG,
    ),
    Case(
        "dynamic range",
        AREA,
        "an echo of 1 count beside one of full scale, 120 to 20 bins apart",
        f"{EXACT}; the strong peak moves by at most {SLOPE_OF_ONE} bin: 1 count against its curvature",
        dynamic_range,
        *WHOLE_COUNTS,
    ),
    Case("widths", AREA, "σ from 1 bin to a quarter of the record", EXACT, widths, *EARLY),
    Case(
        "separations",
        AREA,
        "two equal echoes, 60 bins apart to none",
        f"{EXACT}; two echoes become one and never two again",
        separations,
        *ROUNDED_DOWN,
    ),
    Case(
        "many echoes",
        AREA,
        "0 to 64 echoes in one record",
        "as many records as echoes, numbered in order",
        many,
        *FIVE_BITS,
    ),
    Case(
        "noise",
        AREA,
        "white, coloured, impulsive; deviation 0 to 4 times the signal",
        f"{EXACT}; no echo below its waveform's threshold",
        noises,
        *DEAF,
    ),
    Case(
        "drifting baseline",
        AREA,
        "slopes of -1 to 30 counts a bin",
        "centres and widths are bit for bit those of a level baseline, as long as the echo rises above the first 50 "
        "samples: a second difference does not see a line",
        drift,
        *WHOLE_COUNTS,
    ),
    Case(
        "even and odd baselines",
        AREA,
        "odd samples 1, 5 and 50 counts higher",
        "positions and widths are bit for bit those without: the even and the odd taps of a symmetric even set have "
        "the same sum",
        even_and_odd,
        *TAP_LEFT_OUT,
    ),
    Case(
        "stuck bits, missing codes",
        AREA,
        "each bit stuck at 0 and at 1; codes that never come",
        EXACT,
        digitiser,
        *ROUNDED_DOWN,
    ),
    Case(
        "a missing code's harm",
        AREA,
        "each code of an echo's flank missing in turn",
        "the peak moves by at most what a count more in each sample of that code makes of the first difference, over "
        "its slope there",
        missing_code,
        *UNFILTERED,
    ),
    Case(
        "saturation",
        AREA,
        "up to four times full scale, a tail below the baseline behind it, echoes cut by an end",
        f"{EXACT}; a flag on some echo if and only if a sample is full scale",
        saturation,
        *NOT_SATURATED,
    ),
    Case("clipped at zero", AREA, "a baseline at 0 counts", f"{EXACT}; no amplitude below 0", undershoot, *EARLY),
    Case(
        "word length",
        AREA,
        "FRAC 4 to 24 beside float64",
        "a centre is off by -1/2 to 1 of its last place: two inflections rounded half up, then their mean",
        word_length,
        *ROUNDED_DOWN,
    ),
    Case("noise sums", AREA, "50 samples of 16 bits at full scale, at 0, half and half", EXACT, noise_sums, *FLOAT32),
)
