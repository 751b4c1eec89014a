"""Shapes of echoes as compiled code reads them, against their equations and against convolutions on a finer grid."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.signal import fftconvolve
from scipy.stats import norm

from openecho.decompose.fit import echo_sum
from openecho.decompose.least_squares import add_slopes
from openecho.decompose.pulses import DENSITY, REACH, ROUGH_DENSITY, ROUGH_ROWS, Pulse, gaussian, laser, measured, rough

FloatArray = NDArray[np.float64]

NARROWEST = 6.0
STEP = 1 / (ROUGH_ROWS - 1)
"""Of a row, in s² / (w₀² + s²)."""


def transmitted() -> FloatArray:
    """A pulse with a slow tail on a baseline, counts, like recorded ones."""
    x = np.arange(90.0)
    return np.asarray(20 + 300 * np.exp(-((x - 30) ** 2) / 32) + 90 * np.exp(-((x - 37) ** 2) / 72))


PULSES = {"gaussian": gaussian(), "laser": laser(), "rough": rough(NARROWEST), "measured": measured(transmitted())}


def shape(pulse: Pulse, samples: int, centre: float, width: float) -> FloatArray:
    """One echo of height 1 without a baseline."""
    (echo,) = echo_sum(samples, [0.0], [0], [1.0], [centre], [width], pulse)
    return np.asarray(echo)


def template(t: FloatArray) -> FloatArray:
    """Laser template, height 1, at times in τ."""
    t = np.maximum(t, 0)
    return np.asarray(t**2 / 4 * np.exp(2 - t))


def derivatives(pulse: Pulse, amplitude: float, centre: float, width: float, samples: int) -> FloatArray:
    """What compiled code says of the derivatives by amplitude, centre and ln w, (3, samples)."""
    slopes = np.zeros((3, samples))
    begin, end = add_slopes(amplitude, centre, width, pulse, slopes)
    slopes[:, :begin] = slopes[:, end:] = 0
    return slopes


@pytest.mark.parametrize("width", [7.0, 8.3, 11.0, 40.0, 300.0])
@pytest.mark.parametrize("name", PULSES)
def test_every_shape_has_its_maximum_of_height_1_at_0(name: str, width: float) -> None:
    height, slope, _ = derivatives(PULSES[name], 1.0, 1000.0, width, 2001)
    # Where 0 is between nodes, Hermite's cubics leave f''''/(384 · 64⁴) of the height, and the table's spline its own.
    np.testing.assert_allclose(height[1000], 1, rtol=1e-8)
    np.testing.assert_allclose(slope[1000] * width, 0, atol=1e-6)
    assert height.max() == height[1000]


@pytest.mark.parametrize(("name", "exact"), [("gaussian", 1e-7), ("laser", 1e-7), ("rough", 1e-4), ("measured", 1e-4)])
def test_the_first_row_has_its_inflections_2_apart(name: str, exact: float) -> None:
    pulse = PULSES[name]
    z = pulse.first + np.arange(pulse.table.shape[1]) / pulse.density
    # The spline's curvature is wrong by f⁽⁵⁾ h³ / 24, 1e-8 with 256 nodes; a measured pulse has none but its spline's.
    curvature = CubicSpline(z, pulse.table[0, :, 1]).derivative()
    midpoint = pulse.midpoint[0]
    left, right = (brentq(curvature, midpoint + side - 0.3, midpoint + side + 0.3) for side in (-1, 1))
    np.testing.assert_allclose([left, right], [midpoint - 1, midpoint + 1], atol=exact)


@pytest.mark.parametrize("width", [0.4, 1.0, 5.0, 33.3])
def test_the_gaussian_is_that_of_the_equation(width: float) -> None:
    z = (np.arange(401) - 200.3) / width
    # What is cut is exp(-REACH²/2) high; Hermite's cubics are wrong by max|f''''| / (384 · DENSITY⁴), with 3 for f''''.
    cut, cubic = np.exp(-(REACH**2) / 2), 3 / (384 * DENSITY**4)
    assert max(cut, cubic) < 4e-12
    np.testing.assert_allclose(shape(PULSES["gaussian"], 401, 200.3, width), np.exp(-(z**2) / 2), rtol=0, atol=4e-12)


@pytest.mark.parametrize("width", [0.4, 1.0, 5.0, 33.3])
def test_the_laser_template_is_that_of_the_equation(width: float) -> None:
    tau = width / np.sqrt(2)
    expected = template((np.arange(1001) - 200.3) / tau + 2)
    # Of t² exp(2 - t) / 4 the fourth derivative is 3 e² at most, at the beginning; by z, √2 τ, four times that.
    cubic = 12 * np.exp(2) / (384 * DENSITY**4)
    np.testing.assert_allclose(shape(PULSES["laser"], 1001, 200.3, width), expected, rtol=0, atol=cubic + 1e-14)


def test_widths_at_half_maximum_are_those_of_the_equations() -> None:
    (zero,), (fwhm,) = PULSES["gaussian"].described([5.0])
    np.testing.assert_allclose([zero, fwhm], [0, 5 * np.sqrt(8 * np.log(2))], rtol=1e-15)
    tau = 4.0
    (zero,), (fwhm,) = PULSES["laser"].described([np.sqrt(2) * tau])
    assert zero == 0
    np.testing.assert_allclose(fwhm / tau, 3.3947, atol=5e-5)
    assert template(np.array([2.0]))[0] == 1
    low, high = (brentq(lambda t: template(np.array(t)) - 0.5, *ends) for ends in ((0, 2), (2, 9)))
    np.testing.assert_allclose(fwhm / tau, high - low, rtol=1e-11)


def between_rows(places: FloatArray, values: FloatArray) -> FloatArray:
    """Cubics through values at 0, 1, 2, 3 rows, (x, 4), at places (p,)."""
    weights = [np.prod([(places - j) / (i - j) for j in range(4) if j != i], axis=0) for i in range(4)]
    return np.asarray(values @ np.array(weights))


def beginning_error(share: float) -> float:
    """What cubics between rows of `rough` make of the template's beginning, where its curvature jumps.

    The jump is e²/w₀², and half a parabola that is convolved is s² ((1 + u²) Φ(u) + u φ(u)) / 2 at u = x/s: of degree 1
    in s² only far from the beginning.
    """

    def blurred(x: NDArray[Any], share: NDArray[Any]) -> FloatArray:
        share = np.clip(share, 1e-12, 1 - 1e-12)
        square = share / (1 - share)  # w₀²
        u = x / np.sqrt(square)
        return np.asarray(square * ((1 + u**2) * norm.cdf(u) + u * norm.pdf(u)) / 2)

    first = min(max(int(share / STEP) - 1, 0), ROUGH_ROWS - 4)
    x = np.linspace(-1, 1, 2001)[:, None]
    found = between_rows(np.array([share / STEP - first]), blurred(x, STEP * (first + np.arange(4.0))))
    return float(np.exp(2) * np.abs(found - blurred(x, np.array([share]))).max())


def node_error() -> float:
    """What Hermite's cubic makes of the template's beginning, somewhere between two nodes."""
    f, jump = np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201))
    cubic = (1 - jump) ** 2 / 2 * f**2 * (3 - 2 * f) - (1 - jump) * f**2 * (1 - f)
    return float(np.exp(2) / ROUGH_DENSITY**2 * np.abs(cubic - np.maximum(f - jump, 0) ** 2 / 2).max())


def end_error() -> float:
    """What cubics between the last rows make of the skewness, which is of degree 3/2 in (w₀/w)².

    Edgeworth: it adds κ₃ / (6 w³) · z³ exp(-z²/2), if the maximum stays at 0, and the template's κ₃ is 6 τ³.
    """
    places = np.linspace(0, 1, 200)
    degree = np.abs(between_rows(places, np.arange(4.0)[None] ** 1.5) - places**1.5).max()
    return float((STEP / 2) ** 1.5 * degree * 3**1.5 * np.exp(-1.5))


@pytest.mark.parametrize("narrowest", [3.0, 7.0])
@pytest.mark.parametrize("share", [0.0, 4e-4, 0.001, 0.006, 0.01, 0.03, 0.05, 0.1, 0.2, 0.5, 0.8, 0.95, 0.975, 0.996])
def test_a_rough_echo_is_the_convolution_of_template_and_gaussian(narrowest: float, share: float) -> None:
    width = narrowest / np.sqrt(1 - share)
    roughness, tau = np.sqrt(share) * width, narrowest / np.sqrt(2)
    step = tau / 400
    t = np.arange(0, 40 * tau, step)
    fine, begin = template(t / tau), 0.0
    if roughness > 0:
        taps = np.arange(-np.ceil(8.5 * roughness / step), np.ceil(8.5 * roughness / step) + 1) * step
        fine, begin = fftconvolve(fine, np.exp(-(taps**2) / (2 * roughness**2))), taps[0]
    spline = CubicSpline(begin + step * np.arange(len(fine)), fine)
    highest = int(fine.argmax())
    peak = brentq(spline.derivative(), *spline.x[[highest - 1, highest + 1]], xtol=1e-12)
    # 2e-6: nodes 1/64 of a width apart, behind a Gaussian. The other terms are to first order in the step of a row or
    # of a node, so that a tenth is added.
    tolerance = 2e-6 + 1.1 * (beginning_error(share) + (share < 3 * STEP) * node_error())
    if share > 1 - 3 * STEP:
        tolerance += 1.1 * end_error()
    x, pulse = np.arange(int(20 * width + 30 * tau)), rough(narrowest)
    for centre in 10 * width + np.arange(0, 1, 0.125):
        at = x - centre + peak
        within = (at >= spline.x[0]) & (at <= spline.x[-1])
        expected = np.where(within, spline(at) / spline(peak), 0.0)
        np.testing.assert_allclose(shape(pulse, len(x), centre, width), expected, rtol=0, atol=tolerance)


def test_a_rough_echo_is_nowhere_wrong_by_more_than_a_thousandth() -> None:
    assert node_error() < 3e-5
    assert max(beginning_error(share) for share in STEP * np.linspace(0.01, 1, 100)) < 1.1e-3
    assert end_error() < 3e-5


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.9])
def test_a_measured_gaussian_is_again_a_gaussian_behind_another(share: float) -> None:
    sigma = 6.0
    pulse = measured(20 + 300 * np.exp(-((np.arange(120) - 60.3) ** 2) / (2 * sigma**2)))
    # Between samples the spline's curvature is f'' + c f'''', with c from -1/12 to 1/24; at z = 1, f'''' is -f''' / σ.
    assert -1 / 12 < (pulse.narrowest - sigma) * sigma < 1 / 24
    width = pulse.narrowest / np.sqrt(1 - share)
    x = np.arange(601) - 300.3
    expected = np.exp(-(x**2) / (2 * (width**2 - pulse.narrowest**2 + sigma**2)))
    # The spline's slope is wrong by √3/216 f'''', which moves the maximum, and its value by f''''/384, with 3 σ⁻⁴ for
    # f''''; behind a Gaussian only the mean of its error is left, f''''/720.
    fourth = 3 / sigma**4
    tolerance = fourth * (3**0.5 / 216 * sigma * np.exp(-0.5) + 1 / 384) if share == 0 else fourth / 720
    np.testing.assert_allclose(shape(pulse, 601, 300.3, width), expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize(
    ("name", "width"),
    [
        *((name, width) for name in ("gaussian", "laser") for width in (0.45, 2.0, 7.1)),
        *(("rough", NARROWEST * factor) for factor in (1.001, 1.003, 1.06, 1.5, 3.0, 7.0, 9.0, 30.0)),
        *(("measured", PULSES["measured"].narrowest * factor) for factor in (1.001, 1.3, 8.5)),
    ],
)
def test_derivatives_are_those_of_the_shape(name: str, width: float) -> None:
    amplitude, centre, delta, samples = 3.0, 100.37, 1e-5, 300
    values = np.array([amplitude, centre, np.log(width)])

    def echo(values: FloatArray) -> FloatArray:
        return np.asarray(values[0] * shape(PULSES[name], samples, values[1], float(np.exp(values[2]))))

    differences = [
        (8 * (echo(values + step) - echo(values - step)) - echo(values + 2 * step) + echo(values - 2 * step))
        / (12 * delta)
        for step in delta * np.eye(3)
    ]
    # What is rounded is (x - centre) / width at 100 bins, times slopes of 2 and less, and the height, over δ.
    rounding = 3 * amplitude * np.finfo(float).eps / delta * (1 + 100 / width)
    np.testing.assert_allclose(
        derivatives(PULSES[name], amplitude, centre, width, samples), differences, rtol=0, atol=rounding
    )


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, np.inf])
def test_a_pulse_that_has_no_width_is_one_line(width: float) -> None:
    with pytest.raises(ValueError, match=r"^narrowest: found [^\n]*, expected a width in bins above 0$"):
        rough(width)


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (np.ones((2, 20)), r"shape \(2, 20\), expected \(m,\) with m from 8"),
        (np.arange(7.0), r"shape \(7,\), expected \(m,\) with m from 8"),
        ([0, 0, 1, 3, np.nan, 1, 0, 0], "a value that is not finite or the same everywhere"),
        ([0, 0, 1, 3, np.inf, 1, 0, 0], "a value that is not finite or the same everywhere"),
        ([5] * 20, "a value that is not finite or the same everywhere"),
        (np.arange(20.0), "the maximum at an end, expected a whole pulse"),
        (np.arange(20.0)[::-1], "the maximum at an end, expected a whole pulse"),
        (np.exp(-(((np.arange(60) - 1.2) / 8) ** 2)), "no inflection or half height on both sides"),
    ],
    ids=range(8),
)
def test_samples_without_a_pulse_are_one_line(samples: ArrayLike, message: str) -> None:
    with pytest.raises(ValueError, match=rf"^pulse: found [^\n]*{message}[^\n]*$"):
        measured(samples)


@pytest.mark.filterwarnings("error")
@settings(max_examples=100, deadline=None)
@given(
    samples=arrays(np.float64, st.integers(8, 40), elements=st.floats(allow_nan=False, allow_infinity=False))
    | arrays(np.float64, st.integers(8, 40), elements=st.integers(0, 30))
)
def test_any_finite_samples_are_a_pulse_or_one_line(samples: FloatArray) -> None:
    try:
        pulse = measured(samples)
    except ValueError as caught:
        message = str(caught)
        assert re.fullmatch("pulse: found [^\n]*, expected [^\n]*", message)
        return
    assert np.isfinite([*pulse.table.ravel(), *pulse.midpoint, *pulse.fwhm]).all()
    assert pulse.narrowest > 0
    assert (pulse.fwhm > 0).all()
    np.testing.assert_allclose(shape(pulse, 1, 0.0, pulse.narrowest), 1, rtol=1e-6)
