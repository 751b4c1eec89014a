"""The fit of Gaussians against the bound that no unbiased estimate can be below, and on arrays of any values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from openecho.decompose.gaussian import Fit, fit_gaussians

LENGTH = 256
X = np.arange(LENGTH)
WAVEFORMS = 3000
FIELDS = ("amplitude", "centre", "sigma")

FloatArray = NDArray[np.float64]


def waveforms(truth: FloatArray, baseline: float, noise: float, seed: int) -> FloatArray:
    """Sums of Gaussians (n, k, 3) on a baseline, with white noise."""
    amplitude, centre, sigma = (truth[:, :, i, None] for i in range(3))
    clean = (amplitude * np.exp(-((X - centre) ** 2) / (2 * sigma**2))).sum(axis=1) + baseline
    return np.asarray(clean + np.random.default_rng(seed).normal(0, noise, clean.shape))


def bound(components: FloatArray, noise: float) -> FloatArray:
    """Cramér-Rao bound of each parameter, (k, 3), beside a baseline that is fitted, too."""
    slopes = [np.ones(LENGTH)]
    for amplitude, centre, sigma in components:
        z = (X - centre) / sigma
        height = np.exp(-(z**2) / 2)
        slopes += [height, amplitude * height * z / sigma, amplitude * height * z**2 / sigma]
    information = np.stack(slopes) @ np.stack(slopes).T
    return np.asarray(noise * np.sqrt(np.diag(np.linalg.inv(information))[1:]).reshape(-1, 3))


def fitted(samples: FloatArray, start: FloatArray, noise: float | None = None) -> tuple[Fit, FloatArray, FloatArray]:
    """Fit from (n, k, 3) starting values; the fit, its values and its errors, (n, k, 3)."""
    count = len(samples)
    deviation = None if noise is None else np.full(count, noise)
    fit = fit_gaussians(samples, np.full(count, LENGTH), np.full(count, start.shape[1]), start, noise=deviation)
    values = np.stack([getattr(fit, name) for name in FIELDS], axis=1).reshape(start.shape)
    errors = np.stack([getattr(fit, f"{name}_error") for name in FIELDS], axis=1).reshape(start.shape)
    return fit, values, errors


@pytest.mark.parametrize("snr", [10, 30, 100, 1000])
def test_a_single_echo_comes_as_close_as_the_bound_with_true_errors(snr: float) -> None:
    random = np.random.default_rng(int(snr))
    truth = np.tile([snr, 128.0, 5.0], (WAVEFORMS, 1, 1))
    truth[:, :, 1] += random.uniform(-0.5, 0.5, (WAVEFORMS, 1))
    start = truth * [0.8, 1, 1.3] + [0, 1.5, 0]
    fit, values, errors = fitted(waveforms(truth, 20, 1, int(snr)), start, noise=1)
    assert fit.converged.all()
    # The deviation of a standard deviation over n values is 1 / sqrt(2 n) of it: 5 of these, and the bound's own bias.
    rms = np.sqrt(((values - truth) ** 2).mean(axis=0))
    np.testing.assert_allclose(rms / bound(np.array([[snr, 128.0, 5.0]]), 1), 1, atol=5 / np.sqrt(2 * WAVEFORMS))
    np.testing.assert_allclose((((values - truth) / errors) ** 2).mean(axis=0), 1, atol=5 * np.sqrt(2 / WAVEFORMS))


@pytest.mark.parametrize("separation", [1.5, 2.0, 2.35, 3.0, 6.0])
def test_two_overlapping_echoes_come_as_close_as_the_bound(separation: float) -> None:
    random = np.random.default_rng(0)
    truth = np.tile([[200.0, 128 - 2.5 * separation, 5.0], [200.0, 128 + 2.5 * separation, 5.0]], (WAVEFORMS, 1, 1))
    truth[:, :, 1] += random.uniform(-0.5, 0.5, (WAVEFORMS, 1))
    start = truth * [[0.9, 1, 1.1], [1.1, 1, 0.9]] + [[0, -0.6, 0], [0, 0.7, 0]]
    fit, values, _ = fitted(waveforms(truth, 20, 1, 1), start)
    assert fit.converged.all()
    ratio = np.sqrt(((values - truth) ** 2).mean(axis=0)) / bound(truth[0], 1)
    assert ratio.max() < 1 + 5 / np.sqrt(2 * WAVEFORMS)


def test_without_noise_the_values_are_exact() -> None:
    truth = np.array([[[50.0, 60.2, 3.0], [900.0, 120.7, 8.0], [20.0, 180.1, 2.0]]])
    fit, values, _ = fitted(waveforms(truth, 210, 0, 0), truth * [1.2, 1.005, 0.9])
    np.testing.assert_allclose(values, truth, rtol=1e-9)
    np.testing.assert_allclose(fit.baseline, 210, rtol=1e-10)
    assert fit.rms[0] < 1e-6


def test_waveforms_of_any_length_and_count_are_fitted_each_by_itself() -> None:
    random = np.random.default_rng(2)
    counts, lengths = random.integers(0, 4, 40), random.integers(120, LENGTH, 40)
    start = np.column_stack(
        [random.uniform(50, 200, counts.sum()), random.uniform(20, 100, counts.sum()), np.full(counts.sum(), 4.0)]
    )
    samples = random.normal(10, 1, (40, LENGTH))
    each = np.split(start, np.cumsum(counts)[:-1])
    for row, components in enumerate(each):
        for amplitude, centre, sigma in components:
            samples[row] += amplitude * np.exp(-((X - centre) ** 2) / (2 * sigma**2))
    together = fit_gaussians(samples, lengths, counts, start)
    for row, components in enumerate(each):
        alone = fit_gaussians(
            samples[row : row + 1, : lengths[row]], lengths[row : row + 1], [len(components)], components
        )
        picked = slice(counts[:row].sum(), counts[: row + 1].sum())
        np.testing.assert_allclose(alone.centre, together.centre[picked], rtol=1e-12)
        np.testing.assert_allclose(alone.rms, together.rms[row], rtol=1e-12)


def test_a_component_that_is_not_there_gets_no_negative_amplitude() -> None:
    truth = np.array([[[200.0, 80.0, 5.0]]])
    start = np.array([[[180.0, 81.0, 4.0], [50.0, 180.0, 5.0]]])
    samples = waveforms(truth, 20, 0, 0) - 3 * np.exp(-((X - 180) ** 2) / 50)
    _, values, errors = fitted(samples, start)
    np.testing.assert_allclose(values[0, 0], truth[0, 0], rtol=0.01)
    assert values[0, 1, 0] == 0
    assert errors[0, 1, 0] == 0
    assert (errors[0, 1, 1:] == np.inf).all()
    assert np.isfinite(errors[0, 0]).all()


@settings(max_examples=200, deadline=None)
@given(
    samples=arrays(np.float64, st.tuples(st.just(1), st.integers(0, 30)), elements=st.floats(-1e300, 1e300)),
    start=arrays(np.float64, st.tuples(st.integers(0, 3), st.just(3)), elements=st.floats(-1e300, 1e300)),
)
def test_any_finite_arrays_have_an_answer(samples: FloatArray, start: FloatArray) -> None:
    with np.errstate(all="raise", under="ignore"):
        fit = fit_gaussians(samples, [samples.shape[1]], [len(start)], start)
    assert np.isfinite([*fit.amplitude, *fit.centre, *fit.sigma, *fit.baseline, *fit.rms]).all()
    assert (fit.amplitude >= 0).all()
    assert (fit.sigma > 0).all()
    assert not np.isnan([*fit.amplitude_error, *fit.centre_error, *fit.sigma_error]).any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"samples": [1.0, 2.0]}, "samples: found 1 dimensions, expected 2"),
        ({"samples": [[np.nan, 1, 2, 3]]}, "samples: found a value that is not finite or beyond 1e\\+300"),
        ({"start": [[1, np.inf, 1]]}, "start: found a value that is not finite"),
        ({"start": [[1, 2, 1], [1, 2, 1]]}, "start: found 2 components, expected 1, the sum of count"),
        ({"length": [5]}, "length: found one outside 0 to 4"),
        ({"count": [1, 1]}, r"count: found shape \(2,\), expected \(1,\)"),
    ],
)
def test_bad_input_is_one_line(arguments: dict[str, object], message: str) -> None:
    good: dict[str, object] = {
        "samples": [[1.0, 2.0, 4.0, 3.0]],
        "length": [4],
        "count": [1],
        "start": [[3.0, 2.0, 1.0]],
    }
    with pytest.raises(ValueError, match=message):
        fit_gaussians(**(good | arguments))  # type: ignore[arg-type]
