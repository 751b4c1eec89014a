"""Thresholds and baselines that suit given waveforms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openecho.codec.batch import pack
from openecho.codec.form import PREDICTION, THRESHOLD, Form

NOISE_SAMPLES = 50
"""First samples of a waveform, which are believed to be noise."""
START_SAMPLES = 16
"""First samples of a waveform, at whose height prediction should begin."""
TRIAL = 64
"""Waveforms."""


def choose(samples: NDArray[np.uint16], length: NDArray[np.int32], bits: int, mode: int) -> Form:
    """A form that suits these waveforms: the exact optimum of the threshold coding; for prediction a start that pays.

    Prediction starts at the medians of the first samples, or at 0, which a baseline does not leave: where the noise is
    smooth and its mean wanders, the line through the last samples is better alone. The first `TRIAL` waveforms decide.

    Parameters
    ----------
    samples : uint16 (n, m)
    length : int32 (n,)
        Samples in each row, 0 to m.
    bits : int
        N, 1 to 16.
    mode : int
        `THRESHOLD` or `PREDICTION`.

    Returns
    -------
    Form

    Raises
    ------
    CodecError
        If mode or bits are out of range, or a sample has more bits.
    """
    form = Form(mode, bits)
    if mode == THRESHOLD:
        return best_threshold(samples, length, bits)
    starts = _starts(samples, length, form.largest), (0, 0)
    forms = [Form(PREDICTION, bits, baseline=baseline) for baseline in starts]
    return min(forms, key=lambda form: len(pack(samples[:TRIAL], length[:TRIAL], form)[0]))


def published_threshold(samples: NDArray[np.uint16], length: NDArray[np.int32], bits: int) -> Form:
    """Mode 0 as published: twice the RMS of the background noise, about its mean, and no baseline.

    The noise is that of the first `NOISE_SAMPLES` of all waveforms; the threshold is rounded up to whole counts.
    """
    noise = _first(samples, length, NOISE_SAMPLES).astype(np.float64)
    recorded = np.arange(noise.shape[1]) < length[:, None]
    count = np.maximum(recorded.sum(axis=1, keepdims=True), 1)
    deviation = np.where(recorded, noise - (noise * recorded).sum(axis=1, keepdims=True) / count, 0)
    rms = np.sqrt((deviation**2).sum() / max(1, recorded.sum()))
    return Form(THRESHOLD, bits, min(int(np.ceil(2 * rms)), (1 << bits) - 1))


def best_threshold(
    samples: NDArray[np.uint16], length: NDArray[np.int32], bits: int, baseline: tuple[int, int] | None = None
) -> Form:
    """The threshold, and unless it is given the baselines, that need the fewest bits before any credit is spent.

    From the histograms of even and of odd samples: with l bits for a small value, those of 2^l neighbouring counts
    cost l + 1 bits and all others N + 1, so that for each l the best place of the window is found from their running
    sums: O(n + N 2^N), and O(n + 2^N) where the baselines are given.
    """
    size = 1 << bits
    recorded = np.arange(samples.shape[1]) < length[:, None]
    cost, threshold, place = np.inf, 0, (0, 0)
    counts = [np.bincount(samples[:, i::2][recorded[:, i::2]], minlength=size)[:size] for i in (0, 1)]
    total = sum(int(count.sum()) for count in counts)
    sums = [np.append(0, np.cumsum(np.concatenate([count, count]))) for count in counts]
    for small in range(bits + 1):
        starts = [
            _window(running, 1 << small, size, None if baseline is None else baseline[i])
            for i, running in enumerate(sums)
        ]
        within = sum(int(running[at + (1 << small)] - running[at]) for at, running in zip(starts, sums, strict=True))
        bits_needed = within * (small + 1) + (total - within) * (bits + 1)
        if bits_needed < cost:
            cost, threshold, place = bits_needed, (1 << small) - 1, (starts[0], starts[1])
    return Form(THRESHOLD, bits, threshold, place)


def _window(running: NDArray[np.int64], width: int, size: int, given: int | None) -> int:
    """Where a window of so many counts, which may wrap, holds most samples; the lowest such place."""
    return int(np.argmax(running[width : width + size] - running[:size])) if given is None else given


def _starts(samples: NDArray[np.uint16], length: NDArray[np.int32], largest: int) -> tuple[int, int]:
    """Medians of the first samples with even and with odd index."""
    first = _first(samples, length, START_SAMPLES)
    recorded = np.arange(first.shape[1]) < length[:, None]
    even, odd = (first[:, i::2][recorded[:, i::2]] for i in (0, 1))
    middle = [int(np.median(part)) if part.size else 0 for part in (even, odd if odd.size else even)]
    return min(middle[0], largest), min(middle[1], largest)


def _first(samples: NDArray[np.uint16], length: NDArray[np.int32], count: int) -> NDArray[np.uint16]:
    return samples[:, : min(count, int(length.max(initial=0)))]
