"""Streams of beats as flat arrays."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from .config import Config

Array: TypeAlias = npt.NDArray[Any]
IntArray: TypeAlias = npt.NDArray[np.int64]
FloatArray: TypeAlias = npt.NDArray[np.float64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]

Beats: TypeAlias = dict[str, Array]
"""Fields of a stream: int64 arrays of equal length, one entry a beat, every waveform in turn.

`last` is bool and ends a waveform. `cause` is the index, among the beats that the function was given, of the beat
that determines this one: latency counts from there. A masked entry is undefined and not to be compared.
"""


def stream(samples: Array, length: Array, config: Config | None = None) -> Beats:
    """Waveforms as a sample stream.

    Parameters
    ----------
    samples : (n, m) integer array
        A waveform a row, counts.
    length : (n,) integer array
        Samples that were recorded in each row, 1 to m.
    config : Config, optional
        Its `sample_w` bounds the counts; the default configuration if left out.

    Returns
    -------
    Beats
        `sample` (counts) and `last`.

    Raises
    ------
    ValueError
        If the arrays are not as described.
    """
    samples, length = np.asarray(samples), np.asarray(length)
    if samples.ndim != 2 or samples.size == 0:
        raise ValueError(f"samples: found shape {samples.shape}, expected (waveforms, samples), neither of them 0")
    if samples.dtype.kind not in "iu":
        raise ValueError(f"samples: found {samples.dtype}, expected integers")
    full_scale = (1 << (config or Config()).sample_w) - 1
    if samples.min() < 0 or samples.max() > full_scale:
        raise ValueError(f"samples: found {samples.min()} to {samples.max()}, expected 0 to {full_scale}")
    if length.shape != samples.shape[:1] or length.dtype.kind not in "iu":
        expected = f"integers of shape {samples.shape[:1]}"
        raise ValueError(f"length: found {length.dtype} of shape {length.shape}, expected {expected}")
    if length.min() < 1 or length.max() > samples.shape[1]:
        raise ValueError(f"length: found {length.min()} to {length.max()}, expected 1 to {samples.shape[1]}")
    recorded = np.arange(samples.shape[1]) < length[:, np.newaxis]
    last = np.zeros(recorded.sum(), bool)
    last[np.cumsum(length) - 1] = True
    return {"sample": samples[recorded].astype(np.int64), "last": last}


def waveform_of(last: BoolArray) -> IntArray:
    """Number the waveforms from 0: that of each beat."""
    return np.cumsum(last) - last


def interleave(last: BoolArray, inner: Array | int, trailer: Array | int) -> IntArray:
    """Join a field's values on the trailers (where `last`) and on the beats before them, both in order."""
    field = np.empty(last.shape, np.int64)
    field[~last] = inner
    field[last] = trailer
    return field
