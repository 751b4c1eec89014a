"""Whatever the samples, enhancement answers with finite ones of the same shape, or refuses in one line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy import linalg

from openecho.enhance import denoise, gaussian, homomorphic, moving_average, noise, vondrak

FloatArray = NDArray[np.float64]

pytestmark = pytest.mark.filterwarnings("error")
MOST = np.finfo(np.float64).max
LEAST = 5e-324
"""The least subnormal."""
SCALES = (LEAST, 1e-308, 1e-160, 1.0, 1e160, 1e308, MOST)
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def filled(shape: tuple[int, int]) -> st.SearchStrategy[FloatArray]:
    counts = arrays(np.float64, shape, elements=st.integers(0, 1023).map(float))
    unit = arrays(np.float64, shape, elements=st.floats(-1, 1))
    return st.one_of(
        arrays(np.float64, shape, elements=FINITE),
        arrays(np.float64, shape, elements=st.sampled_from([*SCALES, *(-scale for scale in SCALES), 0.0, -0.0])),
        FINITE.map(lambda value: np.full(shape, value)),
        st.tuples(unit, st.sampled_from(SCALES)).map(lambda drawn: drawn[0] * drawn[1]),
        st.tuples(counts, st.integers(0, 1023)).map(lambda drawn: np.minimum(*drawn)),
    )


WAVEFORMS = st.tuples(st.integers(0, 3), st.integers(1, 40)).flatmap(filled)
"""Any, in the extremes of float64, constant, around one scale, and saturated ones."""
MANY = settings(max_examples=200, deadline=None, derandomize=True)


def is_like(samples: FloatArray, enhanced: FloatArray) -> None:
    assert enhanced.shape == samples.shape
    assert enhanced.dtype == np.float64
    assert np.isfinite(enhanced).all()


@MANY
@given(samples=WAVEFORMS, lags=st.integers(0, 50))
@example(samples=np.array([[MOST, -MOST]]), lags=1)
@example(samples=np.array([[LEAST, 0.0, LEAST, MOST]]), lags=1)
@example(samples=np.array([[LEAST, 0.0, LEAST, 0.0]]), lags=1)
def test_noise_is_finite_with_a_baseline_among_the_samples(samples: FloatArray, lags: int) -> None:
    found = noise(samples, lags=lags)
    rows = len(samples)
    is_like(np.empty(rows), found.baseline)
    is_like(np.empty(rows), found.sigma)
    is_like(np.empty(lags + 1), found.correlation)
    assert found.quiet.shape == samples.shape
    if rows == 0:
        return
    least, greatest = samples.min(axis=1), samples.max(axis=1)
    rounding = 40 * 2.0**-54 * np.abs(samples).max(axis=1)  # of half a sum of 40
    assert (least / 2 - rounding <= found.baseline / 2).all()
    assert (found.baseline / 2 <= greatest / 2 + rounding).all()
    assert (found.sigma >= 0).all()
    np.testing.assert_array_equal(found.sigma[least == greatest], 0)
    assert (found.count >= 1).all()
    np.testing.assert_array_equal(found.count, found.quiet.sum(axis=1))
    assert found.correlation[0] == 1
    assert linalg.eigvalsh(linalg.toeplitz(found.correlation))[0] > -1e-13 * (lags + 1)


@MANY
@given(
    samples=WAVEFORMS,
    wavelet=st.sampled_from(["haar", "sym8"]),
    mode=st.sampled_from(["soft", "hard"]),
    sigma=st.none() | st.sampled_from([0.0, *SCALES]),
    rho=st.none() | st.floats(-1, 1),
)
@example(samples=np.array([[MOST, -MOST, MOST, MOST]]), wavelet="sym8", mode="hard", sigma=None, rho=None)
def test_denoised_is_finite_or_refused(
    samples: FloatArray, wavelet: str, mode: str, sigma: float | None, rho: float | None
) -> None:
    deviation = None if sigma is None else np.full(len(samples), sigma)
    correlation = None if rho is None else [1, rho, rho**2]
    given_ones = {"wavelet": wavelet, "mode": mode, "sigma": deviation, "correlation": correlation}
    if sigma is None and rho is not None:
        with pytest.raises(ValueError, match=r"^correlation: .*, expected both$"):
            denoise(samples, **given_ones)  # type: ignore[arg-type]
        return
    is_like(samples, denoise(samples, **given_ones))  # type: ignore[arg-type]


@MANY
@given(samples=WAVEFORMS, epsilon=st.floats(0, allow_nan=False))
@example(samples=np.array([[MOST, -MOST, MOST, -MOST, MOST]]), epsilon=1.0)
@example(samples=np.array([[LEAST, 0.0, 0.0, LEAST, LEAST]]), epsilon=1.0)
def test_vondrak_is_finite(samples: FloatArray, epsilon: float) -> None:
    is_like(samples, vondrak(samples, epsilon))


@MANY
@given(samples=WAVEFORMS, half=st.integers(0, 40))
def test_moving_average_is_finite_and_within_the_samples(samples: FloatArray, half: int) -> None:
    averaged = moving_average(samples, 2 * half + 1)
    is_like(samples, averaged)
    assert (averaged >= samples.min(axis=1, keepdims=True)).all()
    assert (averaged <= samples.max(axis=1, keepdims=True)).all()


@MANY
@given(samples=WAVEFORMS, sigma=st.floats(LEAST, 40))
def test_gaussian_is_finite_and_within_the_samples(samples: FloatArray, sigma: float) -> None:
    smoothed = gaussian(samples, sigma)
    is_like(samples, smoothed)
    assert (smoothed >= samples.min(axis=1, keepdims=True)).all()
    assert (smoothed <= samples.max(axis=1, keepdims=True)).all()


@MANY
@given(
    samples=WAVEFORMS,
    period=st.floats(LEAST, MOST),
    baseline=FINITE,
    floor=st.floats(LEAST, MOST),
    order=st.integers(1, 400),
)
def test_homomorphic_is_finite(samples: FloatArray, period: float, baseline: float, floor: float, order: int) -> None:
    is_like(samples, homomorphic(samples, period, baseline=baseline, floor=floor, order=order))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    "enhance",
    [
        noise,
        denoise,
        lambda samples: vondrak(samples, 1),
        lambda samples: moving_average(samples, 3),
        lambda samples: gaussian(samples, 1),
        lambda samples: homomorphic(samples, 4),
    ],
)
def test_what_is_not_finite_is_refused_in_one_line(enhance, value: float) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=r"^samples: found a value that is not finite, expected finite .*$") as error:
        enhance([[1.0, value, 2.0, 3.0, 5.0]])
    assert "\n" not in str(error.value)
