"""The core's method on one waveform in exact fractions, straight from the equations: slow, and right to the last bit.

Nothing of `openecho.golden` is in it but the settings: a mistake there does not come back here.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from openecho import golden
from openecho.golden.floating import Format


def half_up(value: Fraction, bits: int) -> int:
    """Nearest multiple of 2^-bits, half up, times 2^bits."""
    return math.floor(value * (1 << bits) + Fraction(1, 2))


def rounded(value: Fraction | int, form: Format) -> Fraction:
    """Nearest number of a format without an end, ties to even."""
    value = Fraction(value)
    exponent = value.numerator.bit_length() - value.denominator.bit_length()
    exponent -= abs(value) < Fraction(2) ** exponent
    place = Fraction(2) ** (max(exponent, 1 - form.bias) - form.frac_w)
    return round(value / place) * place


def quarter_fwhm() -> Fraction:
    """0.25·FWHM of a Gaussian of σ = 1, √(2 ln 2)/2, to 2⁻²⁰⁰; the series is Σ 1/(k·2^k) = ln 2."""
    squared = sum(Fraction(1, k << k) for k in range(1, 420)) / 2
    return Fraction(math.isqrt(math.floor(squared * 2**400)), 2**200)


def position(x: Fraction, config: golden.Config) -> Fraction | int:
    """A position (bins) as the core has it: in 2^-frac bins, or as a number of its format."""
    return half_up(x, config.frac) if config.form is None else rounded(x, config.form)


def zero(x: Fraction, y: int, y_next: int, config: golden.Config) -> Fraction | int:
    """Where the line from (x, y) to (x + 1, y_next) crosses zero; Zhou 2022, Eq (4), and Eq (5) corrected."""
    y, y_next = abs(y), abs(y_next)
    if config.form is None:
        return half_up(x + Fraction(y, y + y_next), config.frac)
    fl = partial(rounded, form=config.form)
    value, next_value = fl(Fraction(y, 2**11)), fl(Fraction(y_next, 2**11))
    return fl(fl(x) + fl(value / fl(value + next_value)))


def noise_of(s: list[int]) -> tuple[int, int, int]:
    """Mean and deviation of the first 50 samples (2^-8 counts), and whether there are too few."""
    if len(s) < 50:
        return 0, 0, 1
    head = s[:50]
    variance = sum(v * v for v in head) * 50 - sum(head) ** 2
    root = Fraction(math.isqrt(variance * 2**8), 2**4)
    return half_up(Fraction(sum(head), 50), 8), half_up(root / 50, 8), 0


def components_of(s: list[int], mean: int, deviation: int, config: golden.Config) -> list[dict[str, Any]]:
    """Components of a waveform between their inflections: Zhou 2022, sections 3.2.1 and 3.2.2, as corrected."""
    t, taps = config.tap_count, config.taps
    filtered = [sum(taps[k] * s[i - k] for k in range(min(t, i + 1))) for i in range(len(s))]
    first = [v - (filtered[i - 1] if i > 0 else 0) for i, v in enumerate(filtered)]
    second = [v - (first[i - 1] if i > 0 else 0) for i, v in enumerate(first)]
    end, components = t, []
    while end + 1 < len(s):
        begin = end + 1
        if second[begin] > 0:
            end = begin
            continue
        end = begin
        while end + 1 < len(s) and second[end + 1] <= 0:
            end += 1
        at_start, at_end = begin == t + 1, end == len(s) - 1
        beats = end - begin + 1
        if (at_start and at_end) or beats <= max(config.min_interval, 1):
            continue
        x = [i - Fraction(t + 1, 2) for i in range(len(s))]
        first_x, last_x = position(x[begin], config), position(x[end], config)
        left = first_x if at_start else zero(x[begin - 1], second[begin - 1], second[begin], config)
        right = last_x if at_end else zero(x[end], second[end], second[end + 1], config)
        falls = [i for i in range(begin, end + 1) if first[i - 1] > 0 >= first[i]]
        assert len(falls) <= 1
        peaks = [zero(i - 1 - Fraction(t, 2), first[i - 1], first[i], config) for i in falls]
        # Strictly between the outer bracketing coordinates, or up to the last sample that a cut run has seen.
        inner = [j for j in range(len(s)) if x[begin] - 1 < j < (x[end] + 1 if not at_end else x[end] + Fraction(1, 4))]
        maximum = max(s[j] for j in inner)
        amplitude = maximum * 256 - mean
        threshold = max(Fraction(config.min_amplitude), Fraction(config.k) * Fraction(deviation, 256))
        if Fraction(amplitude, 256) < threshold:
            continue
        components.append(
            {
                "left": left,
                "right": right,
                "peak": peaks[0] if peaks else None,
                "amplitude": amplitude,
                "length": None,
                "mean": None,
                "flags": (maximum == 2**config.sample_w - 1) + 2 * (at_start or at_end) + 4 * (not peaks),
                "last": False,
                "cause": end if at_end else end + 1,
            }
        )
    return components


def echo_of(component: dict[str, Any], config: golden.Config) -> dict[str, Any]:
    """Parameters of a component: Zhou 2022, Eqs (6), (7) and (9)."""
    left, right, n = component["left"], component["right"], Fraction(max(config.n, 1.0))
    centre: Fraction | int
    width: Fraction | int
    time: Fraction | int
    amplitude: Fraction | int = component["amplitude"]
    if config.form is None:
        centre = half_up(Fraction(left + right, 2), 0)
        width = half_up(Fraction(right - left) / n, 0)
        time = centre - half_up(width / Fraction(half_up(1 / quarter_fwhm(), config.pos_w), 1 << config.pos_w), 0)
    else:
        fl = partial(rounded, form=config.form)
        centre = fl(left + right) / 2
        width = fl(fl(right - left) / fl(n))
        time = fl(centre - fl(width / fl(1 / quarter_fwhm())))
        amplitude = fl(Fraction(amplitude, 256))
    return {
        "centre": centre,
        "peak": centre if component["peak"] is None else component["peak"],
        "width": width,
        "time": time,
        "amplitude": amplitude,
        "flags": component["flags"],
    }


def decomposed(waveform: np.ndarray, config: golden.Config) -> tuple[tuple[int, int, int], list[Any], list[Any]]:
    """Decompose one waveform.

    Parameters
    ----------
    waveform : (m,) integer array
        Counts.
    config : Config

    Returns
    -------
    noise : (int, int, int)
        As `noise_of`.
    components, echoes : list of dict
        Fields of `golden.inflection` and `golden.parameters`, with those of the trailer last; numbers are integers in
        the units of the core, or fractions where they are floats.
    """
    s = waveform.tolist()[: config.max_samples]
    mean, deviation, none = noise_of(s)
    found = components_of(s, mean, deviation, config)
    flags = (len(s) < config.tap_count + 2) + 2 * (len(waveform) > config.max_samples) + 4 * none
    trailer = dict.fromkeys(("left", "right", "peak")) | {"amplitude": deviation, "length": len(s), "mean": mean}
    components = [*found, trailer | {"flags": flags, "last": True, "cause": len(s) - 1}]
    end = {"centre": len(s), "peak": mean, "width": 0, "time": 0, "amplitude": deviation, "flags": flags}
    return (mean, deviation, none), components, [*(echo_of(component, config) for component in found), end]


def unlike(records: np.ndarray, waveforms: list[np.ndarray], config: golden.Config) -> int:
    """Count the fields of records that are not those of the exact echoes.

    Parameters
    ----------
    records : structured (n,)
        Decoded records of these waveforms, from one reset on.
    waveforms : list of (m,) integer arrays
        Counts.
    config : Config

    Returns
    -------
    int
        Fields that differ, all of them for each record too many or too few.
    """
    expected = [fields for row, waveform in enumerate(waveforms) for fields in _records(row, waveform, config)]
    pairs = zip(records, expected, strict=False)
    differing = sum(bool(found[name] != value) for found, fields in pairs for name, value in fields.items())
    return differing + abs(len(records) - len(expected)) * len(records.dtype.names or ())


def _records(row: int, waveform: np.ndarray, config: golden.Config) -> list[dict[str, Any]]:
    """Fields of the decoded records of one waveform."""
    (mean, deviation, _), _, (*echoes, end) = decomposed(waveform, config)
    scale = dict.fromkeys(("centre", "peak", "width", "time"), config.frac) | {"amplitude": golden.AMP_FRAC}
    made = []
    for number, echo in enumerate(echoes):
        values = {n: Fraction(echo[n], 1 if config.form else 1 << bits) for n, bits in scale.items()}
        made.append({"trailer": False, "sequence": row, "number": number, "flags": echo["flags"], **values})
    last = {"trailer": True, "sequence": row, "number": len(echoes), "flags": end["flags"], "length": end["centre"]}
    noise = {
        "noise_mean": Fraction(mean, 1 << golden.AMP_FRAC),
        "noise_deviation": Fraction(deviation, 1 << golden.AMP_FRAC),
    }
    return [*made, last | noise]
