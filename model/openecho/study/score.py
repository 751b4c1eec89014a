"""Echoes of a recording against what others found in its waveforms, and against the waveforms themselves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.table import Table

from openecho.decompose import Method
from openecho.decompose.criteria import r_squared, rmse
from openecho.formats.recording import MAX_LENGTH, Recording, check_bits
from openecho.formats.references import Reference
from openecho.golden import NO_PEAK

NEAR, FAR = 1, 3
"""Bins within which a mode counts as found precisely, and as found at all: GEDI's pulse is σ 4.6 bins wide."""

METRES_PER_NS = 0.149896229
"""Range along the beam: half the speed of light."""

PERCENTILES = (5, 50, 95)

ROW = 2 * MAX_LENGTH
"""What parts the positions of one waveform from those of the next where both are one number."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Sums = dict[str, Any]
"""Sums over waveforms, modes, echoes or samples by name, for a Counter to add up."""


def score(
    recording: Recording,
    references: Sequence[Reference],
    method: Method,
    advance: Callable[[int], object] = lambda done: None,
) -> dict[str, Any]:
    """Decompose all waveforms of a recording, and judge their echoes.

    Parameters
    ----------
    recording : Recording
        Open; it is read block by block.
    references : sequence of Reference
        Of this recording, as from `openecho.formats.references`.
    method : Method
        What decomposes, of `openecho.decompose.prepare`.
    advance : callable, optional
        Called with the number of waveforms that are done.

    Returns
    -------
    dict
        Of numbers, None where there is nothing to take them from. ``waveforms``, ``echoes``, ``echoes_per_waveform``;
        ``rmse`` (counts) and ``r_squared``: their 5th, 50th and 95th percentile over the waveforms; ``residual``:
        ``mean``, ``deviation``, ``largest`` (counts) and ``autocorrelation`` at lag 1 of the recorded samples less what
        was fitted; ``references``, a dict for each, in bins and, with the suffix ``_m``, in metres of range:

        ``name``, ``waveforms``, ``modes``: what is judged.
        ``within_1``, ``within_3``: share of modes that an echo's peak is within so many bins of.
        ``spurious_per_waveform``: echoes whose peak is further than 3 bins from every mode.
        ``peak_rms``, ``peak_bias``, ``centre_rms``: error of the nearest echo of modes that have one within 3 bins.
        ``ground_waveforms``: those with a ground and an echo, whose last is taken for it. ``ground_within_3``,
        ``ground_median_error``, ``ground_rms_within_3``: how well.

        Echoes without a peak of their own, shoulders, are no answer to a mode, and never spurious.

    Raises
    ------
    DataError
        If the recording can't be read, or has counts that the core's samples have no bits for.
    """
    total: Counter[str] = Counter()
    against = [Counter[str]() for _ in references]
    misfits, shares, grounds = [], [], [[np.zeros(0)] for _ in references]
    largest = 0.0
    for block in recording.blocks():
        check_bits(recording.path, block, method.sample_w)
        n, m = block.samples.shape
        found = method(block.samples, block.length, recording.bin_ns)
        fit = found.fitted(m)
        misfits.append(rmse(block.samples, block.length, fit))
        shares.append(r_squared(block.samples, block.length, fit))
        residual = np.where(np.arange(m) < block.length[:, None], block.samples - fit, 0.0)
        largest = max(largest, float(abs(residual).max()))
        total.update(_sums(residual, block.length) | {"waveforms": n, "echoes": len(found.echoes)})
        peaked = found.echoes[found.echoes["flags"] & NO_PEAK == 0]
        for reference, tally, errors in zip(references, against, grounds, strict=True):
            tally.update(_matches(peaked, reference, block.first, n))
            errors.append(_ground_errors(peaked, reference.ground[block.first : block.first + n]))
        advance(total["waveforms"])
    return {
        "waveforms": total["waveforms"],
        "echoes": total["echoes"],
        "echoes_per_waveform": total["echoes"] / total["waveforms"],
        "rmse": _percentiles(np.concatenate(misfits)),
        "r_squared": _percentiles(np.concatenate(shares)),
        "residual": _residual(total) | {"largest": largest},
        "references": [
            _judged(reference, tally, np.concatenate(errors), recording.bin_ns)
            for reference, tally, errors in zip(references, against, grounds, strict=True)
        ],
    }


def tables(results: dict[str, dict[str, Any]]) -> list[Table]:
    """Scores as tables for a terminal.

    Parameters
    ----------
    results : dict
        `score` of one recording by the name of the method, of the core's by that of its tap set.

    Returns
    -------
    list of Table
        Echoes against each reference, if there are any; then how well they explain the waveforms.
    """
    modes = _table(
        "against references, bins",
        ("method", "reference"),
        (
            "modes",
            "within\n1",
            "within\n3",
            "spurious/\nwaveform",
            "peak\nRMS",
            "centre\nRMS",
            "ground\nwithin 3",
            "ground\nmedian",
        ),
    )
    fits = _table(
        "fit, counts; 5th, 50th and 95th percentile",
        ("method",),
        ("echoes/\nwaveform", "RMSE", "R²", "residual\nmean", "residual\ndeviation"),
    )
    for name, result in results.items():
        modes.add_section()
        for row in result["references"]:
            modes.add_row(
                name,
                row["name"],
                f"{row['modes']}",
                *(_number(row[key]) for key in ("within_1", "within_3")),
                _number(row["spurious_per_waveform"], 2),
                *(_number(row[key], 2) for key in ("peak_rms", "centre_rms")),
                _number(row["ground_within_3"]),
                _number(row["ground_median_error"], 2),
            )
        fits.add_row(
            name,
            _number(result["echoes_per_waveform"], 2),
            " ".join(_number(value, 2) for value in result["rmse"].values()).strip(),
            " ".join(_number(value) for value in result["r_squared"].values()).strip(),
            *(_number(result["residual"][key], 2) for key in ("mean", "deviation")),
        )
    return [modes, fits] if modes.rows else [fits]


def _matches(peaked: np.ndarray, reference: Reference, first: int, n: int) -> Sums:
    """Sums over the modes, and over the echoes with a peak, of the n waveforms from `first` on."""
    low, high = np.searchsorted(reference.waveform, (first, first + n))
    waveform, position = reference.waveform[low:high] - first, reference.position[low:high]
    judged = reference.judged[first : first + n]
    echo, error = _nearest(waveform, position, peaked["waveform"], peaked["peak"])
    hit = abs(error) <= FAR
    peak_error = error[hit]
    centre_error = peaked["centre"][echo[hit]] - position[hit]
    mine = peaked[judged[peaked["waveform"]]]
    _, distance = _nearest(mine["waveform"], mine["peak"], waveform, position)
    return {
        "waveforms": int(judged.sum()),
        "modes": len(position),
        "near": int((abs(error) <= NEAR).sum()),
        "hits": int(hit.sum()),
        "spurious": int((abs(distance) > FAR).sum()),
        "peak": float(peak_error.sum()),
        "peak_squared": float((peak_error**2).sum()),
        "centre_squared": float((centre_error**2).sum()),
    }


def _nearest(waveform: Ints, position: Floats, waveforms: Ints, positions: Floats) -> tuple[Ints, Floats]:
    """Find the nearest of some positions to each of others, in the same waveform.

    Parameters
    ----------
    waveform, position : (a,) arrays
        What is asked for.
    waveforms, positions : (b,) arrays
        Among what.

    Returns
    -------
    index : int64 (a,)
        Into the b; the lower of two as near.
    difference : float64 (a,)
        Its position minus the one asked for; infinite where the waveform has none.
    """
    if not len(positions):
        return np.zeros(len(position), np.int64), np.full(len(position), np.inf)
    among = waveforms * ROW + positions
    order = np.argsort(among, kind="stable")
    after = np.searchsorted(among[order], waveform * ROW + position)
    index = order[np.clip([after - 1, after], 0, len(order) - 1)]
    difference = np.where(waveforms[index] == waveform, positions[index] - position, np.inf)
    chosen = abs(difference).argmin(axis=0), np.arange(len(position))
    return index[chosen], difference[chosen]


def _ground_errors(peaked: np.ndarray, ground: Floats) -> Floats:
    """Peak of the last echo minus the ground, of the waveforms that have both."""
    ends = np.searchsorted(peaked["waveform"], np.arange(len(ground) + 1))
    both = (np.diff(ends) > 0) & ~np.isnan(ground)
    errors: Floats = peaked["peak"][ends[1:][both] - 1] - ground[both]
    return errors


def _judged(reference: Reference, tally: Counter[str], ground: Floats, bin_ns: float | None) -> dict[str, Any]:
    """What the sums over all waveforms say of one reference."""
    within = ground[abs(ground) <= FAR]
    bins = {
        "peak_rms": _root(_ratio(tally["peak_squared"], tally["hits"])),
        "peak_bias": _ratio(tally["peak"], tally["hits"]),
        "centre_rms": _root(_ratio(tally["centre_squared"], tally["hits"])),
        "ground_median_error": float(np.median(ground)) if len(ground) else None,
        "ground_rms_within_3": _root(_ratio(float((within**2).sum()), len(within))),
    }
    metres = {f"{name}_m": _in_metres(value, bin_ns) for name, value in bins.items()} if bin_ns is not None else {}
    return {
        "name": reference.name,
        "waveforms": tally["waveforms"],
        "modes": tally["modes"],
        "within_1": _ratio(tally["near"], tally["modes"]),
        "within_3": _ratio(tally["hits"], tally["modes"]),
        "spurious_per_waveform": _ratio(tally["spurious"], tally["waveforms"]),
        "ground_waveforms": len(ground),
        "ground_within_3": _ratio(len(within), len(ground)),
        **bins,
        **metres,
    }


def _sums(residual: Floats, length: NDArray[np.int32]) -> Sums:
    """Sums over the recorded samples, and over pairs of neighbours, of residuals that are 0 past each length."""
    before, after = residual[:, :-1], residual[:, 1:]
    last = residual[np.arange(len(length)), length - 1]
    return {
        "samples": int(length.sum()),
        "sum": float(residual.sum()),
        "squares": float((residual**2).sum()),
        "pairs": int((length - 1).sum()),
        "before": float(residual.sum() - last.sum()),
        "after": float(residual.sum() - residual[:, 0].sum()),
        "products": float((before * after).sum()),
    }


def _residual(sums: Counter[str]) -> dict[str, float | None]:
    """Mean, deviation and autocorrelation at lag 1 from `_sums`."""
    mean = sums["sum"] / sums["samples"]
    variance = max(sums["squares"] / sums["samples"] - mean**2, 0.0)
    covariance = _ratio(sums["products"] - mean * (sums["before"] + sums["after"]), sums["pairs"])
    correlation = None if covariance is None else _ratio(covariance + mean**2, variance)
    return {"mean": mean, "deviation": variance**0.5, "autocorrelation": correlation}


def _percentiles(values: Floats) -> dict[str, float | None]:
    """`PERCENTILES` of those values that are numbers."""
    known = values[~np.isnan(values)]
    return {f"{p}": float(np.percentile(known, p)) if len(known) else None for p in PERCENTILES}


def _ratio(part: float, whole: float) -> float | None:
    return part / whole if whole else None


def _root(value: float | None) -> float | None:
    return None if value is None else value**0.5


def _in_metres(value: float | None, bin_ns: float) -> float | None:
    return None if value is None else value * bin_ns * METRES_PER_NS


def _number(value: float | None, digits: int = 3) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _table(title: str, names: Sequence[str], numbers: Sequence[str]) -> Table:
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=0)
    for name in names:
        table.add_column(name, no_wrap=True)
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)
    return table
