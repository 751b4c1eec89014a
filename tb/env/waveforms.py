"""The waveforms that every bench sends: each situation of the functional coverage, and random ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from openecho import golden, stimulus
from openecho.golden import NOISE_SAMPLES, Config
from tb.env.coverage import Samples, beats_of

PERIODS = (4, 6, 7, 9, 12, 14, 17, 24)
"""Of square waves, in samples: with many of them a component comes as soon as one can after another."""
SETTLE = 13
"""Samples from which on waveforms may follow each other for ever: the threshold is set once in each."""
BURST = 10
"""Echoes that may come as close as echoes can, if it is quiet before and after."""
RARELY = 0.02
"""Part of recorded samples that the core may keep waiting: for many echoes, or where waveforms are as short as one."""
WAITING = 10
"""Components that so many may be with those between them that turn out to be none."""


def sensitive(config: Config) -> Config:
    """The same parameters with settings under which every component is an echo, however low."""
    return replace(config, n=1.5, min_interval=2, min_amplitude=0, k=0.0)


def every_shape(config: Config, rng: np.random.Generator) -> list[Samples]:
    """All shapes, all lengths, and random samples.

    Parameters
    ----------
    config : Config
        Sample width, taps and longest waveform.
    rng : Generator
        For the noise and the random waveforms.

    Returns
    -------
    list of integer arrays
        In an order that has waveforms of very different lengths next to each other.
    """
    return [*_directed(config, rng).values(), *with_many_echoes(config, rng), *every_length(config, rng)]


def with_many_echoes(config: Config, rng: np.random.Generator) -> list[Samples]:
    """Waveforms with 1 to 17 echoes, echoes that an edge cuts, and random samples with as many components as can be."""
    shapes = _directed(config, rng)
    full = (1 << config.sample_w) - 1
    anything = [rng.integers(0, full, 200, endpoint=True) for _ in range(2)]
    return [*(samples for name, samples in shapes.items() if name.startswith(("echoes", "cut"))), *anything]


def every_length(config: Config, rng: np.random.Generator) -> list[Samples]:
    """Waveforms at and beside each length at which something changes, long and short in turn."""
    shortest, longest = config.tap_count + 2, config.max_samples
    lengths = [longest + 30, 1, longest + 1, 2, longest, shortest - 1, longest - 1, shortest, shortest + 1, 528]
    lengths += [NOISE_SAMPLES - 1, NOISE_SAMPLES, NOISE_SAMPLES + 1, shortest, shortest, 1, 1, 60]
    full = (1 << config.sample_w) - 1
    x = np.arange(max(lengths))
    slow = full * (0.5 + 0.4 * np.sin(x / 9)) + rng.normal(0, full / 200, x.size)
    return [stimulus.quantise(slow, config.sample_w)[:length] for length in lengths]


def dense(config: Config, rng: np.random.Generator, height: int) -> list[Samples]:
    """Long and short waveforms of samples up to a height, in counts, with components as close as they can be."""
    shortest = max(config.tap_count + 2, SETTLE)
    lengths = [1024, 300, 528, *[shortest] * 30, *[NOISE_SAMPLES] * 8, 51, 200, *[57] * 4, 1000]
    waveforms: list[Samples] = [rng.integers(0, height, length, endpoint=True) for length in lengths]
    square = {period: _square(np.arange(400), period, height) for period in PERIODS}
    # Every distance from the end of a run to the end of its waveform.
    return [*waveforms, *square.values(), *(square[period][: 400 - cut] for period in PERIODS for cut in range(period))]


def bursts(config: Config) -> list[Samples]:
    """Echoes as close as they can be, then a quiet in which they can be worked off, then short waveforms; and again.

    Full scale. A burst has up to `BURST` periods, as many as the longest waveform has room for with their quiet, and as
    are no more than `WAITING` components. Which of these are echoes hangs on the taps: not every period comes through
    the filter, and behind long taps there are components between the periods, too. k must be 0.
    """
    short = [np.zeros(length, np.int64) for length in (SETTLE, 22, NOISE_SAMPLES, 57)]
    return [waveform for period in (11, 15, 19, 22, 24) for waveform in (_burst(period, config), *short, *short)]


def _burst(period: int, config: Config) -> Samples:
    """Longest such burst with this period, and the quiet before and behind it."""
    full, every_component = (1 << config.sample_w) - 1, replace(config, min_amplitude=0, k=0.0)
    for periods in range(BURST, -1, -1):
        burst = np.pad(_square(np.arange(periods * period), period, full), (NOISE_SAMPLES, 2 * config.tap_count))
        components = golden.core(beats_of([burst]), every_component)["last"].size - 1
        quiet = components * clocks_per_echo(config)
        if components <= WAITING and burst.size + quiet <= config.max_samples:
            return np.pad(burst, (0, quiet))
    raise ValueError(f"max_samples {config.max_samples}: too few for any waveform with its noise")


def clocks_per_echo(config: Config) -> int:
    """Clocks that the core needs for an echo, at most.

    Those of `inflection` or of `parameters`, which work side by side; as floats, nine operations in a row and what they
    wait.
    """
    if config.form is None:
        return max(3 * (config.frac + 6) + 7, 2 * config.pos_w + 9)
    return 12 * (config.frac + 6)


def _square(x: NDArray[np.int64], period: int, height: int) -> Samples:
    """Square wave of 0 and a height that begins high at x = 0."""
    return np.where(x % period < period // 2, height, 0)


def _directed(config: Config, rng: np.random.Generator) -> dict[str, Samples]:
    length = min(1024, config.max_samples)
    return dict(stimulus.directed(config.sample_w, length, config.tap_count, int(rng.integers(1 << 31))))
