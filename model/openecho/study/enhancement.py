"""The figures of the V–L paper, ours: accumulation and wavelet, Vondrák's curve, and the laser's template.

After X. Fan and Y.-Q. Wang, V–L decomposition of a novel full-waveform lidar system based on virtual instrument
technique: its Figs 8, 9, 10 and 13, on simulated echoes with known truth. Where the paper is silent, the constants
below say what was chosen, and why.

Run as ``python -m openecho.study.enhancement``; the report is ``build/reports/enhancement.json``, with a picture of
each part beside it.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from rich.console import Console
from rich.table import Table

from openecho import decompose, report, stimulus
from openecho.decompose import criteria
from openecho.enhance import accumulate, gaussian, moving_average, snr_db, vondrak
from openecho.enhance.noise import noise
from openecho.enhance.wavelet import LEVELS, denoise
from openecho.scene.physics.pulse import FWHM_TAU
from openecho.study.figure import FILTERED, FOUND, RAW, SUM, save

FloatArray = NDArray[np.float64]

FWHM = 20.0
"""Bins, of every echo: in Fig 10 the pulse's surroundings are samples 226 to 246."""
TAU = FWHM / FWHM_TAU
"""τ of the laser's pulse, bins."""
SIGMA = FWHM / np.sqrt(8 * np.log(2))
"""σ of a Gaussian as wide, bins: what the decompositions are told of the pulse."""
AMPLITUDE = 200.0
"""Counts."""
LENGTH = 512
"""Samples in a record, but for the stepped target."""

SINGLE_DB = -5.95
"""Power SNR of one cycle, Fig 8(a)."""
CYCLES = 8
"""Accumulated, Fig 8(b)."""
SPECKLE_ORDER = 4
"""M of the gamma distribution, mean 1 and variance 1/M; M = D_rec/D_sp, whose values the paper's Table 1 lost."""
DEPTHS = (1, 2, 3, LEVELS, 5)
"""Levels of the wavelet transform that are tried; the paper does not give its own."""

ROUGH_NOISE = 10.0
"""σ of the noise on the echo that is smoothed, counts: a twentieth of its height."""
EPSILONS = (100.0, 10.0, 1.0)
"""Fig 9."""
PERIODS = np.geomspace(3, 60, 40)
"""Bins, that a smoothing of the sweep passes with half of its amplitude."""
AVERAGES = tuple(range(3, 37, 2))
"""Widths of the moving average in the sweep, samples."""

NOISE = 2.68
"""σ of the noise on what is fitted, counts: a true template then explains 0.9935 of a record, as in Fig 10(b)."""
BASELINE = 20.0
"""Counts; well above the noise, so that nothing is clipped at zero."""

PIXELS = 128
"""Fig 13."""
BIN_M = 0.149896229
"""Depth of a bin, m, at the paper's 1 GS/s."""
GATE = 2002
"""Samples: the paper's 300 m of elevation at 1 GS/s."""
TERRACES = 16
"""Step heights of the target, 1/8 to 2 FWHM of the pulse, for as many pixels each."""
LOWER = 0.7
"""Amplitude of the lower surface's echo over that of the upper one's."""
AVERAGE = 5
"""Samples of the moving average before the Gaussian fit: the paper has no number; a quarter of the pulse."""
FREE = 16
"""Pixels in which the number of echoes has no limit: a Gaussian then takes ten for each, and long."""
REPEATS = 8
"""Targets with other noise and sub-bin positions, for the spread of what is counted on one."""

PAPER = {
    "snr_db": {"one cycle": -5.95, "accumulated": 3.20, "wavelet": 9.38},
    "r_squared": {"gaussian": 0.9934, "laser": 0.9935},
    "windowed_r_squared": {"gaussian": 0.9984, "laser": 0.9988},
    # Printed the other way round, against the sentence that they prove.
    "relative_error": {"moving average, Gaussian": 0.0075, "V–L": 0.0016},
}
"""What the paper has, by quantity."""

METHODS = {"moving average, Gaussian": "gaussian", "V–L": "vl", "laser template alone": "laser"}
"""On the stepped target: what `openecho.decompose` calls each. The last is V–L without Vondrák's smoothing."""

STYLES = ({"color": SUM, "marker": "o"}, {"color": FILTERED, "marker": "*"})
"""Of Gaussian and of V–L, circle and asterisk as in Fig 13."""


@dataclass(frozen=True)
class Part:
    """One part of the study.

    Attributes
    ----------
    title : str
        With what it was measured on.
    report : dict
        JSON types; ``rows`` is the table that is printed.
    figure : Figure
    """

    title: str
    report: dict[str, Any]
    figure: Figure


def pulse(x: ArrayLike, peak: ArrayLike) -> FloatArray:
    """Laser-shaped echo p(t) = (t/τ)² exp(-t/τ), t ≥ 0, of height 1.

    The paper's Eq (18), after Carlsson, Steinvall & Letalick 2001 (FOI-R-0163); its maximum is at t = 2 τ.

    Parameters
    ----------
    x, peak : array_like
        Bins; they broadcast.

    Returns
    -------
    float64 (...)
    """
    u = np.maximum((np.asarray(x, np.float64) - np.asarray(peak, np.float64)) / TAU + 2, 0)
    return np.asarray(u**2 * np.exp(2 - u) / 4)


def cycles(signal: FloatArray, count: int, rng: np.random.Generator, *, lasting: bool) -> FloatArray:
    """Waveforms of `count` groups of `CYCLES` pulses, with speckle and Gaussian noise.

    y = s·g + n: g is gamma distributed of mean 1, new at each sample, and n so strong that the expected power SNR of
    one cycle is `SINGLE_DB`.

    Parameters
    ----------
    signal : float64 (m,)
        s, counts.
    count : int
        Groups.
    rng : numpy.random.Generator
    lasting : bool
        Whether speckle stays the same from cycle to cycle, as on a target that stands still, or is new in each.

    Returns
    -------
    float64 (count · `CYCLES`, m)
        Counts, the cycles of a group in a row.
    """
    power = np.sum(signal**2)
    sigma = np.sqrt((power / 10 ** (SINGLE_DB / 10) - power / SPECKLE_ORDER) / len(signal))
    shape = (count, CYCLES, len(signal))
    patterns = (count, 1, len(signal)) if lasting else shape
    speckle = rng.gamma(SPECKLE_ORDER, 1 / SPECKLE_ORDER, patterns)
    return np.asarray((signal * speckle + rng.normal(0, sigma, shape)).reshape(-1, len(signal)))


def signal_to_noise(seed: int, count: int = 400) -> Part:
    """SNR of one cycle, of `CYCLES` accumulated, and behind the wavelet: Fig 8.

    SNR is a power ratio over the whole record, 10 log₁₀(Σ s² / Σ (y - s)²); what speckle adds to the signal counts as
    noise. Theory: Gaussian noise that is new in each cycle loses 10 log₁₀ 8 = 9.03 dB, so does speckle that is; speckle
    that lasts loses nothing, and takes a part of the gain. The paper's 9.15 dB is of a single record: of 512 samples
    the ratio of two noise powers is good to some 0.4 dB. What the wavelet gains depends on its levels, of which each
    takes half of a white noise: the paper's 6.18 dB is about that of two.

    Parameters
    ----------
    seed : int
        Of speckle and noise.
    count : int, optional
        Accumulated waveforms.

    Returns
    -------
    Part
    """
    rng = np.random.default_rng([seed, 0])
    signal = AMPLITUDE * pulse(np.arange(LENGTH), 236)
    rows: list[dict[str, Any]] = []
    drawn = {}
    for speckle in ("new", "lasting"):
        lasting = speckle == "lasting"
        single = cycles(signal, count, rng, lasting=lasting)
        summed = accumulate(single, CYCLES)
        rows.append(_snr_row(speckle, "one cycle", None, single, signal) | {"expected_db": SINGLE_DB})
        rows.append(_snr_row(speckle, "accumulated", None, summed, signal) | {"expected_db": _accumulated_db(lasting)})
        deviation = noise(summed).sigma
        for levels in DEPTHS:
            cleaned = denoise(summed, levels=levels, sigma=deviation)
            rows.append(_snr_row(speckle, "wavelet", levels, cleaned, signal))
            if levels == LEVELS and not lasting:
                drawn = {"one cycle": single[0], f"{CYCLES} cycles accumulated": summed[0], "and wavelet": cleaned[0]}
    title = f"power SNR, dB, of {count} records of {LENGTH} samples; speckle of order {SPECKLE_ORDER}"
    return Part(title, {"waveforms": count, "rows": rows}, _draw_snr(drawn, signal))


def _accumulated_db(lasting: bool) -> float:
    """Expected SNR behind the accumulation."""
    total = 10 ** (-SINGLE_DB / 10)
    speckle = 1 / SPECKLE_ORDER
    kept = speckle + (total - speckle) / CYCLES if lasting else total / CYCLES
    return float(-10 * np.log10(kept))


def _snr_row(speckle: str, stage: str, levels: int | None, samples: FloatArray, signal: FloatArray) -> dict[str, Any]:
    """SNR of all records together, and its spread from record to record."""
    each = [snr_db(row, signal) for row in samples]
    return {
        "speckle": speckle,
        "stage": stage,
        "levels": levels,
        "snr_db": snr_db(samples, signal),
        "spread_db": float(np.std(each, ddof=1)),
        "paper_db": PAPER["snr_db"][stage],
        "expected_db": None,
    }


def _draw_snr(drawn: Mapping[str, FloatArray], signal: FloatArray) -> Figure:
    figure = Figure(figsize=(7, 7), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for axes, (title, samples) in zip(panels, drawn.items(), strict=True):
        axes.plot(samples, color=RAW, lw=0.8, label="record")
        axes.plot(signal, color=FOUND, lw=1.2, label="true echo")
        axes.set_title(f"{title}: {snr_db(samples, signal):.2f} dB", fontsize=10)
        axes.set_ylabel("counts")
    panels[-1].set_xlabel("bin")
    panels[-1].set_xlim(0, len(signal) - 1)
    _legend(figure, panels[:1])
    return figure


def smoothing(seed: int, count: int = 200) -> Part:
    """Vondrák's curve at the paper's ε, and at the best, beside moving average and Gaussian: Fig 9.

    ε is that of `openecho.enhance.vondrak`, of time in bins: it passes a period of P bins with ε / (ε + (2 sin(π/P))⁶).
    The paper's unit of time is not known, and ε goes with its sixth power: its three curves can be named here, but not
    compared. So all methods are also swept over the period that they pass with half of its amplitude.

    Parameters
    ----------
    seed : int
        Of the noise and of sub-bin positions.
    count : int, optional
        Waveforms.

    Returns
    -------
    Part
        RMS error is of all samples of all waveforms against the truth, counts; roughness the RMS third difference,
        counts, whose square Vondrák's method weighs.
    """
    rng = np.random.default_rng([seed, 1])
    clean = AMPLITUDE * pulse(np.arange(LENGTH), 236 + rng.uniform(0, 1, (count, 1)))
    rough = clean + rng.normal(0, ROUGH_NOISE, clean.shape)
    swept = _swept(rough, clean)
    best = {name: min(points, key=lambda point: point["rms_error"]) for name, points in swept.items()}
    rows = [_smooth_row("true echo", None, None, clean, clean), _smooth_row("not smoothed", None, None, rough, clean)]
    rows += [_smooth_row("Vondrák", e, _half_period(e), vondrak(rough, e), clean) for e in EPSILONS]
    rows += best.values()
    shown = {f"Vondrák, ε = {epsilon:g}": vondrak(rough[0], epsilon) for epsilon in EPSILONS}
    setting = best["Vondrák"]["setting"]
    shown[f"Vondrák, ε = {setting:.1g}, least error"] = vondrak(rough[0], setting)
    title = f"smoothing of {count} echoes, noise σ {ROUGH_NOISE:g} counts; the last three at their least error"
    return Part(
        title, {"waveforms": count, "rows": rows, "sweep": swept}, _draw_smooth(rough[0], clean[0], shown, rows, swept)
    )


def _half_period(epsilon: float) -> float | None:
    """Period in bins that Vondrák's method passes with half of its amplitude; none if all pass with more."""
    return float(np.pi / np.arcsin(epsilon ** (1 / 6) / 2)) if epsilon <= 64 else None


def _swept(rough: FloatArray, clean: FloatArray) -> dict[str, list[dict[str, Any]]]:
    """Each method at settings from fine to coarse."""
    rows = [row for period in PERIODS for row in _swept_at(rough, clean, period)]
    rows += [_averaged_over(rough, clean, width) for width in AVERAGES]
    return {name: [row for row in rows if row["method"] == name] for name in ("Vondrák", "moving average", "Gaussian")}


def _swept_at(rough: FloatArray, clean: FloatArray, period: float) -> list[dict[str, Any]]:
    """Vondrák's method and the Gaussian so that they pass a period with half of its amplitude."""
    epsilon = (2 * np.sin(np.pi / period)) ** 6
    sigma = period * np.sqrt(np.log(2) / 2) / np.pi  # exp(-2 (π σ/P)²) = 1/2
    return [
        _smooth_row("Vondrák", epsilon, period, vondrak(rough, epsilon), clean),
        _smooth_row("Gaussian", sigma, period, gaussian(rough, sigma), clean),
    ]


def _averaged_over(rough: FloatArray, clean: FloatArray, width: int) -> dict[str, Any]:
    period = width / 0.6034  # where sin(πx)/(πx) = 1/2
    return _smooth_row("moving average", width, period, moving_average(rough, width), clean)


def _smooth_row(
    method: str, setting: float | None, half_period: float | None, smooth: FloatArray, clean: FloatArray
) -> dict[str, Any]:
    return {
        "method": method,
        "setting": None if setting is None else float(setting),
        "half_period_bins": None if half_period is None else float(half_period),
        "rms_error": _rms(smooth - clean),
        "roughness": _rms(np.diff(smooth, 3)),
    }


def _rms(values: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _draw_smooth(
    rough: FloatArray,
    clean: FloatArray,
    shown: Mapping[str, FloatArray],
    rows: list[dict[str, Any]],
    swept: Mapping[str, list[dict[str, Any]]],
) -> Figure:
    figure = Figure(figsize=(12, 8), layout="constrained")
    panels = figure.subplot_mosaic([[label, "errors"] for label in shown])
    errors = panels.pop("errors")
    for label, axes in panels.items():
        axes.plot(rough, ".", color=RAW, markersize=4, label="noisy echo")
        axes.plot(clean, color="black", lw=0.8, label="true echo")
        axes.plot(shown[label], color=FILTERED, lw=1.3, label="smoothed")
        axes.set_title(label, fontsize=10)
        axes.set_xlim(210, 280)
        axes.set_ylabel("counts")
        axes.tick_params(labelbottom=False)
    axes.tick_params(labelbottom=True)
    axes.set_xlabel("bin")
    for (method, points), colour in zip(swept.items(), (FILTERED, SUM, FOUND), strict=True):
        x, y = ([point[name] for point in points] for name in ("half_period_bins", "rms_error"))
        errors.plot(x, y, ".-", color=colour, lw=1, markersize=4, label=method)
    known = [row for row in rows if row["setting"] in EPSILONS and row["half_period_bins"]]
    for row in known:
        errors.annotate(
            f"ε = {row['setting']:g}",
            (row["half_period_bins"], row["rms_error"]),
            (12, 8),
            textcoords="offset points",
            arrowprops={"arrowstyle": "-", "lw": 0.6},
        )
    errors.axhline(ROUGH_NOISE, color=RAW, lw=1, ls="--", label="not smoothed")
    errors.set_xscale("log")
    errors.set_yscale("log")
    errors.set_xticks([3, 5, 10, 20, 50], ["3", "5", "10", "20", "50"], minor=False)
    errors.set_yticks([3, 5, 10, 20], ["3", "5", "10", "20"], minor=False)
    errors.minorticks_off()
    errors.set_xlabel("period passed with half of its amplitude, bins")
    errors.set_ylabel("RMS error, counts")
    errors.set_ylim(3, 20)
    _legend(figure, (axes, errors), columns=7)
    return figure


def templates(seed: int, count: int = 200) -> Part:
    """One Gaussian and one laser pulse fitted to a laser-shaped echo: Fig 10.

    R² of the record and of the windows around the true echoes, the same samples for both. A Gaussian stands later than
    the maximum of a pulse with a tail: the bias of its position. How many components each fit takes if it may, and what
    it explains then: one Gaussian cannot come as near as the paper's 0.9934, several can.

    Parameters
    ----------
    seed : int
        Of the noise and of sub-bin positions.
    count : int, optional
        Waveforms.

    Returns
    -------
    Part
    """
    rng = np.random.default_rng([seed, 2])
    peak = 236 + rng.uniform(0, 1, count)
    clean = BASELINE + AMPLITUDE * pulse(np.arange(LENGTH), peak[:, None])
    samples = stimulus.quantise(clean + rng.normal(0, NOISE, clean.shape))
    length, truth = np.full(count, LENGTH), {"waveform": np.arange(count), "peak": peak, "fwhm": np.full(count, FWHM)}
    rows, fits = [], {}
    for template in ("gaussian", "laser"):
        found = decompose(samples, method=template, width=SIGMA, most=1)
        free = decompose(samples, method=template, width=SIGMA)
        fits[template] = found.fitted(LENGTH)
        error = found.echoes["peak"] - peak[found.echoes["waveform"]]
        rows.append(
            {
                "template": template,
                "r_squared": float(np.mean(criteria.r_squared(samples, length, fits[template]))),
                "paper_r_squared": PAPER["r_squared"][template],
                "windowed": float(np.mean(criteria.windowed_r_squared(samples, length, fits[template], truth))),
                "paper_windowed": PAPER["windowed_r_squared"][template],
                "bias_bins": float(np.mean(error)),
                "deviation_bins": float(np.std(error)),
                "free_components": len(free.echoes) / count,
                "free_r_squared": float(np.mean(criteria.r_squared(samples, length, free.fitted(LENGTH)))),
            }
        )
    title = f"templates on {count} laser-shaped echoes of FWHM {FWHM:g} bins, noise σ {NOISE:g} of {AMPLITUDE:g} counts"
    figure = _draw_templates(samples[0], {name: fit[0] for name, fit in fits.items()}, peak[0])
    return Part(title, {"waveforms": count, "rows": rows}, figure)


def _draw_templates(samples: NDArray[Any], fits: Mapping[str, FloatArray], peak: float) -> Figure:
    figure = Figure(figsize=(7, 6), layout="constrained")
    waveform, residual = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    waveform.plot(samples, ".", color=RAW, markersize=5, label="samples")
    residual.axhspan(-NOISE, NOISE, color=RAW, alpha=0.25, lw=0, label="σ of the noise")
    for axes in (waveform, residual):
        axes.axvspan(peak - FWHM / 2, peak + FWHM / 2, color=FOUND, alpha=0.08, lw=0, label="3 dB window")
    for (name, fit), style in zip(fits.items(), STYLES, strict=True):
        waveform.plot(fit, color=style["color"], lw=1.3, label=f"{name} template")
        residual.plot(samples - fit, color=style["color"], lw=1)
    waveform.set_ylabel("counts")
    residual.set_ylabel("samples - fit, counts")
    residual.set_xlabel("bin")
    residual.set_xlim(195, 300)
    _legend(figure, (waveform, residual), columns=3)
    figure.align_ylabels()
    return figure


def target() -> NDArray[Any]:
    """True depths of both surfaces of every pixel (`PIXELS`, 2), bins of the range gate, without a sub-bin part.

    The upper surface falls from pixel to pixel through most of the gate, as terrain does; the lower one is a step
    below, of `TERRACES` heights from 1/8 to 2 FWHM.
    """
    upper = np.linspace(0.15, 0.85, PIXELS) * GATE
    step = FWHM * (1 + np.arange(PIXELS) * TERRACES // PIXELS) / (TERRACES / 2)
    return np.stack([upper, upper + step], axis=1)


def stepped(depth: FloatArray, rng: np.random.Generator) -> NDArray[Any]:
    """Waveforms (n, `GATE`), counts, of pixels with surfaces at `depth` (n, 2), bins."""
    samples = np.full((len(depth), GATE), BASELINE)
    for surface, height in enumerate((1.0, LOWER)):
        samples += height * AMPLITUDE * pulse(np.arange(GATE), depth[:, surface, None])
    return stimulus.quantise(samples + rng.normal(0, NOISE, samples.shape))


def resolution(seed: int, repeats: int = REPEATS) -> Part:
    """Moving average and Gaussian fit against V–L on a target with steps: Fig 13.

    The paper counts adjacent pixels whose depths can't be told apart; what limits a full-waveform lidar is whether two
    surfaces within a pixel can be, so here each pixel has two. All methods see the same samples, and may find two
    echoes at most, so that the Gaussian does not spend further ones on the tails. The laser template without the
    smoothing is tried as well, to tell which of the two parts of V–L makes the difference.

    Parameters
    ----------
    seed : int
        Of noise and sub-bin positions.
    repeats : int, optional
        Targets.

    Returns
    -------
    Part
        Of each method: ``relative_error``, mean of |found - true| / true over all surfaces, depths counted from the
        gate's begin, a surface without an echo of its own taking the nearest one; ``resolved_error``, the same over
        pixels that all methods tell apart; ``bias_bins`` and ``deviation_bins`` of these. ``indistinct``, pixels of a
        target that can't be told apart, with ``indistinct_spread`` from target to target: not both surfaces have an
        echo within half of the step. ``split``, pixels of a target without steps in which two echoes are found: so
        many may also be told apart by chance. ``free_echoes``, how many a pixel without a step has if their number has
        no limit.
    """
    rng = np.random.default_rng([seed, 3])
    depth = np.concatenate([target() + rng.uniform(0, 1, (PIXELS, 1)) for _ in range(repeats)])
    samples, level = stepped(depth, rng), stepped(np.repeat(depth[:, :1], 2, axis=1), rng)
    echoes = [_echoes(name, samples, 2) for name in METHODS]
    nearest = [nearest_echoes(found, depth) for found in echoes]
    apart = [told_apart(near, depth) for near in nearest]
    every = np.logical_and.reduce(apart)
    rows = []
    for name, near, distinct in zip(METHODS, nearest, apart, strict=True):
        indistinct = np.count_nonzero(~distinct.reshape(repeats, PIXELS), axis=1)
        twice = np.bincount(_echoes(name, level, 2)["waveform"], minlength=len(level)) > 1
        error = near - depth
        rows.append(
            {
                "method": name,
                "relative_error": float(np.nanmean(np.abs(error) / depth)),
                "paper_relative_error": PAPER["relative_error"].get(name),
                "resolved_error": float(np.mean((np.abs(error) / depth)[every])),
                "bias_bins": float(np.mean(error[every])),
                "deviation_bins": float(np.std(error[every])),
                "indistinct": float(np.mean(indistinct)),
                "indistinct_spread": float(np.std(indistinct, ddof=min(1, repeats - 1))),
                "split": np.count_nonzero(twice) / repeats,
                "free_echoes": len(_echoes(name, level[:FREE], None)) / FREE,
            }
        )
    title = (
        f"{repeats} targets of {PIXELS} pixels with steps of 1/8 to 2 FWHM, noise σ {NOISE:g} of {AMPLITUDE:g} counts"
    )
    drawn = {name: found[found["waveform"] < PIXELS] for name, found in zip(METHODS, echoes, strict=True)}
    figure = _draw_resolution(drawn, depth[:PIXELS], [distinct[:PIXELS] for distinct in apart])
    return Part(title, {"targets": repeats, "resolved_by_all": int(every.sum()), "rows": rows}, figure)


def _echoes(method: str, samples: NDArray[Any], most: int | None) -> np.ndarray:
    """Echoes of pixels by one of `METHODS`, at most so many, or as many as it finds."""
    smooth = moving_average(samples, AVERAGE) if method == "moving average, Gaussian" else samples
    limit = {} if most is None else {"most": most}
    return decompose(smooth, method=METHODS[method], width=SIGMA, **limit).echoes


def nearest_echoes(echoes: Mapping[str, NDArray[Any]] | NDArray[Any], depth: FloatArray) -> FloatArray:
    """Where the echo is that is nearest to each true depth; nan in a waveform without echoes.

    Parameters
    ----------
    echoes : structured (e,) or mapping of arrays
        `waveform` and `peak`, bins.
    depth : float64 (n, k)
        Bins.

    Returns
    -------
    float64 (n, k)
    """
    nearest = np.full(depth.shape, np.nan)
    for row, peak in zip(echoes["waveform"], echoes["peak"], strict=True):
        # Not "nearer": nan, no echo so far, is neither nearer nor farther.
        farther = ~(np.abs(nearest[row] - depth[row]) <= np.abs(peak - depth[row]))
        nearest[row, farther] = peak
    return nearest


def told_apart(nearest: FloatArray, depth: FloatArray) -> NDArray[np.bool_]:
    """Whether both surfaces of each pixel (n,) have an echo less than half of the step away, which so is its own.

    Parameters
    ----------
    nearest : float64 (n, 2)
        Of `nearest_echoes`.
    depth : float64 (n, 2)
        True depths, bins.

    Returns
    -------
    bool (n,)
    """
    half = (depth[:, 1:] - depth[:, :1]) / 2
    return np.asarray((np.abs(nearest - depth) < half).all(axis=1))


def _draw_resolution(drawn: Mapping[str, Any], depth: FloatArray, apart: list[NDArray[np.bool_]]) -> Figure:
    figure = Figure(figsize=(9, 7.5), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    pixel = np.arange(len(depth))
    for axes, (name, echoes), distinct, style in zip(panels, drawn.items(), apart, STYLES, strict=False):
        axes.step(pixel, (depth - depth[:, :1]) * BIN_M, where="mid", color="black", lw=0.9, label=["true depth", None])
        place = (echoes["peak"] - depth[echoes["waveform"], 0]) * BIN_M
        axes.plot(echoes["waveform"], place, ls="", **style, mfc="none", markersize=5, label=name)
        for first in pixel[~distinct]:
            axes.axvspan(first - 0.5, first + 0.5, color=RAW, alpha=0.25, lw=0)
        axes.fill_between([], [], color=RAW, alpha=0.25, lw=0, label="surfaces not told apart")
        axes.set_title(f"{name}: {np.count_nonzero(~distinct)} of {len(depth)} pixels not told apart", fontsize=10)
        axes.set_ylabel("depth below the upper surface, m")
    panels[0].set_ylim(2.7 * FWHM * BIN_M, -FWHM * BIN_M)
    panels[1].set_xlim(-0.5, len(depth) - 0.5)
    panels[1].set_xlabel("pixel")
    _legend(figure, panels)
    return figure


def _legend(figure: Figure, panels: Any, columns: int = 6) -> None:
    """One legend below all panels, each label once."""
    shown = {
        label: handle for axes in panels for handle, label in zip(*_labelled(axes), strict=True) if label != "None"
    }
    figure.legend(
        handles=list(shown.values()), labels=list(shown), loc="outside lower center", frameon=False, ncols=columns
    )


def _labelled(axes: Axes) -> tuple[list[Any], list[Any]]:
    handles, labels = axes.get_legend_handles_labels()
    return list(handles), list(labels)


PARTS = {"snr": signal_to_noise, "smoothing": smoothing, "templates": templates, "resolution": resolution}
"""By the name that they have in the report and in the files of the pictures."""


def tabulate(part: Part) -> Table:
    """Table of a part's rows; side by side as columns where they are fewer than what is said of each."""
    rows = part.report["rows"]
    lines = [[name.replace("_", " ") for name in rows[0]]]
    lines += [[_cell(name, value) for name, value in row.items()] for row in rows]
    if len(rows) < len(rows[0]):
        lines = [list(line) for line in zip(*lines, strict=True)]
    table = Table(title=part.title)
    for name in lines[0]:
        table.add_column(name, justify="right")
    for line in lines[1:]:
        table.add_row(*line)
    return table


def _cell(name: str, value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    return f"{value:.2f}" if name.endswith("_db") else f"{value:.4g}"


def main() -> None:
    """Run the study, print its tables, and write its report and pictures."""
    parser = argparse.ArgumentParser(prog="openecho.study.enhancement", description=main.__doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of noise, speckle and positions (0)")
    seed = parser.parse_args().seed
    parts = {name: part(seed) for name, part in PARTS.items()}
    print(f"seed {seed}")
    for part in parts.values():
        Console().print(tabulate(part))
    content = {"tools": report.tools("numpy", "scipy", "numba", "PyWavelets"), "seed": seed, "paper": PAPER}
    content |= {name: part.report for name, part in parts.items()}
    path = report.write("enhancement", content)
    for name, part in parts.items():
        picture = path.with_name(f"enhancement_{name}.png")
        save(part.figure, picture)
        print(picture)
    print(path)


if __name__ == "__main__":
    main()
