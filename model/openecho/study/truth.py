"""Echoes that simulated waveforms truly have, and what methods are told of the pulse that they are made of."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import least_squares

from openecho.golden.float64 import FWHM
from openecho.scene.instrument import Instrument
from openecho.scene.physics.pulse import STEPS, laser
from openecho.scene.schema import Scene
from openecho.scene.simulate import Simulator
from openecho.stimulus import TRUTH

Floats = NDArray[np.float64]

DETECTABLE = 5.0
"""Deviations of the noise that an echo is high which a method is asked for."""

MISFIT = 0.01
"""Share of its height by which an echo of a scene differs from the pulse at least: that of a slope, or of leaves."""

LAGS = 6
"""Of the noise's autocorrelation, from 0."""

SPREADS = np.append(0, np.geomspace(0.1, 20, 40))
"""Deviations of a target's range, in those of the pulse, at which the shape of its echo is worked out."""


def resolved(scene: Scene, ready: Simulator, truth: np.ndarray) -> tuple[np.ndarray, Floats]:
    """Echoes that can be told apart and from noise.

    Surfaces less than the pulse's FWHM apart are one echo, where the mean of their light is.

    Parameters
    ----------
    scene : Scene
    ready : Simulator
        That of the scene.
    truth : structured (k,)
        Of `openecho.scene.simulate.TRUTH`.

    Returns
    -------
    echoes : structured (echoes,)
        Of `openecho.stimulus.TRUTH`: bins and counts; the width is the FWHM over that of a Gaussian of σ = 1.
    ground : float64 (waveforms,)
        The last of those surfaces that are no leaves, bins; nan without one.
    """
    chain = ready.instrument
    area = truth["energy"] * scene.digitiser.gain * scene.digitiser.rate
    first = np.ones(len(truth), np.bool_)
    first[1:] = (np.diff(truth["waveform"]) > 0) | (np.diff(truth["bin"]) > chain.fwhm)
    echo = np.cumsum(first) - 1
    light = np.bincount(echo, area)
    position = np.bincount(echo, area * truth["bin"]) / light
    square = (truth["bin"] - position[echo]) ** 2 + (truth["spread"] / chain.bin) ** 2
    width, height = _shape(chain, np.sqrt(np.bincount(echo, area * square) / light))
    echoes = np.empty(len(light), TRUTH)
    echoes["waveform"], echoes["centre"] = truth["waveform"][first], position
    echoes["width"], echoes["amplitude"] = width, light * height
    seen = echoes["amplitude"] > DETECTABLE * np.sqrt(chain.dark + chain.shot * echoes["amplitude"])
    seen &= (position > 0) & (position < scene.digitiser.samples - 1)
    ground = np.full(scene.shots * scene.beams, np.nan)
    solid = truth[~np.isnan(truth["incidence"])]
    ground[solid["waveform"]] = solid["bin"]  # the last of each stays
    return echoes[seen], ground


def _shape(chain: Instrument, spread: Floats) -> tuple[Floats, Floats]:
    """Width (bins) and height (1/bin) of echoes of area 1 from targets whose range has these deviations (bins)."""
    pulse = sampled(chain)
    shapes = []
    for part in SPREADS * chain.deviation:
        margin = math.ceil(4 * part * STEPS)
        spread_out = gaussian_filter1d(np.pad(pulse, margin), part * STEPS) if part else pulse
        half = np.flatnonzero(spread_out >= spread_out.max() / 2)
        shapes.append((len(half) / STEPS / FWHM, STEPS * spread_out.max() / pulse.sum()))
    widths, heights = (np.interp(spread, SPREADS * chain.deviation, column) for column in np.transpose(shapes))
    return widths, heights


def sampled(chain: Instrument) -> Floats:
    """The recorded pulse at steps of a bin, in any unit (k,)."""
    return np.asarray(chain.pulse[::-1].T.ravel())  # a later row is earlier in the pulse


def told(x: Floats, pulse: Floats, least: float = 0.0) -> dict[str, dict[str, float]]:
    """What the fits are told of a pulse.

    Parameters
    ----------
    x, pulse : float64 (k,)
        Bins from its maximum, and the pulse there.
    least : float
        Share of its height by which an echo is taken to differ from the pulse at least.

    Returns
    -------
    dict
        For ``gaussian`` and ``laser``, settings ``width`` and ``misfit`` of the method: the width that fits the pulse
        best, and the RMS that is left of its height.
    """
    settings = {}
    for name, shape in SHAPES.items():
        # To digits that no machine rounds differently: an echo more or less may hang on the last.
        width, misfit = (round(value, 4) for value in shaped(x, pulse, shape))
        settings[name] = {"width": width, "misfit": max(misfit, least)}
    return settings


def shaped(x: Floats, pulse: Floats, shape: Callable[..., Floats]) -> tuple[float, float]:
    """Width, bins, of the curve that fits a pulse best, and the RMS that it leaves of the pulse's height."""
    pulse = pulse / pulse.max()
    high = pulse >= 0.5
    fwhm = float(np.ptp(x[high]))
    near = abs(x) < 2 * fwhm
    x, pulse = x[near], pulse[near]
    found = least_squares(lambda known: shape(x, *known) - pulse, (1.0, 0.0, fwhm / FWHM))
    return float(found.x[2]), float(np.sqrt((found.fun**2).mean()))


def told_of_scene(chain: Instrument) -> dict[str, dict[str, Any]]:
    """What the fits are told of a scene's pulse and of its noise: `told`, and ``correlation``."""
    pulse, scene = sampled(chain), chain.scene
    settings = told((np.arange(len(pulse)) - pulse.argmax()) / STEPS, pulse, MISFIT)
    # The response's autocorrelation, exp(-t²/4σ²) with σ = √(ln 2)/(2πB).
    lag = np.arange(LAGS) / scene.digitiser.rate * math.pi * scene.receiver.bandwidth / math.sqrt(math.log(2))
    return {name: known | {"correlation": tuple(np.exp(-(lag**2)).tolist())} for name, known in settings.items()}


def normal(x: Floats, height: float, at: float, width: float) -> Floats:
    """Gaussian of σ `width`."""
    return np.asarray(height * np.exp(-0.5 * ((x - at) / width) ** 2))


def asymmetric(x: Floats, height: float, at: float, width: float) -> Floats:
    """Laser's pulse of √2 τ `width`."""
    return np.asarray(height * laser((x - at) * math.sqrt(2) / width + 2) / laser(2.0))


SHAPES: Mapping[str, Callable[..., Floats]] = {"gaussian": normal, "laser": asymmetric}
"""Shapes that echoes can be taken for."""
