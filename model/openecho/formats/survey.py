"""What is in a recording: one pass over all of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.formats.recording import Block, Recording
from openecho.golden import NOISE_SAMPLES

PERCENTILES = (5, 50, 95)


@dataclass(frozen=True)
class Survey:
    """Samples, noise and extent of a recording.

    Attributes
    ----------
    length : int32 (n,)
        Samples of each waveform.
    least, greatest : int
        Counts.
    clipped : int
        Waveforms with two or more neighbouring samples of the greatest count: that is what saturation looks like.
    noise_mean, noise_deviation, noise_correlation : float64 (k,)
        Mean and population deviation (counts) of the first 50 samples, and the correlation of neighbours among them
        (nan where they do not vary), of each waveform that has so many.
    extent : float64 (2, 3) or None
        Least and greatest coordinates of first and last bins, of those that are numbers; nan where none is.
    time : (float, float) or None
        Least and greatest time of a shot.
    shot : (int, int) or None
        The instrument's own numbers of the first and of the last shot in the file.
    """

    length: NDArray[np.int32]
    least: int
    greatest: int
    clipped: int
    noise_mean: NDArray[np.float64]
    noise_deviation: NDArray[np.float64]
    noise_correlation: NDArray[np.float64]
    extent: NDArray[np.float64] | None
    time: tuple[float, float] | None
    shot: tuple[int, int] | None


def survey(recording: Recording, advance: Callable[[int], object] = lambda done: None) -> Survey:
    """Go through a recording block by block.

    Parameters
    ----------
    recording : Recording
        Open.
    advance : callable, optional
        Called with the number of waveforms that are done.

    Returns
    -------
    Survey

    Raises
    ------
    DataError
        If the recording can't be read.
    """
    lengths, noises, extents, times, shots = [], [], [], [], []
    least, greatest, clipped = 2**16, -1, 0
    for block in recording.blocks():
        recorded = np.arange(block.samples.shape[1]) < block.length[:, None]
        least = min(least, int(block.samples.min(where=recorded, initial=2**16 - 1)))
        if block.samples.max() > greatest:
            greatest, clipped = int(block.samples.max()), 0
        full = (block.samples == greatest) & recorded
        clipped += int((full[:, :-1] & full[:, 1:]).any(axis=1).sum())
        lengths.append(block.length)
        noises.append(noise(block))
        if block.geolocation is not None:
            extents.append(_extent(np.concatenate([block.geolocation.first, block.geolocation.last])))
        if block.time is not None:
            times.append(_extent(block.time[:, None]))
        if block.shot is not None:
            shots += [int(block.shot[0]), int(block.shot[-1])]
        advance(block.first + len(block.length))
    mean, deviation, correlation = np.concatenate(noises, axis=1)
    return Survey(
        length=np.concatenate(lengths),
        least=least,
        greatest=greatest,
        clipped=clipped,
        noise_mean=mean,
        noise_deviation=deviation,
        noise_correlation=correlation,
        extent=_extent(np.concatenate(extents)) if extents else None,
        time=tuple(_extent(np.concatenate(times))[:, 0].tolist()) if times else None,
        shot=(shots[0], shots[-1]) if shots else None,
    )


def noise(block: Block) -> NDArray[np.float64]:
    """Mean, deviation and correlation of neighbours (3, k) of the first 50 samples of waveforms that have so many."""
    first = block.samples[block.length >= NOISE_SAMPLES, :NOISE_SAMPLES].astype(np.float64)
    if not len(first):
        return np.zeros((3, 0))
    mean, variance = first.mean(axis=1), first.var(axis=1)
    off = first - mean[:, None]
    covariance = (off[:, :-1] * off[:, 1:]).mean(axis=1)
    correlation = np.divide(covariance, variance, out=np.full(len(first), np.nan), where=variance > 0)
    return np.stack([mean, variance**0.5, correlation])


def lines(recording: Recording, found: Survey) -> list[tuple[str, str]]:
    """Names and texts that tell a user what is in a recording."""
    bin_ns = recording.bin_ns
    length = np.percentile(found.length, (0, 50, 100))
    told = [
        ("file", str(recording.path)),
        ("format", recording.format),
        ("waveforms", f"{recording.waveforms}"),
        ("sample interval", "not in the file" if bin_ns is None else f"{bin_ns:g} ns"),
        ("samples a waveform", _spread(length, 0)),
        ("samples", f"{int(found.length.sum(dtype=np.int64))}"),
        ("counts", f"{found.least} to {found.greatest}, {found.greatest.bit_length()} bits"),
        ("clipped", f"{found.clipped} waveforms, {found.clipped / recording.waveforms:.2%}"),
    ]
    told[3:3] = [(name, f"{count} waveforms") for name, count in recording.parts if name is not None]
    if bin_ns is not None:
        told.append(("length", _spread(length * bin_ns, 1) + " ns"))
    short = recording.waveforms - len(found.noise_mean)
    if short:
        told.append(("no noise", f"{short} waveforms of fewer than {NOISE_SAMPLES} samples"))
    if len(found.noise_mean):
        known = found.noise_correlation[~np.isnan(found.noise_correlation)]
        told += [
            ("noise mean", _spread(np.percentile(found.noise_mean, PERCENTILES), 2) + " counts"),
            ("noise deviation", _spread(np.percentile(found.noise_deviation, PERCENTILES), 2) + " counts"),
            ("noise lag 1", f"{np.median(known):.2f}" if len(known) else "constant"),
        ]
    if recording.volts is not None:
        told.append(("volts", "{1:g} + {0:g} a count".format(*recording.volts)))
    if found.extent is not None:
        told.append(("coordinates", recording.coordinates or ""))
        told += [(axis, f"{low:.9g} to {high:.9g}") for axis, low, high in zip("xyz", *found.extent, strict=True)]
    if found.time is not None:
        first, last = found.time
        told.append(("time", f"{first:.12g} to {last:.12g} {recording.time_unit}"))
    if found.shot is not None:
        told.append(("shot numbers", "{} to {}".format(*found.shot)))
    return told


def _spread(values: NDArray[Any], digits: int) -> str:
    """Three of them, least first."""
    return " ".join(f"{value:.{digits}f}" for value in values)


def _extent(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least and greatest (2, k) of each column (n, k), of those that are numbers."""
    known = np.isfinite(values)
    low = np.min(values, axis=0, where=known, initial=np.inf)
    high = np.max(values, axis=0, where=known, initial=-np.inf)
    extent: NDArray[np.float64] = np.where(known.any(axis=0), [low, high], np.nan)
    return extent
