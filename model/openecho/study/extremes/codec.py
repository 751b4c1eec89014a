"""Extremes of the codec: whatever the samples, they come back, and a record is hardly longer than they are."""

from __future__ import annotations

import importlib
import itertools
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.codec import PREDICTION, THRESHOLD, CodecError, Form, decode, encode
from openecho.study.extremes.case import Case, Outcome, Trial, planted

Samples = NDArray[np.uint16]

AREA = "codec"

RECORD = importlib.import_module("openecho.codec.record")

_ENCODE, _DECODE = encode, decode
"""As they are, for the faults that stand in their place."""


def worst(bits: int, trial: Trial) -> Iterator[Samples]:
    """Waveforms that no prediction and no threshold suits."""
    full = (1 << bits) - 1
    for size in (0, 1, 2, 3, 31, 200):
        x = np.arange(size)
        yield trial.rng.integers(0, full + 1, size).astype(np.uint16)
        yield np.where(x % 2 == 0, full, 0).astype(np.uint16)
        yield np.where(x % 4 < 2, full, 0).astype(np.uint16)
        yield np.where(x == size // 2, full, 0).astype(np.uint16)
        yield np.full(size, full, np.uint16)
        yield (x % (full + 1)).astype(np.uint16)
        # Quiet until the code is short, then as loud as can be, again and again.
        yield np.where(x % 23 < 20, 0, trial.rng.integers(0, full + 1, size)).astype(np.uint16)


def forms(bits: int) -> Iterator[Form]:
    """Both modes, with thresholds and baselines at their ends."""
    full = (1 << bits) - 1
    for baseline in ((0, 0), (0, full), (full, 0), (full, full)):
        yield Form(PREDICTION, bits, 0, baseline)
        yield from (Form(THRESHOLD, bits, threshold, baseline) for threshold in {0, 1, full})


def round_trip(trial: Trial) -> Outcome:
    """Every width, form and shape, there and back."""
    tried, wrong, longest = 0, 0, 0
    for bits in (1, 2, 11, 16) if not trial.full else range(1, 17):
        for samples, form in itertools.product(worst(bits, trial), forms(bits)):
            record = encode(samples, form)
            wrong += not np.array_equal(decode(record), samples)
            longest = max(longest, 8 * (len(record) - 16) - bits * samples.size)
            tried += 1
    # 32 bits more than the samples, and up to 31 that fill the last word.
    held = wrong == 0 and longest <= 32 + 31
    return Outcome(held, f"{wrong} of {tried:,} differ; payload at most {longest} bits longer, with its padding")


def longest_record(trial: Trial) -> Outcome:
    """A record of 65,535 samples, the most that there is room for, and one sample more."""
    wrong = 0
    for mode in (THRESHOLD, PREDICTION):
        samples = trial.rng.integers(0, 1 << 16, 65_535).astype(np.uint16)
        wrong += not np.array_equal(decode(encode(samples, Form(mode, 16))), samples)
        try:
            encode(np.append(samples, 0), Form(mode, 16))
            wrong += 1
        except CodecError:
            pass
    return Outcome(wrong == 0, f"{wrong} of 4 went wrong")


def damage(trial: Trial) -> Outcome:
    """Every bit of a record flipped, one at a time."""
    tried, unnoticed = 0, 0
    for mode in (THRESHOLD, PREDICTION):
        for _ in range(1 if not trial.full else 40):
            samples = (30 + trial.rng.integers(0, 6, 60) + 200 * (np.arange(60) == 30)).astype(np.uint16)
            record = encode(samples, Form(mode, 8, 0 if mode == PREDICTION else 7, (30, 31)))
            for bit in range(8 * len(record)):
                changed = bytearray(record)
                changed[bit // 8] ^= 0x80 >> bit % 8
                tried += 1
                try:
                    unnoticed += not np.array_equal(decode(bytes(changed)), samples)
                except CodecError:
                    continue
    return Outcome(unnoticed == 0, f"{unnoticed} of {tried:,} flips gave other samples")


class _Agreeable(int):
    """A number that is equal to any."""

    __hash__ = int.__hash__

    def __eq__(self, other: object) -> bool:
        return True

    def __ne__(self, other: object) -> bool:
        return False


def _signed(record: bytes) -> Any:
    return _DECODE(record).astype(np.int16)


def _unchecked(samples: Any, bits: int) -> int:
    return _Agreeable(0)


def _one_too_many(samples: Any, form: Form) -> bytes:
    return _ENCODE(np.asarray(samples)[:65_535], form)


HERE = sys.modules[__name__]

CASES = (
    Case(
        "worst samples",
        AREA,
        "random, alternating, impulses, full scale, ramps, quiet then loud; 1 to 16 bits; every mode, thresholds and "
        "baselines at their ends",
        "they come back; the payload is at most 32 bits longer than they are, before it fills its last word",
        round_trip,
        "samples read as signed words",
        planted(HERE, "decode", _signed),
    ),
    Case(
        "longest record",
        AREA,
        "65,535 random samples of 16 bits, and 65,536",
        "they come back; one more is refused",
        longest_record,
        "cut where it should refuse",
        planted(HERE, "encode", _one_too_many),
    ),
    Case(
        "flipped bits",
        AREA,
        "each bit of a record, in both modes",
        "never other samples than those that were written",
        damage,
        "a checksum that agrees with any",
        planted(RECORD, "checksum", _unchecked),
    ),
)
