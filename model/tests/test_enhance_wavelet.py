"""Wavelet denoising: what it leaves as it is, its thresholds, and what it gains in white and in coloured noise."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import pywt
from numpy.typing import NDArray
from scipy import linalg, special

from openecho.enhance import denoise, snr_db
from openecho.enhance.autoregression import continued
from openecho.enhance.wavelet import LEVELS, _gains

FloatArray = NDArray[np.float64]

N, M = 400, 256
X = np.arange(M)
NOISES = {"white": (1,), "lvis": (1, 0.59), "gedi": (1, 0.93, 0.74, 0.50, 0.27)}
ALL = 1e6
"""Deviation, in that of the noise, whose threshold no coefficient is above."""


def coloured(name: str, seed: int) -> FloatArray:
    """Noise of variance 1 with the autocorrelation of that name."""
    print(f"seed {seed}")
    factor = np.linalg.cholesky(linalg.toeplitz(continued(NOISES[name], M)))
    return np.asarray(np.random.default_rng(seed).standard_normal((N, M)) @ factor.T)


def echo(centre: float, sigma: float) -> FloatArray:
    return np.asarray(np.exp(-((X - centre) ** 2) / (2 * sigma**2)))


@pytest.mark.parametrize("name", ["haar", "db4", "sym8", "coif3"])
@pytest.mark.parametrize("m", [1, 2, 7, 100, 256])
def test_without_noise_everything_stays(m: int, name: str) -> None:
    samples = np.random.default_rng(m).uniform(-1000, 1000, (3, m))
    for mode in ("soft", "hard"):
        kept = denoise(samples, wavelet=name, mode=mode, sigma=np.zeros(3))
        # PyWavelets has the taps of coif3 to 10 digits and the others to 12 or more.
        np.testing.assert_allclose(kept, samples, rtol=0, atol=1e-6 if name == "coif3" else 1e-8)
    np.testing.assert_array_equal(denoise(samples, levels=0), samples)


@pytest.mark.parametrize("mode", ["soft", "hard"])
def test_thresholds_are_those_of_the_equation(mode: str) -> None:
    samples = 20 * echo(130.2, 6) + coloured("gedi", seed=0)[:5]
    sigma, factor = np.array([0.5, 1, 1, 1, 2]), np.sqrt(2 * np.log(M))
    gain = _gains(pywt.Wavelet("sym8"), LEVELS, NOISES["gedi"])
    around = np.concatenate([samples, samples[:, ::-1]], axis=1)
    coarse, *details = pywt.swt(around, "sym8", LEVELS, axis=1, trim_approx=True)
    for given, deviation in [
        ({"sigma": sigma, "correlation": NOISES["gedi"]}, [sigma * g for g in gain[::-1]]),
        ({"sigma": sigma}, [sigma] * LEVELS),
        ({}, [1.482602218505602 * np.median(np.abs(detail), axis=1) for detail in details]),
    ]:
        kept = [
            np.stack([pywt.threshold(*each, mode) for each in zip(detail, level * factor, strict=True)])
            for detail, level in zip(details, deviation, strict=True)
        ]
        expected = pywt.iswt([coarse, *kept], "sym8", axis=1)[:, :M]
        np.testing.assert_allclose(denoise(samples, mode=mode, **given), expected, rtol=0, atol=1e-12)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", NOISES)
@pytest.mark.parametrize("taps", ["haar", "sym8"])
def test_noise_of_each_level_is_that_of_its_filter(taps: str, name: str) -> None:
    # The response to each of 512 impulses at the middle is the filter; it must not reach round.
    details = pywt.swt(np.eye(512), taps, LEVELS, axis=1, trim_approx=True)[:0:-1]
    middle = np.stack(details)[:, :, 256]
    assert not middle[:, [0, -1]].any()
    expected = np.einsum("ji,ik,jk->j", middle, linalg.toeplitz(continued(NOISES[name], 512)), middle)
    np.testing.assert_allclose(_gains(pywt.Wavelet(taps), LEVELS, NOISES[name]) ** 2, expected, rtol=1e-10)


@pytest.mark.parametrize("name", NOISES)
def test_coloured_noise_goes_as_white_noise_does(name: str) -> None:
    samples, sigma = coloured(name, seed=1), np.ones(N)
    nothing = denoise(samples, sigma=ALL * sigma)

    def removed(**given: object) -> float:
        left = np.abs(denoise(samples, **given) - nothing).max(axis=1)  # type: ignore[arg-type]
        return float((left < 1e-9).mean())

    # The universal threshold leaves half of the waveforms of white noise without a coefficient: 256 cross 3.33 σ with a
    # chance of 0.2 at each of four levels, and neighbours do so together. A share has the deviation √(1/4N).
    assert abs(removed(sigma=sigma, correlation=NOISES[name]) - 0.5) < 4 * np.sqrt(1 / (4 * N))
    if name != "white":
        assert removed(sigma=sigma) < 0.05, "coarse levels have twice the noise of white"

    # Half as high again it leaves nearly all without one: no more cross than all coefficients together, each with its
    # exact deviation, for at the ends, where a waveform turns back, that is greater.
    turned = np.concatenate([np.eye(M), np.eye(M)[:, ::-1]], axis=1)
    details = pywt.swt(turned, "sym8", LEVELS, axis=1, trim_approx=True)[:0:-1]
    covariance = linalg.toeplitz(continued(NOISES[name], M))
    variance = np.stack([((covariance @ detail) * detail).sum(axis=0) for detail in details])
    level = 1.5 * np.sqrt(2 * np.log(M)) * _gains(pywt.Wavelet("sym8"), LEVELS, NOISES[name])
    most = special.erfc(level[:, None] / np.sqrt(2 * variance)).sum()
    assert most < 0.15
    assert 1 - removed(sigma=1.5 * sigma, correlation=NOISES[name]) < most + 4 * np.sqrt(most / N)


@pytest.mark.parametrize("shift", [1, 2, 3, 8])
def test_a_shift_of_the_waveform_shifts_the_answer(shift: int) -> None:
    samples = np.zeros((2, 2 * M))
    samples[:, M // 2 : 3 * M // 2] = 20 * echo(128.3, 5) + np.pad(
        coloured("white", seed=2)[:2, 96:160], ((0, 0), (96, 96))
    )
    given = {"levels": 3, "sigma": np.array([0.5, 1.5])}  # three levels reach 105 bins
    shifted = denoise(np.roll(samples, shift, axis=1), **given)  # type: ignore[arg-type]
    np.testing.assert_allclose(shifted, np.roll(denoise(samples, **given), shift, axis=1), rtol=0, atol=1e-11)  # type: ignore[arg-type]


def gain(name: str, **given: object) -> float:
    signal = 20 * echo(128.3, 6)
    samples = signal + coloured(name, seed=3)
    return snr_db(denoise(samples, **given), signal) - snr_db(samples, signal)  # type: ignore[arg-type]


def test_an_echo_gains_most_with_the_autocorrelation_of_its_noise() -> None:
    sigma = np.ones(N)
    # Four levels leave 1/16 of white noise, 12 dB, and an echo of 20 σ keeps some noise with its own coefficients.
    # Measured: 10.0 dB in white noise; in that of GEDI 4.1 with its correlation, 3.6 by the median, 2.6 as if white.
    assert 9.8 < gain("white", sigma=sigma) < 12
    assert gain("white") > 9.6
    for name, ahead in (("lvis", 0.3), ("gedi", 1.3)):
        known = gain(name, sigma=sigma, correlation=NOISES[name])
        assert known > gain(name)
        assert known > gain(name, sigma=sigma) + ahead


@pytest.mark.parametrize("m", [256, 250, 101])
def test_ends_are_not_bent(m: int) -> None:
    constant, ramp = np.full(m, 300.0), 0.1 * np.arange(m)
    sigma = [1.0]
    np.testing.assert_allclose(denoise([constant], sigma=sigma), [constant], rtol=1e-12)
    # What turns back has a corner at its ends, which rounds by the slope times 2.9 bins, the reach of the coarsest
    # filter; what goes round has a step instead, and errs by 1.4.
    assert np.abs(denoise([ramp], sigma=sigma) - ramp).max() < 0.1 * 2.9


def test_a_batch_is_its_waveforms_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    samples, sigma = coloured("lvis", seed=4)[:7], np.linspace(0.5, 2, 7)
    together = denoise(samples, sigma=sigma)
    monkeypatch.setattr(sys.modules["openecho.enhance.wavelet"], "TOGETHER", 3 * M)
    np.testing.assert_array_equal(denoise(samples, sigma=sigma), together)
    for row, deviation, expected in zip(samples, sigma, together, strict=True):
        np.testing.assert_array_equal(denoise([row], sigma=[deviation]), [expected])


def test_samples_are_not_changed_in_place() -> None:
    samples = coloured("white", seed=5)
    before = samples.copy()
    denoise(samples)
    np.testing.assert_array_equal(samples, before)


def test_no_waveforms_stay_none() -> None:
    assert denoise(np.empty((0, 20)), sigma=[]).shape == (0, 20)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"samples": [1.0]}, r"samples: found shape \(1,\), expected \(n, m\) with m from 1"),
        ({"samples": [[1, np.nan]]}, "samples: found a value that is not finite, expected finite ones"),
        ({"wavelet": "sinc"}, r"wavelet: found 'sinc', expected one of pywt.wavelist\(\)"),
        ({"wavelet": "bior2.2"}, "wavelet: found 'bior2.2', expected an orthogonal one"),
        ({"mode": "firm"}, "mode: found 'firm', expected 'soft' or 'hard'"),
        ({"levels": 3}, "levels: found 3, expected 0 to 2"),
        ({"levels": -1}, "levels: found -1, expected 0 to 2"),
        ({"sigma": [1.0, 2.0]}, r"sigma: found shape \(2,\), expected \(1,\), one of each waveform"),
        ({"sigma": [-1.0]}, r"sigma: found \[-1.\], expected finite ones from 0"),
        ({"sigma": [np.nan]}, r"sigma: found \[nan\], expected finite ones from 0"),
        ({"correlation": [1.0]}, "correlation: found one without sigma, expected both"),
        ({"sigma": [1.0], "correlation": [0.5]}, "correlation: found one that is not 1 at lag 0 .*, expected such"),
    ],
)
def test_bad_input_is_one_line(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        denoise(**{"samples": [[1.0, 2.0, 4.0, 3.0]], **arguments})  # type: ignore[arg-type]


def test_without_pywavelets_only_denoise_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pywt", None)
    with pytest.raises(ModuleNotFoundError, match=r"^PyWavelets is not installed, .*: pip install 'openecho\[fit\]'$"):
        denoise([[1.0, 2.0]])
    program = "import sys; sys.modules['pywt'] = None; import openecho.enhance"
    subprocess.run([sys.executable, "-c", program], check=True)
