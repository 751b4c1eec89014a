"""Module `filter`: the Gaussian filter, as an exact integer."""

import numpy as np

from .beats import Beats, waveform_of
from .config import Config


def filter(beats: Beats, config: Config) -> Beats:
    """Sum of taps times samples, Σ A_k·s[i−k], with zeros before the start of each waveform.

    Zhou 2022, Eq (11). The division by 2¹¹ is left out: no result depends on the scale of the filtered waveform.

    Parameters
    ----------
    beats : Beats
        `sample` (counts), `index`, `overlong`, `last`.
    config : Config

    Returns
    -------
    Beats
        `sum`; `first`, what it is more than the sum before; `raw`, the sample `config.delay` beats ago, undefined in
        the beats before that; `index`, `overlong`.
    """
    sample, last = beats["sample"], beats["last"]
    slot = np.arange(sample.size) + config.tap_count * waveform_of(last)
    padded = np.zeros(slot[-1] + 1, np.int64)
    padded[slot] = sample
    filtered = np.convolve(padded, config.taps)
    return {
        "sum": filtered[slot],
        "first": np.diff(filtered, prepend=0)[slot],
        "raw": np.ma.MaskedArray(np.roll(sample, config.delay), mask=beats["index"] < config.delay),
        "index": beats["index"],
        "overlong": beats["overlong"],
        "last": last,
        "cause": np.arange(sample.size),
    }
