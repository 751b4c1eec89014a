"""Module `parameters`: the Gaussian of each component, and which of them are echoes."""

import numpy as np

from .beats import Beats, IntArray, waveform_of
from .config import AMP_FRAC, NO_NOISE, NO_PEAK, RATIO_FRAC, Config
from .rounding import divide


def parameters(beats: Beats, noise: Beats, config: Config) -> Beats:
    """Centre, peak, width, echo time and amplitude of each component that rises out of the noise.

    Zhou 2022: Eq (6), Eq (7) with its sign corrected, Eq (8), Eq (9) with FWHM = 2·√(2 ln 2)·width. The threshold is
    beyond the paper: amplitude ≥ max(min_amplitude, k·deviation). A component without a peak gets its centre as peak.

    Parameters
    ----------
    beats : Beats
        `left`, `right`, `peak` (bins, `frac` fractional bits), `maximum` (counts), `length`, `flags`, `last`.
    noise : Beats
        One beat a waveform: `mean`, `deviation` (counts, 8 fractional bits), `none`.
    config : Config

    Returns
    -------
    Beats
        Echoes in order, then a trailer (`last`), for each waveform. Of an echo `centre`, `peak`, `width`, `time`: bins,
        `frac` fractional bits; `amplitude`: counts, 8 fractional bits. Of a trailer `centre` is the length, `peak` the
        noise mean, `amplitude` the noise deviation; `width` and `time` are 0. `flags` of either.
    """
    last = beats["last"]
    waveform = waveform_of(last)
    mean, deviation = noise["mean"][waveform], noise["deviation"][waveform]
    amplitude = (np.ma.getdata(beats["maximum"]) << AMP_FRAC) - mean
    threshold = np.maximum(config.min_amplitude << (AMP_FRAC + RATIO_FRAC), config.k_raw * deviation)
    kept = np.flatnonzero(last | (amplitude << RATIO_FRAC >= threshold))

    left, right, inner_peak, length = (np.ma.getdata(beats[name])[kept] for name in ("left", "right", "peak", "length"))
    last, flags = last[kept], beats["flags"][kept]
    centre = (left + right + 1) >> 1
    peak = np.where(flags & NO_PEAK, centre, inner_peak)
    width = divide(right - left, max(config.n_raw, 1 << RATIO_FRAC), RATIO_FRAC)
    return {
        "centre": np.where(last, length, centre),
        "peak": np.where(last, mean[kept], peak),
        "width": np.where(last, 0, width),
        "time": np.where(last, 0, _echo_time(centre, width)),
        "amplitude": np.where(last, deviation[kept], amplitude[kept]),
        "flags": flags | np.where(last, NO_NOISE * noise["none"][waveform[kept]], 0),
        "last": last,
        "cause": kept,
    }


def _echo_time(centre: IntArray, width: IntArray) -> IntArray:
    """Eq (9): centre − 0.25·FWHM = centre − κ·width, κ = ½·√(2 ln 2), by shifts and additions.

    2κ ≈ (1 + 2⁻⁴ − 2⁻⁶ − 2⁻¹⁴)·(1 + 2⁻³ − 2⁻¹²), 1.2·10⁻⁷ off; the multiples of 8·width below are cut at each shift.
    """
    wide = width << 3
    first_factor = wide + ((wide - ((wide + (wide >> 8)) >> 2)) >> 4)
    both_factors = first_factor + ((first_factor - (first_factor >> 9)) >> 3)
    time: IntArray = ((centre << 4) - both_factors + 8) >> 4
    return time
