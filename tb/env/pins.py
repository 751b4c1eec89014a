"""Port access for code that runs in every clock cycle.

`handle.value` builds a typed object on each read and checks each write: that costs more than all else that a bench does
in a cycle. These functions bind the simulator's own calls once instead, which makes the benches about three times
faster. They use cocotb's private `_handle`; the version of cocotb is pinned.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

Handle = Any
"""A port of the simulated module."""
Pin = int | str
"""What a writer takes: an integer for up to 32 bits, binary digits for more."""

_DEPOSIT = 0  # the simulator interface's code for an ordinary write
_INTEGER_BITS = 32  # the widest port that the simulator interface writes as an integer


def width(handle: Handle) -> int:
    """Bits of a port."""
    return len(handle)


def reader(handle: Handle) -> Callable[[], str]:
    """Return a function that reads a port as binary digits, most significant first; X and Z stay visible."""
    return handle._handle.get_signal_val_binstr  # type: ignore[no-any-return]


def writer(handle: Handle) -> Callable[[Pin], None]:
    """Return a function that writes a port; see `encode` for what it takes."""
    access = handle._handle
    write = access.set_signal_val_binstr if width(handle) > _INTEGER_BITS else access.set_signal_val_int
    return partial(write, _DEPOSIT)


def encode(values: NDArray[np.integer[Any]], bits: int) -> list[Pin]:
    """Numbers, negative ones included, as a writer of a port of so many bits takes them."""
    unsigned = [int(value) & ((1 << bits) - 1) for value in values.tolist()]
    return [f"{value:0{bits}b}" for value in unsigned] if bits > _INTEGER_BITS else list(unsigned)


def decode(digits: str, count: int, words: int = 1) -> tuple[NDArray[np.uint64], NDArray[np.bool_], int]:
    """Numbers from what a reader returned in many cycles.

    Parameters
    ----------
    digits : str
        Binary digits of all cycles, one after the other.
    count : int
        Cycles.
    words : int
        Numbers that one port packs, the first in its lowest bits.

    Returns
    -------
    values : uint64 (count, words)
        Bits that are neither 0 nor 1 read 0.
    unknown : bool (count, words)
        Where there was such a bit.
    bits : int
        Bits of a number.
    """
    codes = np.frombuffer(digits.encode(), np.uint8).reshape(count, words, -1)[:, ::-1]
    bits = codes.shape[2]
    values = np.zeros((count, words), np.uint64)
    for bit in range(bits):
        values |= (codes[:, :, bits - 1 - bit] == ord("1")).astype(np.uint64) << np.uint64(bit)
    return values, (codes & ~np.uint8(1) != ord("0")).any(axis=2), bits
