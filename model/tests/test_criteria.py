"""How well echoes explain a waveform: the sum of their Gaussians, and its distance from the samples."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray

from openecho.decompose import criteria


def made(count: int, rows: int, m: int, seed: int) -> dict[str, NDArray[np.float64]]:
    """Echoes anywhere, also outside the samples."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    return {
        "waveform": np.sort(rng.integers(0, rows, count)),
        "peak": rng.uniform(-20, m + 20, count),
        "amplitude": rng.uniform(5, 2000, count),
        "width": rng.uniform(0.1, 40, count),
        "corrected_width": rng.uniform(0.1, 40, count),
    }


def dense(echoes: dict[str, NDArray[np.float64]], noise_mean: NDArray[np.float64], m: int) -> NDArray[np.float64]:
    """The sum with every component at every sample."""
    total = np.tile(noise_mean[:, None], (1, m))
    for row, peak, height, sigma in zip(
        *(echoes[name] for name in ("waveform", "peak", "amplitude", "corrected_width")), strict=True
    ):
        total[row] += height * np.exp(-(((np.arange(m) - peak) / sigma) ** 2) / 2)
    return total


@pytest.mark.parametrize("added", [7, 2**18])
def test_fitted_is_the_sum_of_all_components_at_all_samples(added: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(criteria, "ADDED", added)
    echoes, noise_mean = made(200, 30, 150, seed=1), np.arange(30.0)
    found = criteria.fitted(echoes, noise_mean, 150)
    assert found.shape == (30, 150)
    assert abs(found - dense(echoes, noise_mean, 150)).max() < 1e-11


def test_fitted_without_echoes_is_the_noise_mean() -> None:
    found = criteria.fitted(made(0, 1, 5, seed=2), np.array([3.0, 4.5]), 5)
    np.testing.assert_array_equal(found, [[3.0] * 5, [4.5] * 5])


def test_memory_follows_the_samples_and_not_the_echoes() -> None:
    echoes = made(20_000, 400, 1310, seed=3)
    tracemalloc.start()
    criteria.fitted(echoes, np.zeros(400), 1310)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40e6, "20,000 echoes at 1310 samples are 210 MB"


def test_a_width_that_could_not_be_corrected_is_taken_as_it_is() -> None:
    echoes = {"width": np.array([4.0, 6.0, 5.0]), "corrected_width": np.array([0.0, 3.5, 0.0])}
    np.testing.assert_array_equal(criteria.component_width(echoes), [4.0, 3.5, 5.0])


def test_rmse_is_the_distance_from_the_sum_of_the_echoes() -> None:
    x = np.arange(120)
    centre, width, amplitude = (
        np.array([[30.25], [70.5], [50.0]]),
        np.array([[4.0], [9.0], [6.0]]),
        np.full((3, 1), 90.0),
    )
    wanted = 7 + amplitude * np.exp(-(((x - centre) / width) ** 2) / 2)
    samples = np.stack([wanted[0] + wanted[1] - 7, wanted[2] + 3 * (-1.0) ** x, np.full(120, 11.0)])
    samples[1, 100:] = 2000
    echoes = {"waveform": np.array([0, 0, 1]), "amplitude": amplitude[:, 0]}
    fitted = criteria.fitted(echoes, np.full(3, 7.0), 120, centre[:, 0], width[:, 0])
    assert criteria.rmse(samples, np.array([120, 100, 120]), fitted) == pytest.approx([0, 3, 4], abs=1e-12)


def test_rmse_of_unsigned_counts_below_the_fit_does_not_wrap() -> None:
    assert criteria.rmse(np.array([[2, 2]], np.uint16), np.array([2]), np.array([[5.0, 6.0]])) == math.sqrt(12.5)


def test_r_squared_is_the_share_of_the_variance_that_is_explained() -> None:
    samples = np.array([[1, 3, 5, 7, 900]] * 4, np.uint16)
    fitted = np.array([[1, 3, 5, 7, 0], [4, 4, 4, 4, 0], [2, 4, 4, 6, 0], [7, 5, 3, 1, 0]], float)
    np.testing.assert_array_equal(criteria.r_squared(samples, np.full(4, 4), fitted), [1, 0, 0.8, -3])


def test_r_squared_of_a_constant_waveform_is_not_a_number() -> None:
    samples = np.array([[6, 6, 6, 0], [6, 6, 6, 7]], np.uint16)
    found = criteria.r_squared(samples, np.array([3, 4]), np.full((2, 4), 6.25))
    assert np.isnan(found).tolist() == [True, False]


def windowed_in_steps(
    samples: NDArray[np.float64], fitted: NDArray[np.float64], echoes: list[tuple[float, float]]
) -> float:
    """The paper's steps for one waveform: windows in order, overlapping ones joined, then sums over each."""
    windows: list[list[int]] = []
    for low, high in sorted((math.ceil(peak - fwhm / 2), math.floor(peak + fwhm / 2)) for peak, fwhm in echoes):
        if windows and low <= windows[-1][1]:
            windows[-1][1] = max(windows[-1][1], high)
        else:
            windows.append([low, high])
    mean, left, total = sum(samples) / len(samples), 0.0, 0.0
    for low, high in windows:
        for x in range(max(low, 0), min(high, len(samples) - 1) + 1):
            left += (samples[x] - fitted[x]) ** 2
            total += (samples[x] - mean) ** 2
    return 1 - left / total if total else math.nan


@pytest.mark.parametrize("seed", range(5))
def test_windowed_r_squared_is_that_of_the_steps_in_the_paper(seed: int) -> None:
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    n, m = 40, 90
    length = rng.integers(20, m + 1, n)
    samples, fitted = rng.uniform(0, 100, (n, m)), rng.uniform(0, 100, (n, m))
    echoes = {"waveform": rng.integers(0, n, 120), "peak": rng.uniform(-10, m + 10, 120).round(1)}
    echoes["fwhm"] = rng.uniform(0, 25, 120).round(1)
    expected = []
    for row in range(n):
        mine = echoes["waveform"] == row
        own = list(zip(echoes["peak"][mine], echoes["fwhm"][mine], strict=True))
        expected.append(windowed_in_steps(samples[row, : length[row]], fitted[row, : length[row]], own))
    assert 0 < np.isnan(expected).sum() < n / 2
    np.testing.assert_allclose(criteria.windowed_r_squared(samples, length, fitted, echoes), expected, rtol=1e-9)


def test_windows_that_overlap_count_a_sample_once() -> None:
    samples = np.array([[0, 2, 6, 8, 4, 0, 1, 0]] * 2, np.uint16)
    fitted = np.array([[9, 2, 5, 8, 2, 9, 9, 9]] * 2, float)
    echoes = {"waveform": np.array([0, 0, 1]), "peak": np.array([2.0, 3.0, 2.5]), "fwhm": np.array([2.0, 2.0, 3.0])}
    # Samples 1 to 4 either way: the mean is 21/8, the residuals are 0, 1, 0 and 2.
    expected = 1 - 5 / sum((y - 21 / 8) ** 2 for y in (2, 6, 8, 4))
    found = criteria.windowed_r_squared(samples, np.array([8, 8]), fitted, echoes)
    np.testing.assert_allclose(found, [expected] * 2, rtol=1e-14)


def test_a_window_over_the_whole_record_gives_r_squared() -> None:
    samples = np.array([[1, 3, 5, 7, 900]] * 4, np.uint16)
    fitted = np.array([[1, 3, 5, 7, 0], [4, 4, 4, 4, 0], [2, 4, 4, 6, 0], [7, 5, 3, 1, 0]], float)
    echoes = {"waveform": np.arange(4), "peak": np.full(4, 1.5), "fwhm": np.full(4, 100.0)}
    found = criteria.windowed_r_squared(samples, np.full(4, 4), fitted, echoes)
    np.testing.assert_array_equal(found, [1, 0, 0.8, -3])


def test_windowed_r_squared_leaves_out_what_is_no_echo() -> None:
    x = np.arange(200)
    clean = 300 * np.exp(-(((x - 100) / 8) ** 2) / 2)
    rough = clean + np.where(abs(x - 100) > 40, 20.0 * (-1) ** x, 0)
    echo = {"waveform": np.array([0]), "peak": np.array([100.0]), "fwhm": np.array([2.3548 * 8])}
    every = np.array([200])
    assert criteria.r_squared(rough[None], every, clean[None])[0] < 0.97
    assert criteria.windowed_r_squared(rough[None], every, clean[None], echo)[0] == 1


def test_windowed_r_squared_without_an_echo_is_not_a_number() -> None:
    samples = np.array([[1, 2, 9, 2, 1]] * 3, np.uint16)
    echoes = {"waveform": np.array([0, 2]), "peak": np.array([2.0, 40.0]), "fwhm": np.array([2.0, 3.0])}
    found = criteria.windowed_r_squared(samples, np.full(3, 5), samples.astype(float), echoes)
    np.testing.assert_array_equal(found, [1, np.nan, np.nan])
