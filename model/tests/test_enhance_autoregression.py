"""Autoregressive continuation and whitening against closed forms and dense matrices."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from openecho.enhance import whitening
from openecho.enhance.autoregression import RIDGE, continued

GEDI = (1, 0.93, 0.74, 0.50, 0.27)
"""Figures of GEDI's noise, rounded so that no noise has them."""


def drawn(order: int, seed: int) -> NDArray[np.float64]:
    """Autocorrelation at lags 0 … order of an autoregression; reflections below 0.8 keep it stable."""
    print(f"seed {seed}")
    predictor, power, rho = np.ones(1), 1.0, [1.0]
    for reflection in np.random.default_rng(seed).uniform(-0.8, 0.8, order):
        rho.append(-reflection * power - predictor[1:] @ rho[:0:-1])
        predictor = np.append(predictor, 0) + reflection * np.append(0, predictor[::-1])
        power *= 1 - reflection**2
    return np.array(rho)


def whitened(filters: NDArray[np.float64], samples: NDArray[np.float64]) -> NDArray[np.float64]:
    order = len(filters) - 1
    used = [min(t, order) for t in range(len(samples))]
    return np.array([filters[k, : k + 1] @ samples[t - k : t + 1][::-1] for t, k in enumerate(used)])


def test_autoregression_of_first_order_goes_on_as_a_geometric_series() -> None:
    np.testing.assert_allclose(continued([1, -0.9], 60), (-0.9) ** np.arange(60), rtol=1e-12)


def test_autoregression_of_second_order_goes_on_as_a_damped_cosine() -> None:
    radius, angle, k = 0.9, 0.7, np.arange(80)
    phase = np.arctan((1 - radius**2) / (1 + radius**2) / np.tan(angle))
    expected = radius**k * np.cos(k * angle - phase) / np.cos(phase)
    np.testing.assert_allclose(continued(expected[:3], 80), expected, atol=1e-12)


@pytest.mark.parametrize("size", [0, 1, 3, 4])
def test_known_lags_stay(size: int) -> None:
    rho = drawn(3, seed=0)
    np.testing.assert_array_equal(continued(rho, size), rho[:size])


@pytest.mark.parametrize("order", range(9))
def test_whitening_is_the_inverse_of_the_cholesky_factor(order: int) -> None:
    rho = drawn(order, seed=order)
    covariance = linalg.toeplitz(continued(rho, 100))
    samples = np.random.default_rng(order).standard_normal(100)
    expected = linalg.solve_triangular(linalg.cholesky(covariance, lower=True), samples, lower=True)
    found = whitened(whitening(rho), samples)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_first_rows_are_the_lower_orders() -> None:
    rho = drawn(6, seed=7)
    filters = whitening(rho)
    np.testing.assert_array_equal(filters[0], [1, 0, 0, 0, 0, 0, 0])
    for order in range(1, 7):
        np.testing.assert_allclose(filters[: order + 1, : order + 1], whitening(rho[: order + 1]), rtol=1e-15)


def test_noise_without_memory_stays() -> None:
    np.testing.assert_array_equal(continued([1.0], 4), [1, 0, 0, 0])
    np.testing.assert_array_equal(whitening([1.0]), [[1]])
    np.testing.assert_array_equal(whitening([1.0, 0, 0]), np.eye(3)[[0, 0, 0]])


@pytest.mark.parametrize("rho", [GEDI, (1, 1, 1), (1, 0.9, 0), (1, -1)])
def test_figures_that_no_noise_has_get_the_least_white_noise(rho: tuple[float, ...]) -> None:
    least = linalg.eigvalsh(linalg.toeplitz(rho))[0]
    assert least < RIDGE
    nearest = continued(rho, len(rho))
    np.testing.assert_allclose(nearest[1:] * (1 + RIDGE - least), rho[1:], rtol=1e-14)
    assert np.abs(continued(rho, 1000)).max() == 1
    # From W Σ Wᵀ = 1: a row of W is no longer than 1/√λ.
    assert np.linalg.norm(whitening(rho), axis=1).max() <= 1 / np.sqrt(linalg.eigvalsh(linalg.toeplitz(nearest))[0])


@pytest.mark.parametrize(
    ("correlation", "found"),
    [
        ([], "correlation: found shape (0,), expected (lags + 1,)"),
        ([[1.0]], "correlation: found shape (1, 1), expected (lags + 1,)"),
        ([0.9, 0.1], "correlation: found one that is not 1 at lag 0 and -1 to 1 elsewhere, expected such"),
        ([1, 1.5], "correlation: found one that is not 1 at lag 0 and -1 to 1 elsewhere, expected such"),
        ([1, np.nan], "correlation: found one that is not 1 at lag 0 and -1 to 1 elsewhere, expected such"),
    ],
)
def test_a_wrong_autocorrelation_is_one_line(correlation: ArrayLike, found: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(found)}$"):
        continued(correlation, 5)
    with pytest.raises(ValueError, match=f"^{re.escape(found)}$"):
        whitening(correlation)


def test_a_negative_size_is_one_line() -> None:
    with pytest.raises(ValueError, match=r"^size: found -1, expected 0 or more$"):
        continued([1.0], -1)
