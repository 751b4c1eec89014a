"""How well echoes explain the waveform that they were found in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

REACH = 9
"""σ to either side of a component that are added: past them it is below 3e-18 of its amplitude, which float64 loses."""

ADDED = 2**18
"""Samples of components that are held at a time; a single component may have more."""


Echoes = np.ndarray | Mapping[str, NDArray[Any]]
"""Columns of `openecho.tables.COLUMNS` by name: a structured array, or a mapping of arrays."""


def component_width(echoes: Echoes) -> NDArray[np.float64]:
    """σ of the Gaussian that stands for each echo in its raw waveform, bins.

    The filter widens an echo, which `corrected_width` takes back. Where echoes overlap, the distance of the inflections
    is not that of one echo: it can be less than the filter alone leaves, and there is nothing to correct. For echoes
    that stand apart it is the better width by far; in merged canopy returns, which are no sum of so few Gaussians, the
    width of the filtered echo often leaves a little less.

    Parameters
    ----------
    echoes : Echoes (e,)
        `width` and `corrected_width`, bins.

    Returns
    -------
    float64 (e,)
        The corrected width where it is positive, else the width.
    """
    return np.where(echoes["corrected_width"] > 0, echoes["corrected_width"], echoes["width"])


def fitted(
    echoes: Echoes,
    noise_mean: NDArray[np.float64],
    m: int,
    position: NDArray[np.float64] | None = None,
    width: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Noise mean plus a Gaussian for each echo, amplitude · exp(-(x - position)² / (2 width²)).

    By default each stands at the echo's maximum and has its own width; Zhou 2022 takes centre and filtered width.

    Parameters
    ----------
    echoes : Echoes (e,)
        `waveform` (row, from 0) and `amplitude` (counts) of each echo, and what `position` and `width` are left to.
    noise_mean : (n,) float array
        Of each waveform, counts.
    m : int
        Samples.
    position : (e,) float array, optional
        Maximum of each Gaussian, bins; the echo's `peak`, which is nearer the truth than its `centre`, if left out.
    width : (e,) float array, optional
        σ of each, bins, above 0; `component_width` if left out.

    Returns
    -------
    float64 (n, m)
        Counts.
    """
    position = echoes["peak"] if position is None else position
    width = component_width(echoes) if width is None else width
    total = np.repeat(np.asarray(noise_mean, np.float64), m)
    row, amplitude = np.asarray(echoes["waveform"], np.int64), np.asarray(echoes["amplitude"], np.float64)
    begin = np.clip(np.ceil(position - REACH * width), 0, m).astype(np.int64)
    size = np.clip(np.floor(position + REACH * width) + 1, begin, m).astype(np.int64) - begin
    end = np.cumsum(size)
    for some in np.split(np.arange(len(size)), np.flatnonzero(np.diff(end // ADDED)) + 1):
        each = np.repeat(some, size[some])
        x = begin[each] + np.arange(len(each)) - np.repeat(np.cumsum(size[some]) - size[some], size[some])
        component = amplitude[each] * np.exp(-((x - position[each]) ** 2) / (2 * width[each] ** 2))
        np.add.at(total, row[each] * m + x, component)
    return total.reshape(-1, m)


def rmse(samples: NDArray[Any], length: NDArray[Any], fitted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Root mean square difference of each raw waveform from what was fitted to it.

    Zhou 2022, Eq (12), with the root and the square that its print lost.

    Parameters
    ----------
    samples : (n, m) array
        A waveform a row, counts.
    length : (n,) integer array
        Samples that were recorded in each row.
    fitted : (n, m) float array
        Counts.

    Returns
    -------
    float64 (n,)
        Counts.
    """
    mean_square: NDArray[np.float64] = np.mean((samples - fitted) ** 2, axis=1, where=_recorded(samples, length))
    return mean_square**0.5


def r_squared(samples: NDArray[Any], length: NDArray[Any], fitted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of each waveform's variance that what was fitted to it explains: 1 - Σ(y - ŷ)² / Σ(y - ȳ)².

    Parameters
    ----------
    samples, length, fitted
        As in `rmse`.

    Returns
    -------
    float64 (n,)
        At most 1, below 0 where the waveform's mean would explain more; nan for a constant waveform.
    """
    recorded = _recorded(samples, length)
    mean = np.mean(samples, axis=1, where=recorded, keepdims=True)
    total = np.sum((samples - mean) ** 2, axis=1, where=recorded)
    left = np.sum((samples - fitted) ** 2, axis=1, where=recorded)
    unexplained: NDArray[np.float64] = np.divide(left, total, out=np.full(len(total), np.nan), where=total > 0)
    return 1 - unexplained


def windowed_r_squared(
    samples: NDArray[Any], length: NDArray[Any], fitted: NDArray[np.float64], echoes: Echoes
) -> NDArray[np.float64]:
    """Share of the variance at the echoes that what was fitted explains: 1 - Σ W(y - ŷ)² / Σ W(y - ȳ)².

    Fan & Wang, V–L decomposition, Eqs (23) and (24), where R² of the whole record follows the noise of what lies
    between the echoes. W is 1 between the 3 dB points of each echo and 0 elsewhere; windows that overlap are one, so
    no sample counts twice. The print lost the equations. What its text leaves open is decided here:

    - 3 dB is half of the power, and counts follow the optical power: the points are half a FWHM to either side of the
      maximum. The laser's pulse rises sooner than it falls, but a window must not depend on the template it judges.
    - A sample belongs to a window if it lies between the points or on one.
    - ȳ is the mean of the whole record, as in `r_squared`. That of the windows would make the total several times
      smaller and so lower the figure, where the paper's rises, from 0.9935 to 0.9988.

    Parameters
    ----------
    samples, length, fitted
        As in `rmse`.
    echoes : Echoes (e,)
        `waveform` (row, from 0), `peak` and `fwhm` (bins) of each echo whose surroundings count: those found, or the
        true ones where fits are compared over the same samples.

    Returns
    -------
    float64 (n,)
        At most 1; nan for a constant waveform and for one without a sample in a window.
    """
    recorded = _recorded(samples, length)
    mean = np.mean(samples, axis=1, where=recorded, keepdims=True)
    inside = recorded & _windows(samples.shape, echoes)
    total = np.sum((samples - mean) ** 2, axis=1, where=inside)
    left = np.sum((samples - fitted) ** 2, axis=1, where=inside)
    unexplained: NDArray[np.float64] = np.divide(left, total, out=np.full(len(total), np.nan), where=total > 0)
    return 1 - unexplained


def _windows(shape: tuple[int, ...], echoes: Echoes) -> NDArray[np.bool_]:
    """Which samples (n, m) lie between the half-maximum points of an echo."""
    n, m = shape
    row = np.asarray(echoes["waveform"], np.int64)
    begin = np.clip(np.ceil(echoes["peak"] - echoes["fwhm"] / 2), 0, m).astype(np.int64)
    end = np.clip(np.floor(echoes["peak"] + echoes["fwhm"] / 2) + 1, begin, m).astype(np.int64)
    # Windows that begin less those that end: above 0 where one or more are open.
    change = np.zeros((n, m + 1), np.int64)
    np.add.at(change, (row, begin), 1)
    np.add.at(change, (row, end), -1)
    return np.asarray(np.cumsum(change, axis=1)[:, :m] > 0)


def _recorded(samples: NDArray[Any], length: NDArray[Any]) -> NDArray[np.bool_]:
    """Which samples (n, m) lie within the length of their row."""
    recorded: NDArray[np.bool_] = np.arange(samples.shape[1]) < length[:, np.newaxis]
    return recorded
