"""The core's own method, inflection points: arrays of waveforms in, a table of echoes out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openecho.decompose.columns import dtype
from openecho.decompose.engines import ENGINES
from openecho.golden import ARITHMETICS, NO_NOISE, TAP_SETS, TOO_LONG, TOO_SHORT, Config, decode_records
from openecho.golden.float64 import FWHM, corrected_width

WAVEFORM = np.dtype(
    [("length", "i4"), ("echoes", "i4"), ("noise_mean", "f8"), ("noise_deviation", "f8"), ("flags", "u1")]
)
"""What the core says of each waveform: samples, number of echoes, noise of the first 50 samples in counts, flags."""


@dataclass(frozen=True)
class Decomposition:
    """Echoes of some waveforms.

    Attributes
    ----------
    echoes : structured (echoes,)
        Columns of `columns.COLUMNS`, in the order of waveforms and of bins.
    waveforms : structured (n,) of `WAVEFORM`
        One entry for each waveform, also for one without echoes. Its flags: 1 too short, 2 too long and cut,
        4 fewer than the 50 samples that measure the noise.
    """

    echoes: np.ndarray
    waveforms: np.ndarray


def configure(
    longest: int = 0,
    *,
    arithmetic: str = "fixed",
    taps: str | Sequence[int] = "paper",
    sample_w: int = Config.sample_w,
    n: float = Config.n,
    min_interval: int = Config.min_interval,
    min_amplitude: int = Config.min_amplitude,
    k: float = Config.k,
) -> Config:
    """Core that takes waveforms of up to `longest` samples whole.

    Parameters
    ----------
    longest : int
        Samples.
    arithmetic : str
        One of `golden.ARITHMETICS`.
    taps : str or sequence of int
        One of `golden.TAP_SETS`, or the taps themselves.
    sample_w : int
        Bits of the digitiser; its greatest count is saturation.
    n, min_interval, min_amplitude, k
        Settings of the core, as in `golden.Config`.

    Returns
    -------
    Config

    Raises
    ------
    ValueError
        In one line, which value was found and what was expected.
    """
    for name, value, known in (("arithmetic", arithmetic, ARITHMETICS), ("taps", taps, TAP_SETS)):
        if (isinstance(value, str) or name == "arithmetic") and value not in known:
            raise ValueError(f"{name}: found {value!r}, expected one of {', '.join(known)}")
    chosen = TAP_SETS[taps] if isinstance(taps, str) else tuple(taps)
    if sum(chosen) <= 0:
        raise ValueError(f"taps: found a sum of {sum(chosen)}, expected a filter that smooths, with a sum above 0")
    return Config(
        sample_w=sample_w,
        max_samples=max(Config.max_samples, longest),
        taps=chosen,
        n=n,
        min_interval=min_interval,
        min_amplitude=min_amplitude,
        k=k,
    ).in_arithmetic(arithmetic)


def decompose(
    samples: ArrayLike,
    length: ArrayLike | None = None,
    *,
    bin_ns: float | None = None,
    engine: str = "model",
    **settings: Any,
) -> Decomposition:
    """Find the echoes of each waveform, bit for bit as the core finds them (Zhou 2022, as corrected in `golden`).

    Parameters
    ----------
    samples : (n, m) integer array
        A waveform a row, counts; or (m,), one waveform.
    length : (n,) integer array, optional
        Samples that were recorded in each row; all m if left out.
    bin_ns : float, optional
        Sample interval in nanoseconds, for the columns in nanoseconds.
    engine : str
        ``model`` or ``rtl``: the golden model, or the RTL itself in simulation, in a checkout of the project.
    **settings
        As `configure` takes them: `arithmetic`, `taps`, `sample_w`, `n`, `min_interval`, `min_amplitude`, `k`.

    Returns
    -------
    Decomposition

    Raises
    ------
    ValueError
        If an array or a setting is not as described.

    Examples
    --------
    >>> found = openecho.decompose(samples, taps="gedi", bin_ns=1.0)  # doctest: +SKIP
    >>> found.echoes["peak_ns"]  # doctest: +SKIP
    """
    if engine not in ENGINES:
        raise ValueError(f"engine: found {engine!r}, expected one of {', '.join(ENGINES)}")
    if bin_ns is not None and not 0 < bin_ns < np.inf:
        raise ValueError(f"bin_ns: found {bin_ns}, expected a positive number")
    rows = np.atleast_2d(np.asarray(samples))
    lengths = np.full(len(rows), rows.shape[1]) if length is None else np.atleast_1d(np.asarray(length))
    config = configure(rows.shape[-1], **settings)
    return tabulate(ENGINES[engine](rows, lengths, config), config, bin_ns)


def tabulate(records: NDArray[Any], config: Config, bin_ns: float | None) -> Decomposition:
    """Table of what the core says in its records.

    Parameters
    ----------
    records : (k, 8) integer array
        All records of some waveforms, whose sequence starts at 0.
    config : Config
        What the core was built with and set to.
    bin_ns : float or None
        Sample interval in nanoseconds.

    Returns
    -------
    Decomposition
    """
    decoded = decode_records(records, config)
    found, trailers = decoded[~decoded["trailer"]], decoded[decoded["trailer"]]
    echoes = np.zeros(len(found), dtype(() if bin_ns is None else ("bin_ns",)))
    echoes["waveform"] = found["sequence"]
    for name in ("number", "centre", "peak", "time", "width", "amplitude", "flags"):
        echoes[name] = found[name]
    echoes["fwhm"] = FWHM * found["width"]
    echoes["corrected_width"] = corrected_width(found["width"], config)
    if bin_ns is not None:
        for name in ("centre", "peak", "time"):
            echoes[f"{name}_ns"] = found[name] * bin_ns
    waveforms = np.zeros(len(trailers), WAVEFORM)
    waveforms["echoes"] = trailers["number"]
    for name in ("length", "noise_mean", "noise_deviation", "flags"):
        waveforms[name] = trailers[name]
    return Decomposition(echoes, waveforms)


def troubles(waveforms: np.ndarray) -> dict[str, int]:
    """How many waveforms the core could not treat as any other, by what was the matter with them."""
    names = {TOO_SHORT: "too short for the filter", TOO_LONG: "too long and cut", NO_NOISE: "too short for noise"}
    counts = {name: int(np.count_nonzero(waveforms["flags"] & flag)) for flag, name in names.items()}
    return {name: count for name, count in counts.items() if count}
