"""The whole method in float64, straight from the equations: what the core is judged against."""

import numpy as np

from .beats import Array, Beats, BoolArray, FloatArray, IntArray, stream, waveform_of
from .config import NO_PEAK, NOISE_SAMPLES, SATURATED, TAP_FRAC, TRUNCATED, Config
from .inflection import falls_in_runs, maxima, not_positive_runs, raw_end
from .reader import reader

FWHM = 2 * np.sqrt(2 * np.log(2))
"""Full width at half maximum of a Gaussian, in its σ."""


def decompose(samples: Array, length: Array, config: Config, published: bool = False) -> dict[str, Array]:
    """Echoes of each waveform by Zhou 2022, corrected or as published.

    The filter's sums are whole numbers below 2^53, which Eq (11) divides by 2¹¹: float64 holds the filtered waveform
    and its differences exactly, and the division changes no result.

    Parameters
    ----------
    samples : (n, m) integer array
        A waveform a row, counts.
    length : (n,) integer array
        Samples that were recorded in each row; those past `config.max_samples` are not looked at.
    config : Config
    published : bool
        Take the paper's word against the design's corrections: Eq (5) as printed; only the components that the
        five-state machine finds; as maximum the first raw sample of the interval where the first difference goes 1100
        (1 is positive), or the greatest sample, as in the core, if there is none. What the paper leaves open
        (threshold, interval of 2 to 5 bins, `peak`) is as in the core.

    Returns
    -------
    dict of arrays
        One entry an echo: `waveform` (row), `left`, `right`, `centre`, `peak`, `width`, `time` (bins), `amplitude`,
        `maximum` (counts), `flags` and each flag as bool (`saturated`, `truncated`, `no_peak`), and `five_state`,
        whether the paper's state machine finds it. One entry a waveform: `noise_mean`, `noise_deviation` (counts).
    """
    beats, noise = reader(stream(samples, length, config), config)
    sample, index = beats["sample"], beats["index"]
    mean, deviation = _noise(sample, np.flatnonzero(index == 0), noise["none"] == 0)

    # Differences are used only where the filter lies inside the waveform: what comes before its start does not matter.
    filtered = np.convolve(sample, np.array(config.taps) / 2**TAP_FRAC)[: sample.size]
    first = np.diff(filtered, prepend=0)
    second = np.diff(first, prepend=0)

    begin, end, five_state = _runs(second, beats, config)
    if published:
        begin, end, five_state = begin[five_state], end[five_state], five_state[five_state]
    cut_left, cut_right = index[begin] == config.first_valid, beats["last"][end]
    x = index - (config.tap_count + 1) / 2
    left = _inflection(second, x, begin, begin - 1, cut_left)
    right = _inflection(second, x, end, end, cut_right, published)
    fall, found = falls_in_runs(first, begin, end)
    centre = (left + right) / 2
    width = (right - left) / max(config.n, 1)
    maximum = _maximum(sample, begin - config.delay, raw_end(end, cut_right, config) - config.delay, published)
    waveform = waveform_of(beats["last"])[begin]

    peak = centre.copy()
    fall = fall[found]
    peak[found] = zero_crossing(index[fall] - config.tap_count / 2, first[fall], first[fall + 1])

    saturated, truncated = maximum == (1 << config.sample_w) - 1, cut_left | cut_right
    echoes = {
        "waveform": waveform,
        "left": left,
        "right": right,
        "centre": centre,
        "peak": peak,
        "width": width,
        "time": centre - 0.25 * FWHM * width,
        "amplitude": maximum - mean[waveform],
        "maximum": maximum,
        "flags": SATURATED * saturated + TRUNCATED * truncated + NO_PEAK * ~found,
        "saturated": saturated,
        "truncated": truncated,
        "no_peak": ~found,
        "five_state": five_state,
    }
    kept = echoes["amplitude"] >= np.maximum(config.min_amplitude, config.k * deviation[waveform])
    return {name: values[kept] for name, values in echoes.items()} | {"noise_mean": mean, "noise_deviation": deviation}


def zero_crossing(x: FloatArray, y: FloatArray, y_next: FloatArray, published: bool = False) -> FloatArray:
    """Where the line from (x, y) to (x + 1, y_next), of opposite signs, crosses zero: Eq (4), and Eq (5) corrected.

    With `published` as Eq (5) is printed: the mirror image within the bin.
    """
    numerator = y_next if published else y
    return x + abs(numerator) / (abs(y) + abs(y_next))


def saved_echoes(samples: Array, length: Array, config: Config) -> IntArray:
    """Echoes that the direct paths of the corrected state machine save, of each waveform.

    The paper's five states lose a component that follows fewer than two positive signs, or three after another one.

    Parameters
    ----------
    samples, length, config
        As in `decompose`.

    Returns
    -------
    (n,) integer array
        Echoes with both inflections inside the waveform that the five-state machine does not find.
    """
    echoes = decompose(samples, length, config)
    saved = ~echoes["five_state"] & ~echoes["truncated"]
    return np.bincount(echoes["waveform"][saved], minlength=len(length))


def corrected_width(width: FloatArray, config: Config) -> FloatArray:
    """Width of the echoes before the filter widened them: √max(0, width² − variance of the normalised taps).

    True for a Gaussian filter. Taps cut short of their tails move the inflections by more than their variance says:
    the paper's, cut at 1.6 σ, leave an echo of σ 3, 5, 8 or 16 at 5.7, 6.0, 8.3 or 16.04.

    Parameters
    ----------
    width : (...) float array
        σ of filtered echoes, bins: `width` as decomposed with n = 2.
    config : Config
        Its taps must not sum to 0.

    Returns
    -------
    (...) float array
        σ, bins.
    """
    offset = np.arange(config.tap_count) - (config.tap_count - 1) / 2
    variance = float(np.average(offset**2, weights=config.taps))
    return (width**2 - variance).clip(0) ** 0.5


def _noise(sample: IntArray, starts: IntArray, enough: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Mean and population deviation of the first 50 samples, 0 where there are not enough."""
    mean, deviation = np.zeros((2, starts.size))
    window = sample[starts[enough, np.newaxis] + np.arange(NOISE_SAMPLES)]
    mean[enough], deviation[enough] = window.mean(axis=1), window.std(axis=1)
    return mean, deviation


def _runs(second: FloatArray, beats: Beats, config: Config) -> tuple[IntArray, IntArray, BoolArray]:
    """First and last beat of each component's run, and whether the five-state machine finds it."""
    begin, end = not_positive_runs(second, beats["index"], config)
    cut_left, cut_right = beats["index"][begin] == config.first_valid, beats["last"][end]
    five_state = _five_states(begin, end, beats["index"][begin] - config.first_valid) & ~cut_right
    kept = (end - begin + 1 > max(config.min_interval, 1)) & ~(cut_left & cut_right)
    return begin[kept], end[kept], five_state[kept]


def _five_states(begin: IntArray, end: IntArray, before: IntArray) -> BoolArray:
    """Whether the state machine of Zhou 2022, section 3.2.2 C, reaches inflection point 2 after each run.

    It looks at two neighbouring signs a beat and needs 11, in IDLE, before a run. IDLE follows on inflection point 2
    one beat late, so a run after a found one needs three positive signs before it; any other needs two.

    Parameters
    ----------
    begin, end : (runs,) integer array
        First and last beat of each run that is not positive.
    before : (runs,) integer array
        Beats of its waveform before each run.
    """
    order = np.arange(begin.size)
    positive = np.minimum(begin - np.append(-1, end[:-1]) - 1, before)
    opens = positive == before
    long_enough = end > begin
    # Two positive signs suffice exactly if the run before was not found: such runs are found by turns.
    by_turns = (positive == 2) & long_enough & ~opens
    found = (positive >= 2) & long_enough
    anchor = np.maximum.accumulate(np.where(by_turns, 0, order))
    five_state: BoolArray = found[anchor] ^ ((order - anchor) % 2 == 1)
    return five_state


def _inflection(
    y: FloatArray, x: FloatArray, run: IntArray, before: IntArray, cut: BoolArray, published: bool = False
) -> FloatArray:
    """Zero crossing after each beat `before`; the position of the run's own outermost beat where the run is cut."""
    inflection = x[run]
    before = before[~cut]
    inflection[~cut] = zero_crossing(x[before], y[before], y[before + 1], published)
    return inflection


def _maximum(sample: IntArray, begin: IntArray, end: IntArray, published: bool) -> IntArray:
    """Greatest raw sample from begin to end, or as published the first with two rises before it and two falls after."""
    greatest = maxima(sample, begin, end)
    if not published:
        return greatest
    rises = np.diff(sample) > 0
    crests = 2 + np.flatnonzero(rises[:-3] & rises[1:-2] & ~rises[2:-1] & ~rises[3:])
    crest = np.append(crests, sample.size - 1)[np.searchsorted(crests, begin + 2)]
    return np.where(crest <= end - 2, sample[crest], greatest)
