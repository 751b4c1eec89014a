"""The waveforms that every bench sends: each situation of the functional coverage, and random ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from openecho import stimulus
from openecho.golden import NOISE_SAMPLES, Config
from tb.env.coverage import Samples

QUIET = NOISE_SAMPLES + 14
"""Samples without an echo that go before those with many, so that the noise is measured on noise."""


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
    shapes = dict(stimulus.directed(config.sample_w, _typical(config), config.tap_count, int(rng.integers(1 << 31))))
    full = (1 << config.sample_w) - 1
    noise = rng.normal(full / 32, max(full / 1000, 1), _typical(config))
    return [
        *shapes.values(),
        stimulus.quantise(noise, config.sample_w),
        *with_many_echoes(config, rng),
        *every_length(config, rng),
    ]


def with_many_echoes(config: Config, rng: np.random.Generator) -> list[Samples]:
    """Waveforms with 1 to 17 echoes, echoes that an edge cuts, and random samples with as many components as can be."""
    length, full = _typical(config), (1 << config.sample_w) - 1
    seed = int(rng.integers(1 << 31))
    shapes = dict(stimulus.directed(config.sample_w, length, config.tap_count, seed))
    shorter = dict(stimulus.directed(config.sample_w, length - QUIET, config.tap_count, seed))
    echoes = [
        np.concatenate([shapes["noise"][:QUIET], samples])
        for name, samples in shorter.items()
        if name.startswith("echoes")
    ]
    # The filter must lie inside the waveform, so the echo that an edge cuts stands half its length from there.
    middle, wide = length // 2, shapes["saturated"]
    cut = [wide[middle - config.delay :], wide[: middle + config.delay]]
    return [*echoes, *cut, *(rng.integers(0, full, 200, endpoint=True) for _ in range(2))]


def every_length(config: Config, rng: np.random.Generator) -> list[Samples]:
    """Waveforms at and beside each length at which something changes, long and short in turn."""
    shortest, longest = config.tap_count + 2, config.max_samples
    lengths = [longest + 30, 1, longest + 1, 2, longest, shortest - 1, longest - 1, shortest, shortest + 1, 528]
    lengths += [NOISE_SAMPLES - 1, NOISE_SAMPLES, NOISE_SAMPLES + 1, shortest, shortest, 1, 1, 60]
    full = (1 << config.sample_w) - 1
    x = np.arange(max(lengths))
    slow = full * (0.5 + 0.4 * np.sin(x / 9)) + rng.normal(0, full / 200, x.size)
    return [stimulus.quantise(slow, config.sample_w)[:length] for length in lengths]


def _typical(config: Config) -> int:
    return min(1024, config.max_samples)
