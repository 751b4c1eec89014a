"""How many echoes are found in waveforms that have so many, and that nothing is found where there is nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from openecho.decompose.gaussian import fit_gaussians
from openecho.decompose.peeling import find_gaussians

LENGTH = 256
X = np.arange(LENGTH)
WAVEFORMS = 1000
UNASKED = 0.005
"""Waveforms that may have a component too many: 256 places times the chance that χ² of 3 exceeds 5 ln 256 are 0.001."""

FloatArray = NDArray[np.float64]


def waveforms(components: list[tuple[float, float, float]], noise: float, seed: int) -> tuple[FloatArray, FloatArray]:
    """Waveforms of these Gaussians, shifted by parts of a bin, on a baseline; and their centres."""
    random = np.random.default_rng(seed)
    shift = random.uniform(-0.5, 0.5, (WAVEFORMS, 1))
    samples = 20 + random.normal(0, noise, (WAVEFORMS, LENGTH))
    for amplitude, centre, sigma in components:
        samples += amplitude * np.exp(-((X - centre - shift) ** 2) / (2 * sigma**2))
    return samples, shift + [centre for _, centre, _ in components]


def centre_bound(components: list[tuple[float, float, float]], noise: float) -> FloatArray:
    """Cramér-Rao bound of each centre."""
    slopes = [np.ones(LENGTH)]
    for amplitude, centre, sigma in components:
        z = (X - centre) / sigma
        height = np.exp(-(z**2) / 2)
        slopes += [height, amplitude * height * z / sigma, amplitude * height * z**2 / sigma]
    information = np.stack(slopes) @ np.stack(slopes).T
    return np.asarray(noise * np.sqrt(np.diag(np.linalg.inv(information))[2::3]))


def test_nothing_is_found_in_noise() -> None:
    samples, _ = waveforms([], 1, 0)
    count, start = find_gaussians(samples, np.full(WAVEFORMS, LENGTH), np.ones(WAVEFORMS))
    assert count.sum() == 0
    assert start.shape == (0, 3)


@pytest.mark.parametrize(
    "components",
    [
        [(200.0, 128 - 1.0 * 5, 5.0), (200.0, 128 + 1.0 * 5, 5.0)],  # 2 sigma apart: one maximum, a flat one
        [(200.0, 128 - 1.175 * 5, 5.0), (200.0, 128 + 1.175 * 5, 5.0)],
        [(200.0, 128 - 3.0 * 5, 5.0), (200.0, 128 + 3.0 * 5, 5.0)],
        [(400.0, 110.0, 5.0), (20.0, 130.0, 5.0)],  # 20 times as low
        [(100.0, 60.0, 3.0), (150.0, 90.0, 12.0), (60.0, 150.0, 4.0), (300.0, 200.0, 6.0)],
    ],
)
def test_every_echo_is_found_and_its_centre_comes_as_close_as_the_bound(
    components: list[tuple[float, float, float]],
) -> None:
    samples, centres = waveforms(components, 1, 1)
    length = np.full(WAVEFORMS, LENGTH)
    count, start = find_gaussians(samples, length, np.ones(WAVEFORMS))
    right = count == len(components)
    assert (count >= len(components)).all()
    assert right.mean() >= 1 - UNASKED
    fit = fit_gaussians(samples, length, count, start)
    found = fit.centre[np.repeat(right, count)].reshape(-1, len(components))
    error = np.sort(found, axis=1) - centres[right]
    ratio = np.sqrt((error**2).mean(axis=0)) / centre_bound(components, 1)
    assert ratio.max() < 1 + 5 / np.sqrt(2 * WAVEFORMS)


def test_no_more_are_found_than_asked_for() -> None:
    samples, _ = waveforms([(100.0, 60.0, 4.0), (300.0, 120.0, 4.0), (200.0, 180.0, 4.0)], 1, 2)
    count, start = find_gaussians(samples[:20], np.full(20, LENGTH), np.ones(20), most=2)
    np.testing.assert_array_equal(count, 2)
    assert (np.sort(start[:, 1].reshape(20, 2), axis=1) > 100).all()  # the two that are higher
    count, start = find_gaussians(samples[:20], np.full(20, LENGTH), np.ones(20), most=0)
    assert count.sum() == len(start) == 0


def test_samples_past_the_length_have_no_say() -> None:
    samples, _ = waveforms([(100.0, 60.0, 4.0), (300.0, 180.0, 4.0)], 1, 3)
    count, start = find_gaussians(samples[:20], np.full(20, 120), np.ones(20))
    np.testing.assert_array_equal(count, 1)
    np.testing.assert_allclose(start[:, 1], 60, atol=1)


@settings(max_examples=100, deadline=None)
@given(
    samples=arrays(np.float64, st.tuples(st.just(1), st.integers(0, 30)), elements=st.floats(-1e300, 1e300)),
    noise=st.floats(0, 1e300),
)
def test_any_finite_waveform_has_an_answer(samples: FloatArray, noise: float) -> None:
    with np.errstate(all="raise", under="ignore"):
        count, start = find_gaussians(samples, [samples.shape[1]], [noise], most=3)
    assert len(start) == count[0] <= 3
    assert np.isfinite(start).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"length": [5]}, "length: found one outside 0 to 4"),
        ({"length": [4, 4]}, r"length: found shape \(2,\), expected \(1,\)"),
        ({"noise": [-1.0]}, "noise: found one below 0"),
        ({"samples": [[1, np.inf, 2, 3]]}, "samples: found a value that is not finite"),
        ({"width": 0.0}, "width, least, most: found 0.0, 4.0, 16"),
    ],
)
def test_bad_input_is_one_line(arguments: dict[str, object], message: str) -> None:
    good: dict[str, object] = {"samples": [[1.0, 2.0, 4.0, 3.0]], "length": [4], "noise": [1.0]}
    with pytest.raises(ValueError, match=message):
        find_gaussians(**(good | arguments))  # type: ignore[arg-type]
