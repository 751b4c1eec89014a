"""Pulse accumulation: the mean of what several pulses brought back from the same place."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def accumulate(samples: ArrayLike, cycles: int) -> FloatArray:
    """Mean of each `cycles` waveforms in a row.

    The signal is that of one pulse, noise that is new in each has 1/√M of its deviation: M times the power
    signal-to-noise ratio (the V–L paper, section 3.4.1; speckle too, if the target moves on between pulses).

    Parameters
    ----------
    samples : array_like (n, m)
        Waveforms in the order of the pulses.
    cycles : int
        M, from 1. Pulses at the end that are less than so many are left out.

    Returns
    -------
    float64 (n // cycles, m)

    Raises
    ------
    ValueError
        If `cycles` is below 1, or `samples` no table of waveforms.
    """
    rows = np.asarray(samples, np.float64)
    if rows.ndim != 2:
        raise ValueError(f"samples: found {rows.ndim} dimensions, expected 2, waveforms and samples")
    if cycles < 1:
        raise ValueError(f"cycles: found {cycles}, expected 1 or more")
    groups = len(rows) // cycles
    # Divided before they are added: no sum of huge values overflows.
    return np.asarray((rows[: groups * cycles].reshape(groups, cycles, -1) / cycles).sum(axis=1))


def snr_db(samples: ArrayLike, signal: ArrayLike) -> float:
    """Power signal-to-noise ratio 10 log₁₀(Σ signal² / Σ (samples − signal)²), dB; infinite without noise.

    Parameters
    ----------
    samples : array_like (..., m)
        Waveforms without their baseline.
    signal : array_like (m,) or (..., m)
        What they would be without noise; not all zero.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the signal is zero.
    """
    rows, true = np.broadcast_arrays(np.asarray(samples, np.float64), np.asarray(signal, np.float64))
    scale = np.abs(true).max(initial=0)
    if scale == 0:
        raise ValueError("signal: found none, expected one that is not zero")
    power, noise = ((true / scale) ** 2).sum(), (((rows - true) / scale) ** 2).sum()
    return float("inf") if noise == 0 else float(10 * np.log10(power / noise))
