"""Module `inflection`: the components of a waveform, between pairs of inflection points, that rise out of the noise."""

import numpy as np

from .arithmetic import add, div, from_int, magnitude
from .beats import Array, Beats, BoolArray, IntArray, interleave, waveform_of
from .config import AMP_FRAC, NO_NOISE, NO_PEAK, RATIO_FRAC, SATURATED, TOO_LONG, TOO_SHORT, TRUNCATED, Config
from .rounding import divide


def inflection(beats: Beats, noise: Beats, config: Config) -> Beats:
    """Find the runs of beats r…e whose second difference is not positive, and where it and the first cross zero.

    Zhou 2022, section 3.2.2. Eq (3) as its worked example decides: left is + → −, right is − → +, zero is not
    positive. Eq (4), and Eq (5) corrected to x_left + |y_left|/(|y_left| + y_right). Every + → − and − → + counts:
    the state machine has the direct paths that the paper's lacks. A run is kept if it is longer than `min_interval`
    (and than one beat, the paper's false turning point). A run cut by one edge ends at that edge and is flagged
    TRUNCATED; a run cut by both is no component. Eq (8): the amplitude is the maximum of the raw samples less the
    mean of the noise. Beyond the paper: the peak, where the first difference of the filtered waveform falls through
    zero inside the run, and the threshold `stands_out`. It is passed before the interpolation, which so works for
    echoes alone.

    Parameters
    ----------
    beats : Beats
        `second`, `first`, `raw` (counts), `index`, `overlong`, `last`. `first` must be what `second` is the difference
        of: it then falls along a run, and crosses zero once at most.
    noise : Beats
        One beat a waveform: `mean`, `deviation` (counts, 8 fractional bits), `none`.
    config : Config

    Returns
    -------
    Beats
        Components in order, then a trailer (`last`), for each waveform. `left`, `right`, `peak`: bins, 0 at the first
        raw sample, with `frac` fractional bits or as floats; `amplitude`: counts, 8 fractional bits in either
        arithmetic, of a trailer the deviation of the noise; `length`: samples, and `mean`, of the noise: counts, 8
        fractional bits, both on trailers; `flags`.
    """
    index, second, first, ends = beats["index"], beats["second"], beats["first"], np.flatnonzero(beats["last"])
    begin, end = _components(beats, config)
    maximum = maxima(np.ma.getdata(beats["raw"]), begin, raw_end(end, beats["last"][end], config))
    waveform = waveform_of(beats["last"])[end]
    amplitude = (maximum << AMP_FRAC) - noise["mean"][waveform]

    kept = stands_out(amplitude, noise["deviation"][waveform], config)
    begin, end, maximum, amplitude, waveform = (v[kept] for v in (begin, end, maximum, amplitude, waveform))

    cut_left, cut_right = _cuts(begin, end, beats, config)
    left, right = _inflections(second, begin, end, cut_left, cut_right, index, config)
    fall, found = falls_in_runs(first, begin, end)
    peak = np.zeros_like(left)
    peak[found] = _zero(first, fall[found], index, config.tap_count, config)
    flags = SATURATED * (maximum == (1 << config.sample_w) - 1) + TRUNCATED * (cut_left | cut_right) + NO_PEAK * ~found

    length = index[ends] + 1
    too_short, too_long = length < config.tap_count + 2, beats["overlong"][ends]
    trailer_flags = TOO_SHORT * too_short + TOO_LONG * too_long + NO_NOISE * noise["none"]
    last = _last_of_each(waveform, ends.size)
    return {
        "left": np.ma.MaskedArray(interleave(last, left, 0), mask=last),
        "right": np.ma.MaskedArray(interleave(last, right, 0), mask=last),
        "peak": np.ma.MaskedArray(interleave(last, peak, 0), mask=interleave(last, ~found, 1) == 1),
        "amplitude": interleave(last, amplitude, noise["deviation"]),
        "length": np.ma.MaskedArray(interleave(last, 0, length), mask=~last),
        "mean": np.ma.MaskedArray(interleave(last, 0, noise["mean"]), mask=~last),
        "flags": interleave(last, flags, trailer_flags),
        "last": last,
        "cause": interleave(last, np.where(cut_right, end, end + 1), ends),
    }


def stands_out(amplitude: IntArray, deviation: IntArray, config: Config) -> BoolArray:
    """Whether amplitude ≥ max(min_amplitude, k·deviation), without a rounding; beyond the paper.

    Parameters
    ----------
    amplitude, deviation : (...) int64 array
        Of a component, less than 0 too, and of the noise of its waveform: counts, 8 fractional bits.
    config : Config

    Returns
    -------
    (...) bool array
    """
    threshold = np.maximum(config.min_amplitude << (AMP_FRAC + RATIO_FRAC), config.k_raw * deviation)
    result: BoolArray = amplitude << RATIO_FRAC >= threshold
    return result


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


def _components(beats: Beats, config: Config) -> tuple[IntArray, IntArray]:
    """First and last beat of each run that is long enough and not cut by both edges."""
    begin, end = not_positive_runs(beats["second"], beats["index"], config)
    cut_left, cut_right = _cuts(begin, end, beats, config)
    kept = (end - begin + 1 > max(config.min_interval, 1)) & ~(cut_left & cut_right)
    return begin[kept], end[kept]


def _cuts(begin: IntArray, end: IntArray, beats: Beats, config: Config) -> tuple[BoolArray, BoolArray]:
    """Whether the start of its waveform cuts each run begin…end, and whether the end does."""
    return beats["index"][begin] == config.first_valid, beats["last"][end]


def _inflections(
    second: Array,
    begin: IntArray,
    end: IntArray,
    cut_left: BoolArray,
    cut_right: BoolArray,
    index: IntArray,
    config: Config,
) -> tuple[IntArray, IntArray]:
    """Raw bin of the left and of the right inflection; of the outermost beat itself where an edge cuts the run."""
    delay = config.tap_count + 1
    left, right = _position(index[begin], delay, config), _position(index[end], delay, config)
    left[~cut_left] = _zero(second, begin[~cut_left] - 1, index, delay, config)
    right[~cut_right] = _zero(second, end[~cut_right], index, delay, config)
    return left, right


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
