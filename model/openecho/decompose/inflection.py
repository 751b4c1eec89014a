"""The core's own method, inflection points: arrays of waveforms in, a table of echoes out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.decompose.columns import dtype
from openecho.decompose.decomposition import WAVEFORM, Decomposition
from openecho.decompose.engines import ENGINES
from openecho.golden import ARITHMETICS, TAP_SETS, Config, decode_records
from openecho.golden.float64 import FWHM, corrected_width


@dataclass(frozen=True)
class Inflection:
    """The core with its settings; called with waveforms, it decomposes them.

    Bit for bit as the core does (Zhou 2022, as corrected in `golden`).

    Attributes
    ----------
    config : Config
        What the core was built with and set to.
    engine : str
        One of `ENGINES`: the golden model, or the RTL itself in simulation, in a checkout of the project.
    """

    config: Config
    engine: str = "model"

    columns = ("core",)
    """What its echoes have besides what all have, of the words in `Column.needs`."""

    def __post_init__(self) -> None:
        """Refuse an engine that there is not."""
        if self.engine not in ENGINES:
            raise ValueError(f"engine: found {self.engine!r}, expected one of {', '.join(ENGINES)}")

    @property
    def sample_w(self) -> int:
        """Bits that a sample may have."""
        return self.config.sample_w

    def __call__(self, samples: NDArray[Any], length: NDArray[Any], bin_ns: float | None) -> Decomposition:
        """Decompose waveforms (n, m) of so many samples (n,), counts; with nanoseconds if a bin's are known."""
        return tabulate(ENGINES[self.engine](samples, length, self.config), self.config, bin_ns)


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
    echoes = np.zeros(len(found), dtype(("core",) if bin_ns is None else ("core", "bin_ns")))
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
