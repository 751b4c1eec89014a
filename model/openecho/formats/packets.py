"""Samples that lie end to end, or anywhere, in a flat array or file: cut into the rows of a block."""

from __future__ import annotations

from collections.abc import Callable
from typing import IO, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

SAMPLE_BITS = (8, 16)
"""Widths of stored samples that are supported, both unsigned and little-endian."""

HEADER = 60
"""Bytes before the packets in a LAS waveform data record and in a ``.wvs``: PulseWaves copies the LAS layout."""


def cut_rows(
    read: Callable[[int, int], NDArray[Any]], starts: NDArray[np.int64], lengths: NDArray[np.int32], dtype: DTypeLike
) -> NDArray[Any]:
    """Read pieces of a flat array as the rows of one array, in one read where they lie together.

    Parameters
    ----------
    read : callable
        (start, stop) to the elements between.
    starts : int64 (n,)
        First element of each row, from 0.
    lengths : int32 (n,)
        Elements of each row, at least 1.
    dtype : dtype
        Of the elements.

    Returns
    -------
    dtype (n, m)
        m the longest length; zero past each length.
    """
    rows = np.zeros((len(starts), int(lengths.max(initial=0))), dtype)
    if not len(rows):
        return rows
    low, high = int(starts.min()), int((starts + lengths).max())
    # Shot follows shot in nearly every file. Where they are scattered, one read could be the whole file.
    if high - low <= 2 * int(lengths.sum(dtype=np.int64)):
        flat = read(low, high)
        for row, start, length in zip(rows, starts - low, lengths, strict=True):
            row[:length] = flat[start : start + length]
    else:
        for row, start, length in zip(rows, starts, lengths, strict=True):
            row[:length] = read(int(start), int(start) + int(length))
    return rows


def read_packets(
    file: IO[bytes], starts: NDArray[np.int64], lengths: NDArray[np.int32], bits: NDArray[np.uint8]
) -> NDArray[np.uint16]:
    """Read packets of 8- or 16-bit samples from a file.

    Parameters
    ----------
    file : binary file
        Positions past its end raise EOFError.
    starts : int64 (n,)
        Byte where each packet begins.
    lengths : int32 (n,)
        Samples of each.
    bits : uint8 (n,)
        Of each one's samples: one of `SAMPLE_BITS`.

    Returns
    -------
    uint16 (n, m)
        m the longest length; zero past each length.
    """

    def read(start: int, stop: int) -> NDArray[np.uint8]:
        file.seek(start)
        found = file.read(stop - start)
        if len(found) != stop - start:
            raise EOFError(f"file ends at byte {start + len(found)} within a packet that ends at {stop}")
        return np.frombuffer(found, np.uint8)

    samples = np.zeros((len(starts), int(lengths.max())), np.uint16)
    for width in SAMPLE_BITS:
        mine = bits == width
        rows = cut_rows(read, starts[mine], lengths[mine] * (width // 8), np.uint8).view(f"<u{width // 8}")
        samples[mine, : rows.shape[1]] = rows
    return samples
