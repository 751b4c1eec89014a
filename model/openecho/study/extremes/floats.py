"""Extremes of the core in floating point: subnormals, overflow and cancellation on its own data path."""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho import golden
from openecho.golden import Config
from openecho.golden.floating import Format
from openecho.study.extremes.case import Case, Outcome, Trial, bounded, equal, planted
from openecho.study.extremes.core import (
    EVERYTHING,
    EXACT,
    INFLECTION,
    as_fractions,
    at_the_limits,
    echoes,
    gaussian,
    judged,
    made,
)
from openecho.study.trade.ways import FORMATS

AREA = "core in floating point"

PARAMETERS = importlib.import_module("openecho.golden.parameters")

STEEP = (-1491, -2978, -2299, -2218, -2218, -2299, -2978, -1491)
"""Taps behind which `SUDDEN` has second differences of 8 and -375,873 beside each other: a quotient below 2^-14, which
binary16 holds as a subnormal. Found by search."""

SUDDEN = (2, 0, 255, 255)
"""Samples in a row, all others 0."""


def configs(base: Config = EVERYTHING) -> Iterator[Config]:
    """The core in every format."""
    for exp_w, frac in FORMATS.values():
        yield replace(base, exp_w=exp_w, frac=frac)


def every_operation(trial: Trial) -> Outcome:
    """Extreme waveforms in every format."""
    chosen = list(configs())
    chosen += [] if not trial.full else list(configs(replace(EVERYTHING, sample_w=8, max_samples=64)))
    return judged(as_fractions(list(at_the_limits(config, trial)), config) for config in chosen)


def subnormals(trial: Trial) -> Outcome:
    """Crossings just behind a beat, in binary16."""
    config = replace(EVERYTHING, exp_w=5, frac=10, sample_w=8, taps=STEEP)
    waveforms = [trial.rng.choice([0, 1, 254, 255], 60) for _ in range(10 if not trial.full else 600)]
    for at in range(60, 80):  # behind the samples that measure the noise
        waveforms.append(np.zeros(100, np.int64))
        waveforms[-1][at : at + len(SUDDEN)] = SUDDEN
    return judged(iter([as_fractions(waveforms, config)]))


def overflow(trial: Trial) -> Outcome:
    """Every format that the core takes at its greatest results, and every one that it refuses."""
    taps = (golden.PAPER_TAPS, (32767, -32768, -32768, 32767), (32767,) * 48)
    forms, widths, longest = [(5, 10), (8, 23)], [8, 11, 16], [64, 65536]
    if trial.full:
        forms, widths, longest = [*forms, (6, 9), (8, 7), (11, 52)], list(range(8, 17)), [64, 1024, 4096, 65536]
    tried, refused = 0, 0
    for (exp_w, frac), bits, size, chosen in itertools.product(forms, widths, longest, taps):
        try:
            config = replace(EVERYTHING, exp_w=exp_w, frac=frac, sample_w=bits, max_samples=size, taps=chosen)
        except ValueError:
            refused += 1
            continue
        found = echoes(list(greatest(config)), config)
        for name in ("centre", "peak", "width", "time", "amplitude"):
            assert np.isfinite(found[name]).all(), f"{name} in {config}"
        tried += 1
    return Outcome(tried > 0 and refused > 0, f"{tried} accepted, all finite; {refused} refused")


def greatest(config: Config) -> Iterator[NDArray[np.int64]]:
    """Waveforms that are as long, as high and as steep as a core takes."""
    full, x = (1 << config.sample_w) - 1, np.arange(config.max_samples)
    last = x >= config.max_samples - 100
    yield np.where(x == config.max_samples - 30, full, 0)
    yield np.where(last & (x % 2 == 0), full, 0)
    yield np.where(last & (x // config.tap_count % 2 == 0), full, 0)
    yield np.where(x < 10, full, 0)


def cancellation(trial: Trial) -> Outcome:
    """Widths far from the start, where both inflections are large and nearly the same."""
    worst, told = 0.0, []
    starts = (100, 1000, 4000) if not trial.full else range(100, 4080, 50)
    waveforms = [made(20 + gaussian(4096, start + 0.37, 4, 900)) for start in starts]
    samples, length = np.stack(waveforms), np.full(len(waveforms), 4096)
    for name, config in zip(FORMATS, configs(Config()), strict=True):
        form = Format(config.exp_w, config.frac)
        found, true = echoes(waveforms, config), golden.float64.decompose(samples, length, config)
        off = abs(found["width"] - true["width"])
        # Of each inflection the coordinate, the quotient's sum and the quotient (of 1 at most) are rounded, half a last
        # place of the position each; then the difference and the quotient by n, of the width.
        bound = 2 * 1.5 * last_place(true["right"], form) / config.n + last_place(true["width"], form)
        worst = max(worst, float((off / bound).max()))
        told.append(f"{name} {off.max():.1e}")
    outcome = bounded(worst, 1.0, "largest error, in its bound,")
    return Outcome(outcome.held, f"{outcome.found}; bins: {', '.join(told)}")


def last_place(value: NDArray[np.float64], form: Format) -> NDArray[np.float64]:
    """Last place of numbers in a format."""
    return np.asarray(np.exp2(np.floor(np.log2(value)) - form.frac_w))


def formats_agree(trial: Trial) -> Outcome:
    """The same echoes in every format and in fixed point: what is found must not hang on the arithmetic."""
    signal = 20 + gaussian(600, 300, 6, 400)
    waveforms = [made(signal + trial.rng.normal(0, 1, 600)) for _ in range(100 if trial.full else 8)]
    counts = [
        np.bincount(echoes(waveforms, config)["sequence"], minlength=len(waveforms))
        for config in (Config(), *configs(Config()))
    ]
    return equal(int(sum((count != counts[0]).sum() for count in counts)), len(waveforms), "numbers of echoes")


def _not_shifted(a: Any, b: Any, form: Format) -> Any:
    quotient, half = golden.arithmetic.div(a, b, form), form.bias - 1 << form.frac_w
    subnormal = (quotient > 0) & (quotient < 1 << form.frac_w)
    return np.where(subnormal, half | quotient, quotient)


def _half_a_word(a: Any, b: Any, form: Format) -> Any:
    lost = (1 << form.frac_w // 2 + 2) - 1
    return golden.arithmetic.sub(a & ~lost, b, form)


def _towards_zero(a: Any, b: Any, form: Format) -> Any:
    return golden.arithmetic.div(a, b, form) - 1


def _less_in_floats(amplitude: Any, deviation: Any, config: Config) -> Any:
    return _STANDS_OUT(amplitude + (4000 if config.form else 0), deviation, config)


_STANDS_OUT = INFLECTION.stands_out

CASES = (
    Case(
        "every operation",
        AREA,
        "binary16, bfloat16, binary32, binary64 at extreme waveforms",
        f"{EXACT}, each operation rounded once to nearest even",
        every_operation,
        "quotients a last place too small",
        planted(INFLECTION, "div", _towards_zero),
    ),
    Case(
        "subnormal quotients",
        AREA,
        "second differences of 8 and -375,873 beside each other, binary16",
        f"{EXACT}; a quotient so small is less than half a last place of any position",
        subnormals,
        "subnormals taken for numbers of 0.5 on",
        planted(INFLECTION, "div", _not_shifted),
    ),
    Case(
        "overflow",
        AREA,
        "exponents of 5, 6 and 8 bits, 8 to 16 bits a sample, 64 to 65,536 samples, steepest taps",
        "a core that could overflow is refused when it is set up; any other has finite results",
        overflow,
        "set up without that check",
        planted(Config, "_check_range", lambda self, form: None),
    ),
    Case(
        "cancellation",
        AREA,
        "widths of 8 bins up to bin 4000, in every format",
        "off by at most three halves of a position's last place for each inflection over n, and one of its own",
        cancellation,
        "the difference taken of half words",
        planted(PARAMETERS, "sub", _half_a_word),
    ),
    Case(
        "what is found",
        AREA,
        "noisy waveforms in fixed point and in every format",
        "the same number of echoes",
        formats_agree,
        "a threshold of its own in floating point",
        planted(INFLECTION, "stands_out", _less_in_floats),
    ),
)
