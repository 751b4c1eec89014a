"""Vondrák smoothing against exact solutions, and at its limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from openecho.enhance import vondrak
from openecho.study.extremes.smoothing import exact

LENGTH = 200
EPSILONS = tuple(10.0**power for power in range(-12, 13, 2))


def waveform(seed: int) -> NDArray[np.float64]:
    """Two echoes and noise on a baseline."""
    x = np.arange(LENGTH)
    echoes = 300 * np.exp(-((x - 80.3) ** 2) / 50) + 120 * np.exp(-((x - 101.1) ** 2) / 50)
    return np.asarray(np.rint(echoes + 210 + np.random.default_rng(seed).normal(0, 2, LENGTH)))


@pytest.mark.parametrize("epsilon", EPSILONS)
def test_even_spacing_is_exact(epsilon: float) -> None:
    samples = waveform(0)
    expected = exact(samples, epsilon, np.arange(float(LENGTH)), np.ones(LENGTH))
    np.testing.assert_allclose(vondrak(samples, epsilon), expected, rtol=1e-12)


@pytest.mark.parametrize("epsilon", EPSILONS)
def test_uneven_spacing_and_weights_are_exact(epsilon: float) -> None:
    random = np.random.default_rng(1)
    position = np.cumsum(random.uniform(0.2, 3, LENGTH))
    weight = random.uniform(0.1, 4, LENGTH)
    weight[random.integers(0, LENGTH, 30)] = 0
    samples = waveform(1)
    expected = exact(samples, epsilon, position, weight)
    smoothed = vondrak(samples, epsilon, position=position, weight=weight)
    np.testing.assert_allclose(smoothed, expected, rtol=1e-10, atol=1e-10 * np.abs(expected).max())


def test_nothing_followed_is_the_best_parabola_and_everything_the_data() -> None:
    samples, x = waveform(2), np.arange(LENGTH)
    weight = np.random.default_rng(2).uniform(0.1, 4, LENGTH)
    parabola = np.polyval(np.polyfit(x, samples, 2, w=np.sqrt(weight)), x)
    for epsilon in (0.0, 1e-300, 1e-30):
        np.testing.assert_allclose(vondrak(samples, epsilon, weight=weight), parabola, rtol=1e-11)
    for epsilon in (1e20, 1e300, np.inf):
        np.testing.assert_allclose(vondrak(samples, epsilon, weight=weight), samples, rtol=1e-14)


@pytest.mark.parametrize("epsilon", [1e-12, 1.0, 1e12])
def test_a_parabola_passes_unchanged(epsilon: float) -> None:
    position = np.cumsum(np.random.default_rng(3).uniform(0.2, 3, LENGTH))
    samples = 3 - 2 * position + 0.01 * position**2
    np.testing.assert_allclose(vondrak(samples, epsilon, position=position), samples, rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("period", [6, 12, 40])
def test_a_period_passes_with_the_stated_amplitude(period: int) -> None:
    x, epsilon = np.arange(1200), (2 * np.sin(np.pi / period)) ** 6
    wave = np.cos(2 * np.pi * x / period)
    inner = slice(400, 800)  # where the ends have no say
    np.testing.assert_allclose(vondrak(wave, epsilon)[inner], 0.5 * wave[inner], atol=1e-9)


def test_a_sample_without_weight_is_bridged() -> None:
    samples = waveform(4)
    weight = np.ones(LENGTH)
    weight[85] = 0
    spiked = samples.copy()
    spiked[85] = 1e6
    np.testing.assert_allclose(vondrak(spiked, 10, weight=weight), vondrak(samples, 10, weight=weight), rtol=1e-9)


def test_a_batch_is_its_waveforms_one_by_one() -> None:
    samples = np.stack([waveform(seed) for seed in range(6)]).reshape(2, 3, LENGTH)
    weight = np.random.default_rng(5).uniform(0.5, 2, samples.shape)
    smoothed = vondrak(samples, 10, weight=weight)
    assert smoothed.shape == samples.shape
    for index in np.ndindex(2, 3):
        np.testing.assert_allclose(smoothed[index], vondrak(samples[index], 10, weight=weight[index]), rtol=1e-13)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_waveforms_too_short_to_bend_stay(count: int) -> None:
    samples = np.array([5.0, 1.0, 9.0])[:count]
    np.testing.assert_array_equal(vondrak(samples, 0.1), samples)


@given(
    arrays(np.float64, st.integers(1, 40), elements=st.floats(-1e300, 1e300)),
    st.floats(0, allow_nan=False),
)
def test_any_finite_waveform_has_a_finite_answer_within_its_reach(samples: NDArray[np.float64], epsilon: float) -> None:
    with np.errstate(all="raise", under="ignore"):
        smoothed = vondrak(samples, epsilon)
    assert np.isfinite(smoothed).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"samples": [1, np.nan, 2, 3]}, "samples: found a value that is not finite"),
        ({"epsilon": -1.0}, "epsilon: found -1.0, expected 0 to infinity"),
        ({"epsilon": np.nan}, "epsilon: found nan"),
        ({"position": [0, 1, 1, 2]}, "position: found values that don't rise"),
        ({"position": [0, 1, 2]}, r"position: found shape \(3,\), expected \(4,\)"),
        ({"weight": [1, -1, 1, 1]}, "weight: found one below 0"),
        ({"weight": [1, 1, 0, 0]}, "weight: found less than three samples with one"),
        ({"weight": [[1, 1, 1, 1]]}, "weight: found shape"),
    ],
)
def test_bad_input_is_one_line(arguments: dict[str, object], message: str) -> None:
    given_ones: dict[str, object] = {"samples": [1.0, 2.0, 4.0, 3.0], "epsilon": 1.0, **arguments}
    with pytest.raises(ValueError, match=message):
        vondrak(**given_ones)  # type: ignore[arg-type]
