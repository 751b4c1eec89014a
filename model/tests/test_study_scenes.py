"""The study of scenes: what counts as one echo, and what a set of waveforms looks like."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from openecho.scene.instrument import instrument
from openecho.scene.physics.pulse import STEPS
from openecho.scene.schema import load
from openecho.scene.simulate import TRUTH, simulator
from openecho.study import scenes
from openecho.study.truth import asymmetric, normal, resolved, sampled, shaped

Floats = NDArray[np.float64]


def test_surfaces_closer_than_the_pulse_are_one_echo_where_their_light_is() -> None:
    scene = load("ice").model_copy(update={"shots": 3})
    ready = simulator(scene)
    truth = np.zeros(5, TRUTH)
    truth["waveform"] = [0, 0, 0, 1, 1]
    truth["bin"] = [100, 103, 120, 90, 94]
    truth["energy"] = [1e-14, 3e-14, 1e-14, 1e-20, 2e-20]
    truth["incidence"] = [np.nan, np.nan, 0, 0, np.nan]
    echoes, ground = resolved(scene, ready, truth)
    # 102.25 is three parts of four on the way; the second waveform's echoes are far below the noise.
    assert echoes["waveform"].tolist() == [0, 0]
    assert echoes["centre"] == pytest.approx([102.25, 120])
    assert ground[:2].tolist() == [120, 90]
    assert np.isnan(ground[2])


def recorded(name: str) -> tuple[Floats, Floats]:
    """Bins from the maximum of a scene's pulse, and the pulse there."""
    pulse = sampled(instrument(load(name)))
    return (np.arange(len(pulse)) - pulse.argmax()) / STEPS, pulse


def test_the_shape_that_a_pulse_is_told_by_is_its_own() -> None:
    width, misfit = shaped(*recorded("savanna"), normal)
    # FWHM 15 ns, and the response of 71 MHz: √(ln 2)/(2π·71 MHz) = 1.866 ns.
    assert width == pytest.approx(np.hypot(15 / 2.354820, 1.866260), rel=1e-4)
    assert misfit < 1e-6
    width, misfit = shaped(*recorded("ice"), asymmetric)
    # √2 τ of 5 ns / 3.3947, a little more behind a response of 200 MHz, which is no longer of that shape.
    assert 2.08 < width < 2.3
    assert 0.01 < misfit < 0.03


@pytest.mark.parametrize("spread", [0.0, 2.0, 9.0])
def test_width_and_height_of_an_echo_are_those_of_the_pulse_spread_by_its_target(spread: float) -> None:
    scene = load("savanna").model_copy(update={"shots": 1})
    ready = simulator(scene)
    chain = ready.instrument
    truth = np.zeros(1, TRUTH)
    truth["bin"], truth["energy"], truth["spread"] = 100, 1e-12, spread * chain.bin
    (echo,) = resolved(scene, ready, truth)[0]
    # That pulse is a Gaussian: its width and the target's add as variances, and its height is area / (√2π width).
    width = np.hypot(np.hypot(15 / 2.354820, 1.866260), spread)
    area = 1e-12 * scene.digitiser.gain * scene.digitiser.rate
    assert echo["width"] == pytest.approx(width, rel=0.004)
    assert echo["amplitude"] == pytest.approx(area / (np.sqrt(2 * np.pi) * width), rel=0.005)


def test_looks_are_those_of_the_noise_that_was_made() -> None:
    rng = np.random.default_rng(0)
    white = rng.normal(0, 3, (2000, 101))
    samples = np.rint(200 + (white[:, 1:] + white[:, :-1])).astype(np.uint16)
    found = scenes.looks(samples, np.full(2000, 100, np.int32), 3.0)
    assert found["baseline"].mean() == pytest.approx(200, abs=0.1)
    assert np.median(found["noise deviation"]) == pytest.approx(3 * np.sqrt(2), abs=0.15)
    # Half at lag 1 and none beyond, less what the mean of 50 samples takes away: 2 of 50.
    assert found["autocorrelation"][:3] == pytest.approx([0.48, -0.04, -0.04], abs=0.02)
