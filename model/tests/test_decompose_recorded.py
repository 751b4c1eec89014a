"""The fits on recorded waveforms, beside what others made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from openecho import decompose
from openecho.decompose import METHODS
from openecho.decompose.find import find_echoes
from openecho.decompose.fit import Fit, fit_echoes
from openecho.decompose.pulses import Pulse, measured, rough

FloatArray = NDArray[np.float64]

FILES = ("gedi_cerrado.npz", "lvis_arctic.npz", "lvis_tx.npz", "neon_harvard.npz")
SMOOTHED = 6.5
"""Bins, σ of the smoothing of GEDI L2A's setting a1."""


def test_neon_is_explained_better_than_its_reference_by_no_more_echoes(recorded: Path) -> None:
    with np.load(recorded / "neon_harvard.npz") as file:
        samples, length, reference = file["samples"].astype(float), file["length"], file["ref_decomposition"]
    waveform = reference[:, 0].astype(int) - 1
    known = np.bincount(waveform, minlength=len(samples))
    x = np.arange(samples.shape[1])
    left = np.where(x < length[:, None], samples, 0.0)
    for row, (amplitude, centre, sigma) in zip(waveform, reference[:, 1:4], strict=True):
        left[row] -= (amplitude * np.exp(-(((x - (centre - 1)) / sigma) ** 2) / 2)) * (x < length[row])
    left -= (left.sum(axis=1) / length)[:, None] * (x < length[:, None])  # the baseline that is best for it
    theirs = np.sqrt((left**2).sum(axis=1) / length)[known > 0]

    samples, length, known = samples[known > 0], length[known > 0], known[known > 0]
    assert len(samples) == 482
    noise = np.full(len(samples), 3.0)
    count, start, baseline = find_echoes(samples, length, noise, width=8.0, most=known)
    ours = fit_echoes(samples, length, count, start, baseline=baseline)
    assert (count <= known).all()
    assert (ours.rms < theirs).mean() >= 0.97
    assert np.median(ours.rms) < 0.95 * np.median(theirs)
    # As many as the noise allows, they leave less than a quarter.
    count, start, baseline = find_echoes(samples, length, noise)
    free = fit_echoes(samples, length, count, start, baseline=baseline)
    assert (free.rms < theirs).mean() >= 0.99
    assert np.median(free.rms) < 0.25 * np.median(theirs)


def one_echo(samples: FloatArray, pulse: Pulse | None, width: float) -> Fit:
    """A baseline and an echo in each waveform."""
    start = np.stack([np.ptp(samples, axis=1), samples.argmax(axis=1), np.full(len(samples), width)], axis=1)
    length = np.full(len(samples), samples.shape[1])
    return fit_echoes(samples, length, np.ones(len(samples), int), start, pulse=pulse)


def test_the_templates_leave_less_than_half_of_what_a_gaussian_leaves_of_the_lvis_pulse(recorded: Path) -> None:
    with np.load(recorded / "lvis_tx.npz") as file:
        pulses = file["samples"].astype(float)
    gaussian = one_echo(pulses, None, 5.0)
    left = np.sqrt((gaussian.rms**2).mean())
    assert 11 < left < 12

    laser = one_echo(pulses, rough(4.0), 5.0)
    assert np.sqrt((laser.rms**2).mean()) < 0.5 * left

    # Each with the mean of the others, moved to one place: they were triggered at whole bins.
    x = np.arange(pulses.shape[1])
    moved = np.stack(
        [np.interp(x + shift, x, pulse) for pulse, shift in zip(pulses, gaussian.centre - 60, strict=True)]
    )
    others = [measured(np.delete(moved, n, axis=0).mean(axis=0)) for n in range(len(pulses))]
    fits = [one_echo(pulses[n : n + 1], pulse, 1.01 * pulse.narrowest).rms[0] for n, pulse in enumerate(others)]
    assert np.sqrt(np.mean(np.square(fits))) < 0.3 * left


def test_the_smoothed_sum_of_echoes_has_the_ground_of_gedi_where_the_smoothed_waveform_has_it(recorded: Path) -> None:
    """Modes are maxima of a smoothed waveform; an echo of many that merge is not at one, but their sum is."""
    with np.load(recorded / "gedi_cerrado.npz") as file:
        samples, length, ground = file["samples"], file["length"], file["ref_a1_zcross"]
    judged = np.isfinite(ground)
    samples, length, ground = samples[judged], length[judged], ground[judged]
    found = decompose(samples, length, method="gaussian", width=6.0, misfit=0.01)
    smoothed = gaussian_filter1d(found.fitted(samples.shape[1]), SMOOTHED, axis=1)
    error = np.array([nearest_maximum(row[:m], place) for row, m, place in zip(smoothed, length, ground, strict=True)])
    assert (abs(error) <= 1).mean() >= 0.99
    assert (abs(error) <= 3).all()


def nearest_maximum(curve: FloatArray, place: float) -> float:
    """Distance of the nearest maximum from a place."""
    k = np.flatnonzero((curve[1:-1] > curve[:-2]) & (curve[1:-1] >= curve[2:])) + 1
    before, at, after = curve[k - 1], curve[k], curve[k + 1]
    maxima = k + (before - after) / (before - 2 * at + after) / 2
    return float(maxima[np.abs(maxima - place).argmin()] - place)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", FILES)
def test_every_recorded_file_has_an_answer_from_every_method(name: str, method: str, recorded: Path) -> None:
    with np.load(recorded / name) as file:
        samples, length = file["samples"][:40], file["length"][:40]
    settings = {} if method == "inflection" else {"misfit": 0.01}
    with np.errstate(all="raise", under="ignore"):
        found = decompose(samples, length, method=method, **settings)
    assert len(found.waveforms) == len(samples)
    assert found.waveforms["echoes"].sum() == len(found.echoes)
    assert np.isfinite(found.fitted(samples.shape[1])).all()
    for column in found.echoes.dtype.names or ():
        known = found.echoes[column]
        assert not np.isnan(known).any(), column
    assert (found.echoes["width"] > 0).all()
    assert (found.echoes["amplitude"] >= 0).all()
