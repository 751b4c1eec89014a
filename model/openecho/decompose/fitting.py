"""Methods that fit: echoes of a given shape, so many as the noise allows, by least squares."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.decompose.columns import dtype
from openecho.decompose.decomposition import NOT_CONVERGED, WAVEFORM, Decomposition
from openecho.decompose.find import find_echoes
from openecho.decompose.fit import GREATEST, GREATEST_WIDTH, Fit, check_finite, fit_echoes
from openecho.decompose.least_squares import LEAST_WIDTH
from openecho.decompose.pulses import Pulse, gaussian, laser, measured, rough
from openecho.enhance import noise, vondrak
from openecho.enhance.wavelet import MAD
from openecho.golden import TRUNCATED

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

PASSBAND = 2.5
"""Of the Vondrák smoothing, radians a width: a Gaussian echo has 4 % of its amplitude there, 2e-4 at twice that."""
LIMITS = {"width": GREATEST_WIDTH, "noise": GREATEST, "misfit": 1.0, "saturation": GREATEST, "epsilon": GREATEST}
"""Settings that are numbers from 0, and the greatest of each."""
MOST = 64
"""Echoes of a waveform that can be asked for: the time for a fit rises with the square of their number."""
ENOUGH = 16
"""Samples of plain noise from which its deviation is known well enough, to a sixth."""
ROUNDING = 12**-0.5
"""Deviation of the rounding to whole counts, the least that the noise of counts can have; Bennett 1948."""
DIFFERENCES = 4
"""Order of the differences whose deviation stands for the noise where a waveform has no other place for it."""


@dataclass(frozen=True)
class Fitting:
    """A method and its settings; called with waveforms, it decomposes them.

    Attributes
    ----------
    shape : str
        ``gaussian`` or ``laser``.
    smoothed : bool
        Whether the first guess is taken from the waveform behind Vondrák's smoothing. Whether an echo pays is judged,
        and all are fitted, in the waveform as it was recorded: smoothing changes the shape of an echo, and the noise.
    width : float
        Of a usual echo, bins: half the distance of its inflections, σ of a Gaussian, √2 τ of the laser template.
    widths : str
        ``free``, ``shared`` by the echoes of a waveform, or ``fixed`` at `width`.
    most : int
        Echoes of a waveform.
    least : float
        Height that is worth an echo's trial, deviations of the noise behind a matched filter.
    criterion, start : str
        As in `find_echoes`.
    noise : float, optional
        Deviation of the noise, counts; if left out, measured in each waveform.
    correlation : tuple of float
        Autocorrelation of the noise, 1 at lag 0.
    misfit : float
        Share of a waveform's height by which its echoes may differ from the shape, besides the noise. Echoes that only
        mend the shape are so left out: about 0.01 for recorded waveforms.
    saturation : float, optional
        Counts from which on the digitiser clips: such samples have no say.
    epsilon : float, optional
        Of Vondrák's smoothing; if left out, what lets echoes of the usual width pass.
    rough : bool
        Whether the shape is convolved with a Gaussian for rough targets; `width` is the transmitted pulse's then.
    transmitted : tuple of float, optional
        Recorded transmitted pulse, counts, which is the shape then, convolved with a Gaussian for rough targets.
    """

    shape: str = "gaussian"
    smoothed: bool = False
    width: float = 5.0
    widths: str = "free"
    most: int = 16
    least: float = 4.0
    criterion: str = "ebic"
    start: str = "inflection"
    noise: float | None = None
    correlation: tuple[float, ...] = (1.0,)
    misfit: float = 0.0
    saturation: float | None = None
    epsilon: float | None = None
    rough: bool = False
    transmitted: tuple[float, ...] | None = None

    columns = ("fit",)
    """What its echoes have besides what all have, of the words in `Column.needs`."""
    sample_w = None
    """Bits that a sample may have: any."""

    def __post_init__(self) -> None:
        """Refuse what no waveform is needed for to see that it is wrong."""
        for name, greatest in LIMITS.items():
            value = getattr(self, name)
            if value is not None and not 0 <= value <= greatest:
                raise ValueError(f"{name}: found {value}, expected a number from 0 to {greatest:g}")
        if self.width < LEAST_WIDTH:
            raise ValueError(f"width: found {self.width}, expected {LEAST_WIDTH:.3g} to {GREATEST_WIDTH:g} bins")
        if self.shape == "gaussian" and (self.rough or self.transmitted is not None):
            raise ValueError("rough, transmitted: found one with a Gaussian, expected them with the laser's methods")
        if self.epsilon is not None and not self.smoothed:
            raise ValueError(f"epsilon: found {self.epsilon}, expected it with method vl alone")
        if not isinstance(self.most, int | np.integer) or not 0 <= self.most <= MOST:
            raise ValueError(f"most: found {self.most}, expected 0 to {MOST}")
        self(np.zeros((1, 8)), np.array([8]), None)

    @property
    def pulse(self) -> Pulse:
        """Shape of the echoes."""
        return _pulse(self.shape, self.width if self.rough else None, self.transmitted)

    def __call__(self, samples: NDArray[Any], length: NDArray[Any], bin_ns: float | None) -> Decomposition:
        """Decompose waveforms (n, m) of so many samples (n,), counts; with nanoseconds if a bin's are known."""
        rows, lengths = _checked(samples, length)
        recorded = np.arange(rows.shape[1]) < lengths[:, None]
        deviation = _noise(rows, recorded) if self.noise is None else np.full(len(rows), float(self.noise))
        common: dict[str, Any] = {
            "pulse": self.pulse,
            "correlation": self.correlation,
            "widths": self.widths,
            "width": max(self.width, self.pulse.narrowest),
            "weight": None if self.saturation is None else rows < self.saturation,
        }
        count, start, baseline = find_echoes(
            rows,
            lengths,
            np.hypot(deviation, self.misfit * _height(rows, recorded)) if self.misfit else deviation,
            least=self.least,
            most=self.most,
            criterion=self.criterion,
            start=self.start,
            smoothed=self._smoothed(rows, recorded) if self.smoothed else None,
            **common,
        )
        known = None if self.noise is None else deviation
        fit = fit_echoes(rows, lengths, count, start, baseline=baseline, noise=known, **common)
        waveforms = np.zeros(len(rows), WAVEFORM)
        waveforms["length"], waveforms["echoes"] = lengths, count
        waveforms["noise_mean"], waveforms["noise_deviation"] = fit.baseline, deviation
        waveforms["flags"] = np.where(fit.converged, 0, NOT_CONVERGED)
        return Decomposition(_table(fit, lengths, self.pulse, bin_ns), waveforms, self.pulse)

    def _smoothed(self, rows: FloatArray, recorded: BoolArray) -> FloatArray:
        epsilon = (PASSBAND / self.width) ** 6 if self.epsilon is None else self.epsilon
        # Of less than three samples nothing could be smoothed, and what was not recorded does no harm.
        short = np.count_nonzero(recorded, axis=1, keepdims=True) < 3
        return vondrak(rows, epsilon, weight=recorded | short)


def _checked(samples: NDArray[Any], length: NDArray[Any]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Samples and lengths as the fit takes them."""
    rows, lengths = np.asarray(samples), np.asarray(length)
    if rows.dtype.kind not in "biuf":
        raise ValueError(f"samples: found {rows.dtype}, expected real numbers")
    if rows.ndim != 2:
        raise ValueError(f"samples: found shape {rows.shape}, expected (waveforms, samples)")
    if lengths.shape != (len(rows),):
        raise ValueError(f"length: found shape {lengths.shape}, expected ({len(rows)},)")
    if lengths.dtype.kind not in "iu":
        raise ValueError(f"length: found {lengths.dtype}, expected whole numbers")
    check_finite("samples", rows)
    return rows.astype(np.float64), lengths.astype(np.int64)


@lru_cache(maxsize=8)
def _pulse(shape: str, roughened: float | None, transmitted: tuple[float, ...] | None) -> Pulse:
    if transmitted is not None:
        return measured(transmitted)
    if roughened is not None:
        return rough(roughened)
    return gaussian() if shape == "gaussian" else laser()


def _height(rows: FloatArray, recorded: BoolArray) -> FloatArray:
    """Difference of the greatest and the least sample of each waveform."""
    highest = np.max(rows, axis=1, initial=-np.inf, where=recorded)
    return np.asarray(highest - np.min(rows, axis=1, initial=np.inf, where=recorded))


def _noise(rows: FloatArray, recorded: BoolArray) -> FloatArray:
    """Deviation of each waveform's noise: where there is nothing else, or else in differences between neighbours."""
    found = noise(rows, np.count_nonzero(recorded, axis=1), lags=0)
    deviation = found.sigma.copy()
    for n in np.flatnonzero(found.count < ENOUGH):
        change = np.diff(rows[n, recorded[n]], DIFFERENCES)
        gain = np.sqrt(comb(2 * DIFFERENCES, DIFFERENCES))  # of the squares of the binomial coefficients
        deviation[n] = MAD * np.median(np.abs(change)) / gain if len(change) else 0.0
    whole = (rows == np.rint(rows)).all(axis=1, where=recorded)
    return np.where(whole, np.maximum(deviation, ROUNDING), deviation)


def _table(fit: Fit, lengths: NDArray[np.int64], pulse: Pulse, bin_ns: float | None) -> np.ndarray:
    """Echoes of each waveform in the order of bins."""
    waveform = np.repeat(np.arange(len(lengths)), fit.count)
    order = np.lexsort((fit.centre, waveform))
    midpoint, fwhm = pulse.described(fit.width)
    echoes = np.zeros(len(order), dtype(("fit",) if bin_ns is None else ("fit", "bin_ns")))
    echoes["waveform"] = waveform
    echoes["number"] = np.arange(len(order)) - np.repeat(np.cumsum(fit.count) - fit.count, fit.count)
    values = {
        "peak": fit.centre,
        "centre": fit.centre + midpoint,
        "time": fit.centre + midpoint - fwhm / 4,
        "width": fit.width,
        "fwhm": fwhm,
        "amplitude": fit.amplitude,
        "centre_error": fit.centre_error,
        "width_error": fit.width_error,
        "amplitude_error": fit.amplitude_error,
    }
    for name, value in values.items():
        echoes[name] = value[order]
    outside = (echoes["peak"] < 0) | (echoes["peak"] > lengths[waveform] - 1)
    echoes["flags"] = np.where(outside, TRUNCATED, 0)
    if bin_ns is not None:
        for name in ("centre", "peak", "time"):
            echoes[f"{name}_ns"] = echoes[name] * bin_ns
    return echoes
