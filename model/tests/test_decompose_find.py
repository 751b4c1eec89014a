"""How many echoes are found in waveforms that have so many, and that nothing is found where there is nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.ndimage import gaussian_filter1d

from openecho.decompose.choices import CRITERIA, STARTS, WIDTHS
from openecho.decompose.find import find_echoes
from openecho.decompose.fit import echo_sum, fit_echoes
from openecho.decompose.pulses import gaussian, laser, rough
from openecho.enhance.autoregression import continued

LENGTH = 256
X = np.arange(LENGTH)
WAVEFORMS = 1000
LENGTHS = np.full(WAVEFORMS, LENGTH)
ONES = np.ones(WAVEFORMS)
UNASKED = 0.005
"""Waveforms that may have an echo too many: 256 places times the chance that χ² of 3 exceeds 5 ln 256 are 0.001."""
CORRELATION = (1.0, 0.93, 0.74, 0.50, 0.27)
"""Of the noise of GEDI, at the first lags."""

FloatArray = NDArray[np.float64]
Echo = tuple[float, float, float]

PULSES = {"gaussian": gaussian(), "laser": laser(), "rough": rough(4.0)}


def waveforms(components: list[Echo], noise: float, seed: int, name: str = "gaussian") -> tuple[FloatArray, FloatArray]:
    """Waveforms of these echoes, shifted by parts of a bin, on a baseline; and their centres."""
    random = np.random.default_rng(seed)
    shift = random.uniform(-0.5, 0.5, (WAVEFORMS, 1))
    samples = 20 + random.normal(0, noise, (WAVEFORMS, LENGTH))
    for amplitude, centre, width in components:
        places = centre + shift[:, 0]
        one = np.arange(WAVEFORMS)
        samples += echo_sum(LENGTH, 0 * ONES, one, amplitude * ONES, places, width * ONES, PULSES[name])
    return samples, shift + [centre for _, centre, _ in components]


def centre_bound(components: list[Echo], noise: float) -> FloatArray:
    """Cramér-Rao bound of each centre, of Gaussians."""
    slopes = [np.ones(LENGTH)]
    for amplitude, centre, sigma in components:
        z = (X - centre) / sigma
        height = np.exp(-(z**2) / 2)
        slopes += [height, amplitude * height * z / sigma, amplitude * height * z**2 / sigma]
    information = np.stack(slopes) @ np.stack(slopes).T
    return np.asarray(noise * np.sqrt(np.diag(np.linalg.inv(information))[2::3]))


def apart(separation: float) -> list[Echo]:
    """Two equal echoes so many widths apart."""
    return [(200.0, 128 - 2.5 * separation, 5.0), (200.0, 128 + 2.5 * separation, 5.0)]


FIVE = [(100.0, 60.0, 3.0), (150.0, 90.0, 12.0), (60.0, 150.0, 4.0), (300.0, 200.0, 6.0)]


def test_nothing_is_found_in_noise() -> None:
    samples, _ = waveforms([], 1, 0)
    count, start, baseline = find_echoes(samples, LENGTHS, ONES)
    assert count.sum() == 0
    assert start.shape == (0, 3)
    # A fit ends where a step gains less than 1e-9 of the sum of squares.
    np.testing.assert_allclose(baseline, samples.mean(axis=1), atol=1e-9**0.5)


@pytest.mark.parametrize(
    "components",
    [
        apart(1.25),  # one maximum, and one minimum of the curvature
        apart(1.5),
        apart(2.0),  # one maximum, a flat one
        apart(2.35),
        apart(6.0),
        [(400.0, 110.0, 5.0), (20.0, 130.0, 5.0)],  # 20 times as low
        FIVE,
    ],
    ids=["1.25", "1.5", "2", "2.35", "6", "low", "four"],
)
@pytest.mark.parametrize("start", STARTS)
def test_every_echo_is_found_and_its_centre_comes_as_close_as_the_bound(components: list[Echo], start: str) -> None:
    samples, centres = waveforms(components, 1, 1)
    count, first, baseline = find_echoes(samples, LENGTHS, ONES, start=start)
    right = count == len(components)
    assert (count >= len(components)).all()
    assert right.mean() >= 1 - UNASKED
    fit = fit_echoes(samples, LENGTHS, count, first, baseline=baseline)
    found = fit.centre[np.repeat(right, count)].reshape(-1, len(components))
    error = np.sort(found, axis=1) - centres[right]
    # The deviation of a standard deviation over n values is 1 / sqrt(2 n) of it: 5 of these.
    ratio = np.sqrt((error**2).mean(axis=0)) / centre_bound(components, 1)
    assert ratio.max() < 1 + 5 / np.sqrt(2 * WAVEFORMS)


@pytest.mark.parametrize("name", ["laser", "rough"])
def test_echoes_of_other_shapes_are_found_with_these_shapes(name: str) -> None:
    samples, centres = waveforms([(200.0, 90.0, 6.0), (100.0, 108.0, 6.0), (150.0, 180.0, 9.0)], 1, 2, name)
    count, first, baseline = find_echoes(samples, LENGTHS, ONES, pulse=PULSES[name], width=6.0)
    right = count == 3
    assert (count >= 3).all()
    assert right.mean() >= 1 - UNASKED
    fit = fit_echoes(samples, LENGTHS, count, first, baseline=baseline, pulse=PULSES[name])
    found = np.sort(fit.centre[np.repeat(right, count)].reshape(-1, 3), axis=1) - centres[right]
    error = fit.centre_error[np.repeat(right, count)].reshape(-1, 3)
    assert np.abs(found).max() < 6 * error.max()
    # The mean is what a wrong shape would move.
    assert (np.abs(found.mean(axis=0)) < 5 * found.std(axis=0) / np.sqrt(right.sum())).all()


def test_echoes_a_width_apart_are_mostly_two_and_all_if_their_width_is_known() -> None:
    samples, _ = waveforms(apart(1.0), 1, 1)
    counts = {mode: find_echoes(samples, LENGTHS, ONES, widths=mode)[0] for mode in WIDTHS}
    for count in counts.values():
        assert (count >= 1).all()
        assert (count > 2).mean() <= 2 * UNASKED
    assert (counts["free"] == 2).mean() > 0.95
    assert (counts["shared"] == 2).mean() > 0.95
    assert (counts["fixed"] == 2).mean() >= 1 - UNASKED


@pytest.mark.parametrize("criterion", ["bic", "aic"])
@pytest.mark.parametrize("components", [[], apart(1.0), FIVE], ids=["none", "two", "four"])
def test_a_criterion_that_asks_for_less_finds_no_less(criterion: str, components: list[Echo]) -> None:
    samples, _ = waveforms(components, 1, 3)
    strict, _, _ = find_echoes(samples, LENGTHS, ONES, least=2.0)
    count, _, _ = find_echoes(samples, LENGTHS, ONES, least=2.0, criterion=criterion)
    assert (count >= strict).all()
    assert count.sum() > strict.sum()


def test_no_more_are_found_than_asked_for_and_the_highest_stay() -> None:
    samples, _ = waveforms([(100.0, 60.0, 4.0), (300.0, 120.0, 4.0), (200.0, 180.0, 4.0)], 1, 2)
    count, first, _ = find_echoes(samples[:20], LENGTHS[:20], ONES[:20], most=2)
    np.testing.assert_array_equal(count, 2)
    np.testing.assert_allclose(first[:, 1].reshape(20, 2), [[120, 180]] * 20, atol=1)
    count, first, _ = find_echoes(samples[:20], LENGTHS[:20], ONES[:20], most=0)
    assert count.sum() == len(first) == 0


def test_each_waveform_may_have_its_own_greatest_number() -> None:
    samples, _ = waveforms([(100.0, 60.0, 4.0), (300.0, 120.0, 4.0), (200.0, 180.0, 4.0)], 1, 2)
    most = np.arange(20) % 5
    count, first, _ = find_echoes(samples[:20], LENGTHS[:20], ONES[:20], most=most)
    np.testing.assert_array_equal(count, np.minimum(most, 3))
    assert len(first) == count.sum()
    for one, places in zip(count, np.split(first[:, 1], np.cumsum(count)[:-1]), strict=True):
        np.testing.assert_allclose(np.sort(places), sorted([120.0, 180.0, 60.0][:one]), atol=1)


def coloured(seed: int) -> FloatArray:
    """Waveforms of nothing but noise with `CORRELATION`."""
    white = np.random.default_rng(seed).normal(0, 1, (WAVEFORMS, LENGTH))
    return np.asarray(20 + white @ np.linalg.cholesky(toeplitz(continued(CORRELATION, LENGTH))).T)


def test_nothing_is_found_in_coloured_noise_if_its_correlation_is_known() -> None:
    samples = coloured(4)
    count, _, _ = find_echoes(samples, LENGTHS, ONES, correlation=CORRELATION)
    assert (count > 0).mean() <= UNASKED
    count, _, _ = find_echoes(samples, LENGTHS, ONES)
    assert (count > 0).mean() > 0.5


def test_echoes_in_coloured_noise_are_found_if_its_correlation_is_known() -> None:
    echoes, centres = waveforms([(100.0, 100.0, 6.0), (60.0, 118.0, 6.0)], 0, 5)
    samples = echoes + coloured(6) - 20
    count, first, baseline = find_echoes(samples, LENGTHS, ONES, correlation=CORRELATION, width=6.0)
    right = count == 2
    assert (count >= 2).all()
    assert right.mean() >= 1 - UNASKED
    fit = fit_echoes(samples, LENGTHS, count, first, baseline=baseline, correlation=CORRELATION, noise=ONES)
    ratio = (fit.centre - centres.ravel())[np.repeat(right, 2)] / fit.centre_error[np.repeat(right, 2)]
    np.testing.assert_allclose((ratio**2).mean(), 1, atol=5 * np.sqrt(2 / len(ratio)))


def test_the_first_guess_is_taken_from_a_guide_and_all_else_from_the_waveform() -> None:
    samples, centres = waveforms([(20.0, 90.0, 5.0), (15.0, 150.0, 5.0)], 2, 7)
    guide = gaussian_filter1d(samples, 3.0, axis=1)
    count, first, baseline = find_echoes(samples, LENGTHS, 2 * ONES, smoothed=guide)
    assert (count == 2).mean() >= 1 - UNASKED
    plain, _, _ = find_echoes(samples, LENGTHS, 2 * ONES)
    assert (count == plain).mean() >= 1 - UNASKED
    right = count == 2
    fit = fit_echoes(samples, LENGTHS, count, first, baseline=baseline)
    error = np.sort(fit.centre[np.repeat(right, 2)].reshape(-1, 2), axis=1) - centres[right]
    ratio = np.sqrt((error**2).mean(axis=0)) / centre_bound([(20.0, 90.0, 5.0), (15.0, 150.0, 5.0)], 2)
    # At 7.5 deviations of the noise the bound's own bias shows: of second order in centre error over width, 2 %.
    assert ratio.max() < 1.03 + 5 / np.sqrt(2 * WAVEFORMS)
    # A guide that shows nothing: echoes are added one by one, as if there were no guess.
    blind, places, _ = find_echoes(samples, LENGTHS, 2 * ONES, smoothed=0 * samples)
    none, others, _ = find_echoes(samples, LENGTHS, 2 * ONES, start="none")
    np.testing.assert_array_equal(blind, none)
    np.testing.assert_allclose(places, others, rtol=1e-6)  # from another baseline


def test_clipped_samples_have_no_say() -> None:
    samples, _ = waveforms([(400.0, 100.0, 6.0), (200.0, 140.0, 6.0)], 1, 8)
    clipped = np.minimum(samples, 250)
    count, first, _ = find_echoes(clipped, LENGTHS, ONES, width=6.0, weight=clipped < 250)
    assert (count == 2).mean() >= 1 - UNASKED
    np.testing.assert_allclose(first[np.repeat(count == 2, count), 0].reshape(-1, 2).max(axis=1), 400, rtol=0.05)
    more, _, _ = find_echoes(clipped, LENGTHS, ONES, width=6.0)
    assert (more > 2).all()


def test_samples_past_the_length_have_no_say() -> None:
    samples, _ = waveforms([(100.0, 60.0, 4.0), (300.0, 180.0, 4.0)], 1, 3)
    count, first, _ = find_echoes(samples[:20], np.full(20, 120), ONES[:20])
    np.testing.assert_array_equal(count, 1)
    np.testing.assert_allclose(first[:, 1], 60, atol=1)


def test_an_echo_of_one_sample_is_no_echo_of_no_width() -> None:
    # Its inflections fall together: all of the curvature is below 0 in one place.
    count, first, _ = find_echoes([[3, 3, 3, 1023, 3, 3]], [6], [3.5], width=1 / 3, widths="fixed", least=0.0)
    np.testing.assert_array_equal(count, 1)
    np.testing.assert_allclose(first[0, 1], 3, atol=0.01)


@pytest.mark.filterwarnings("error")
@settings(max_examples=200, deadline=None)
@given(
    samples=arrays(np.float64, st.tuples(st.just(1), st.integers(0, 30)), elements=st.floats(-1e300, 1e300))
    | arrays(np.float64, st.tuples(st.just(1), st.integers(0, 60)), elements=st.integers(0, 9)),
    noise=st.floats(0, 1e300),
    options=st.fixed_dictionaries(
        {
            "pulse": st.sampled_from(list(PULSES.values())),
            "correlation": st.sampled_from([(1.0,), CORRELATION]),
            "width": st.floats(4.0, 60.0),
            "widths": st.sampled_from(WIDTHS),
            "least": st.floats(0, 1e300),
            "criterion": st.sampled_from(sorted(CRITERIA)),
            "start": st.sampled_from(STARTS),
        }
    ),
)
def test_any_finite_waveform_has_an_answer(samples: FloatArray, noise: float, options: dict[str, Any]) -> None:
    with np.errstate(all="raise", under="ignore"):
        count, first, baseline = find_echoes(samples, [samples.shape[1]], [noise], most=3, **options)
    assert len(first) == count[0] <= 3
    assert np.isfinite(first).all()
    assert np.isfinite(baseline).all()
    assert (first[:, 0] >= 0).all()
    assert (first[:, 2] > 0).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"length": [5]}, "length: found one outside 0 to 4"),
        ({"length": [4, 4]}, r"length: found shape \(2,\), expected \(1,\)"),
        ({"noise": [-1.0]}, "noise: found one below 0"),
        ({"noise": [np.nan]}, "noise: found one below 0"),
        ({"noise": 1.0}, r"noise: found shape \(\), expected \(1,\)"),
        ({"samples": [[1, np.inf, 2, 3]]}, "samples: found a value that is not finite"),
        ({"width": 0.0}, "width, least, most: found 0.0, 4.0, 16"),
        ({"least": -1.0}, "width, least, most: found 5.0, -1.0, 16"),
        ({"most": -1}, "width, least, most: found 5.0, 4.0, -1"),
        ({"criterion": "best"}, "criterion: found 'best', expected one of ebic, bic, aic"),
        ({"start": "guess"}, "start: found 'guess', expected one of inflection, maxima, none"),
        ({"widths": "equal"}, "widths: found 'equal', expected one of free, shared, fixed"),
        ({"smoothed": [[1.0, 2.0]]}, r"smoothed: found shape \(1, 2\)"),
        ({"smoothed": [[1.0, 2.0, np.nan, 3.0]]}, "smoothed: found shape"),
        ({"weight": [[1, 1]]}, r"weight: found shape \(1, 2\)"),
        ({"correlation": [1.0, 2.0]}, "correlation: found one that is not 1 at lag 0"),
    ],
    ids=str,
)
def test_bad_input_is_one_line(arguments: dict[str, object], message: str) -> None:
    good: dict[str, object] = {"samples": [[1.0, 2.0, 4.0, 3.0]], "length": [4], "noise": [1.0]}
    with pytest.raises(ValueError, match=f"^{message}") as caught:
        find_echoes(**(good | arguments))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
