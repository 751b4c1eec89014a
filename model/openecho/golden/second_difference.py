"""Module `second_difference`: the discrete second derivative."""

import numpy as np

from .beats import Beats, IntArray
from .config import Config


def second_difference(beats: Beats, config: Config) -> Beats:
    """First and second backward difference of the filtered waveform, taken as 0 before its start.

    Zhou 2022, Eq (2), with its newest sample y[x+2] as the current one.

    Parameters
    ----------
    beats : Beats
        `sum`, `raw`, `index`, `overlong`, `last`.
    config : Config
        Not used; every module is called alike.

    Returns
    -------
    Beats
        `second`, `first`, and `raw`, `index`, `overlong` as they came.
    """
    starts = np.flatnonzero(beats["index"] == 0)
    first = _difference(beats["sum"], starts)
    return {
        "second": _difference(first, starts),
        "first": first,
        "raw": beats["raw"],
        "index": beats["index"],
        "overlong": beats["overlong"],
        "last": beats["last"],
        "cause": np.arange(first.size),
    }


def _difference(values: IntArray, starts: IntArray) -> IntArray:
    """Each value less the one before it in its waveform; the first of a waveform stays."""
    result = np.diff(values, prepend=0)
    result[starts] = values[starts]
    return result
