"""The core beside the same method in float64: the paper's Tables 1 and 2, for all 40 reference waveforms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho import golden, stimulus

QUANTITIES = ("centre", "peak", "width", "time", "amplitude")
"""What is compared of each echo; bins, and counts for the amplitude."""


def rmse(samples: NDArray[Any], echoes: np.ndarray, baseline: float) -> float:
    """Root mean square difference between a waveform and the Gaussians found in it: Zhou 2022, Eq (12).

    The width is the published one, of the filtered echo, so the misfit shows how much the filter widens an echo.

    Parameters
    ----------
    samples : integer (m,)
        Raw waveform, counts.
    echoes : structured (echoes,)
        `centre`, `width` (bins) and `amplitude` (counts).
    baseline : float
        Noise mean, counts.

    Returns
    -------
    float
        Counts.
    """
    fitted = baseline + stimulus.gaussians(len(samples), echoes)
    return float(np.sqrt(np.mean((samples - fitted) ** 2)))


def compare(records: np.ndarray, samples: NDArray[Any], length: NDArray[Any], config: golden.Config) -> dict[str, Any]:
    """Put the core's echoes beside those of `golden.float64`.

    Parameters
    ----------
    records : structured (records,)
        The core's output for these waveforms, decoded; its sequence starts at 0.
    samples : integer (n, m)
        Raw waveforms, counts.
    length : integer (n,)
        Samples in each.
    config : golden.Config
        What the core was built with and set to.

    Returns
    -------
    dict
        ``waveforms``: for each its ``length``, the ``core`` and ``float64`` echoes and ``rmse``.
        ``differing_waveforms``: how many have another number of echoes in float64 than in the core.
        ``largest_difference``: of each of `QUANTITIES` and of ``rmse`` over the others.
    """
    reference = golden.float64.decompose(samples, length, config)
    trailers = records[records["trailer"]]
    waveforms, differing = [], 0
    largest = dict.fromkeys((*QUANTITIES, "rmse"), 0.0)
    for row, count in enumerate(length):
        ours = records[~records["trailer"] & (records["sequence"] == row)]
        theirs = {name: reference[name][reference["waveform"] == row] for name in QUANTITIES}
        baselines = {"core": trailers["noise_mean"][row], "float64": reference["noise_mean"][row]}
        fits = {"core": ours, "float64": theirs}
        errors = {name: rmse(samples[row, :count], echoes, baselines[name]) for name, echoes in fits.items()}
        if len(ours) == len(theirs["centre"]):
            for name in QUANTITIES:
                worst = np.max(np.abs(ours[name] - theirs[name]), initial=0.0)
                largest[name] = max(largest[name], float(worst))
            largest["rmse"] = max(largest["rmse"], abs(errors["core"] - errors["float64"]))
        else:
            differing += 1
        waveforms.append(
            {"length": int(count), "rmse": errors} | {name: _rows(echoes) for name, echoes in fits.items()}
        )
    return {"waveforms": waveforms, "differing_waveforms": differing, "largest_difference": largest}


def _rows(echoes: Any) -> list[dict[str, float]]:
    """Columns of echoes as one dict an echo."""
    columns = (np.asarray(echoes[name], float).tolist() for name in QUANTITIES)
    return [dict(zip(QUANTITIES, values, strict=True)) for values in zip(*columns, strict=True)]
