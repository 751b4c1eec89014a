"""The picture of a decomposition: waveform, echoes and their sum, what they leave, and how the core found them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.registry import BackendFilter, backend_registry
from matplotlib.figure import Figure
from numpy.typing import NDArray

from openecho import golden
from openecho.decompose import Decomposition

RAW, FILTERED, CURVATURE, FOUND, SUM = "#909090", "#1f4e79", "#5f6b3a", "#c0392b", "#e08214"

MARGIN = 40
"""Bins shown on either side of the echoes."""


class FigureError(RuntimeError):
    """A picture that can't be written or shown as asked: one line with what was found and what was expected."""


def draw(
    found: Decomposition,
    samples: NDArray[Any],
    length: NDArray[Any],
    config: golden.Config | None,
    rows: Mapping[str, int],
    bin_ns: float | None = None,
) -> Figure:
    """Draw waveforms with the echoes that were found in them.

    From top to bottom: waveform, each echo, and the sum of them; the waveform less that sum, with the noise deviation
    to either side. Of the core's own method also the filtered waveform, and the second difference with the inflections;
    its echoes are Gaussians of their corrected widths where their peaks are.

    Parameters
    ----------
    found : Decomposition
        Of these waveforms.
    samples : integer (n, m)
        Raw waveforms, counts.
    length : integer (n,)
        Samples in each.
    config : golden.Config or None
        What the core was built with and set to; None for echoes that were fitted.
    rows : mapping
        Title to row of `samples`; one column of the picture each.
    bin_ns : float, optional
        Sample interval in nanoseconds, for a scale of them.

    Returns
    -------
    Figure
    """
    heights = [3, 1] if config is None else [3, 1, 1.5]
    figure = Figure(figsize=(6.5 * len(rows), 1.53 * sum(heights)), layout="constrained")
    axes = figure.subplots(len(heights), len(rows), sharex="col", squeeze=False, height_ratios=heights)
    for column, (title, row) in enumerate(rows.items()):
        raw = samples[row, : length[row]].astype(float)
        shown = found.alone(row)
        _waveform(axes[0, column], raw, shown)
        _residual(axes[1, column], raw, shown)
        if config is not None:
            _filtered(axes[0, column], raw, config)
            _second_difference(axes[2, column], raw, shown.echoes, config)
        axes[0, column].set_xlim(*_window(shown.echoes, len(raw)))
        axes[0, column].set_title(title)
        axes[-1, column].set_xlabel("bin")
        if bin_ns is not None:
            to_ns, to_bins = (lambda x: x * bin_ns), (lambda ns: ns / bin_ns)
            axes[0, column].secondary_xaxis("top", functions=(to_ns, to_bins)).set_xlabel("ns")
    for axis, label in zip(axes[:, 0], ("counts", "raw - sum, counts", "counts/bin²"), strict=False):
        axis.set_ylabel(label)
    # Below all panels: within one, twenty echoes or plain noise leave no room for it.
    labels = {
        label: handle for axis in axes.flat for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        handles=list(labels.values()),
        labels=list(labels),
        loc="outside lower center",
        frameon=False,
        fontsize=8,
        ncols=5 * len(rows),
        columnspacing=1,
    )
    figure.align_ylabels(axes[:, 0])
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a picture, complete or not at all; the suffix decides the format.

    Raises
    ------
    FigureError
        For a suffix that matplotlib does not know.
    OSError
        If it can't be written.
    """
    known = figure.canvas.get_supported_filetypes()
    if path.suffix[1:].casefold() not in known:
        raise FigureError(f"{path}: found suffix {path.suffix!r}, expected one of {', '.join(known)}")
    partial = path.with_name(f"partial_{path.name}")
    try:
        figure.savefig(partial, dpi=120)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def show(figure: Figure) -> None:
    """Open a window and wait until it is closed.

    Raises
    ------
    FigureError
        If there is nowhere to open one.
    """
    import matplotlib.pyplot as plt  # looks for a display when it is imported, which nobody else needs

    windows = backend_registry.list_builtin(BackendFilter.INTERACTIVE)  # type: ignore[no-untyped-call]
    if plt.get_backend().casefold() not in windows:
        raise FigureError("found no display for a window, expected one, or -o FILE.png")
    try:
        plt.figure(figure)  # type: ignore[arg-type, unused-ignore]
    except ImportError as error:
        # Where MPLBACKEND or a matplotlibrc names a backend, nobody has yet looked whether its toolkit is installed.
        backend = plt.get_backend()
        raise FigureError(f"{backend}: found no toolkit for its windows, expected one, or -o FILE.png") from error
    plt.show()


def _waveform(axes: Axes, raw: NDArray[np.float64], found: Decomposition) -> None:
    """Raw waveform, each echo, and the sum of all."""
    baseline, x = float(found.waveforms["noise_mean"][0]), np.arange(len(raw))
    axes.plot(x, raw, ".", color=RAW, markersize=4, label="raw waveform")
    for number, echo in enumerate(found.echoes):
        near = np.abs(x - echo["peak"]) < 2 * echo["fwhm"]
        shape = found.alone(0, number).fitted(len(raw))[0, near]
        axes.fill_between(x[near], baseline, shape, color=FOUND, alpha=0.15, lw=0)
        axes.plot(x[near], shape, color=FOUND, lw=0.8, alpha=0.8)
    axes.plot([], [], color=FOUND, lw=0.9, label="echoes")
    axes.plot(x, found.fitted(len(raw))[0], "--", color=SUM, lw=1.2, label="their sum")
    height = baseline + found.echoes["amplitude"]
    axes.vlines(found.echoes["centre"], baseline, height, color=FOUND, lw=0.9, ls=":", label="centre")
    axes.plot(found.echoes["peak"], height, "v", color=FOUND, markersize=6, label="peak, amplitude")
    axes.margins(y=0.1)


def _filtered(axes: Axes, raw: NDArray[np.float64], config: golden.Config) -> None:
    """Filtered waveform."""
    taps = np.array(config.taps) / sum(config.taps)
    if len(raw) >= len(taps):
        # Only where the filter lies inside the waveform, and moved back by its group delay.
        filtered = np.convolve(raw, taps, "valid")
        axes.plot(np.arange(len(filtered)) + (len(taps) - 1) / 2, filtered, color=FILTERED, lw=1.2, label="filtered")


def _residual(axes: Axes, raw: NDArray[np.float64], found: Decomposition) -> None:
    """Raw waveform less the sum of its echoes."""
    deviation = float(found.waveforms["noise_deviation"][0])
    axes.axhspan(-deviation, deviation, color=FILTERED, alpha=0.15, lw=0, label="noise deviation")
    axes.axhline(0, color="black", lw=0.6)
    axes.plot(np.arange(len(raw)), raw - found.fitted(len(raw))[0], color=RAW, lw=1, label="residual")


def _second_difference(axes: Axes, raw: NDArray[np.float64], echoes: np.ndarray, config: golden.Config) -> None:
    """Second difference with its group delay taken out, and the inflections of each echo."""
    taps = np.array(config.taps) / sum(config.taps)
    axes.axhline(0, color="black", lw=0.6)
    if len(raw) >= len(taps) + 2:
        second = np.convolve(np.diff(raw, 2), taps, "valid")
        x = np.arange(len(second)) + (len(taps) + 1) / 2
        axes.plot(x, second, color=CURVATURE, lw=1.2, label="second difference")
    half = echoes["width"] * max(config.n, 1) / 2
    for centre, reach in zip(echoes["centre"], half, strict=True):
        axes.axvspan(centre - reach, centre + reach, color=FOUND, alpha=0.08, lw=0)
    inflections = np.concatenate([echoes["centre"] - half, echoes["centre"] + half])
    axes.plot(
        inflections, np.zeros(len(inflections)), "o", color=FOUND, markersize=5, mfc="white", label="inflection points"
    )


def _window(echoes: np.ndarray, length: int) -> tuple[float, float]:
    """First and last bin to show: the echoes and a margin, or the whole waveform if there are none."""
    if not len(echoes):
        return -0.5, length - 0.5
    reach = 3 * echoes["width"]
    low, high = (echoes["centre"] - reach).min() - MARGIN, (echoes["centre"] + reach).max() + MARGIN
    return max(low, 0), min(high, length - 1)
