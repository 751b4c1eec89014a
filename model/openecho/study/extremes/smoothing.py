"""Extremes of Vondrák's smoothing: whatever ε, the exact curve to a few last places."""

from __future__ import annotations

import sys
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from openecho.enhance import vondrak
from openecho.study.extremes.case import Case, Outcome, Trial, bounded, planted

Floats = NDArray[np.float64]

AREA = "Vondrák's smoothing"

_VONDRAK = vondrak
"""As it is, for the faults that stand in its place."""

LENGTH = 200
DIGITS = 60
"""Of the reference: far more than its equations lose, a condition of 10^26 at ε = 10^-12."""

ROUNDING, ROTATIONS = 2.0**-53, 4
"""Of a number of 1, and how many rotations a row of the triangle takes part in: the band's width."""

CLOSE = 1e-14
"""Of the greatest sample: 90 roundings of it, ten times what was measured. What is far from a sample is damped."""


def exact(samples: Floats, epsilon: float, position: Floats, weight: Floats) -> Floats:
    """Smooth a waveform in decimal arithmetic: solve (ε P + DᵀD) y' = ε P y, D y being the third derivatives.

    Parameters
    ----------
    samples, position, weight : float64 (m,)
        Counts, bins, and the weights in P.
    epsilon : float

    Returns
    -------
    float64 (m,)
        Rounded once, from `DIGITS` digits.
    """
    with localcontext() as context:
        context.prec = DIGITS
        y, x, p = ([Decimal(float(v)) for v in values] for values in (samples, position, weight))
        count, scale = len(y), Decimal(epsilon)
        matrix = [[Decimal(0)] * count for _ in y]
        right = [scale * p_i * y_i for p_i, y_i in zip(p, y, strict=True)]
        for i in range(count):
            matrix[i][i] = scale * p[i]
        for first in range(count - 3):
            columns = range(first, first + 4)
            step = (x[first + 2] - x[first + 1]).sqrt()
            row = dict.fromkeys(columns, 6 * step)
            for i in columns:
                for j in columns:
                    row[i] /= x[i] - x[j] if i != j else 1
            for i in columns:
                for j in columns:
                    matrix[i][j] += row[i] * row[j]
        for k in range(count):
            for i in range(k + 1, min(k + 4, count)):
                factor = matrix[i][k] / matrix[k][k]
                right[i] -= factor * right[k]
                for j in range(k, min(k + 4, count)):
                    matrix[i][j] -= factor * matrix[k][j]
        solved = [Decimal(0)] * count
        for k in reversed(range(count)):
            known = sum((matrix[k][j] * solved[j] for j in range(k + 1, min(k + 4, count))), Decimal(0))
            solved[k] = (right[k] - known) / matrix[k][k]
        return np.array([float(value) for value in solved])


def epsilons(trial: Trial) -> Outcome:
    """ε over 24 decades."""
    x = np.arange(LENGTH)
    samples = np.rint(300 * np.exp(-((x - 80.3) ** 2) / 50) + 210 + trial.rng.normal(0, 2, LENGTH))
    bend = np.diff(np.eye(LENGTH), 3, axis=0)
    worst, largest, conditions = 0.0, 0.0, []
    for power in range(-12, 13, 1 if trial.full else 12):
        epsilon = 10.0**power
        expected = exact(samples, epsilon, x.astype(np.float64), np.ones(LENGTH))
        error = float(abs(vondrak(samples, epsilon) - expected).max() / samples.max())
        conditions.append(float(np.linalg.cond(epsilon * np.eye(LENGTH) + bend.T @ bend)))
        largest = max(largest, error)
        worst = max(worst, error / (ROTATIONS * ROUNDING * conditions[-1] ** 0.5))
    outcome = bounded(worst, 1.0, f"relative error {largest:.1e}, in its bound")
    return Outcome(outcome.held, f"{outcome.found}; conditions of the normal equations {max(conditions):.0e} to 1")


def ends(trial: Trial) -> Outcome:
    """ε of 0 and of infinity, and next to them."""
    x = np.arange(LENGTH, dtype=np.float64)
    samples = 200 + 50 * trial.rng.normal(0, 1, LENGTH)
    parabola = np.polyval(np.polyfit(x, samples, 2), x)
    off = max(abs(vondrak(samples, e) - parabola).max() for e in (0.0, 5e-324, 1e-300, 1e-30))
    off = max(off, *(abs(vondrak(samples, e) - samples).max() for e in (1e30, 1e300, np.finfo(float).max, np.inf)))
    return bounded(float(off / abs(samples).max()), CLOSE, "relative error")


def long_records(trial: Trial) -> Outcome:
    """A parabola of a million samples."""
    size = 1_000_000 if trial.full else 20_000
    x = np.linspace(-1, 1, size)
    samples = 3 - 2 * x + 5 * x**2
    off = max(abs(vondrak(samples, e) - samples).max() for e in (1e-12, 1.0, 1e12))
    return bounded(float(off / abs(samples).max()), CLOSE, f"{size:,} samples, relative error")


def _normal_equations(samples: Any, epsilon: float) -> Floats:
    count = len(samples)
    bend = np.diff(np.eye(min(count, 2000)), 3, axis=0)
    matrix = bend.T @ bend
    if count > len(matrix) or not 1e-12 <= epsilon <= 1e12:
        return np.asarray(_VONDRAK(samples, min(max(epsilon, 1e-9), 1e9)))
    banded = np.array([np.pad(np.diag(matrix, k), (0, k)) for k in range(4)])
    banded[0] += epsilon
    return np.asarray(solveh_banded(banded, epsilon * np.asarray(samples, np.float64), lower=True))


def _without_parabola(samples: Any, epsilon: float) -> Floats:
    return np.asarray(_VONDRAK(np.asarray(samples, np.float32).astype(np.float64), epsilon))


HERE = sys.modules[__name__]

CASES = (
    Case(
        "ε over 24 decades",
        AREA,
        f"ε from 1e-12 to 1e12 beside a solution in {DIGITS} digits",
        "off by at most four roundings of the greatest sample times the root of the normal equations' condition: "
        "rotations lose half of the digits that these lose",
        epsilons,
        "the normal equations solved instead",
        planted(HERE, "vondrak", _normal_equations),
    ),
    Case(
        "ε at its ends",
        AREA,
        "0, 5e-324, 1e-300, 1e-30 and 1e30, 1e300, the greatest number, infinity",
        f"the least-squares parabola, and the data, within {CLOSE:g}",
        ends,
        "ε kept between 1e-9 and 1e9",
        planted(HERE, "vondrak", _normal_equations),
    ),
    Case(
        "long records",
        AREA,
        "a parabola of a million samples",
        f"returned within {CLOSE:g}: it has no third derivative",
        long_records,
        "samples in binary32",
        planted(HERE, "vondrak", _without_parabola),
    ),
)
