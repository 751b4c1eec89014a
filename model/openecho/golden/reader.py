"""Module `reader`: numbers the samples, limits the length, measures the noise."""

import numpy as np

from .beats import Beats, IntArray
from .config import AMP_FRAC, NOISE_SAMPLES, ROOT_FRAC, Config
from .rounding import divide


def reader(beats: Beats, config: Config) -> tuple[Beats, Beats]:
    """Number the samples of each waveform, cut it at `max_samples`, and take its noise from the first 50 samples.

    Zhou 2022, sections 2.1 and 3.2.1 (pipeline data reading).

    Parameters
    ----------
    beats : Beats
        `sample` (counts) and `last`.
    config : Config

    Returns
    -------
    samples : Beats
        `sample`, `index` (from 0 in each waveform), `overlong` (1 on the last beat of a waveform that was cut).
    noise : Beats
        One beat a waveform: `mean` and `deviation` (population) of the first 50 samples, counts with 8 fractional
        bits; `none` is 1, and both are 0, if fewer were passed on.
    """
    sample, last = beats["sample"], beats["last"]
    ends = np.flatnonzero(last)
    starts = np.append(0, ends[:-1] + 1)
    index = np.arange(sample.size) - np.repeat(starts, ends + 1 - starts)
    overlong = (index == config.max_samples - 1) & ~last
    kept = np.flatnonzero(index < config.max_samples)
    samples = {
        "sample": sample[kept],
        "index": index[kept],
        "overlong": overlong[kept].astype(np.int64),
        "last": (last | overlong)[kept],
        "cause": kept,
    }
    passed = np.minimum(ends + 1 - starts, config.max_samples)
    enough = passed >= NOISE_SAMPLES
    mean, deviation = np.zeros((2, starts.size), np.int64)
    first_50 = sample[starts[enough, np.newaxis] + np.arange(NOISE_SAMPLES)]
    mean[enough], deviation[enough] = _mean_and_deviation(first_50)
    noise = {
        "mean": mean,
        "deviation": deviation,
        "none": (~enough).astype(np.int64),
        "cause": starts + np.minimum(passed, NOISE_SAMPLES) - 1,
    }
    return samples, noise


def _mean_and_deviation(window: IntArray) -> tuple[IntArray, IntArray]:
    """Mean and population deviation of each row of 50 counts, 8 fractional bits.

    50²·variance = 50·Σs² − (Σs)² is a whole number below 2^42. Its square root, with 4 fractional bits, is the floor
    of a float64 root: exact below 2^52, where no root can round up to the next whole number.
    """
    total = window.sum(axis=1)
    scaled_variance = NOISE_SAMPLES * (window * window).sum(axis=1) - total * total
    root = np.sqrt(scaled_variance << (2 * ROOT_FRAC)).astype(np.int64)
    return divide(total, NOISE_SAMPLES, AMP_FRAC), divide(root, NOISE_SAMPLES, AMP_FRAC - ROOT_FRAC)
