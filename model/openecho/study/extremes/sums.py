"""Extremes of what adds up: sums over 10⁹ samples."""

from __future__ import annotations

import sys
from collections import Counter
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.enhance import accumulate
from openecho.study import score
from openecho.study.extremes.case import Case, Outcome, Trial, bounded, planted

Floats = NDArray[np.float64]

AREA = "sums"

BLOCK = 1 << 20
"""Samples of a block, as recordings are read."""

ROUNDING = 2.0**-53


def residuals(trial: Trial) -> Outcome:
    """Mean and deviation of the residuals of a score, where their mean is far from 0."""
    blocks = 1000 if trial.full else 40
    rows, length = BLOCK // 1024, np.full(BLOCK // 1024, 1024, np.int32)
    # Multiples of 2^-6: every product and every sum is a whole number of 2^-12, which Python adds up exactly.
    kinds = [np.rint(64 * trial.rng.normal(1000, 3, (rows, 1024))).astype(np.int64) for _ in range(4)]
    total: Counter[str] = Counter()
    exact, squares = 0, 0
    for number in range(blocks):
        whole = kinds[number % len(kinds)]
        total.update(_sums(whole / 64, length))
        exact, squares = exact + int(whole.sum()), squares + int((whole**2).sum())
    samples = blocks * BLOCK
    mean = Fraction(exact, 64 * samples)
    variance = Fraction(squares, 64 * 64 * samples) - mean**2
    found = score._residual(total)
    deviation = found["deviation"]
    assert deviation is not None
    # Sums of blocks are rounded once for each block and inside it some 20 times (numpy adds in pairs); the variance is
    # the difference of two numbers as large as the mean's square.
    bound = (blocks + 20) * ROUNDING * float(mean**2 + variance)
    return bounded(abs(deviation**2 - float(variance)), bound, f"{samples:.1e} samples, error of the variance")


def means(trial: Trial) -> Outcome:
    """The mean of many pulses of full scale."""
    cycles = 1_000_003 if trial.full else 30_011
    samples = 65535 - trial.rng.integers(0, 3, (cycles, 16))
    found = accumulate(samples, cycles)[0]
    exact = np.array([float(Fraction(int(total), cycles)) for total in samples.sum(axis=0)])
    # Each sample over M is rounded, and each of the M sums of up to the mean.
    bound = 2 * cycles * ROUNDING
    return bounded(float(abs(found / exact - 1).max()), bound, f"{cycles:,} pulses, relative error")


def _sums(residual: Floats, length: NDArray[np.int32]) -> dict[str, Any]:
    return score._sums(residual, length)


def _in_binary32(residual: Floats, length: NDArray[np.int32]) -> dict[str, Any]:
    return score._sums(residual.astype(np.float32), length)


def _one_by_one(samples: Any, cycles: int) -> Floats:
    total = np.zeros(samples.shape[1], np.float32)
    for row in np.array_split(samples, 64):
        total += row.sum(axis=0)
    return np.asarray(total / cycles, np.float64)[None]


HERE = sys.modules[__name__]

CASES = (
    Case(
        "residuals of a score",
        AREA,
        "10⁹ samples in blocks of a million, their mean 300 deviations from 0",
        "the variance off by at most a rounding for each block of the mean's square, against whole numbers",
        residuals,
        "blocks in binary32",
        planted(HERE, "_sums", _in_binary32),
    ),
    Case(
        "mean of pulses",
        AREA,
        "a million pulses of full scale",
        "off by at most two roundings for each pulse, against whole numbers",
        means,
        "a sum in binary32",
        planted(HERE, "accumulate", _one_by_one),
    ),
)
