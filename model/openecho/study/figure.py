"""The picture of a decomposition: waveform, filtered waveform, second difference, inflections and echoes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from openecho import golden, stimulus

RAW, FILTERED, CURVATURE, FOUND = "#909090", "#1f4e79", "#5f6b3a", "#c0392b"

MARGIN = 40
"""Bins shown on either side of the echoes."""


def draw(
    path: Path,
    records: np.ndarray,
    samples: NDArray[Any],
    length: NDArray[Any],
    config: golden.Config,
    rows: Mapping[str, int],
) -> None:
    """Draw waveforms with the echoes that the core found in them.

    Parameters
    ----------
    path : Path
        Picture to write; its suffix decides the format.
    records : structured (records,)
        The core's output for these waveforms, decoded; its sequence starts at 0.
    samples : integer (n, m)
        Raw waveforms, counts.
    length : integer (n,)
        Samples in each.
    config : golden.Config
        What the core was built with and set to.
    rows : mapping
        Title to row of `samples`; one column of the picture each.
    """
    figure = Figure(figsize=(6.5 * len(rows), 6.5), layout="constrained")
    axes = figure.subplots(2, len(rows), sharex="col", squeeze=False, height_ratios=[2, 1])
    for column, (title, row) in enumerate(rows.items()):
        upper, lower = axes[:, column]
        mine = records[records["sequence"] == row]
        _waveform(upper, samples[row, : length[row]], mine, config)
        _second_difference(lower, samples[row, : length[row]], mine[~mine["trailer"]], config)
        upper.set_title(title)
        lower.set_xlabel("bin")
    axes[0, 0].set_ylabel("counts")
    axes[1, 0].set_ylabel("counts/bin²")
    axes[0, -1].legend(loc="upper right", frameon=False, fontsize=9)
    axes[1, -1].legend(loc="lower right", frameon=False, fontsize=9)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"partial_{path.name}")
    figure.savefig(partial, dpi=120)
    partial.replace(path)


def _waveform(axes: Axes, samples: NDArray[Any], records: np.ndarray, config: golden.Config) -> None:
    """Raw and filtered waveform, and each echo as the Gaussian that its record describes."""
    echoes = records[~records["trailer"]]
    baseline = float(records["noise_mean"][records["trailer"]][0])
    x = np.arange(len(samples))
    taps = np.array(config.taps) / sum(config.taps)
    # Only where the filter lies inside the waveform, and moved back by its group delay.
    filtered = np.convolve(samples, taps, "valid")
    axes.plot(x, samples, ".", color=RAW, markersize=4, label="raw waveform")
    axes.plot(np.arange(len(filtered)) + (len(taps) - 1) / 2, filtered, color=FILTERED, lw=1.2, label="filtered")
    for echo in echoes:
        shape = baseline + stimulus.gaussians(len(samples), np.atleast_1d(echo))
        near = np.abs(x - echo["centre"]) < 3.5 * echo["width"]
        axes.fill_between(x[near], baseline, shape[near], color=FOUND, alpha=0.12, lw=0)
        axes.plot(x[near], shape[near], color=FOUND, lw=0.9, alpha=0.8)
    height = baseline + echoes["amplitude"]
    axes.vlines(echoes["centre"], baseline, height, color=FOUND, lw=0.9, ls=":", label="centre")
    axes.plot(echoes["peak"], height, "v", color=FOUND, markersize=6, label="peak, amplitude")
    axes.plot([], [], color=FOUND, lw=0.9, label="echo as recorded")
    axes.set_xlim(*_window(echoes, len(samples)))
    axes.margins(y=0.1)


def _second_difference(axes: Axes, samples: NDArray[Any], echoes: np.ndarray, config: golden.Config) -> None:
    """Second difference with its group delay taken out, and the inflections of each echo."""
    taps = np.array(config.taps) / sum(config.taps)
    second = np.convolve(np.diff(samples.astype(float), 2), taps, "valid")
    axes.axhline(0, color="black", lw=0.6)
    axes.plot(np.arange(len(second)) + (len(taps) + 1) / 2, second, color=CURVATURE, lw=1.2, label="second difference")
    half = echoes["width"] * max(config.n, 1) / 2
    for centre, reach in zip(echoes["centre"], half, strict=True):
        axes.axvspan(centre - reach, centre + reach, color=FOUND, alpha=0.08, lw=0)
    inflections = np.concatenate([echoes["centre"] - half, echoes["centre"] + half])
    axes.plot(
        inflections, np.zeros(len(inflections)), "o", color=FOUND, markersize=5, mfc="white", label="inflection points"
    )


def _window(echoes: np.ndarray, length: int) -> tuple[float, float]:
    """Bins that hold all echoes; the whole waveform if there is none."""
    if len(echoes) == 0:
        return 0, length
    reach = 3 * echoes["width"]
    low, high = np.min(echoes["centre"] - reach), np.max(echoes["centre"] + reach)
    return max(0.0, float(low) - MARGIN), min(float(length), float(high) + MARGIN)
