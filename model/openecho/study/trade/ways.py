"""Every way to decompose that is compared: the core as it can be built, its method in software, and the fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.decompose import Method, prepare
from openecho.decompose.columns import dtype
from openecho.decompose.decomposition import WAVEFORM, Decomposition
from openecho.decompose.inflection import Inflection
from openecho.golden import ARITHMETICS, TAP_SETS, Config, float64
from openecho.golden.float64 import FWHM, corrected_width

EXTENTS = ("full", "quick")
"""Of the study: all that there is, or enough to see that it runs."""

FRACS = (4, 8, 12, 16, 20, 24)
"""Fractional bits of a position in fixed point."""

FORMATS: Mapping[str, tuple[int, int]] = {
    "binary16": ARITHMETICS["float16"],
    "bfloat16": (8, 7),
    "binary32": ARITHMETICS["float32"],
    "binary64": ARITHMETICS["float64"],
}
"""Bits of exponent and fraction of each IEEE-754 format."""

FIXED, FLOATING, TAPS, SOFTWARE, FIT = (
    *("core, fixed point", "core, floating point", "core, other taps"),
    *("inflections in software", "fit"),
)
"""Groups."""

USUAL = "core FRAC 16"
"""The core as it is built if nothing is said."""

Shapes = Mapping[str, Mapping[str, Any]]
"""What the fits are told, as `openecho.study.trade.sets.Set.told`."""


@dataclass(frozen=True)
class Way:
    """One way to decompose.

    Attributes
    ----------
    name, group : str
    config : Config, optional
        Of the core.
    dsp : bool
        Whether the core may be built with multipliers.
    published : bool or None
        Of the core's method in float64 software: with the paper's equations as printed, or as the core has them.
    method : str
        Of a fit, as `openecho.decompose` calls it.
    """

    name: str
    group: str
    config: Config | None = None
    dsp: bool = True
    published: bool | None = None
    method: str = ""

    @property
    def in_hardware(self) -> bool:
        """Whether it can be built."""
        return self.group in (FIXED, FLOATING, TAPS)

    @property
    def bits(self) -> Way:
        """The way whose results are its own, bit for bit: a core without multipliers has those of one with them."""
        return replace(self, name="", dsp=True)

    def prepare(self, longest: int, told: Shapes) -> Method:
        """Take it for waveforms of up to so many samples, of which the fits are told something."""
        if self.config is None:
            return prepare(self.method, longest, told["gaussian" if self.method == "gaussian" else "laser"])
        config = replace(self.config, max_samples=max(self.config.max_samples, longest))
        return Inflection(config) if self.published is None else InSoftware(config, self.published)


@dataclass(frozen=True)
class InSoftware:
    """The core's method in float64, without its rounding; called with waveforms, it decomposes them.

    Attributes
    ----------
    config : Config
        Settings.
    published : bool
        Whether the equations are those that Zhou 2022 prints.
    """

    config: Config
    published: bool

    columns = ("core",)
    """What its echoes have besides what all have, of the words in `openecho.decompose.Column.needs`."""

    @property
    def sample_w(self) -> int:
        """Bits that a sample may have."""
        return self.config.sample_w

    def __call__(self, samples: NDArray[Any], length: NDArray[Any], bin_ns: float | None) -> Decomposition:
        """Decompose waveforms (n, m) of so many samples (n,), counts; with nanoseconds if a bin's are known."""
        found = float64.decompose(samples, length, self.config, self.published)
        echoes = np.zeros(len(found["waveform"]), dtype(("core",) if bin_ns is None else ("core", "bin_ns")))
        for name in ("waveform", "centre", "peak", "time", "width", "amplitude", "flags"):
            echoes[name] = found[name]
        count = np.bincount(found["waveform"], minlength=len(length))
        echoes["number"] = np.arange(len(echoes)) - np.repeat(np.cumsum(count) - count, count)
        echoes["fwhm"] = FWHM * found["width"]
        echoes["corrected_width"] = corrected_width(found["width"], self.config)
        if bin_ns is not None:
            for name in ("centre", "peak", "time"):
                echoes[f"{name}_ns"] = found[name] * bin_ns
        waveforms = np.zeros(len(length), WAVEFORM)
        waveforms["length"], waveforms["echoes"] = length, count
        waveforms["noise_mean"], waveforms["noise_deviation"] = found["noise_mean"], found["noise_deviation"]
        return Decomposition(echoes, waveforms)


WAYS = (
    *(Way(f"core FRAC {frac}", FIXED, Config(frac=frac)) for frac in FRACS),
    Way(f"{USUAL}, no DSP", FIXED, Config(), dsp=False),
    *(Way(f"core {name}", FLOATING, Config(exp_w=exp_w, frac=frac)) for name, (exp_w, frac) in FORMATS.items()),
    *(Way(f"core, taps {name}", TAPS, Config(taps=taps)) for name, taps in TAP_SETS.items() if name != "paper"),
    Way("inflections, float64", SOFTWARE, Config(), published=False),
    Way("inflections, as printed", SOFTWARE, Config(), published=True),
    Way("Gaussian", FIT, method="gaussian"),
    Way("laser template", FIT, method="laser"),
    Way("V–L", FIT, method="vl"),
)
"""All of them."""
