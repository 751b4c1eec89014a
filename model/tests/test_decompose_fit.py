"""The fit of echoes against the bound that no unbiased estimate can be below, and on arrays of any values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from openecho.decompose.fit import Fit, echo_sum, fit_echoes
from openecho.decompose.pulses import Pulse, gaussian, laser, measured, rough
from openecho.enhance.autoregression import continued

LENGTH = 256
X = np.arange(LENGTH)
WAVEFORMS = 3000
FIELDS = ("amplitude", "centre", "width")
CORRELATION = (1.0, 0.93, 0.74, 0.50, 0.27)
"""Of the noise of GEDI, at the first lags."""

FloatArray = NDArray[np.float64]

RECORDED = 300 * np.exp(-((X[:90] - 30) ** 2) / 32) + 90 * np.exp(-((X[:90] - 37) ** 2) / 72)
PULSES = {"gaussian": gaussian(), "laser": laser(), "rough": rough(3.0), "measured": measured(RECORDED)}


def clean(truth: FloatArray, baseline: float, pulse: Pulse) -> FloatArray:
    """Sums of echoes (n, k, 3) on a baseline."""
    owner = np.repeat(np.arange(len(truth)), truth.shape[1])
    amplitude, centre, width = truth.reshape(-1, 3).T
    return echo_sum(LENGTH, np.full(len(truth), baseline), owner, amplitude, centre, width, pulse)


def waveforms(
    truth: FloatArray, baseline: float, noise: float, seed: int, pulse: Pulse = PULSES["gaussian"]
) -> FloatArray:
    """Sums of echoes (n, k, 3) on a baseline, with white noise."""
    return clean(truth, baseline, pulse) + np.random.default_rng(seed).normal(0, noise, (len(truth), LENGTH))


def slopes(components: FloatArray, pulse: Pulse = PULSES["gaussian"]) -> FloatArray:
    """Derivatives by the baseline and amplitude, centre and width of each echo (k, 3): central differences."""
    delta = 1e-4
    rows = [np.ones(LENGTH)]
    for step in delta * np.eye(components.size).reshape(-1, *components.shape):
        more, less = clean(np.stack([components + step, components - step]), 0.0, pulse)
        rows.append((more - less) / (2 * delta))
    return np.stack(rows)


def bound(
    components: FloatArray,
    noise: float,
    pulse: Pulse = PULSES["gaussian"],
    covariance: FloatArray | None = None,
    widths: str = "free",
) -> FloatArray:
    """Cramér-Rao bound of each parameter, (k, 3), beside a baseline that is fitted, too.

    Root of the mean square over echoes `shifted` by parts of a bin: what of the laser template's beginning is seen
    depends on them.
    """
    size, squares = components.size + 1, []
    of_width = np.arange(3, size, 3)
    unknowns = np.eye(size)
    if widths != "free":
        together = unknowns[:, of_width].sum(axis=1)
        unknowns = np.delete(unknowns, of_width, axis=1)
        unknowns = np.column_stack([unknowns, together]) if widths == "shared" else unknowns
    for shift in np.linspace(-0.5, 0.5, 32, endpoint=False) + 1 / 64:
        jacobian = unknowns.T @ slopes(components + np.array([0, shift, 0]), pulse)
        whitened = jacobian.T if covariance is None else np.linalg.solve(covariance, jacobian.T)
        variance = unknowns @ np.linalg.inv(jacobian @ whitened) @ unknowns.T
        squares.append(np.diag(variance)[1:].reshape(-1, 3))
    return np.asarray(noise * np.sqrt(np.mean(squares, axis=0)))


def fitted(
    samples: FloatArray,
    start: FloatArray,
    noise: float | None = None,
    pulse: Pulse | None = None,
    widths: str = "free",
    width: float = 5.0,
    correlation: tuple[float, ...] = (1.0,),
) -> tuple[Fit, FloatArray, FloatArray]:
    """Fit from (n, k, 3) starting values; the fit, its values and its errors, (n, k, 3)."""
    count = len(samples)
    deviation = None if noise is None else np.full(count, noise)
    fit = fit_echoes(
        samples,
        np.full(count, LENGTH),
        np.full(count, start.shape[1]),
        start,
        noise=deviation,
        pulse=pulse,
        widths=widths,
        width=width,
        correlation=correlation,
    )
    values = np.stack([getattr(fit, name) for name in FIELDS], axis=1).reshape(start.shape)
    errors = np.stack([getattr(fit, f"{name}_error") for name in FIELDS], axis=1).reshape(start.shape)
    return fit, values, errors


def shifted(components: list[list[float]], seed: int) -> FloatArray:
    """These echoes (k, 3) in all waveforms, each waveform's moved by a part of a bin."""
    truth = np.tile(np.array(components), (WAVEFORMS, 1, 1))
    truth[:, :, 1] += np.random.default_rng(seed).uniform(-0.5, 0.5, (WAVEFORMS, 1))
    return truth


def rms(deviations: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((deviations**2).mean(axis=0)))


# The deviation of a standard deviation over n values is 1 / sqrt(2 n) of it, that of a variance sqrt(2 / n): five of
# these, so that one test in a million is wrong by chance.
DEVIATION = 5 / np.sqrt(2 * WAVEFORMS)
VARIANCE = 5 * np.sqrt(2 / WAVEFORMS)


@pytest.mark.parametrize("snr", [10, 30, 100, 1000])
def test_a_single_echo_comes_as_close_as_the_bound_with_true_errors(snr: float) -> None:
    truth = shifted([[snr, 128.0, 5.0]], int(snr))
    start = truth * [0.8, 1, 1.3] + [0, 1.5, 0]
    fit, values, errors = fitted(waveforms(truth, 20, 1, int(snr)), start, noise=1)
    assert fit.converged.all()
    np.testing.assert_allclose(rms(values - truth) / bound(np.array([[snr, 128.0, 5.0]]), 1), 1, atol=DEVIATION)
    np.testing.assert_allclose((((values - truth) / errors) ** 2).mean(axis=0), 1, atol=VARIANCE)


@pytest.mark.parametrize("separation", [1.5, 2.0, 2.35, 3.0, 6.0])
def test_two_overlapping_echoes_come_as_close_as_the_bound(separation: float) -> None:
    truth = shifted([[200.0, 128 - 2.5 * separation, 5.0], [200.0, 128 + 2.5 * separation, 5.0]], 0)
    start = truth * [[0.9, 1, 1.1], [1.1, 1, 0.9]] + [[0, -0.6, 0], [0, 0.7, 0]]
    fit, values, _ = fitted(waveforms(truth, 20, 1, 1), start)
    assert fit.converged.all()
    assert (rms(values - truth) / bound(truth[0], 1)).max() < 1 + DEVIATION


@pytest.mark.parametrize(("name", "width"), [("laser", 5.0), ("rough", 5.0), ("rough", 12.0), ("measured", 7.0)])
def test_echoes_of_any_shape_come_as_close_as_the_bound_with_true_errors(name: str, width: float) -> None:
    truth = shifted([[200.0, 100.0, width], [120.0, 100 + 3 * width, width + 1]], 2)
    start = truth * [0.9, 1, 1.1] + [0, 0.5, 0]
    fit, values, errors = fitted(waveforms(truth, 20, 1, 3, PULSES[name]), start, noise=1, pulse=PULSES[name])
    assert fit.converged.all()
    expected = bound(np.array([[200.0, 100.0, width], [120.0, 100 + 3 * width, width + 1]]), 1, PULSES[name])
    np.testing.assert_allclose(rms(values - truth) / expected, 1, atol=DEVIATION)
    np.testing.assert_allclose((((values - truth) / errors) ** 2).mean(axis=0), 1, atol=VARIANCE)


@pytest.mark.parametrize("name", ["gaussian", "laser"])
def test_a_width_that_echoes_share_is_one_and_known_as_well_as_its_bound(name: str) -> None:
    components = [[200.0, 90.0, 5.0], [60.0, 105.0, 5.0], [100.0, 117.0, 5.0]]
    truth = shifted(components, 4)
    start = truth * [[0.9, 1, 1.1], [1.1, 1, 0.9], [1.1, 1, 1.2]] + [0, 0.5, 0]
    fit, values, errors = fitted(
        waveforms(truth, 20, 1, 5, PULSES[name]), start, noise=1, pulse=PULSES[name], widths="shared"
    )
    assert fit.converged.all()
    assert (values[:, :, 2] == values[:, :1, 2]).all()
    assert (errors[:, :, 2] == errors[:, :1, 2]).all()
    expected = bound(np.array(components), 1, PULSES[name], widths="shared")
    assert (expected[:, 2] < bound(np.array(components), 1, PULSES[name])[:, 2]).all()
    np.testing.assert_allclose(rms(values - truth) / expected, 1, atol=DEVIATION)
    np.testing.assert_allclose((((values - truth) / errors) ** 2).mean(axis=0), 1, atol=VARIANCE)


@pytest.mark.parametrize(("name", "width"), [("gaussian", 5.0), ("gaussian", 7.3), ("laser", 3.0), ("rough", 6.1)])
def test_a_width_that_is_given_stays_and_has_no_error(name: str, width: float) -> None:
    components = [[200.0, 100.0, width], [150.0, 100 + 2.2 * width, width]]
    truth = shifted(components, 6)
    start = truth * [0.9, 1, 2] + [0, 0.1, 0]
    fit, values, errors = fitted(
        waveforms(truth, 20, 1, 7, PULSES[name]), start, noise=1, pulse=PULSES[name], widths="fixed", width=width
    )
    assert fit.converged.all()
    np.testing.assert_allclose(fit.width, width, rtol=4e-16)
    np.testing.assert_array_equal(fit.width_error, 0)
    deviations, expected = (
        (values - truth)[:, :, :2],
        bound(np.array(components), 1, PULSES[name], widths="fixed")[:, :2],
    )
    np.testing.assert_allclose(rms(deviations) / expected, 1, atol=DEVIATION)
    np.testing.assert_allclose(((deviations / errors[:, :, :2]) ** 2).mean(axis=0), 1, atol=VARIANCE)


@pytest.mark.parametrize("name", ["gaussian", "laser"])
def test_coloured_noise_is_fitted_as_well_as_its_bound_and_with_true_errors_only_if_its_colour_is_known(
    name: str,
) -> None:
    pulse = PULSES[name]
    components = np.array([[200.0, 100.0, 6.0], [100.0, 118.0, 6.0]])
    truth = shifted(components.tolist(), 8)
    covariance = toeplitz(continued(CORRELATION, LENGTH))
    white = np.random.default_rng(9).normal(0, 1, (WAVEFORMS, LENGTH))
    samples = clean(truth, 20, pulse) + white @ np.linalg.cholesky(covariance).T
    start = truth * [0.9, 1, 1.1] + [0, 0.5, 0]

    fit, values, errors = fitted(samples, start, noise=1, pulse=pulse, correlation=CORRELATION)
    assert fit.converged.all()
    best = bound(components, 1, pulse, covariance)
    np.testing.assert_allclose(rms(values - truth) / best, 1, atol=DEVIATION)
    np.testing.assert_allclose((((values - truth) / errors) ** 2).mean(axis=0), 1, atol=VARIANCE)

    # As if it were white, its covariance is (J' J)⁻¹ J' C J (J' J)⁻¹: errors are too small by that over (J' J)⁻¹.
    _, values, errors = fitted(samples, start, noise=1, pulse=pulse)
    jacobian = slopes(components, pulse)
    inverse = np.linalg.inv(jacobian @ jacobian.T)
    spread = np.diag(inverse @ jacobian @ covariance @ jacobian.T @ inverse)[1:].reshape(2, 3)
    factor = np.sqrt(spread / np.diag(inverse)[1:].reshape(2, 3))
    assert factor.min() > 2
    np.testing.assert_allclose(rms((values - truth) / errors) / factor, 1, atol=DEVIATION)
    assert (np.sqrt(spread) > best).all()


@pytest.mark.parametrize("widths", ["free", "shared"])
@pytest.mark.parametrize("colour", [(1.0,), CORRELATION], ids=["white", "coloured"])
def test_covariance_is_that_of_many_fits(widths: str, colour: tuple[float, ...]) -> None:
    truth = shifted([[200.0, 120.0, 5.0], [150.0, 131.0, 5.0]], 10)
    white = np.random.default_rng(11).normal(0, 1, (WAVEFORMS, LENGTH))
    noise = white @ np.linalg.cholesky(toeplitz(continued(colour, LENGTH))).T
    samples = clean(truth, 20, PULSES["gaussian"]) + noise
    fit, values, errors = fitted(samples, truth, noise=1, widths=widths, correlation=colour)
    expected = fit.covariance(7)
    assert expected.shape == (7, 7)
    np.testing.assert_allclose(expected, expected.T, rtol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(expected))[1:], errors[7].ravel(), rtol=1e-12)
    deviations = np.column_stack([fit.baseline - 20, (values - truth).reshape(WAVEFORMS, -1)])
    found = deviations.T @ deviations / WAVEFORMS
    # Wishart: the variance of an element over n values is (Cᵢᵢ Cⱼⱼ + Cᵢⱼ²) / n. The mean over all fits stands for one.
    mean = np.mean([fit.covariance(n) for n in range(WAVEFORMS)], axis=0)
    spread = np.sqrt((np.outer(np.diag(mean), np.diag(mean)) + mean**2) / WAVEFORMS)
    assert (np.abs(found - mean) < 5 * spread).all()


def test_covariance_of_what_is_given_or_not_determined_is_0() -> None:
    samples = waveforms(np.array([[[200.0, 80.0, 5.0]]]), 20, 1, 0)
    starts = [[180.0, 81.0, 4.0]], [[180.0, 81.0, 4.0], [0.0, 180.0, 5.0]]
    fit = fit_echoes(
        np.vstack([samples, samples, samples - 3 * np.exp(-((X - 180) ** 2) / 50)]),
        [LENGTH] * 3,
        [0, 1, 2],
        np.vstack(starts),
        widths="fixed",
    )
    assert [fit.covariance(n).shape for n in range(3)] == [(1, 1), (4, 4), (7, 7)]
    np.testing.assert_allclose(fit.covariance(0)[0, 0], fit.rms[0] ** 2 / (LENGTH - 1), rtol=1e-12)
    assert (np.diag(fit.covariance(1)) > 0).tolist() == [True, True, True, False]
    assert (np.diag(fit.covariance(2)) > 0).tolist() == [True, True, True, *[False] * 4]


def test_samples_without_weight_have_no_say() -> None:
    truth = shifted([[300.0, 128.0, 5.0]], 12)
    samples = np.minimum(waveforms(truth, 20, 1, 13), 180)
    fit = fit_echoes(
        samples, np.full(WAVEFORMS, LENGTH), np.ones(WAVEFORMS), truth, noise=np.ones(WAVEFORMS), weight=samples < 180
    )
    assert fit.converged.all()
    # Noise decides which samples are clipped, and so those just below are a little too low: a part of a deviation.
    for name, index in (("centre", 1), ("width", 2)):
        ratio = (getattr(fit, name) - truth[:, 0, index]) / getattr(fit, f"{name}_error")
        assert abs(ratio.mean()) < 0.5
        np.testing.assert_allclose(ratio.std(), 1, atol=0.1)
    assert abs(((fit.amplitude - 300) / fit.amplitude_error).mean()) < 0.5


def test_weights_are_inverse_variances() -> None:
    truth = shifted([[100.0, 128.0, 5.0]], 14)
    deviation = np.where(X < 128, 1.0, 3.0)
    samples = clean(truth, 20, PULSES["gaussian"])
    samples += deviation * np.random.default_rng(15).normal(0, 1, samples.shape)
    weight = np.tile(deviation**-2, (WAVEFORMS, 1))
    fit = fit_echoes(
        samples, np.full(WAVEFORMS, LENGTH), np.ones(WAVEFORMS), truth, noise=np.ones(WAVEFORMS), weight=weight
    )
    jacobian = slopes(truth.mean(axis=0)) / deviation
    expected = np.sqrt(np.diag(np.linalg.inv(jacobian @ jacobian.T)))[1:]
    found = np.stack([getattr(fit, name) for name in FIELDS], axis=1) - truth[:, 0]
    errors = np.stack([getattr(fit, f"{name}_error") for name in FIELDS], axis=1)
    np.testing.assert_allclose(rms(found) / expected, 1, atol=DEVIATION)
    np.testing.assert_allclose(((found / errors) ** 2).mean(axis=0), 1, atol=VARIANCE)


@pytest.mark.parametrize("name", PULSES)
def test_without_noise_the_values_are_exact(name: str) -> None:
    truth = np.array([[[50.0, 60.2, 5.0], [900.0, 110.7, 8.0], [20.0, 180.1, 6.0]]])
    fit, values, _ = fitted(waveforms(truth, 210, 0, 0, PULSES[name]), truth * [1.2, 1.005, 0.9], pulse=PULSES[name])
    np.testing.assert_allclose(values, truth, rtol=1e-9)
    np.testing.assert_allclose(fit.baseline, 210, rtol=1e-10)
    assert fit.rms[0] < 1e-6
    assert fit.converged.all()


def test_waveforms_of_any_length_and_count_are_fitted_each_by_itself() -> None:
    random = np.random.default_rng(2)
    counts, lengths = random.integers(0, 4, 40), random.integers(120, LENGTH, 40)
    start = np.column_stack(
        [random.uniform(50, 200, counts.sum()), random.uniform(20, 100, counts.sum()), np.full(counts.sum(), 4.0)]
    )
    samples = random.normal(10, 1, (40, LENGTH))
    samples += echo_sum(LENGTH, np.zeros(40), np.repeat(np.arange(40), counts), start[:, 0], start[:, 1], start[:, 2])
    together = fit_echoes(samples, lengths, counts, start)
    for row, components in enumerate(np.split(start, np.cumsum(counts)[:-1])):
        alone = fit_echoes(
            samples[row : row + 1, : lengths[row]], lengths[row : row + 1], [len(components)], components
        )
        picked = slice(counts[:row].sum(), counts[: row + 1].sum())
        np.testing.assert_allclose(alone.centre, together.centre[picked], rtol=1e-12)
        np.testing.assert_allclose(alone.rms, together.rms[row], rtol=1e-12)
        np.testing.assert_allclose(alone.covariance(0), together.covariance(row), rtol=1e-9, atol=1e-12)


def test_threads_change_nothing() -> None:
    truth = shifted([[100.0, 128.0, 5.0]], 16)[:300]
    samples = waveforms(truth, 20, 1, 17)
    all_at_once, values, errors = fitted(samples, truth)
    for part in range(0, 300, 50):
        _, some, some_errors = fitted(samples[part : part + 50], truth[part : part + 50])
        np.testing.assert_array_equal(some, values[part : part + 50])
        np.testing.assert_array_equal(some_errors, errors[part : part + 50])
    np.testing.assert_array_equal(all_at_once.count, 1)


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


@pytest.mark.filterwarnings("error")
@settings(max_examples=200, deadline=None)
@given(
    samples=arrays(np.float64, st.tuples(st.just(1), st.integers(0, 30)), elements=st.floats(-1e300, 1e300)),
    start=arrays(np.float64, st.tuples(st.integers(0, 3), st.just(3)), elements=st.floats(-1e300, 1e300)),
    name=st.sampled_from(sorted(PULSES)),
    widths=st.sampled_from(["free", "shared", "fixed"]),
    correlation=st.sampled_from([(1.0,), CORRELATION]),
    noise=st.none() | st.floats(0, 1e300),
)
def test_any_finite_arrays_have_an_answer(
    samples: FloatArray,
    start: FloatArray,
    name: str,
    widths: str,
    correlation: tuple[float, ...],
    noise: float | None,
) -> None:
    with np.errstate(all="raise", under="ignore"):
        fit = fit_echoes(
            samples,
            [samples.shape[1]],
            [len(start)],
            start,
            pulse=PULSES[name],
            widths=widths,
            correlation=correlation,
            noise=None if noise is None else [noise],
        )
    assert np.isfinite([*fit.amplitude, *fit.centre, *fit.width, *fit.baseline, *fit.rms]).all()
    assert (fit.amplitude >= 0).all()
    assert (fit.width > 0).all()
    errors = np.array([*fit.amplitude_error, *fit.centre_error, *fit.width_error])
    assert (errors >= 0).all()  # nan is not
    assert not np.isnan(fit.covariance(0)).any()
    assert (np.diag(fit.covariance(0)) >= 0).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"samples": [1.0, 2.0]}, "samples: found 1 dimensions, expected 2"),
        ({"samples": [[np.nan, 1, 2, 3]]}, "samples: found a value that is not finite or beyond 1e\\+300"),
        ({"start": [[1, np.inf, 1]]}, "start: found a value that is not finite"),
        ({"start": [[1, 2, 1], [1, 2, 1]]}, "start: found 2 echoes, expected 1, the sum of count"),
        ({"length": [5]}, "length: found one outside 0 to 4"),
        ({"count": [1, 1]}, r"count: found shape \(2,\), expected \(1,\)"),
        ({"count": [-1]}, "start: found 1 echoes, expected -1, the sum of count"),
        ({"widths": "equal"}, "widths: found 'equal', expected one of free, shared, fixed"),
        ({"width": 0.0}, "width: found 0.0, expected 0.333 to 100000 bins"),
        ({"width": 2.0, "widths": "fixed", "pulse": rough(3.0)}, "width: found 2.0, expected at least the pulse's, 3"),
        ({"correlation": [0.5, 1]}, "correlation: found one that is not 1 at lag 0"),
        ({"baseline": [1.0, 2.0]}, r"baseline: found shape \(2,\), expected \(1,\)"),
        ({"noise": [1.0, 2.0]}, r"noise: found shape \(2,\), expected \(1,\)"),
        ({"weight": [[1, 1, 1, -1]]}, "weight: found shape"),
        ({"weight": [[1, 1, 1]]}, r"weight: found shape \(1, 3\)"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_bad_input_is_one_line(arguments: dict[str, object], message: str) -> None:
    good: dict[str, object] = {
        "samples": [[1.0, 2.0, 4.0, 3.0]],
        "length": [4],
        "count": [1],
        "start": [[3.0, 2.0, 1.0]],
    }
    with pytest.raises(ValueError, match=f"^{message}") as caught:
        fit_echoes(**(good | arguments))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
