"""The waveforms that every bench sends: each situation of the functional coverage, and random ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from openecho import stimulus
from openecho.golden import NOISE_SAMPLES, Config
from tb.env.coverage import Samples


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


def _directed(config: Config, rng: np.random.Generator) -> dict[str, Samples]:
    length = min(1024, config.max_samples)
    return dict(stimulus.directed(config.sample_w, length, config.tap_count, int(rng.integers(1 << 31))))
