"""Module `parameters`: the Gaussian of each component, and which of them are echoes."""

from decimal import Context

import numpy as np

from .arithmetic import add, constant, div, from_int, sub
from .beats import Beats, IntArray, interleave, waveform_of
from .config import AMP_FRAC, NO_NOISE, NO_PEAK, RATIO_FRAC, Config
from .floating import Format
from .rounding import divide

_DIGITS = Context(prec=50)
TIME_DIVISOR = _DIGITS.divide(2, _DIGITS.sqrt(_DIGITS.multiply(2, _DIGITS.ln(2))))
"""What Eq (9) divides the width σ by: 0.25·FWHM = ½·√(2 ln 2)·σ = σ / (2/√(2 ln 2)) = σ / 1.69864…"""


def parameters(beats: Beats, noise: Beats, config: Config) -> Beats:
    """Centre, peak, width, echo time and amplitude of each component that rises out of the noise.

    Zhou 2022: Eq (6), Eq (7) with its sign corrected, Eq (8), Eq (9) with FWHM = 2·√(2 ln 2)·width. The threshold is
    beyond the paper: amplitude ≥ max(min_amplitude, k·deviation). A component without a peak gets its centre as peak.

    Parameters
    ----------
    beats : Beats
        `left`, `right`, `peak` (bins, `frac` fractional bits or floats), `maximum` (counts), `length`, `flags`,
        `last`.
    noise : Beats
        One beat a waveform: `mean`, `deviation` (counts, 8 fractional bits), `none`.
    config : Config

    Returns
    -------
    Beats
        Echoes in order, then a trailer (`last`), for each waveform. Of an echo `centre`, `peak`, `width`, `time`: bins,
        `frac` fractional bits; `amplitude`: counts, 8 fractional bits; or all of them floats. Of a trailer, in either
        arithmetic, `centre` is the length, `peak` the noise mean, `amplitude` the noise deviation (counts, 8 fractional
        bits); `width` and `time` are 0. `flags` of either.
    """
    last = beats["last"]
    waveform = waveform_of(last)
    mean, deviation = noise["mean"][waveform], noise["deviation"][waveform]
    amplitude = (np.ma.getdata(beats["maximum"]) << AMP_FRAC) - mean
    threshold = np.maximum(config.min_amplitude << (AMP_FRAC + RATIO_FRAC), config.k_raw * deviation)
    kept = np.flatnonzero(last | (amplitude << RATIO_FRAC >= threshold))

    last, flags = last[kept], beats["flags"][kept]
    echo, trailer = kept[~last], kept[last]
    left, right, inner_peak = (np.ma.getdata(beats[name])[echo] for name in ("left", "right", "peak"))
    n_raw = max(config.n_raw, 1 << RATIO_FRAC)
    if config.form is None:
        centre, width, time, height = _solve_in_fixed_point(left, right, amplitude[echo], n_raw)
    else:
        centre, width, time, height = _solve_in_floats(left, right, amplitude[echo], n_raw, config.form)
    peak = np.where(flags[~last] & NO_PEAK, centre, inner_peak)
    return {
        "centre": interleave(last, centre, np.ma.getdata(beats["length"])[trailer]),
        "peak": interleave(last, peak, mean[trailer]),
        "width": interleave(last, width, 0),
        "time": interleave(last, time, 0),
        "amplitude": interleave(last, height, deviation[trailer]),
        "flags": flags | np.where(last, NO_NOISE * noise["none"][waveform[kept]], 0),
        "last": last,
        "cause": kept,
    }


def _solve_in_fixed_point(left: IntArray, right: IntArray, amplitude: IntArray, n_raw: int) -> tuple[IntArray, ...]:
    """Centre, width, echo time and amplitude, rounded half up."""
    centre = (left + right + 1) >> 1
    width = divide(right - left, n_raw, RATIO_FRAC)
    return centre, width, _echo_time(centre, width), amplitude


def _solve_in_floats(
    left: IntArray, right: IntArray, amplitude: IntArray, n_raw: int, form: Format
) -> tuple[IntArray, ...]:
    """Centre, width, echo time and amplitude; every operation is rounded, except for the exact division by two.

    Eq (9) divides by a constant where it could multiply, because the core has a divider and no multiplier.
    """
    centre = div(add(left, right, form), from_int(2, form), form)
    width = div(sub(right, left, form), from_int(n_raw, form, -RATIO_FRAC), form)
    time = sub(centre, div(width, constant(TIME_DIVISOR, form), form), form)
    return centre, width, time, from_int(amplitude, form, -AMP_FRAC)


def _echo_time(centre: IntArray, width: IntArray) -> IntArray:
    """Eq (9): centre − 0.25·FWHM = centre − κ·width, κ = ½·√(2 ln 2), by shifts and additions.

    2κ ≈ (1 + 2⁻⁴ − 2⁻⁶ − 2⁻¹⁴)·(1 + 2⁻³ − 2⁻¹²), 1.2·10⁻⁷ off; the multiples of 8·width below are cut at each shift.
    """
    wide = width << 3
    first_factor = wide + ((wide - ((wide + (wide >> 8)) >> 2)) >> 4)
    both_factors = first_factor + ((first_factor - (first_factor >> 9)) >> 3)
    time: IntArray = ((centre << 4) - both_factors + 8) >> 4
    return time
