"""Robust noise statistics on noise and echoes that are known, and on recorded waveforms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import linalg

from openecho.enhance import noise
from openecho.enhance.autoregression import continued
from openecho.enhance.noise import KEPT_VARIANCE

FloatArray = NDArray[np.float64]

N, M = 400, 750
BASELINE, SIGMA = 210.3, 2.0
NOISES = {"white": (1,), "lvis": (1, 0.59), "gedi": (1, 0.93, 0.74, 0.50, 0.27)}
X = np.arange(M)


def coloured(name: str, seed: int, n: int = N, m: int = M) -> FloatArray:
    """Noise of variance 1 with the autocorrelation of that name."""
    print(f"seed {seed}")
    factor = np.linalg.cholesky(linalg.toeplitz(continued(NOISES[name], m)))
    return np.asarray(np.random.default_rng(seed).standard_normal((n, m)) @ factor.T)


def echo(height: FloatArray, centre: FloatArray, sigma: float) -> FloatArray:
    return np.asarray(height[:, None] * np.exp(-((X - centre[:, None]) ** 2) / (2 * sigma**2)))


def scene(kind: str, seed: int) -> FloatArray:
    """Echoes of N waveforms, counts."""
    random = np.random.default_rng(seed)
    if kind == "one anywhere":
        return echo(random.uniform(100, 1000, N), random.uniform(0, M, N), 5)
    if kind == "saturated":
        return echo(np.full(N, 3000.0), random.uniform(0, M, N), 12)
    begin = random.uniform(0, 0.4 * M, N)
    reach = 0.6 * M if kind == "60 %" else 0
    return np.asarray(
        np.sum([echo(random.uniform(50, 500, N), begin + c, 5) for c in np.arange(12, reach - 12, 14)], axis=0)
    )


@pytest.mark.parametrize("kind", ["none", "one anywhere", "60 %", "saturated", "rounded"])
@pytest.mark.parametrize("name", NOISES)
def test_baseline_and_sigma_are_those_of_the_noise(name: str, kind: str) -> None:
    if kind in ("none", "rounded"):
        samples = BASELINE + SIGMA * coloured(name, seed=1)
    else:
        samples = BASELINE + SIGMA * coloured(name, seed=1) + scene(kind, seed=2)
    variance = SIGMA**2
    if kind in ("saturated", "rounded"):
        samples = np.rint(np.minimum(samples, 1023))
        variance += 1 / 12
    found = noise(samples)
    # 4 deviations of a mean of N, and what the docstring says of runs that are taken for echoes.
    allowed = 4 * found.baseline.std() / np.sqrt(N) + 0.01 * SIGMA
    assert abs(found.baseline.mean() - BASELINE) < allowed
    ratio = found.sigma**2 / variance
    assert abs(ratio.mean() - 1) < 4 * ratio.std() / np.sqrt(N) + 2 * 0.007
    if kind == "saturated":
        assert not found.quiet[samples == 1023].any()


@pytest.mark.parametrize("kind", ["none", "one anywhere", "60 %", "rounded"])
@pytest.mark.parametrize("name", NOISES)
def test_autocorrelation_is_that_of_the_noise(name: str, kind: str) -> None:
    samples = BASELINE + SIGMA * coloured(name, seed=3)
    expected = continued(NOISES[name], 9)
    if kind == "rounded":
        samples = np.rint(samples)
        expected[1:] /= 1 + 1 / (12 * SIGMA**2)
    elif kind != "none":
        samples += scene(kind, seed=4)
    found = noise(samples).correlation
    groups = np.array([noise(some).correlation for some in np.split(samples, 20)])
    assert found[0] == 1
    # 4 deviations of the whole batch, from those of its twentieths, and what the docstring says.
    assert (abs(found - expected) <= 4 * groups.std(axis=0) / np.sqrt(20) + 0.01).all()


@pytest.mark.parametrize("lags", [0, 1])
def test_figures_are_the_textbook_ones_of_the_quiet_samples(lags: int) -> None:
    for row in coloured("lvis", seed=5, n=5, m=200):
        found = noise(row[None], lags=lags)
        quiet = found.quiet[0]
        residual = np.where(quiet, row - row[quiet].mean(), 0)
        variance = (residual**2).sum() / quiet.sum()
        covariance = (residual[1:] * residual[:-1]).sum() / (quiet[1:] & quiet[:-1]).sum()
        lost = (1 + 2 * lags * covariance / variance) / quiet.sum()
        assert found.count[0] == quiet.sum() > 100
        np.testing.assert_allclose(found.baseline[0], row[quiet].mean(), rtol=0, atol=1e-15)
        np.testing.assert_allclose(found.sigma[0] ** 2 * KEPT_VARIANCE * (1 - lost), variance, rtol=1e-13)
        taken = lost * found.sigma[0] ** 2
        expected = [(covariance + taken) / (variance + taken)] * lags
        np.testing.assert_allclose(found.correlation[1:], expected, rtol=1e-12)


def test_a_record_depends_on_no_other_and_not_on_what_lies_past_its_length() -> None:
    length = np.array([750, 200, 31, 1])
    samples = BASELINE + SIGMA * coloured("lvis", seed=6, n=4)
    samples[0] += 300 * np.exp(-((X - 300) ** 2) / 50)
    beyond = np.where(length[:, None] > X, samples, np.nan)
    found = noise(beyond, length)
    for i, m in enumerate(length):
        alone = noise(samples[i : i + 1, :m])
        np.testing.assert_allclose(found.baseline[i], alone.baseline[0], rtol=1e-14)
        np.testing.assert_allclose(found.sigma[i], alone.sigma[0], rtol=1e-11)
        np.testing.assert_array_equal(found.quiet[i, :m], alone.quiet[0])
        assert not found.quiet[i, m:].any()


@pytest.mark.parametrize("m", [1, 2, 64])
@pytest.mark.parametrize("value", [0.0, 7.0, -1.7e308, 5e-324])
def test_a_constant_record_has_its_value_and_no_noise(value: float, m: int) -> None:
    found = noise(np.full((2, m), value), lags=3)
    np.testing.assert_allclose(found.baseline, value, rtol=2**-52)
    np.testing.assert_array_equal(found.sigma, 0)
    np.testing.assert_array_equal(found.correlation, [1, 0, 0, 0])
    assert found.quiet.all()


def test_two_values_are_no_less_uncertain_than_their_rounding() -> None:
    found = noise([[5.0] * 63 + [6.0]])
    assert found.sigma[0] >= 1 / np.sqrt(12)


@pytest.mark.parametrize("power", [1014, -1034])
def test_huge_and_tiny_counts_have_the_noise_of_others(power: int) -> None:
    # Whole counts times a power of two are exact, down to the least subnormal, which is 2⁻⁴⁰ of a count.
    samples = np.rint(BASELINE + SIGMA * coloured("gedi", seed=7, n=20))
    samples[:, 300:400] = 1023
    found, scaled = noise(samples), noise(np.ldexp(samples, power))
    np.testing.assert_allclose(np.ldexp(scaled.baseline, -power), found.baseline, rtol=0, atol=2.0**-40)
    np.testing.assert_allclose(np.ldexp(scaled.sigma, -power), found.sigma, rtol=0, atol=2.0**-40)
    np.testing.assert_array_equal(scaled.correlation, found.correlation)


def test_lags_without_a_pair_have_no_correlation() -> None:
    np.testing.assert_array_equal(noise([[1.0, 2.0, 4.0]], lags=5).correlation[3:], 0)


def test_no_records_have_no_noise() -> None:
    found = noise(np.empty((0, 5)), lags=1)
    assert found.baseline.shape == found.sigma.shape == found.count.shape == (0,)
    np.testing.assert_array_equal(found.correlation, [1, 0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"samples": [1.0]}, r"samples: found shape \(1,\), expected \(n, m\) with m from 1"),
        ({"samples": [[]]}, r"samples: found shape \(1, 0\), expected \(n, m\) with m from 1"),
        ({"samples": [[1, np.inf]]}, "samples: found a value that is not finite, expected finite ones"),
        ({"length": [1, 2]}, r"length: found shape \(2,\), expected \(1,\), one of each waveform"),
        ({"length": [1.0]}, "length: found float64, expected whole numbers"),
        ({"length": [0]}, r"length: found \[0\], expected 1 to 2"),
        ({"length": [3]}, r"length: found \[3\], expected 1 to 2"),
        ({"lags": -1}, "lags: found -1, expected 0 or more"),
    ],
)
def test_bad_input_is_one_line(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        noise(**{"samples": [[1.0, 2.0]], **arguments})  # type: ignore[arg-type]


def test_recorded_gedi_noise_is_that_before_the_canopy(recorded: Path) -> None:
    with np.load(recorded / "gedi_cerrado.npz") as stored:
        samples, length = stored["samples"].astype(np.float64), stored["length"]
        before = stored["ref_top_bin"].astype(int) - 40
    found = noise(samples, length)
    assert 1.7 <= np.median(found.sigma) <= 1.9

    lead = np.arange(samples.shape[1]) < before[:, None]
    mean = samples.mean(axis=1, where=lead)
    residual = np.where(lead, samples - mean[:, None], 0)
    power = (residual**2).sum(axis=1)
    rho = np.array([1.0] + [((residual[:, k:] * residual[:, :-k]).sum(axis=1) / power).mean() for k in range(1, 9)])
    # What the mean takes of the variance and of every product, as a share of the variance.
    lost = (2 * rho.sum() - 1) / before.mean()
    rho = (rho + lost) / (1 + lost)
    sigma = np.sqrt(power / before * (1 + lost))
    # Bartlett 1946, the deviation of lags past those of the process, which is the greatest.
    deviation = np.sqrt((2 * (rho**2).sum() - 1) / before.sum())
    assert (abs(found.correlation - rho) < 4 * deviation + 0.01).all()
    offset, ratio = (found.baseline - mean) / sigma, found.sigma / sigma
    assert abs(offset.mean()) < 4 * offset.std() / np.sqrt(len(offset)) + 0.01
    assert abs(ratio.mean() - 1) < 4 * ratio.std() / np.sqrt(len(ratio)) + 0.007


def test_recorded_lvis_noise_is_that_before_and_after_the_ice(recorded: Path) -> None:
    with np.load(recorded / "lvis_arctic.npz") as stored:
        samples = stored["samples"].astype(np.float64)
    # The maxima are at bins 316 to 325. After them the baseline is 0.14 counts lower, so that both sides count.
    quiet = np.delete(samples, slice(280, 400), axis=1)
    found = noise(samples)
    offset, ratio = found.baseline - quiet.mean(axis=1), found.sigma / quiet.std(axis=1, ddof=1)
    assert abs(offset.mean()) < 4 * offset.std() / np.sqrt(len(offset)) + 0.01
    assert abs(ratio.mean() - 1) < 4 * ratio.std() / np.sqrt(len(ratio)) + 0.007


def test_recorded_lvis_pulses_have_the_published_correlation_at_lag_1(recorded: Path) -> None:
    with np.load(recorded / "lvis_tx.npz") as stored:
        found = noise(stored["samples"], stored["length"])
    # Bartlett 1946 for a first-order autoregression: the deviation is √((1 - ρ²) / N).
    assert abs(found.correlation[1] - 0.59) < 3 * np.sqrt((1 - 0.59**2) / found.count.sum())
