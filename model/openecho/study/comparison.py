"""The core beside the same method in float64: the paper's Tables 1 and 2, for all 40 reference waveforms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho import golden
from openecho.decompose import criteria

QUANTITIES = ("centre", "peak", "width", "time", "amplitude")
"""What is compared of each echo; bins, and counts for the amplitude."""


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
        ``waveforms``: for each its ``length``, the ``core`` and ``float64`` echoes and ``rmse``: Zhou 2022, Eq (12),
        with the published width, that of the filtered echo, so that the misfit shows how much the filter widens it.
        ``differing_waveforms``: how many have another number of echoes in float64 than in the core.
        ``largest_difference``: of each of `QUANTITIES` and of ``rmse`` over the others.
        ``echoes``, ``lost_by_five_states``: all of the core's, and those that the paper's state machine would lose.
    """
    sides = {"core": _decomposed(records), "float64": golden.float64.decompose(samples, length, config)}
    fits = {side: _published_rmse(samples, length, echoes) for side, echoes in sides.items()}
    waveforms, differing = [], 0
    largest = dict.fromkeys((*QUANTITIES, "rmse"), 0.0)
    for row, count in enumerate(length):
        echoes = {side: _of_waveform(columns, row) for side, columns in sides.items()}
        ours, theirs = echoes.values()
        rmse = {side: float(fit[row]) for side, fit in fits.items()}
        if len(ours["centre"]) == len(theirs["centre"]):
            differences = {name: np.max(np.abs(ours[name] - theirs[name]), initial=0.0) for name in QUANTITIES}
            differences["rmse"] = abs(rmse["core"] - rmse["float64"])
            largest = {name: max(value, float(differences[name])) for name, value in largest.items()}
        else:
            differing += 1
        waveforms.append(
            {"length": int(count), "rmse": rmse} | {side: _rows(columns) for side, columns in echoes.items()}
        )
    return {
        "waveforms": waveforms,
        "differing_waveforms": differing,
        "largest_difference": largest,
        "echoes": len(sides["core"]["waveform"]),
        "lost_by_five_states": int(golden.float64.saved_echoes(samples, length, config).sum()),
    }


def _decomposed(records: np.ndarray) -> dict[str, NDArray[Any]]:
    """Decoded records as the arrays that `golden.float64.decompose` returns."""
    echoes, trailers = records[~records["trailer"]], records[records["trailer"]]
    columns = {name: echoes[name] for name in QUANTITIES}
    return columns | {"waveform": echoes["sequence"], "noise_mean": trailers["noise_mean"]}


def _published_rmse(
    samples: NDArray[Any], length: NDArray[Any], echoes: dict[str, NDArray[Any]]
) -> NDArray[np.float64]:
    """Misfit of each waveform with its echoes where and as wide as Zhou 2022 has them."""
    fitted = criteria.fitted(echoes, echoes["noise_mean"], samples.shape[1], echoes["centre"], echoes["width"])
    return criteria.rmse(samples, length, fitted)


def _of_waveform(columns: dict[str, NDArray[Any]], row: int) -> dict[str, NDArray[Any]]:
    """What is compared of the echoes of one waveform."""
    return {name: columns[name][columns["waveform"] == row] for name in QUANTITIES}


def _rows(columns: dict[str, NDArray[Any]]) -> list[dict[str, float]]:
    """Columns of echoes as one dict an echo."""
    return [
        dict(zip(columns, values, strict=True)) for values in zip(*(c.tolist() for c in columns.values()), strict=True)
    ]
