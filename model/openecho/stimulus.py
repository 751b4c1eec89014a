"""Waveforms with known truth: LVIS-like land and ocean sets, and the directed shapes that benches must see.

Everything follows from a seed, so that a run can be repeated. Widths are the σ of a Gaussian in bins, amplitudes its
height in counts above the baseline, positions fractional 0-based sample indices.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Samples = NDArray[np.uint16]

TRUTH = np.dtype([("waveform", np.int32), ("centre", np.float64), ("width", np.float64), ("amplitude", np.float64)])
"""One entry per echo that was put in: row of its waveform, centre (bin), width (σ, bins), amplitude (counts)."""

SAMPLE_W = 11
"""Sample width of the reference sets in bits, as in the paper's data."""

WAVEFORMS = 20
"""Waveforms in each of the two reference sets, as in the paper's experiment."""

LAND_LENGTH = 1024
OCEAN_LENGTH = 528


@dataclass(frozen=True)
class Stimulus:
    """Waveforms and what was put into them.

    Attributes
    ----------
    samples : uint16 (n, m)
        Counts; zero past `length`.
    length : int32 (n,)
        Samples in each row.
    truth : `TRUTH` (echoes,)
        Echoes in the order of waveform, then centre.
    """

    samples: Samples
    length: NDArray[np.int32]
    truth: np.ndarray


def gaussians(length: int, echoes: np.ndarray) -> NDArray[np.float64]:
    """Sum of Gaussian echoes without noise.

    Parameters
    ----------
    length : int
        Samples to compute.
    echoes : structured (echoes,)
        With the fields `centre` (bin), `width` (σ, bins) and `amplitude` (counts), as in `TRUTH`.

    Returns
    -------
    float64 (length,)
        Counts above the baseline.
    """
    x = np.arange(length)[:, None]
    shape = np.exp(-0.5 * ((x - echoes["centre"]) / echoes["width"]) ** 2)
    return np.asarray(shape @ echoes["amplitude"], np.float64)


def quantise(signal: NDArray[np.float64], sample_w: int = SAMPLE_W) -> Samples:
    """Round a signal in counts to the nearest code of a `sample_w`-bit digitiser, clipped at its ends."""
    return np.clip(np.rint(signal), 0, 2**sample_w - 1).astype(np.uint16)


def land(seed: int = 0) -> Stimulus:
    """20 waveforms of 1024 samples with 3 to 6 echoes each, after the paper's Congo set (its Figs. A1 and 14).

    Canopy, layers below and ground: echoes between about bin 500 and bin 800, σ 5 to 16 bins, 25 to 250 counts, on a
    baseline of 15 to 30 counts with white noise of about 1 count.

    Parameters
    ----------
    seed : int
        Seed of the set.

    Returns
    -------
    Stimulus
        Samples (20, 1024).
    """
    rng = np.random.default_rng([seed, 0])
    counts = rng.permutation(np.resize([3, 4, 5, 6], WAVEFORMS))
    echoes = []
    for row, count in enumerate(counts):
        # More layers share the same depth, so they are thinner; neighbours stay far enough apart to be two echoes.
        width = rng.uniform(5, 22 - 2 * count, count)
        gaps = (width[:-1] + width[1:]) * rng.uniform(1.9, 2.4, count - 1)
        centre = rng.uniform(500, 545) + np.concatenate([[0], np.cumsum(gaps)])
        echoes.append(_truth(row, centre, width, np.exp(rng.uniform(np.log(25), np.log(250), count))))
    return _noisy(rng, LAND_LENGTH, echoes)


def ocean(seed: int = 0) -> Stimulus:
    """20 waveforms of 528 samples with 1 or 2 narrow echoes each, after the paper's Antarctic set (its Fig. A2).

    Parameters
    ----------
    seed : int
        Seed of the set.

    Returns
    -------
    Stimulus
        Samples (20, 528); σ 3 to 6 bins, 40 to 250 counts, same baseline and noise as `land`.
    """
    rng = np.random.default_rng([seed, 1])
    counts = rng.permutation(np.resize([1, 2], WAVEFORMS))
    echoes = []
    for row, count in enumerate(counts):
        width = rng.uniform(3, 6, count)
        centre = rng.uniform(230, 280) + np.array([0, rng.uniform(28, 50)])[:count]
        echoes.append(_truth(row, centre, width, np.exp(rng.uniform(np.log(40), np.log(250), count))))
    return _noisy(rng, OCEAN_LENGTH, echoes)


def reference_set(seed: int = 0) -> Stimulus:
    """All 40 reference waveforms: `land`, then `ocean`, padded with zeros to (40, 1024).

    Parameters
    ----------
    seed : int
        Seed of both sets.

    Returns
    -------
    Stimulus
        Rows 0 to 19 land, 20 to 39 ocean.
    """
    first, second = land(seed), ocean(seed)
    samples = np.zeros((2 * WAVEFORMS, LAND_LENGTH), np.uint16)
    samples[:WAVEFORMS] = first.samples
    samples[WAVEFORMS:, :OCEAN_LENGTH] = second.samples
    later = second.truth.copy()
    later["waveform"] += WAVEFORMS
    return Stimulus(samples, np.concatenate([first.length, second.length]), np.concatenate([first.truth, later]))


QUIET = 64
"""Samples of `directed` before many echoes: the noise is measured on the first 50, which must hold none."""


def directed(
    sample_w: int = SAMPLE_W, length: int = 1024, tap_count: int = 20, seed: int = 0
) -> Iterator[tuple[str, Samples]]:
    """Shapes on which a wrong filter, state machine or divider shows.

    Parameters
    ----------
    sample_w : int
        Sample width, bits.
    length : int
        Samples in each waveform.
    tap_count : int
        Taps of the filter; sets how far echoes must stand apart to be found one by one.
    seed : int
        Seed of the noise.

    Yields
    ------
    name : str
        What the waveform shows. ``echoes_<n>`` are left out where `length` has no room for n.
    waveform : uint16 (length,)
        Counts.
    """
    rng = np.random.default_rng([seed, 2])
    full = 2**sample_w - 1
    baseline = full / 64
    noise = rng.normal(0, max(full / 2048, 1), length)
    edge = (tap_count + 1) / 2  # bins from an end to the outermost second difference
    x = np.arange(length)

    def echo(*centre: float, width: float = 4, amplitude: float = full / 4) -> Samples:
        clean = gaussians(length, _truth(0, np.array(centre), width, amplitude))
        return quantise(clean + baseline + noise, sample_w)

    yield "all_zero", np.zeros(length, np.uint16)
    yield "full_scale_flat", np.full(length, full, np.uint16)
    yield "alternating", np.where(x % 2 == 0, 0, full).astype(np.uint16)
    yield "impulse", np.where(x == length // 2, full, 0).astype(np.uint16)
    yield "step", np.where(x < length // 2, 0, full).astype(np.uint16)
    yield "ramp", (x * full // max(length - 1, 1)).astype(np.uint16)
    yield "noise", echo()
    yield "saturated", echo(length / 2, width=10, amplitude=3 * full)
    yield "cut_start", echo(edge, width=max(4, edge))
    yield "cut_end", echo(length - 1 - edge, width=max(4, edge))
    spacing = max(20, 9 * tap_count // 8)
    for count in (1, 2, 8, 16, 17):
        if QUIET + count * spacing <= length:
            yield f"echoes_{count}", echo(*(QUIET + spacing * (0.5 + np.arange(count))))


def _noisy(rng: np.random.Generator, length: int, echoes: list[np.ndarray]) -> Stimulus:
    """Baseline, white noise and quantisation for the echoes of each waveform."""
    samples = []
    for row in echoes:
        noise = rng.normal(rng.uniform(15, 30), rng.uniform(0.9, 1.1), length)
        samples.append(quantise(gaussians(length, row) + noise))
    return Stimulus(np.stack(samples), np.full(len(echoes), length, np.int32), np.concatenate(echoes))


def _truth(row: int, centre: NDArray[np.float64], width: ArrayLike, amplitude: ArrayLike) -> np.ndarray:
    truth = np.empty(len(centre), TRUTH)
    truth["waveform"], truth["centre"], truth["width"], truth["amplitude"] = row, centre, width, amplitude
    return truth
