"""What encoder and decoder share: the container's constants, both predictions, and the checksum.

The format is specified in `openecho.codec`; this is written from its text.
"""

from functools import cache

import numpy as np

from .beats import Array, BoolArray, IntArray

VERSION = 1
"""Of the format."""
THRESHOLD, PREDICTION = 0, 1
"""Modes."""
HEAD, TAIL = 2, 2
"""Words before and behind the payload."""
WORD_W = 32
"""Bits of a word."""
MOST_SAMPLES = (1 << 16) - 1
"""Of a waveform whose record can be decoded."""
LIMITS = {THRESHOLD: 1, PREDICTION: 16}
"""Quotient from which on a sample is written as it is, E, by mode."""
CREDIT_START, CREDIT_LEAST, CREDIT_MOST = 32, 16, 128
"""Bits that a payload may be longer than its samples; below the least a code is no longer tried, from the most on bits
that a code spares are not added."""
SPREAD_START = 3
"""Of both predictions, in counts."""
BASELINE_FRAC = 5
"""Bits behind the point of a baseline that follows the samples."""
POLYNOMIAL = 0x00400007
"""Of the checksum, z^32 + z^22 + z^2 + z + 1, without its highest term."""
ALL_ONES = (1 << WORD_W) - 1
"""What the checksum starts from."""


class Predictions:
    """Both predictions of mode 1, each waveform with its own state, sample by sample.

    The arrays have an entry a waveform, longest first: those that go on are the first `active` ones.
    """

    def __init__(self, even: IntArray, odd: IntArray, sample_w: int) -> None:
        self._sample_w = sample_w
        self._baselines = [(base << BASELINE_FRAC) + (1 << BASELINE_FRAC - 1) for base in (even, odd)]
        self._spread_0, self._spread_2 = (np.full(even.size, SPREAD_START) for _ in range(2))
        self._last, self._before_last = np.zeros((2, even.size), np.int64)

    def take(self, index: int, active: int) -> tuple[IntArray, IntArray]:
        """Prediction of a sample, in half counts, and k of its code."""
        # The baseline, and the line through the last two samples, which sample 0 has not.
        half_0 = self._baselines[index % 2][:active] >> BASELINE_FRAC - 1
        half_2 = 2 * (2 * self._last[:active] - self._before_last[:active])
        self._half_counts = half_0, half_2
        spread_0, spread_2 = self._spread_0[:active], self._spread_2[:active]
        straight = spread_2 < spread_0 if index > 0 else np.zeros(active, np.bool_)
        spread = np.where(straight, spread_2, spread_0)
        return np.where(straight, half_2, half_0), np.where(spread < 3, 0, bit_length(spread) - 1)

    def renew(self, index: int, sample: IntArray) -> None:
        """Learn from the sample that was just predicted."""
        active = sample.size
        half_0, half_2 = self._half_counts
        error = signed(2 * sample - half_0, self._sample_w)
        base = self._baselines[index % 2]
        base[:active] = (base[:active] + np.where(error >= 0, 1, -1)) & ((1 << self._sample_w + BASELINE_FRAC) - 1)
        _follow(self._spread_0[:active], error)
        if index > 0:
            _follow(self._spread_2[:active], signed(2 * sample - half_2, self._sample_w))
        self._before_last[:active] = self._last[:active] if index > 0 else sample
        self._last[:active] = sample


def signed(error: IntArray, sample_w: int) -> IntArray:
    """Errors in half counts, modulo 2^(N+1), from -2^N to 2^N - 1."""
    half = 1 << sample_w
    return ((error + half) & (2 * half - 1)) - half


def fold(error: IntArray) -> IntArray:
    """Errors without their sign, which their parity tells with that of the prediction: -1 is 0, -2 is 1."""
    return np.where(error >= 0, error, -error - 1)


def unfold(folded: IntArray, half: IntArray, sample_w: int) -> IntArray:
    """Samples from folded errors and predictions: an error in half counts is odd where the prediction is."""
    error = np.where((folded ^ half) & 1 == 0, folded, -folded - 1)
    return (error + half >> 1) & ((1 << sample_w) - 1)


def bit_length(value: IntArray) -> IntArray:
    """Bits of numbers from 0 to 2^53."""
    return np.frexp(value.astype(np.float64))[1].astype(np.int64)


def spent(credit: IntArray, bits: IntArray, sample_w: int) -> IntArray:
    """Credit behind samples, after codes of so many bits if they found enough for a code."""
    gain = sample_w - bits
    kept = (credit < CREDIT_LEAST) | ((credit >= CREDIT_MOST) & (gain > 0))
    return np.where(kept, credit, credit + gain)


def checksum(sample: IntArray, starts: IntArray, length: IntArray, sample_w: int) -> IntArray:
    """Checksum of each waveform, a CRC of 32 bits.

    Parameters
    ----------
    sample : (samples,) array
        Counts, all waveforms end to end.
    starts, length : (n,) arrays
        Where each waveform begins and how many samples it has.
    sample_w : int
        Bits of a sample.

    Returns
    -------
    (n,) array
    """
    table = _table(sample_w)
    order = np.argsort(-length, kind="stable")
    crc = np.full(starts.size, ALL_ONES)
    for index, active in enumerate(actives(length)):
        rows = order[:active]
        top = crc[rows] >> WORD_W - sample_w
        crc[rows] = (crc[rows] << sample_w & ALL_ONES) ^ table[top ^ sample[starts[rows] + index]]
    return crc


def actives(length: IntArray) -> IntArray:
    """For each sample index how many waveforms have such a sample."""
    ended = np.bincount(length, minlength=1)
    return length.size - np.cumsum(ended)[:-1]


def bounds(last: BoolArray) -> tuple[IntArray, IntArray]:
    """Where each waveform begins among the beats, and how many it has."""
    ends = np.flatnonzero(last) + 1
    starts = np.append(0, ends[:-1])
    return starts, ends - starts


def _follow(spread: IntArray, error: IntArray) -> None:
    """Renew a spread in place: half of it and half of the error."""
    spread[:] = (fold(error) + 2 * (spread // 2) + 1) // 2


@cache
def _table(sample_w: int) -> Array:
    """Remainder that the highest bits of a checksum, one sample's worth, leave below."""
    remainder = np.arange(1 << sample_w) << WORD_W - sample_w
    for _ in range(sample_w):
        remainder = (remainder << 1 & ALL_ONES) ^ np.where(remainder >> WORD_W - 1 & 1, POLYNOMIAL, 0)
    return remainder
