"""Moving average, Gaussian, homomorphic filter and accumulation on waveforms whose answer is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.special import digamma

from openecho.enhance import accumulate, gaussian, homomorphic, moving_average, snr_db

X = np.arange(256)


def echo(centre: float, sigma: float) -> NDArray[np.float64]:
    return np.asarray(100 * np.exp(-((X - centre) ** 2) / (2 * sigma**2)))


def test_moving_average_is_the_mean_of_its_window() -> None:
    samples = np.random.default_rng(0).integers(0, 2048, (3, 256))
    padded = np.pad(samples, ((0, 0), (3, 3)), mode="edge")
    expected = sum(padded[:, k : k + 256] for k in range(7)) / 7
    np.testing.assert_allclose(moving_average(samples, 7), expected, rtol=1e-12)


def test_gaussian_widens_an_echo_as_stated() -> None:
    smoothed = gaussian(echo(128.25, 5), 3)
    wide = np.hypot(5, 3)
    np.testing.assert_allclose(smoothed, echo(128.25, wide) * 5 / wide, atol=2e-6)


def test_homomorphic_halves_the_logarithm_at_its_period() -> None:
    # A whole number of periods that turns back at both ends, so that the cosine transform has one line.
    wave = np.cos(2 * np.pi * (X + 0.5) / 16)
    filtered = homomorphic(50 + np.exp(4 + 0.5 * wave), 16, baseline=50)
    np.testing.assert_allclose(np.log(filtered - 50), 4 + 0.25 * wave, rtol=1e-12)


def test_homomorphic_brings_speckle_to_its_stated_height() -> None:
    order, waveforms = 4, 400
    speckle = np.random.default_rng(1).gamma(order, 1 / order, (waveforms, 256))
    filtered = homomorphic(1000 * speckle, 1e6)
    level = 1000 * np.exp(digamma(order)) / order
    deviation = level * np.sqrt(1 / order + 1 / (2 * order**2)) / 16  # of the mean of 256 logarithms, to second order
    assert abs(filtered.mean() - level) < 5 * deviation / np.sqrt(waveforms) + 0.5 * deviation**2 / level


def test_homomorphic_takes_what_has_no_logarithm_as_the_floor() -> None:
    np.testing.assert_allclose(homomorphic([0.0, -5.0, 3.0, 2.0], 4, baseline=3, floor=0.5), 3.5, rtol=1e-12)


def test_accumulation_of_m_cycles_gains_m_times_the_power() -> None:
    cycles, groups = 8, 400
    signal = echo(128, 6)
    noise = np.random.default_rng(2).normal(0, 80, (groups * cycles, 256))
    accumulated = accumulate(signal + noise, cycles)
    gain = snr_db(accumulated, signal) - snr_db(signal + noise, signal)
    # Of both noise powers the relative deviation is √(2 / samples).
    spread = 10 / np.log(10) * np.sqrt(2 / accumulated.size + 2 / noise.size)
    assert abs(gain - 10 * np.log10(cycles)) < 4 * spread


def test_accumulation_leaves_out_an_incomplete_group_and_takes_huge_values() -> None:
    np.testing.assert_allclose(accumulate([[1.0, 4.0], [3.0, 8.0], [9.0, 9.0]], 2), [[2.0, 6.0]])
    np.testing.assert_allclose(accumulate([[1.5e308], [1.5e308]], 2), [[1.5e308]])


def test_snr_of_equal_powers_is_zero_db_and_without_noise_infinite() -> None:
    signal = echo(100, 4)
    assert snr_db(2 * signal, signal) == pytest.approx(0)
    assert snr_db(signal, signal) == np.inf


@pytest.mark.parametrize("smooth", [lambda x: moving_average(x, 5), lambda x: gaussian(x, 1.5)])
@given(samples=arrays(np.float64, st.integers(1, 40), elements=st.floats(-1e300, 1e300)))
def test_any_finite_waveform_stays_finite_and_as_long(smooth: Callable[[Any], Any], samples: NDArray[Any]) -> None:
    smoothed = smooth(samples)
    assert smoothed.shape == samples.shape
    assert np.isfinite(smoothed).all()


@given(samples=arrays(np.float64, st.integers(1, 40), elements=st.floats(0, 1e300)))
def test_homomorphic_of_any_waveform_stays_finite(samples: NDArray[Any]) -> None:
    assert np.isfinite(homomorphic(samples, 8)).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: moving_average([1.0], 4), "width: found 4, expected an odd number from 1"),
        (lambda: gaussian([1.0], 0), "sigma: found 0, expected a finite number above 0"),
        (lambda: gaussian([np.inf], 1), "samples: found a value that is not finite"),
        (lambda: homomorphic([1.0], -3), "period: found -3"),
        (lambda: homomorphic([1.0], 3, floor=0), "floor: found 0"),
        (lambda: homomorphic([1.0], 3, order=0), "order: found 0, expected 1 or more"),
        (lambda: accumulate([1.0, 2.0], 2), "samples: found 1 dimensions, expected 2"),
        (lambda: accumulate([[1.0]], 0), "cycles: found 0, expected 1 or more"),
        (lambda: snr_db([1.0], [0.0]), "signal: found none"),
    ],
)
def test_bad_input_is_one_line(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
