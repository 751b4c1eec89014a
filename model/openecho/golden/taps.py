"""Tap sets of the filter, by name."""

import numpy as np

MAX_TAPS = 48
"""Longest filter of the core."""

PAPER_TAPS = (43, 55, 69, 84, 99, 114, 127, 138, 146, 150, 150, 146, 138, 127, 114, 99, 84, 69, 55, 43)
"""The Gaussian of Zhou 2022, Eq (11), as the integers in front of 2⁻¹¹."""


def gaussian_taps(sigma: float, count: int | None = None) -> tuple[int, ...]:
    """Integer taps of a Gaussian; as wide as the echo, it is the filter that finds the echo's peak best.

    Parameters
    ----------
    sigma : float
        Bins.
    count : int, optional
        Taps; 3.5 σ to either side, or as many as the core takes, if left out.

    Returns
    -------
    tuple of int
        Symmetric taps that add up to about 2^13. From there on rounding them costs less than 0.01 % of the peak's
        precision; at the paper's 2^11 it would cost the inflections of a σ of 8 bins 14 %.
    """
    taken = min(2 * round(3.5 * sigma), MAX_TAPS) if count is None else count
    x = np.arange(taken) - (taken - 1) / 2
    gauss = np.exp(-0.5 * (x / sigma) ** 2)
    return tuple(int(tap) for tap in np.rint(gauss * 2**13 / gauss.sum()))


TAP_SETS = {
    "paper": PAPER_TAPS,
    "gedi": gaussian_taps(4.6),
    "lvis": gaussian_taps(5.05),
    "nasa3.5": gaussian_taps(3.5),
    "nasa6.5": gaussian_taps(6.5),
}
"""Taps by name: the paper's; Gaussians as wide as the transmitted pulse of GEDI (σ 4.6 bins of 1 ns, the median of its
own fits) and of LVIS (5.05 bins of 1 ns, with a tail that no Gaussian has); and the two smoothing widths of GEDI's L2A
algorithm settings, 3.5 and 6.5 bins (Hofton & Blair, GEDI ATBD for transmit and receive waveform processing, 2019)."""
