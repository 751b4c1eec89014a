"""Codes of whole batches of waveforms, compiled. Bits gather in an integer of which less than 63 are ever used."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.codec.form import THRESHOLD
from openecho.compiled import njit

START_SPREAD = 3
"""Of either order, in a new waveform."""
LIMITS = (1, 16)
"""E of each mode: bits that announce an escape."""
START_CREDIT, NEEDED_CREDIT, FULL_CREDIT = 32, 16, 128
BASELINE_FRAC = 5
"""Fraction bits of a baseline."""
SLACK = 32
"""Bits that a payload may have more than its samples."""
SPARE = 4
"""Bytes behind a payload from which no code can begin that is still within it; twice as many may be read."""

BIT_LENGTH: NDArray[np.uint8] = np.array([value.bit_length() for value in range(256)], np.uint8)


@njit(inline="always")
def _bit_length(value: Any) -> Any:
    """Of a value below 2^16."""
    return BIT_LENGTH[value >> 8] + 8 if value >> 8 else BIT_LENGTH[value]


@njit(inline="always")
def _parameter(spread: Any) -> Any:
    """K of the codes, from the spread of the order that predicts."""
    return 0 if spread < START_SPREAD else _bit_length(spread) - 1


@njit(inline="always")
def _folded(error: Any, bits: int) -> Any:
    """U >= 0 of an error in half counts, modulo 2^(bits + 1)."""
    wrapped = error << (63 - bits) >> (63 - bits)
    return wrapped ^ (wrapped >> 63)


@njit(inline="always")
def _renewed(spread: Any, folded: Any) -> Any:
    return (folded + (spread & -2) + 1) >> 1


@njit(inline="always")
def _step(error: Any, bits: int) -> int:
    """By which a baseline follows a sample."""
    return 1 if error << (63 - bits) >= 0 else -1


@njit(inline="always")
def _credit(credit: int, gain: int) -> int:
    return credit if credit >= FULL_CREDIT and gain > 0 else credit + gain


@njit(nogil=True)
def pack(samples: Any, length: Any, mode: int, bits: int, small: int, even: int, odd: int, out: Any, ends: Any) -> int:
    """Codes into `out` and the byte behind each waveform into `ends`; `small` is l, of mode 0.

    The bytes are written where they arise: an array that is handed to a function costs more than all else here.
    """
    mask, half, limit = (1 << bits) - 1, 1 << (BASELINE_FRAC - 1), LIMITS[mode]
    at = 0
    for row in range(length.size):
        held: Any = 0
        count: Any = 0
        credit: Any = START_CREDIT
        spread_0: Any = START_SPREAD
        spread_2: Any = START_SPREAD
        here, other = (even << BASELINE_FRAC) + half, (odd << BASELINE_FRAC) + half
        last: Any = 0
        step: Any = 0
        for j in range(length[row]):
            x = np.int64(samples[row, j])
            if mode == THRESHOLD:
                v = (x - (here >> BASELINE_FRAC)) & mask
                k = small
            else:
                error = 2 * x - (here >> (BASELINE_FRAC - 1))
                use_2 = spread_2 < spread_0
                k = _parameter(spread_2 if use_2 else spread_0)
                v = _folded(error, bits)
                spread_0 = _renewed(spread_0, v)
                if j > 0:
                    folded = _folded(2 * (x - last - step), bits)
                    spread_2 = _renewed(spread_2, folded)
                    v = folded if use_2 else v
                    step = x - last
                here += _step(error, bits)
                last = x
            here, other = other, here
            size: Any = bits
            code: Any = x
            if credit >= NEEDED_CREDIT:
                q = v >> k
                if q < limit:
                    size = q + 1 + k
                    code = mode << k | (v & ((1 << k) - 1))
                else:
                    size = limit + bits
                    code = (1 - mode) << bits | x
                credit = _credit(credit, bits - size)
            held = held << size | code
            count += size
            if count >= 32:
                count -= 32
                word = held >> count
                out[at] = word >> 24 & 255
                out[at + 1] = word >> 16 & 255
                out[at + 2] = word >> 8 & 255
                out[at + 3] = word & 255
                at += 4
        held <<= -count & 7
        count += -count & 7
        while count > 0:
            count -= 8
            out[at] = held >> count & 255
            at += 1
        ends[row] = at
    return at


@njit(nogil=True)
def unpack(
    payload: Any, start: int, end: int, length: Any, mode: int, bits: int, small: int, even: int, odd: int, out: Any
) -> int:
    """Samples into `out`; the byte behind the last waveform, or -1 - byte of an error.

    From `start` to `end` of a payload, which has twice `SPARE` bytes behind. `held` has the next bits in its `count`
    lowest; what is above has been read.
    """
    mask, half, limit = (1 << bits) - 1, 1 << (BASELINE_FRAC - 1), LIMITS[mode]
    for row in range(length.size):
        if length[row] > 8 * (end - start):
            return -1 - end
        at = start
        count: Any = 0
        held: Any = 0
        credit: Any = START_CREDIT
        spread_0 = spread_2 = START_SPREAD
        here, other = (even << BASELINE_FRAC) + half, (odd << BASELINE_FRAC) + half
        last: Any = 0
        step: Any = 0
        for j in range(length[row]):
            if count < 32:
                if at >= end + SPARE:
                    return -1 - end
                held = held << 32 | np.int64(payload[at]) << 24 | np.int64(payload[at + 1]) << 16
                held |= np.int64(payload[at + 2]) << 8 | np.int64(payload[at + 3])
                at += 4
                count += 32
            # Half counts: samples stand on the even ones, so the sign that was folded into u is known from its parity.
            use_2 = spread_2 < spread_0
            if mode == THRESHOLD:
                k = small
                guess = here >> BASELINE_FRAC
            else:
                k = _parameter(spread_2 if use_2 else spread_0)
                guess = 2 * (last + step) if use_2 else here >> (BASELINE_FRAC - 1)
            plain = True
            size: Any = bits
            if credit >= NEEDED_CREDIT:
                first = held >> (count - limit) & ((1 << limit) - 1)
                q = first if mode == THRESHOLD else limit - _bit_length(first)
                plain = q == limit
                size = limit + bits if plain else q + 1 + k
                credit = _credit(credit, bits - size)
            count -= size
            if plain:
                x = held >> count & mask
            else:
                v = q << k | (held >> count & ((1 << k) - 1))
                if mode != THRESHOLD:
                    v = (guess + (~v if (guess + v) & 1 else v)) >> 1
                    guess = 0
                x = (guess + v) & mask
            out[row, j] = x
            if mode != THRESHOLD:
                error = 2 * x - (here >> (BASELINE_FRAC - 1))
                spread_0 = _renewed(spread_0, _folded(error, bits))
                if j > 0:
                    spread_2 = _renewed(spread_2, _folded(2 * (x - last - step), bits))
                    step = x - last
                here += _step(error, bits)
                last = x
            here, other = other, here
        used = 8 * (at - start) - count
        start += (used + 7) >> 3
        if start > end:
            return -1 - end
        if used & 7 and payload[start - 1] & (255 >> (used & 7)):
            return -start
    return start
