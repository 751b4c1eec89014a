"""How precisely the core locates an echo, by Monte Carlo over single Gaussian echoes in white noise.

Errors are given as multiples of the Cramér–Rao bound for the position of a Gaussian echo of known shape,
σ_c = σ_n·√(2σ/√π)/A, with σ_n the white noise that was added. Rounding to whole counts adds noise of its own (√(1/12)
count); the bound leaves it out, so the digitiser's part is counted against the core: at σ_n = 1 it alone makes 1.04.

Run as ``python -m openecho.study.precision``; the report is ``build/reports/precision.json``.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table

from openecho import golden, report, stimulus

NOISE = 1.0
"""Standard deviation of the white noise, counts."""

COUNT = 4000
"""Waveforms a point: the RMS of so many errors is itself good to 1.1 %."""

LENGTH = 256
CENTRE = 150.0
"""Samples in a waveform and the bin at which its echo stands, moved by a random part of a bin."""

BASELINE = 20.0
"""Counts; well above the noise, so that nothing is clipped at zero."""


@dataclass(frozen=True)
class Point:
    """One point of the study.

    Attributes
    ----------
    taps : tuple of int
        The filter.
    matched : bool
        Whether the filter is a Gaussian as wide as the echo (else it is the paper's).
    width : float
        σ of the echo, bins.
    amplitude : float
        Height of the echo, counts.
    """

    taps: tuple[int, ...]
    matched: bool
    width: float
    amplitude: float

    @property
    def bound(self) -> float:
        """Cramér–Rao bound of the position, bins."""
        return float(NOISE * np.sqrt(2 * self.width / np.sqrt(np.pi)) / self.amplitude)

    @property
    def config(self) -> golden.Config:
        """The core with this point's taps, everything else at its default."""
        return golden.Config(taps=self.taps)


POINTS = tuple(
    Point(taps, matched, width, amplitude)
    for matched, sets in (
        (False, [(golden.PAPER_TAPS, width) for width in (3, 5, 8, 16)]),
        (True, [(golden.gaussian_taps(width, count), width) for width, count in ((3, 20), (5, 32), (8, 48))]),
    )
    for taps, width in sets
    for amplitude in (20, 200)
)
"""The paper's taps against echoes from narrow to wide, and taps matched to the echo."""


def waveforms(point: Point, count: int, seed: int) -> stimulus.Stimulus:
    """Single Gaussian echoes at random sub-bin positions, with noise, in whole counts.

    Parameters
    ----------
    point : Point
        Echo width and amplitude.
    count : int
        Waveforms.
    seed : int
        Seed of positions and noise.

    Returns
    -------
    Stimulus
        Samples (count, `LENGTH`), one echo in each.
    """
    rng = np.random.default_rng([seed, POINTS.index(point)])
    truth = np.empty(count, stimulus.TRUTH)
    truth["waveform"] = np.arange(count)
    truth["centre"] = CENTRE + rng.uniform(0, 1, count)
    truth["width"], truth["amplitude"] = point.width, point.amplitude
    clean = point.amplitude * np.exp(-0.5 * ((np.arange(LENGTH) - truth["centre"][:, None]) / point.width) ** 2)
    samples = stimulus.quantise(BASELINE + clean + rng.normal(0, NOISE, clean.shape))
    return stimulus.Stimulus(samples, np.full(count, LENGTH, np.int32), truth)


def score(point: Point, records: np.ndarray, truth: np.ndarray) -> dict[str, Any]:
    """Errors of the strongest echo of each waveform.

    Parameters
    ----------
    point : Point
        What was run.
    records : structured (records,)
        All decoded records, whose sequence starts at 0 with the first waveform.
    truth : structured (waveforms,)
        `Stimulus.truth` of `waveforms`.

    Returns
    -------
    dict
        The point (its width as `sigma`), waveforms and how many had an echo at all; over those the RMS error of
        `peak` and `centre` as multiples of the bound, and the mean of the recorded `width` in bins.
    """
    echoes = records[~records["trailer"]]
    echoes = echoes[np.lexsort((-echoes["amplitude"], echoes["sequence"]))]
    found, first = np.unique(echoes["sequence"], return_index=True)
    strongest, expected = echoes[first], truth["centre"][found]

    def multiple(position: NDArray[np.float64]) -> float:
        return float(np.sqrt(np.mean((position - expected) ** 2)) / point.bound)

    return {
        "taps": "matched" if point.matched else "paper",
        "tap_count": len(point.taps),
        "sigma": point.width,
        "amplitude": point.amplitude,
        "waveforms": len(truth),
        "found": len(found),
        "bound_bins": point.bound,
        "peak": multiple(strongest["peak"]),
        "centre": multiple(strongest["centre"]),
        "width": float(np.mean(strongest["width"])),
    }


def study(seed: int, count: int = COUNT) -> list[dict[str, Any]]:
    """Run every point through the golden core, which the RTL equals bit for bit.

    Parameters
    ----------
    seed : int
        Seed of all waveforms.
    count : int
        Waveforms a point.

    Returns
    -------
    list of dict
        A `score` for each of `POINTS`.
    """
    rows = []
    for point in track(POINTS, "precision", transient=True):
        made = waveforms(point, count, seed)
        records = golden.core(golden.stream(made.samples, made.length, point.config), point.config)["record"]
        rows.append(score(point, golden.decode_records(records, point.config), made.truth))
    return rows


def main() -> None:
    """Run the study, print its table and write its report."""
    parser = argparse.ArgumentParser(prog="openecho.study.precision", description=main.__doc__)
    parser.add_argument("--seed", type=int, default=0, help="seed of the waveforms (0)")
    seed = parser.parse_args().seed
    rows = study(seed)
    table = Table(
        title=f"RMS error of position, multiples of the Cramér–Rao bound (seed {seed}, {COUNT} waveforms a point)"
    )
    for name in ("taps", "echo σ", "amplitude", "found", "peak", "centre"):
        table.add_column(name, justify="right")
    for row in rows:
        taps = f"{row['taps']} {row['tap_count']}"
        found = f"{row['found'] / row['waveforms']:.2%}"
        table.add_row(
            taps, str(row["sigma"]), str(row["amplitude"]), found, f"{row['peak']:.2f}", f"{row['centre']:.2f}"
        )
    Console().print(table)
    content = {"tools": report.tools("numpy"), "seed": seed, "noise": NOISE, "rows": rows}
    print(report.write("precision", content))


if __name__ == "__main__":
    main()
