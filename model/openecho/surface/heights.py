"""Relative heights of large footprints: at which height above the ground how much of a waveform's energy is below."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d

Floats = NDArray[np.float64]

PERCENT = np.arange(101)
"""RH0 to RH100."""

SMOOTHING = 6.5
"""Bins of 1 ns, σ of the smoothing in which modes and ends are looked for: GEDI L2A, algorithm settings 1 and 4."""

FRONT, BACK = 3.0, 6.0
"""Deviations of the noise that the smoothed waveform first and last rises to: GEDI L2A, algorithm setting 1."""

HEIGHTS = np.dtype([("ground", np.float64), ("top", np.float64), ("bottom", np.float64), ("rh", np.float64, (101,))])
"""Of a waveform: bins of the ground, of the highest and of the lowest return, and RH0 to RH100, m; nan where there is
none. Heights rise from the ground, and bins fall with height."""


def relative_heights(
    curves: ArrayLike,
    length: ArrayLike,
    deviation: ArrayLike,
    bin_m: float,
    *,
    smoothing: float = SMOOTHING,
    front: float = FRONT,
    back: float = BACK,
) -> np.ndarray:
    """Find ground, ends and relative heights of each waveform.

    As GEDI's L2A does it: the waveform is smoothed; it begins where that first exceeds `front` deviations of the noise,
    and ends where it last exceeds `back`; the ground is its last mode between, and RHp the height over the ground below
    which p % of the energy between the ends is (Hofton & Blair, GEDI ATBD for transmit and receive waveform processing,
    2019).

    Parameters
    ----------
    curves : array_like (n, m)
        Waveforms above their baselines, counts: recorded ones, or the sum of the echoes of each, as of
        `openecho.decompose.Decomposition.fitted`.
    length : array_like (n,)
        Samples of each.
    deviation : array_like (n,)
        Of the noise of each as it was recorded, counts.
    bin_m : float
        Range of a bin, m.
    smoothing : float
        σ, bins.
    front, back : float
        Deviations of the noise.

    Returns
    -------
    structured (n,) of `HEIGHTS`

    Raises
    ------
    ValueError
        If shapes do not agree or a number is out of range: which was found, and which expected.
    """
    rows, lengths, noise = np.asarray(curves, np.float64), np.asarray(length), np.asarray(deviation, np.float64)
    if rows.ndim != 2 or lengths.shape != (len(rows),) or noise.shape != (len(rows),):
        shapes = f"{rows.shape}, {lengths.shape}, {noise.shape}"
        raise ValueError(f"curves, length, deviation: found shapes {shapes}, expected (n, m), (n,), (n,)")
    for name, value in (("bin_m", bin_m), ("smoothing", smoothing), ("front", front), ("back", back)):
        if not 0 < value < np.inf:
            raise ValueError(f"{name}: found {value}, expected a number above 0")
    found: np.ndarray = np.full(len(rows), np.nan, HEIGHTS)
    for row, samples, limit, one in zip(rows, lengths, noise, found, strict=True):
        _heights(gaussian_filter1d(row[:samples], smoothing), limit * front, limit * back, bin_m, one)
    return found


def _heights(smooth: Floats, front: float, back: float, bin_m: float, found: np.void) -> None:
    """Fill in what is found of one smoothed waveform; nothing if it does not rise out of the noise."""
    first, last = np.flatnonzero(smooth > front), np.flatnonzero(smooth > back)
    if not len(first) or not len(last):
        return
    top, bottom = int(first[0]), int(last[-1])
    found["top"], found["bottom"] = top, bottom
    modes = np.flatnonzero((smooth[1:-1] > smooth[:-2]) & (smooth[1:-1] >= smooth[2:])) + 1
    modes = modes[(modes >= top) & (modes <= bottom)]
    if not len(modes):  # a record that begins or ends within its only return
        return
    ground = _vertex(smooth, int(modes[-1]))
    energy = smooth[top : bottom + 1].clip(0)[::-1].cumsum()
    below = np.interp(PERCENT / 100 * energy[-1], energy, np.arange(len(energy)))
    found["ground"], found["rh"] = ground, (ground - (bottom - below)) * bin_m


def _vertex(curve: Floats, at: int) -> float:
    """Place of the maximum of the parabola through a sample and its neighbours."""
    before, here, after = curve[at - 1 : at + 2]
    bend = before - 2 * here + after
    return at + float((before - after) / (2 * bend)) if bend else float(at)
