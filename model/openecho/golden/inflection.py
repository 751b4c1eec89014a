"""Module `inflection`: the components of a waveform, between pairs of inflection points."""

import numpy as np

from .arithmetic import add, div, from_int, magnitude
from .beats import Array, Beats, BoolArray, IntArray, interleave
from .config import NO_PEAK, SATURATED, TOO_LONG, TOO_SHORT, TRUNCATED, Config
from .rounding import divide


def inflection(beats: Beats, config: Config) -> Beats:
    """Find the runs of beats r…e whose second difference is not positive, and where it and the first cross zero.

    Zhou 2022, section 3.2.2. Eq (3) as its worked example decides: left is + → −, right is − → +, zero is not
    positive. Eq (4), and Eq (5) corrected to x_left + |y_left|/(|y_left| + y_right). Every + → − and − → + counts:
    the state machine has the direct paths that the paper's lacks. A run is kept if it is longer than `min_interval`
    (and than one beat, the paper's false turning point). A run cut by one edge ends at that edge and is flagged
    TRUNCATED; a run cut by both is no component. Beyond the paper: the peak, where the first difference of the
    filtered waveform falls through zero inside the run, and the maximum of the raw samples for Eq (8).

    Parameters
    ----------
    beats : Beats
        `second`, `first`, `raw` (counts), `index`, `overlong`, `last`. `first` must be what `second` is the difference
        of: it then falls along a run, and crosses zero once at most.
    config : Config

    Returns
    -------
    Beats
        Components in order, then a trailer (`last`), for each waveform. `left`, `right`, `peak`: bins, 0 at the first
        raw sample, with `frac` fractional bits or as floats; `maximum`: counts; `length`: samples, on trailers;
        `flags`.
    """
    index, second, first = beats["index"], beats["second"], beats["first"]
    begin, end = not_positive_runs(second, index, config)
    cut_left, cut_right = index[begin] == config.first_valid, beats["last"][end]
    kept = (end - begin + 1 > max(config.min_interval, 1)) & ~(cut_left & cut_right)
    begin, end, cut_left, cut_right = begin[kept], end[kept], cut_left[kept], cut_right[kept]

    second_delay, first_delay = config.tap_count + 1, config.tap_count
    left = _position(index[begin], second_delay, config)
    left[~cut_left] = _zero(second, begin[~cut_left] - 1, index, second_delay, config)
    right = _position(index[end], second_delay, config)
    right[~cut_right] = _zero(second, end[~cut_right], index, second_delay, config)

    fall, found = falls_in_runs(first, begin, end)
    peak = np.zeros_like(left)
    peak[found] = _zero(first, fall[found], index, first_delay, config)
    maximum = maxima(np.ma.getdata(beats["raw"]), begin, raw_end(end, cut_right, config))

    flags = SATURATED * (maximum == (1 << config.sample_w) - 1) + TRUNCATED * (cut_left | cut_right) + NO_PEAK * ~found

    ends = np.flatnonzero(beats["last"])
    length = index[ends] + 1
    trailer_flags = TOO_SHORT * (length < config.tap_count + 2) + TOO_LONG * beats["overlong"][ends]
    last = _last_of_each(np.searchsorted(ends, end), ends.size)
    return {
        "left": np.ma.MaskedArray(interleave(last, left, 0), mask=last),
        "right": np.ma.MaskedArray(interleave(last, right, 0), mask=last),
        "peak": np.ma.MaskedArray(interleave(last, peak, 0), mask=interleave(last, ~found, 1) == 1),
        "maximum": np.ma.MaskedArray(interleave(last, maximum, 0), mask=last),
        "length": np.ma.MaskedArray(interleave(last, 0, length), mask=~last),
        "flags": interleave(last, flags, trailer_flags),
        "last": last,
        "cause": interleave(last, np.where(cut_right, end, end + 1), ends),
    }


def not_positive_runs(second: Array, index: IntArray, config: Config) -> tuple[IntArray, IntArray]:
    """First and last beat of each unbroken stretch of valid beats without a positive second difference.

    A waveform begins with beats that are not valid, so no run reaches from one into the next.
    """
    inside = (second <= 0) & (index >= config.first_valid)
    edges = np.flatnonzero(np.diff(inside, prepend=False, append=False))
    return edges[0::2], edges[1::2] - 1


def falls_in_runs(first: Array, begin: IntArray, end: IntArray) -> tuple[IntArray, BoolArray]:
    """Beat before the first + → − of `first` that ends within begin…end, for each run; and whether there is one."""
    falls = np.flatnonzero((first[:-1] > 0) & (first[1:] <= 0))
    nearest = np.searchsorted(falls, begin - 1)
    fall = np.append(falls, first.size)[nearest]
    return fall, fall < end


def raw_end(end: IntArray, cut_right: BoolArray, config: Config) -> IntArray:
    """Beat with the last raw sample before the bracketing coordinate of the right inflection.

    That coordinate lies half a bin after a raw sample if T is even, and on one if T is odd.
    """
    return end + (~cut_right if config.tap_count % 2 == 0 else 0)


def maxima(raw: IntArray, begin: IntArray, end: IntArray) -> IntArray:
    """Greatest raw sample of each stretch of beats begin…end."""
    bounds = np.stack([begin, end + 1], axis=-1).ravel()
    return np.maximum.reduceat(np.append(raw, 0), bounds)[0::2]


def _position(index: IntArray, delay: int, config: Config) -> IntArray:
    """Raw bin of the difference at a beat: `delay` half bins earlier. Rounded once if it is a float."""
    half_bins = 2 * index - delay
    if config.form is None:
        return half_bins << (config.frac - 1)
    return from_int(half_bins, config.form, -1)


def _zero(values: IntArray, before: IntArray, index: IntArray, delay: int, config: Config) -> IntArray:
    """Raw bin where the line from each beat `before` to the next crosses zero: Eq (4), Eq (5).

    In fixed point the fraction of a bin is rounded half up; as floats sum, quotient and sum are rounded one by one.
    """
    position = _position(index[before], delay, config)
    value, next_value = values[before], values[before + 1]
    form = config.form
    if form is None:
        return position + divide(abs(value), abs(value) + abs(next_value), config.frac)
    value, next_value = magnitude(value, form), magnitude(next_value, form)
    return add(position, div(value, add(value, next_value, form), form), form)


def _last_of_each(waveform: IntArray, waveforms: int) -> BoolArray:
    """Where the trailers stand in a stream of components that belong to these waveforms."""
    components = np.bincount(waveform, minlength=waveforms)
    last = np.zeros(waveform.size + waveforms, bool)
    last[np.cumsum(components + 1) - 1] = True
    return last
