"""Module `parameters`: the Gaussian of each component."""

from decimal import Context

import numpy as np

from .arithmetic import add, constant, div, from_int, sub
from .beats import Beats, IntArray, interleave
from .config import AMP_FRAC, NO_PEAK, RATIO_FRAC, Config
from .floating import Format
from .rounding import divide

_DIGITS = Context(prec=50)
TIME_DIVISOR = _DIGITS.divide(2, _DIGITS.sqrt(_DIGITS.multiply(2, _DIGITS.ln(2))))
"""What Eq (9) divides the width σ by: 0.25·FWHM = ½·√(2 ln 2)·σ = σ / (2/√(2 ln 2)) = σ / 1.69864…"""


def parameters(beats: Beats, config: Config) -> Beats:
    """Centre, peak, width, echo time and amplitude of each component.

    Zhou 2022: Eq (6), Eq (7) with its sign corrected, Eq (9) with FWHM = 2·√(2 ln 2)·width. A component without a peak
    gets its centre as peak.

    Parameters
    ----------
    beats : Beats
        `left`, `right`, `peak` (bins, `frac` fractional bits or floats), `amplitude` (counts, 8 fractional bits; of a
        trailer the noise deviation), `length`, `mean`, `flags`, `last`, as `inflection` returns them.
    config : Config

    Returns
    -------
    Beats
        Echoes in order, then a trailer (`last`), for each waveform. Of an echo `centre`, `peak`, `width`, `time`: bins,
        `frac` fractional bits; `amplitude`: counts, 8 fractional bits; or all of them floats. Of a trailer, in either
        arithmetic, `centre` is the length, `peak` the noise mean, `amplitude` the noise deviation (counts, 8 fractional
        bits); `width` and `time` are 0. `flags` of either.
    """
    last, flags, amplitude = beats["last"], beats["flags"], beats["amplitude"]
    left, right, inner_peak = (np.ma.getdata(beats[name])[~last] for name in ("left", "right", "peak"))
    n_raw = max(config.n_raw, 1 << RATIO_FRAC)
    if config.form is None:
        centre, width, time, height = _solve_in_fixed_point(left, right, amplitude[~last], n_raw, config.pos_w)
    else:
        centre, width, time, height = _solve_in_floats(left, right, amplitude[~last], n_raw, config.form)
    peak = np.where(flags[~last] & NO_PEAK, centre, inner_peak)
    return {
        "centre": interleave(last, centre, np.ma.getdata(beats["length"])[last]),
        "peak": interleave(last, peak, np.ma.getdata(beats["mean"])[last]),
        "width": interleave(last, width, 0),
        "time": interleave(last, time, 0),
        "amplitude": interleave(last, height, amplitude[last]),
        "flags": flags,
        "last": last,
        "cause": np.arange(last.size),
    }


def time_divisor(frac: int) -> int:
    """`TIME_DIVISOR` to the nearest number with so many fractional bits, times 2^frac."""
    return int(_DIGITS.to_integral_value(_DIGITS.multiply(TIME_DIVISOR, 1 << frac)))


def echo_time(centre: IntArray, width: IntArray, pos_w: int) -> IntArray:
    """Eq (9) in fixed point: centre − width / K, the quotient rounded half up to `frac` bits.

    K is `TIME_DIVISOR` with as many fractional bits as a position has bits in all: no width is long enough for what K
    is off to make more than 0.18 of the last place.

    Parameters
    ----------
    centre, width : (...) int64 array
        Bins, `frac` fractional bits; the centre is rounded already.
    pos_w : int
        Bits of a position.

    Returns
    -------
    (...) int64 array
        As they are.
    """
    return centre - divide(width, time_divisor(pos_w), pos_w)


def _solve_in_fixed_point(
    left: IntArray, right: IntArray, amplitude: IntArray, n_raw: int, pos_w: int
) -> tuple[IntArray, ...]:
    """Centre, width, echo time and amplitude, rounded half up."""
    centre = (left + right + 1) >> 1
    width = divide(right - left, n_raw, RATIO_FRAC)
    return centre, width, echo_time(centre, width, pos_w), amplitude


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
