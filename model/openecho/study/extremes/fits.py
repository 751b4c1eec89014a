"""Extremes of least squares: Jacobians without an inverse, scales, starts and places far away."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.decompose import METHODS, decompose
from openecho.decompose.fit import Fit, fit_echoes
from openecho.study import bench
from openecho.study.extremes.case import Case, Outcome, Trial, bounded, planted

Floats = NDArray[np.float64]

AREA = "least squares"

_FIT, _DECOMPOSE = fit_echoes, decompose
"""As they are, for the faults that stand in their place."""

STOPPED = 1e-3
"""Standard errors that the last step leaves, at most: `openecho.decompose.least_squares.LEAST_GAIN`."""


ROUNDED = 1e-6
"""Standard errors by which roundings, blown up by the condition of the problem, may move a fit that takes the same
steps: measured 4e-9."""

BELIEVED = 1e300
"""Greatest count that the fits take: `openecho.decompose.fit.GREATEST`."""


def noisy(trial: Trial, *echoes: tuple[float, float, float], length: int = 200) -> Floats:
    """A waveform of echoes (amplitude, centre, σ) in white noise of a count on a baseline of 20."""
    flat = [value for echo in echoes for value in echo]
    return bench.gaussians(np.arange(length, dtype=np.float64), 20.0, *flat) + trial.rng.normal(0, 1, length)


def fitted(samples: Floats, start: Any, **options: Any) -> Fit:
    """Fit of one waveform."""
    row = samples[None]
    return fit_echoes(row, [row.shape[1]], [len(start)], start, **options)


def finite(fit: Fit) -> bool:
    """Whether every value is a number; errors may be infinite."""
    numbers = (fit.amplitude, fit.centre, fit.width, fit.baseline, fit.rms)
    errors = (fit.amplitude_error, fit.centre_error, fit.width_error)
    return all(np.isfinite(v).all() for v in numbers) and not any(np.isnan(v).any() for v in errors)


def singular(trial: Trial) -> Outcome:
    """Starts from which the normal equations have no inverse."""
    samples = noisy(trial, (100, 90, 5))
    alone = fitted(samples, [[100, 90, 5]])
    starts = {
        "the same echo twice": [[50, 90, 5], [50, 90, 5]],
        "twice, 1e-9 bins apart": [[50, 90, 5], [50, 90 + 1e-9, 5]],
        "no height": [[100, 90, 5], [0, 150, 5]],
        "the least width": [[100, 90, 5], [1, 150, 1 / 3]],
        "eight on one": [[12, 90, 5]] * 8,
        "outside the record": [[100, 90, 5], [10, 350, 5]],
    }
    worst, broken = 0.0, []
    for name, start in starts.items():
        fit = fitted(samples, start)
        worst = max(worst, float(fit.rms[0] / alone.rms[0]))
        if not finite(fit):
            broken.append(name)
    # More echoes than there are can only lower the residual; by the last step's share they may fail to.
    held = not broken and worst <= 1 + STOPPED
    return Outcome(held, f"{len(starts) - len(broken)} of {len(starts)} finite, RMS at most {worst:.6f} of one echo's")


def weightless(trial: Trial) -> Outcome:
    """Fewer samples with a say than there are unknowns."""
    samples = noisy(trial, (100, 90, 5))
    weight = np.zeros((1, len(samples)))
    told = []
    for count in (0, 1, 2, 3):
        weight[0, 88 : 88 + count] = 1
        fit = fitted(samples, [[100, 90, 5]], weight=weight)
        errors = np.concatenate([fit.amplitude_error, fit.centre_error, fit.width_error])
        told.append(finite(fit) and bool(((errors == 0) | np.isinf(errors)).any()))
    return Outcome(all(told), f"{sum(told)} of {len(told)} finite and not determined")


def scale(trial: Trial) -> Outcome:
    """Counts times 1e-12 to 1e12."""
    samples = noisy(trial, (100, 90, 5), (60, 104, 6))
    start = np.array([[90.0, 89, 5], [50, 105, 6]])
    usual = fitted(samples, start)
    worst = 0.0
    for power in range(-12, 13, 6 if not trial.full else 1):
        factor = 10.0**power
        fit = fitted(samples * factor, start * [factor, 1, 1])
        for name, unit in (("amplitude", factor), ("centre", 1.0), ("width", 1.0)):
            error = getattr(usual, f"{name}_error")
            worst = max(worst, float(abs((getattr(fit, name) / unit - getattr(usual, name)) / error).max()))
    return bounded(worst, ROUNDED, "difference, standard errors,")


def whatever(trial: Trial) -> Outcome:
    """Samples from the least subnormal to the greatest that is taken, and beyond."""
    rows = [np.array([0.0, scale, 0.0, -scale] * 12) for scale in (5e-324, 1e-308, 1e-160, 1e160, BELIEVED)]
    rows += [trial.rng.choice([0, BELIEVED, -BELIEVED, 5e-324, 1.0], 48) for _ in range(3 if not trial.full else 60)]
    good = 0
    with np.errstate(all="ignore"):
        for row in rows:
            found = [decompose(row, method=method, width=3.0) for method in METHODS if method != "inflection"]
            values = [one.echoes[name] for one in found for name in ("peak", "width", "amplitude")]
            good += all(np.isfinite(value).all() for value in values)
    refused = 0
    for row in (np.full(48, 2 * BELIEVED), np.full(48, np.inf), np.full(48, np.nan)):
        try:
            decompose(row, method="gaussian")
        except ValueError:
            refused += 1
    told = f"{good} of {len(rows)} waveforms have finite echoes with every method, {refused} of 3 refused"
    return Outcome(good == len(rows) and refused == 3, told)


def far_starts(trial: Trial) -> Outcome:
    """Starts up to 50 widths away, and up to ten times too wide or too narrow."""
    samples = noisy(trial, (100, 90, 5))
    true = fitted(samples, [[100, 90, 5]])
    rose, near, reached, tried = 0, [], 0, 0
    for away in (0, 1, 3, 10, 50) if not trial.full else (0, 0.5, 1, 2, 3, 5, 8, 10, 20, 50):
        for times in (0.1, 0.5, 1, 2, 10):
            start = [50, 90 - away * 5 if away < 18 else 90 + away * 5, 5 * times]
            before = samples - bench.gaussians(np.arange(200.0), float(samples.min()), *start)
            fit = fitted(samples, [start], baseline=[samples.min()])
            rose += bool(fit.rms[0] > np.sqrt((before**2).mean()) * (1 + 1e-12))
            there = abs(fit.centre[0] - true.centre[0]) < STOPPED * true.centre_error[0]
            tried, reached = tried + 1, reached + there
            if away <= 1 and times <= 2:
                near.append(there)
    told = f"{reached} of {tried} reach the echo, {sum(near)} of {len(near)} from near; {rose} end above their start"
    return Outcome(rose == 0 and all(near), told)


def places(trial: Trial) -> Outcome:
    """The same echo anywhere in a record of 65,536 samples."""
    short = noisy(trial, (100, 90.3, 5))
    usual = fitted(short, [[90, 91, 6]])
    worst = 0.0
    for offset in (0, 30_000, 65_336):
        long, weight = np.zeros(65_536), np.zeros((1, 65_536))
        long[offset : offset + 200], weight[0, offset : offset + 200] = short, 1
        fit = fitted(long, [[90, 91 + offset, 6]], weight=weight, baseline=[20.0])
        worst = max(worst, float(abs(fit.centre[0] - offset - usual.centre[0]) / usual.centre_error[0]))
    return bounded(worst, ROUNDED, "difference, standard errors,")


HIGHER = 1e5
"""Times. At a million the lower echo is no longer found."""


def dynamic_range(trial: Trial) -> Outcome:
    """An echo 100,000 times as high as that beside it, without noise."""
    x = np.arange(300, dtype=np.float64)
    worst = 0.0
    for apart in (60, 45, 40):
        samples = bench.gaussians(x, 0.0, HIGHER, 120.3, 5.0, 1.0, 120.3 + apart, 5.0)
        found = decompose(samples, method="gaussian", noise=1e-5).echoes
        if len(found) != 2:
            return Outcome(False, f"{len(found)} echoes {apart} bins apart, expected 2")
        worst = max(worst, abs(float(found["peak"][1]) - 120.3 - apart))
    return bounded(worst, 1e-6, "the low echo is off, bins,")


# --- mistakes that somebody could make ------------------------------------------------------------------------------


def _undamped(samples: Any, length: Any, count: Any, start: Any, **options: Any) -> Fit:
    right = _FIT(samples, length, count, start, **options)
    row, known = np.asarray(samples)[0], np.append(np.min(samples), np.ravel(start)).astype(np.float64)
    x = np.arange(len(row), dtype=np.float64)
    for _ in range(10):
        slopes = bench.derivatives(x, *known)
        known = known + np.linalg.solve(slopes.T @ slopes, slopes.T @ (row - bench.gaussians(x, *known)))
    rms = np.sqrt(((row - bench.gaussians(x, *known)) ** 2).mean())
    return replace(right, rms=np.array([rms]), centre=known[2::3], amplitude=known[1::3], width=known[3::3])


def _sure(*arguments: Any, **options: Any) -> Fit:
    fit = _FIT(*arguments, **options)
    errors = {name: np.full(1, 0.5) for name in ("amplitude_error", "centre_error", "width_error")}
    return replace(fit, **errors)


def _in_binary32(samples: Any, length: Any, count: Any, start: Any, **options: Any) -> Fit:
    fit = _FIT(samples, length, count, start, **options)
    return replace(fit, centre=np.asarray(fit.centre, np.float32).astype(np.float64))


def _in_counts(samples: Any, length: Any, count: Any, start: Any, **options: Any) -> Fit:
    fit = _FIT(samples, length, count, start, **options)
    return replace(fit, amplitude=fit.amplitude + 1e-6)  # a tolerance in counts, whatever they are


def _any_step(samples: Any, length: Any, count: Any, start: Any, **options: Any) -> Fit:
    try:
        return _undamped(samples, length, count, start, **options)
    except np.linalg.LinAlgError:
        return replace(_FIT(samples, length, count, start, **options), rms=np.array([np.inf]))


def _rounded_samples(samples: Any, **options: Any) -> Any:
    with np.errstate(over="ignore"):
        return _DECOMPOSE(np.asarray(samples).astype(np.float32), **options)


def _relative(samples: Any, **options: Any) -> Any:
    found = _DECOMPOSE(samples, **options)
    high = found.echoes["amplitude"] > 1e-3 * found.echoes["amplitude"].max()
    return replace(found, echoes=found.echoes[high])


HERE = sys.modules[__name__]

CASES = (
    Case(
        "singular Jacobians",
        AREA,
        "the same echo twice, 1e-9 bins apart, eight on one place; no height, least width, outside the record",
        f"finite; the residual no more than {STOPPED:g} above that of the one true echo",
        singular,
        "steps without damping",
        planted(HERE, "fit_echoes", _undamped),
    ),
    Case(
        "too few samples",
        AREA,
        "weights of 0 for all samples but 0 to 3",
        "finite, with an error of 0 or infinity for what is not determined",
        weightless,
        "errors that are never infinite",
        planted(HERE, "fit_echoes", _sure),
    ),
    Case(
        "scale",
        AREA,
        "counts times 1e-12 to 1e12",
        f"the same echoes within {ROUNDED:g} standard errors (measured 2e-13): the same steps are taken",
        scale,
        "a tolerance in counts",
        planted(HERE, "fit_echoes", _in_counts),
    ),
    Case(
        "whatever the samples",
        AREA,
        "5e-324 to 1e300, of both signs; more, infinity and NaN",
        "finite echoes from every method; what is beyond is refused in one line",
        whatever,
        "samples in binary32",
        planted(HERE, "decompose", _rounded_samples),
    ),
    Case(
        "starts far away",
        AREA,
        "0 to 50 widths away, a tenth to ten times as wide",
        "never worse than the start; the echo itself from up to one width away and at most twice as wide",
        far_starts,
        "steps without damping",
        planted(HERE, "fit_echoes", _any_step),
    ),
    Case(
        "places",
        AREA,
        "one echo at bin 90 to 65,426",
        f"the same centre within {ROUNDED:g} standard errors (measured 4e-9): the same steps are taken",
        places,
        "positions in binary32",
        planted(HERE, "fit_echoes", _in_binary32),
    ),
    Case(
        "dynamic range",
        AREA,
        "an echo a 100,000th as high as its neighbour, 12 to 8 σ behind it, no noise",
        "found, and within 1e-6 bin (measured 1.4e-7): the shapes come from tables, good to some 1e-12 of the high one",
        dynamic_range,
        "echoes below a thousandth of the highest left out",
        planted(HERE, "decompose", _relative),
    ),
)
