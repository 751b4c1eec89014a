"""The decomposition into Gaussians beside two others, on the same waveforms, in one run, on one core.

Beside `gdecomp` 1.0.6 (C++ and MPFIT), and beside `scipy.optimize.curve_fit` as it is ordinarily used: a sum of
Gaussians that starts from the maxima of the smoothed waveform. Each gets what suits it best of what was tried:

- All are told the deviation of the noise and the usual σ of an echo (`Point.told`).
- Both others start from the maxima of the smoothed waveform. `SMOOTHING`, `THRESHOLD` and `APART` are the values, of
  those tried, with which they find most of these waveforms' echoes.
- gdecomp has no baseline among its unknowns: the true one is taken off, so its σ can be better than a bound that counts
  the baseline as unknown. It fits what it looks for maxima in, which is the smoothed waveform; the smoothing is taken
  out of its widths again, and its areas become heights.
- curve_fit has analytic derivatives and fits the raw waveform and a baseline by MINPACK's method of Levenberg and
  Marquardt, from the told σ. A fit that doesn't converge has found nothing.
- `curve_fit, number given` is told how many echoes there are: it takes the most prominent maxima, and where there are
  fewer, two halves of the highest in its place.

Errors are multiples of the Cramér–Rao bound, over the waveforms in which every echo was found. These are the ones that
went well: where echoes are so close that the bound is no small part of their separation, a multiple can be below 1.
Samples are not rounded, so that the bound is that of the noise alone.

Run as ``python -m openecho.study.bench``; the report is ``build/reports/bench.json``, and the pictures beside it are
``bench_detection.png`` and ``bench_error.png``.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import os
import sys
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter, ScalarFormatter
from numpy.typing import ArrayLike, NDArray
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import OptimizeWarning, curve_fit
from scipy.signal import find_peaks

from openecho import report
from openecho.decompose import decompose
from openecho.study import figure

FloatArray = NDArray[np.float64]

NOISE = 1.0
BASELINE = 20.0
"""Standard deviation of the white noise, and what echoes stand on; counts."""

LENGTH = 256
REACH = 8.0
"""Samples of a waveform, and the σ that there are at least from an echo to the ends: wide ones make it longer."""

COUNT = 1000
QUICK_COUNT = 40
"""Waveforms a point: the RMS of so many errors is itself good to 2.2 % and 11 %, those of two echoes to less."""

SPEED_COUNT, SPEED_REPEATS = 500, 9
QUICK_SPEED_COUNT, QUICK_SPEED_REPEATS = 50, 3
"""Waveforms of a timing, and how often all are timed in turn."""

SINGLE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
"""Environment in which numpy's and scipy's linear algebra and numba use one core."""

SMOOTHING = 0.25
"""σ of the smoothing in told σ, of 0.2, 0.25, 0.3, 0.35 and more: less lets noise be maxima, more merges echoes and, as
gdecomp fits the smoothed waveform, costs it precision."""

THRESHOLD = 8.0
"""Least height of a maximum in deviations of the smoothed noise, of 5, 6 and 8: with less, noise passes more often."""

APART: Mapping[str, float] = {"gdecomp": 0.8, "curve_fit": 1.0}
"""Reach of a maximum in told σ, within which lower ones do not count, of 0.6, 0.8, 1 and 1.6."""

HALF_AWAY, HALF_HEIGHT = 0.75, 0.75
"""Of its σ and its height: how far the halves of a maximum are from it, and how high. As in `openecho.decompose`."""


@dataclass(frozen=True)
class Point:
    """One point of the benchmark: a waveform that is repeated with other noise at other parts of a bin.

    Attributes
    ----------
    grid : str
        What is varied, a key of `GRIDS`.
    value : float
        Its value.
    amplitudes : tuple of float
        Height of each echo, counts.
    offsets : tuple of float
        Centre of each from the middle of the waveform, bins, ascending.
    sigma : float
        Of all echoes, bins.
    told : float
        σ that the methods expect, bins.
    """

    grid: str
    value: float
    amplitudes: tuple[float, ...]
    offsets: tuple[float, ...]
    sigma: float = 5.0
    told: float = 5.0

    @property
    def length(self) -> int:
        """Samples of a waveform."""
        return max(LENGTH, 2 * math.ceil(max(self.offsets) + REACH * self.sigma))

    @property
    def centres(self) -> FloatArray:
        """Centre of each echo where it is moved by no part of a bin."""
        return self.length / 2 + np.array(self.offsets)

    @property
    def bound(self) -> FloatArray:
        """`cramer_rao` of its echoes (k, 3)."""
        return cramer_rao(self.amplitudes, self.centres, np.full(len(self.offsets), self.sigma), NOISE, self.length)


def single(grid: str, value: float, amplitude: float = 200, sigma: float = 5, told: float = 5) -> Point:
    """A waveform of one echo."""
    return Point(grid, value, (amplitude,), (0.0,), sigma, told)


def pair(grid: str, value: float, apart: float, ratio: float = 1, sigma: float = 5, told: float = 5) -> Point:
    """A waveform of an echo of 200 counts and one `ratio` times as low, `apart` σ behind it."""
    return Point(grid, value, (200.0, 200 / ratio), (-apart * sigma / 2, apart * sigma / 2), sigma, told)


GRIDS: Mapping[str, str] = {
    "separation": "two equal echoes, so many σ apart",
    "ratio": "two echoes 4 σ apart, one so many times as high",
    "snr": "one echo, so many times as high as the noise's deviation",
    "width": "one echo of such a σ, which is told",
    "width_pair": "two equal echoes 3 σ apart, of such a σ, which is told",
    "untold": "one echo of such a σ, where 5 bins is told",
    "untold_pair": "two equal echoes 3 σ apart, of such a σ, where 5 bins is told",
}
"""What is varied, and between what; 200 counts, σ 5 bins where nothing else is said."""

WIDTHS = (2, 3, 5, 8, 12, 20, 30)

POINTS = (
    *(pair("separation", x, x) for x in (1, 1.25, 1.5, 1.6, 1.75, 2, 2.1, 2.2, 2.3, 2.5, 2.75, 3, 3.5, 4, 5, 6)),
    *(pair("ratio", x, 4, ratio=x) for x in (1, 2, 5, 10, 20)),
    *(single("snr", x, amplitude=x) for x in (5, 10, 20, 50, 100, 200, 500, 1000)),
    *(single("width", x, sigma=x, told=x) for x in WIDTHS),
    *(pair("width_pair", x, 3, sigma=x, told=x) for x in WIDTHS),
    *(single("untold", x, sigma=x) for x in WIDTHS),
    *(pair("untold_pair", x, 3, sigma=x) for x in WIDTHS),
)

SPEED: Mapping[str, Point] = {"one echo": single("", 0), "two echoes 4 σ apart": pair("", 0, 4)}
"""What speed is measured on."""


@dataclass(frozen=True)
class Found:
    """Echoes that a method found.

    Attributes
    ----------
    count : int64 (n,)
        Of each waveform.
    echoes : float64 (e, 3)
        Amplitude (height, counts), centre and σ (bins) of each, those of the first waveform first.
    """

    count: NDArray[np.int64]
    echoes: FloatArray


Method = Callable[[FloatArray, float, int], Found]
"""(samples (n, m), told σ, number of echoes) to what was found. The number is for methods that are given it."""


def cramer_rao(
    amplitudes: ArrayLike, centres: ArrayLike, sigmas: ArrayLike, noise: float, length: int
) -> NDArray[np.float64]:
    """Least standard deviations of unbiased estimates of all parameters of Gaussian echoes and of their baseline.

    The roots of the diagonal of the inverse of the Fisher information JᵀJ/σ_n², with J the exact derivative of every
    sample by every parameter (Kay 1993, Fundamentals of Statistical Signal Processing I, Eq (3.31)).

    Parameters
    ----------
    amplitudes, centres, sigmas : array_like (k,)
        Height (counts), centre (bins, from 0) and σ (bins) of each echo.
    noise : float
        Standard deviation of the white noise, counts.
    length : int
        Samples.

    Returns
    -------
    float64 (k, 3)
        Of amplitude, centre and σ of each echo.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the samples do not determine the parameters.
    """
    echoes = np.column_stack([amplitudes, centres, sigmas]).astype(np.float64)
    slopes = derivatives(np.arange(length, dtype=np.float64), 0.0, *echoes.ravel())
    size = np.sqrt((slopes**2).sum(axis=0))  # columns of one size, so that the inverse loses no digits to units
    covariance = np.linalg.inv((slopes / size).T @ (slopes / size))
    deviation: FloatArray = noise * np.sqrt(np.diag(covariance)) / size
    return deviation[1:].reshape(-1, 3)


def gaussians(x: FloatArray, baseline: float, *parameters: float) -> FloatArray:
    """Sum of Gaussians with these amplitudes, centres and σ on a baseline, at `x`, as `curve_fit` asks for it."""
    total = np.full(len(x), baseline)
    for amplitude, centre, sigma in zip(*(parameters[i::3] for i in range(3)), strict=True):
        total += amplitude * np.exp(-0.5 * ((x - centre) / sigma) ** 2)
    return total


def derivatives(x: FloatArray, baseline: float, *parameters: float) -> FloatArray:
    """Derivatives of `gaussians` by all its parameters, (len(x), 1 + 3 k)."""
    slopes = np.ones((len(x), 1 + len(parameters)))
    for i in range(0, len(parameters), 3):
        amplitude, centre, sigma = parameters[i : i + 3]
        z = (x - centre) / sigma
        slopes[:, i + 1] = np.exp(-0.5 * z**2)
        slopes[:, i + 2] = amplitude * slopes[:, i + 1] * z / sigma
        slopes[:, i + 3] = slopes[:, i + 2] * z
    return slopes


def openecho_gaussian(samples: FloatArray, told: float, number: int) -> Found:
    """What this package finds; all waveforms in one call."""
    echoes = decompose(samples, method="gaussian", width=told, noise=NOISE).echoes
    count = np.bincount(echoes["waveform"], minlength=len(samples))
    return Found(count, np.column_stack([echoes["amplitude"], echoes["centre"], echoes["width"]]))


def gdecomp_smoothed(samples: FloatArray, told: float, number: int) -> Found:
    """What gdecomp finds, a waveform a call, with the true baseline taken off."""
    import gdecomp  # optional

    smooth, reach = SMOOTHING * told, apart("gdecomp", told)
    noise, variance = smoothing(smooth)
    rows = gaussian_filter1d(samples - BASELINE, smooth, axis=1)
    found = [np.reshape(gdecomp.GaussianDecomposition(row, THRESHOLD * noise, reach), (-1, 3)) for row in rows]
    area, centre, width = np.concatenate(found).T
    # A tenth of a bin is left of what is no wider than the smoothing.
    sigma = np.sqrt(np.maximum(width**2 - variance, 0.01))
    return Found(_counts(found), np.column_stack([area / (sigma * math.sqrt(2 * math.pi)), centre, sigma]))


def scipy_curve_fit(samples: FloatArray, told: float, number: int) -> Found:
    """What `curve_fit` finds that starts from all maxima."""
    return _curve_fits(samples, told, None)


def scipy_number_given(samples: FloatArray, told: float, number: int) -> Found:
    """What `curve_fit` finds that is told how many echoes there are."""
    return _curve_fits(samples, told, number)


def _curve_fits(samples: FloatArray, told: float, number: int | None) -> Found:
    smooth = SMOOTHING * told
    threshold = THRESHOLD * smoothing(smooth)[0]
    x, found = np.arange(samples.shape[1], dtype=np.float64), []
    for raw, smoothed in zip(samples, gaussian_filter1d(samples, smooth, axis=1), strict=True):
        baseline = float(np.median(raw))
        start = _maxima(smoothed - baseline, threshold, told, number)
        found.append(_curve_fit(x, raw, [baseline, *np.ravel(start)]))
    return Found(_counts(found), np.concatenate(found))


def _maxima(smoothed: FloatArray, threshold: float, told: float, number: int | None) -> list[list[float]]:
    """Amplitude, centre and σ to start with of each echo that a smoothed waveform shows."""
    maxima, properties = find_peaks(smoothed, height=threshold, distance=apart("curve_fit", told), prominence=0)
    if number is not None:
        maxima = maxima[np.argsort(-properties["prominences"])[:number]]
    start = [[float(smoothed[i]), float(i), told] for i in maxima]
    while number is not None and 0 < len(start) < number:
        amplitude, centre, _ = start.pop(int(np.argmax([echo[0] for echo in start])))
        away = HALF_AWAY * told
        start += [[HALF_HEIGHT * amplitude, centre + side * away, told] for side in (-1, 1)]
    return start


def _curve_fit(x: FloatArray, raw: FloatArray, start: Sequence[float]) -> FloatArray:
    """Echoes (k, 3) that `curve_fit` ends at, none if it doesn't converge."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", OptimizeWarning)
        try:
            values, _ = curve_fit(gaussians, x, raw, start, jac=derivatives)
        except RuntimeError:
            return np.empty((0, 3))
    echoes = np.asarray(values[1:], np.float64).reshape(-1, 3)
    echoes[:, 2] = np.abs(echoes[:, 2])  # the square alone is fitted
    return echoes


def _counts(found: Sequence[FloatArray]) -> NDArray[np.int64]:
    return np.array([len(echoes) for echoes in found], np.int64)


def smoothing(smooth: float) -> tuple[float, float]:
    """Deviation of the noise (counts) behind a smoothing of σ `smooth` bins, and the variance (bins²) that it adds.

    Both of scipy's taps themselves, for those of a short filter are no Gaussian of that σ.
    """
    reach = math.ceil(5 * smooth)
    taps = gaussian_filter1d(np.eye(1, 2 * reach + 1, reach)[0], smooth)
    return NOISE * math.sqrt(np.sum(taps**2)), float(np.sum(taps * np.arange(-reach, reach + 1) ** 2))


def apart(method: str, told: float) -> int:
    """`APART` of a method in bins."""
    return max(2, round(APART[method] * told))


METHODS: Mapping[str, Method] = {
    "openecho": openecho_gaussian,
    "gdecomp": gdecomp_smoothed,
    "curve_fit": scipy_curve_fit,
    "curve_fit, number given": scipy_number_given,
}
"""Methods by name; the first is the one that the others are compared with."""


def waveforms(point: Point, count: int, seed: int | Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Waveforms of a point, all echoes of each moved by the same random part of a bin.

    Parameters
    ----------
    point : Point
        What they are made of.
    count : int
        Waveforms.
    seed : int or sequence of int
        Of shifts and noise.

    Returns
    -------
    samples : float64 (count, point.length)
        Counts, not rounded.
    centres : float64 (count, k)
        True centres, bins.
    """
    rng = np.random.default_rng(seed)
    centres = point.centres + rng.uniform(-0.5, 0.5, (count, 1))
    samples = rng.normal(BASELINE, NOISE, (count, point.length))
    x = np.arange(point.length)
    for amplitude, centre in zip(point.amplitudes, centres.T, strict=True):
        samples += amplitude * np.exp(-0.5 * ((x - centre[:, None]) / point.sigma) ** 2)
    return samples, centres


def score(point: Point, found: Found, centres: FloatArray) -> dict[str, Any]:
    """How many waveforms had all their echoes found, and how precisely.

    A waveform counts if it has as many echoes as are true, and each lies within σ of its own, or within half the
    separation if that is less, so that none can stand for two. What is too many counts as much as what is too few.

    Parameters
    ----------
    point : Point
        What was looked for.
    found : Found
        What was found in n waveforms.
    centres : float64 (n, k)
        What `waveforms` returned.

    Returns
    -------
    dict
        ``found``: share of waveforms. ``fewer``, ``more``: shares with fewer and more echoes than are true.
        ``centre``, ``sigma``: RMS errors over the waveforms that count, as multiples of the bound of each echo;
        None if there are none.
    """
    size = centres.shape[1]
    right = found.count == size
    echoes = found.echoes[np.repeat(right, found.count)].reshape(-1, size, 3)
    echoes = np.take_along_axis(echoes, np.argsort(echoes[:, :, 1], axis=1)[:, :, None], axis=1)
    error = echoes[:, :, 1] - centres[right]
    near = (np.abs(error) <= np.min([point.sigma, *np.diff(point.offsets) / 2])).all(axis=1)
    bound = point.bound

    def multiple(errors: FloatArray, bounds: FloatArray) -> float | None:
        return float(np.sqrt(np.mean((errors[near] / bounds) ** 2))) if near.any() else None

    return {
        "found": float(near.sum() / len(centres)),
        "fewer": float(np.mean(found.count < size)),
        "more": float(np.mean(found.count > size)),
        "centre": multiple(error, bound[:, 1]),
        "sigma": multiple(echoes[:, :, 2] - point.sigma, bound[:, 2]),
    }


def study(methods: Mapping[str, Method], count: int, seed: int) -> list[dict[str, Any]]:
    """Score all methods on the same waveforms of every point.

    Parameters
    ----------
    methods : mapping
        As `METHODS`.
    count : int
        Waveforms a point.
    seed : int
        Of all waveforms.

    Returns
    -------
    list of dict
        For each of `POINTS` its ``grid``, ``value``, ``told`` σ and ``length``, the bounds ``bound_centre`` and
        ``bound_sigma`` of each echo (bins), and under ``methods`` a `score` of each.
    """
    rows = []
    for number, point in enumerate(track(POINTS, "bench", console=Console(stderr=True), transient=True)):
        samples, centres = waveforms(point, count, [seed, number])
        size = centres.shape[1]
        scores = {name: score(point, run(samples, point.told, size), centres) for name, run in methods.items()}
        _, bound_centre, bound_sigma = point.bound.T.tolist()
        rows.append(
            {
                "grid": point.grid,
                "value": point.value,
                "told": point.told,
                "length": point.length,
                "bound_centre": bound_centre,
                "bound_sigma": bound_sigma,
                "methods": scores,
            }
        )
    return rows


def speed(methods: Mapping[str, Method], count: int, repeats: int, seed: int) -> list[dict[str, Any]]:
    """Time all methods in turn, so that what else the machine does falls on all.

    Parameters
    ----------
    methods : mapping
        As `METHODS`.
    count, repeats : int
        Waveforms of a timing, and timings of each method, after one that doesn't count.
    seed : int
        Of the waveforms.

    Returns
    -------
    list of dict
        For each of `SPEED` its ``data`` and under ``methods`` of each the medians of ``waveforms_per_s`` and of
        ``times_as_fast``: the first method's speed over this one's in the same turn.
    """
    rows = []
    for number, (data, point) in enumerate(SPEED.items()):
        samples, centres = waveforms(point, count, [seed, len(POINTS) + number])
        seconds = np.empty((1 + repeats, len(methods)))
        for turn in seconds:
            for i, run in enumerate(methods.values()):
                start = time.perf_counter()
                run(samples, point.told, centres.shape[1])
                turn[i] = time.perf_counter() - start
        seconds = seconds[1:]
        rate = np.median(count / seconds, axis=0).tolist()
        ratio = np.median(seconds / seconds[:, :1], axis=0).tolist()
        each = zip(methods, rate, ratio, strict=True)
        rows.append({"data": data, "methods": {m: {"waveforms_per_s": r, "times_as_fast": q} for m, r, q in each}})
    return rows


STYLES: Mapping[str, Mapping[str, Any]] = {
    "openecho": {"color": "#c0392b", "marker": "o", "ms": 8, "lw": 4, "alpha": 0.5},
    "gdecomp": {"color": "#1f4e79", "marker": "s", "ms": 5},
    "curve_fit": {"color": "#e08214", "marker": "^", "ms": 4, "ls": "--"},
    "curve_fit, number given": {"color": "#5f6b3a", "marker": "o", "ms": 4, "ls": ":", "mfc": "white"},
}
"""Of each method's curve; that below is the broadest, as the curves often lie on one another."""


ERRORS = (0.8, 1.2)
"""Multiples of the bound that the picture shows at least; what lies beyond widens it."""


def draw_detection(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Share of waveforms with both echoes found, against their separation."""
    drawn = Figure(figsize=(6.5, 4), layout="constrained")
    axes = drawn.subplots()
    for name in rows[0]["methods"]:
        values, shares = _curve(rows, "separation", name, "found")
        axes.plot(values, shares, label=name, **STYLES.get(name, {}))
    axes.yaxis.set_major_formatter(PercentFormatter(1))
    axes.set(xlabel="separation of two equal echoes, σ", ylabel="waveforms with both found", ylim=(-0.03, 1.03))
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", frameon=False)
    return drawn


def draw_error(rows: Sequence[Mapping[str, Any]], count: int) -> Figure:
    """RMS error of centre and σ of single echoes as multiples of the bound, against their height over the noise."""
    drawn = Figure(figsize=(9, 4), layout="constrained")
    for axes, quantity in zip(drawn.subplots(1, 2, sharey=True), ("centre", "sigma"), strict=True):
        _error(axes, rows, quantity, count)
    drawn.axes[0].set_ylabel("RMS error / Cramér–Rao bound")
    handles, labels = drawn.axes[0].get_legend_handles_labels()
    drawn.legend(handles, labels, loc="outside lower center", frameon=False, ncols=5, columnspacing=1, fontsize=8)
    return drawn


def _error(axes: Axes, rows: Sequence[Mapping[str, Any]], quantity: str, count: int) -> None:
    spread = 2 / math.sqrt(2 * count)
    label = f"two deviations of an RMS over {count}"
    axes.axhspan(1 - spread, 1 + spread, color="#909090", alpha=0.25, lw=0, label=label)
    axes.axhline(1, color="black", lw=0.8)
    for name in rows[0]["methods"]:
        values, multiples = _curve(rows, "snr", name, quantity)
        axes.plot(values, multiples, label=name, **STYLES.get(name, {}))
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.set(title={"centre": "centre", "sigma": "σ"}[quantity], xlabel="amplitude / deviation of the noise")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, ERRORS[0]), max(high, ERRORS[1]))
    axes.grid(alpha=0.3)


def _curve(rows: Sequence[Mapping[str, Any]], grid: str, name: str, key: str) -> tuple[FloatArray, FloatArray]:
    """Values of a grid and what a method made of them; nan where it made nothing."""
    points = [(row["value"], row["methods"][name][key]) for row in rows if row["grid"] == grid]
    values, made = np.array(points, np.float64).T
    return values, made


def tables(rows: Sequence[Mapping[str, Any]], speeds: Sequence[Mapping[str, Any]]) -> list[Table]:
    """What is printed: speeds, then a table of each grid with found share, centre and σ of each method."""
    fast = _table("waveforms a second on one core (in brackets: how many times as fast openecho is)", "", speeds)
    for row in speeds:
        cells = [f"{m['waveforms_per_s']:,.0f} ({m['times_as_fast']:.2f})" for m in row["methods"].values()]
        fast.add_row(row["data"], *cells)
    made = [fast]
    for grid, meaning in GRIDS.items():
        made.append(_table(meaning, grid.partition("_")[0], rows))
        for row in rows:
            if row["grid"] == grid:
                made[-1].add_row(f"{row['value']:g}", *(_cell(scored) for scored in row["methods"].values()))
    return made


def _table(title: str, first: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """A table without rows: a column `first`, and one for each method."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for name in (first, *rows[0]["methods"]):
        table.add_column(name, justify="right")
    return table


def _cell(scored: Mapping[str, Any]) -> str:
    multiples = "   -    -" if scored["centre"] is None else f"{scored['centre']:.2f} {scored['sigma']:.2f}"
    return f"{100 * scored['found']:.1f} {multiples}"


def missing() -> list[str]:
    """Packages that are asked for and not installed."""
    return [name for name in ("gdecomp", "numba") if importlib.util.find_spec(name) is None]


def main() -> None:
    """Run the benchmark, print its tables, write its report and draw its pictures."""
    parser = argparse.ArgumentParser(prog="openecho.study.bench", description=main.__doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of the waveforms (0)")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK_COUNT} waveforms a point, not {COUNT}")
    options = parser.parse_args()
    if absent := missing():
        expected = "expected it: pip install 'openecho[bench]'"
        print(f"error: {', '.join(absent)} not installed, {expected}", file=sys.stderr)
        sys.exit(2)
    if any(os.environ.get(name) != value for name, value in SINGLE_THREAD.items()):
        # Libraries take their number of threads when they are loaded, which they are by now: once more from the start.
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | SINGLE_THREAD)

    count = QUICK_COUNT if options.quick else COUNT
    timing = (QUICK_SPEED_COUNT, QUICK_SPEED_REPEATS) if options.quick else (SPEED_COUNT, SPEED_REPEATS)
    speeds = speed(METHODS, *timing, options.seed)
    rows = study(METHODS, count, options.seed)
    print(f"seed {options.seed}, {count} waveforms a point: % with all found, RMS errors of centre and σ / bound")
    Console().print(*tables(rows, speeds))
    content = {
        "tools": report.tools("numpy", "scipy", "numba", "gdecomp"),
        "seed": options.seed,
        "quick": options.quick,
        "waveforms": count,
        "noise": NOISE,
        "baseline": BASELINE,
        "options": {"smoothing": SMOOTHING, "threshold": THRESHOLD, "apart": dict(APART)},
        "grids": dict(GRIDS),
        "speed": speeds,
        "rows": rows,
    }
    print(report.write("bench", content))
    for name, drawn in (("bench_detection", draw_detection(rows)), ("bench_error", draw_error(rows, count))):
        path = report.FOLDER / f"{name}.png"
        figure.save(drawn, path)
        print(path)


if __name__ == "__main__":
    main()
