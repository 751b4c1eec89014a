"""Checksum of a record's samples."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.compiled import njit

POLYNOMIAL = 0x00400007
"""z^32 + z^22 + z^2 + z + 1, without its highest term: see `openecho.codec`."""
ALL_ONES = 0xFFFFFFFF


def checksum(samples: NDArray[np.uint16], bits: int) -> int:
    """CRC of 32 bits, of `bits` of each sample, highest first, from all ones, not inverted."""
    return int(_divide(samples, bits, _remainders(bits)))


@cache
def _remainders(bits: int) -> NDArray[np.int64]:
    """What each value of the top `bits` leaves when it is shifted out: of division by the polynomial."""
    rest = np.arange(1 << bits, dtype=np.int64) << (32 - bits)
    for _ in range(bits):
        rest = (rest << 1 & ALL_ONES) ^ np.where(rest >> 31, POLYNOMIAL, 0)
    return rest


@njit(nogil=True)
def _divide(samples: Any, bits: int, remainders: Any) -> int:
    rest = ALL_ONES
    for sample in samples:
        rest = (rest << bits & ALL_ONES) ^ remainders[rest >> (32 - bits) ^ np.int64(sample)]
    return rest
