"""The fits on recorded waveforms, beside what others made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from openecho import decompose, formats
from openecho.decompose import METHODS
from openecho.decompose.find import find_echoes
from openecho.decompose.fit import Fit, fit_echoes
from openecho.decompose.pulses import Pulse, laser, measured, rough
from openecho.formats import references

FloatArray = NDArray[np.float64]

FILES = ("gedi_cerrado.npz", "lvis_arctic.npz", "lvis_tx.npz", "neon_harvard.npz")
SMOOTHED = 6.5
"""Bins, σ of the smoothing of GEDI L2A's setting a1."""
CORRELATION = (1.0, 0.93, 0.74, 0.50, 0.27)
"""Of GEDI's noise, at the first lags."""


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


def test_a_template_is_the_mean_of_pulses_only_where_they_are_moved_to_one_place(recorded: Path) -> None:
    with np.load(recorded / "lvis_tx.npz") as file:
        pulses = file["samples"].astype(float)
    assert np.ptp(pulses.argmax(axis=1)) > 20
    templates = [measured(np.delete(pulses, n, axis=0).mean(axis=0)) for n in range(len(pulses))]
    fits = [one_echo(pulses[n : n + 1], pulse, 1.01 * pulse.narrowest).rms[0] for n, pulse in enumerate(templates)]
    gaussian, template = one_echo(pulses, None, 5.0).rms, one_echo(pulses, laser(), 5.0).rms
    # 15.7 and 16.9 counts, for 11.3 of a Gaussian: the laser template rises too fast, if no Gaussian makes it slower.
    assert np.sqrt(np.mean(np.square(fits))) > 1.3 * np.sqrt((gaussian**2).mean())
    assert np.sqrt((template**2).mean()) > 1.3 * np.sqrt((gaussian**2).mean())


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


def test_echoes_are_at_the_ground_of_gedi_more_often_where_the_noises_correlation_is_known(recorded: Path) -> None:
    with np.load(recorded / "gedi_cerrado.npz") as file:
        samples, length = file["samples"], file["length"]
    with formats.open(recorded / "gedi_cerrado.npz") as recording:
        (reference,) = (one for one in references(recording) if one.name == "a1")
    judged = ~np.isnan(reference.ground)
    samples, length, ground = samples[judged], length[judged], reference.ground[judged]
    assert len(samples) == 688
    near, echoes = [], []
    for correlation in ((1.0,), CORRELATION):
        found = decompose(samples, length, method="gaussian", width=6.0, misfit=0.01, correlation=correlation)
        distance = np.full(len(samples), np.inf)
        places = found.echoes["waveform"]
        np.minimum.at(distance, places, np.abs(found.echoes["peak"] - ground[places]))
        near.append([(distance <= bins).mean() for bins in (1, 3, 10)])
        echoes.append(len(found.echoes))
    # 260, 416 and 639 waveforms of 688, with 3.5 echoes each; 314, 470 and 638 with 2.5.
    assert (np.array(near) > [[0.37, 0.60, 0.92], [0.45, 0.68, 0.92]]).all()
    assert echoes[1] < 0.8 * echoes[0]


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


@pytest.mark.parametrize("method", ["gaussian", "laser", "vl"])
@pytest.mark.parametrize("name", FILES)
def test_fits_leave_noise_and_a_small_misfit_of_every_recorded_file(name: str, method: str, recorded: Path) -> None:
    with np.load(recorded / name) as file:
        samples, length = file["samples"][:40], file["length"][:40]
    found = decompose(samples, length, method=method, misfit=0.01)
    assert (found.waveforms["echoes"] > 0).all()
    inside = np.arange(samples.shape[1]) < length[:, None]
    left = np.where(inside, samples - found.fitted(samples.shape[1]), 0.0)
    rms = np.sqrt((left**2).sum(axis=1) / length)
    # A hundredth of the height was allowed, and the laser template is not the shape of NEON's pulses.
    height = samples.max(axis=1) - found.waveforms["noise_mean"]
    assert (rms < np.hypot(1.5 * found.waveforms["noise_deviation"], 0.03 * height)).all()
