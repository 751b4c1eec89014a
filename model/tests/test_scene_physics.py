"""Pulse, air, targets and receiver against what the physics says: closed forms, integrals and published numbers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.special import lambertw

from openecho.scene.physics import atmosphere, pulse, receiver, reflection
from openecho.scene.schema import Measured, Receiver, Shaped

pytestmark = pytest.mark.filterwarnings("error")

Floats = NDArray[np.float64]

NS, UM, KM = 1e-9, 1e-6, 1e3
ELECTRON, BOLTZMANN, PLANCK, LIGHT = 1.602176634e-19, 1.380649e-23, 6.62607015e-34, 299792458.0
WIDER = math.sqrt(8 * math.log(2))
"""FWHM of a normal curve in its deviations."""

DRAWS = 200_000


def shaped(shape: str, fwhm: float) -> Shaped:
    """A pulse of some FWHM, s."""
    return Shaped.model_validate({"shape": shape, "fwhm": f"{fwhm!r} s"})


def recorded(path: Path, samples: Any, interval: float = NS) -> Measured:
    """A pulse in a file."""
    np.save(path / "pulse.npy", samples)
    return Measured.model_validate(
        {"shape": "measured", "file": str(path / "pulse.npy"), "interval": f"{interval!r} s"}
    )


def detector(**changes: Any) -> Receiver:
    """A receiver that sees every photon and adds nothing, but for what is changed."""
    data = {
        "aperture": "10 cm",
        "optics_efficiency": 0.5,
        "field_of_view": "1 mrad",
        "quantum_efficiency": 1,
        "bandwidth": "100 MHz",
        **changes,
    }
    return Receiver.model_validate({key: value for key, value in data.items() if value is not None})


def variance(template: pulse.Template) -> float:
    """Of a pulse's energy over time, bins²."""
    at = np.arange(len(template.power)) / pulse.STEPS
    share = template.power / template.power.sum()
    return float(share @ (at - share @ at) ** 2)


def width(template: pulse.Template) -> float:
    """Full width at half maximum, bins, between samples on a straight line."""
    power, half = template.power, template.power.max() / 2
    above = np.flatnonzero(power >= half)
    rise, fall = above[0], above[-1]
    left = rise - (power[rise] - half) / (power[rise] - power[rise - 1])
    right = fall + (power[fall] - half) / (power[fall] - power[fall + 1])
    return float(right - left) / pulse.STEPS


def standard_error(draws: Floats, moment: int) -> float:
    """Of the mean of draws (1), or of their variance (2), out of the draws themselves."""
    if moment == 1:
        return float(draws.std() / math.sqrt(draws.size))
    off = (draws - draws.mean()) ** 2
    return float(off.std() / math.sqrt(draws.size))


# The pulse


def test_the_lasers_pulse_is_3_3947_of_its_time_constant_wide() -> None:
    # u² exp(-u) = 2 exp(-2), half of the maximum at u = 2, is (-u/2) exp(-u/2) = -1/(e √2): Lambert's W.
    at = -1 / (math.e * math.sqrt(2))
    expected = 2 * float((lambertw(at, 0) - lambertw(at, -1)).real)
    assert expected == pytest.approx(3.3947, abs=5e-5)
    assert pytest.approx(expected, rel=1e-12) == pulse.FWHM_TAU
    assert pulse.laser(np.array([-1.0, 0.0])).tolist() == [0, 0]
    assert pulse.laser(2.0) == pytest.approx(4 * math.exp(-2))


@pytest.mark.parametrize("shape", ["gaussian", "laser"])
@pytest.mark.parametrize("fwhm", [2, 5, 13.7])
@pytest.mark.parametrize("interval", [0.5 * NS, NS])
def test_a_pulse_without_response_is_as_wide_as_asked_and_has_unit_energy(
    shape: str, fwhm: float, interval: float
) -> None:
    found = pulse.template(shaped(shape, fwhm * NS), interval, None)
    assert found.power.sum() * interval / pulse.STEPS == pytest.approx(1, rel=1e-12)
    assert width(found) * interval == pytest.approx(fwhm * NS, rel=2e-4)
    assert found.fwhm == pytest.approx(width(found), rel=1e-9)
    assert found.deviation**2 == pytest.approx(variance(found), rel=1e-9)


def test_the_variance_of_pulses_is_that_of_their_closed_form() -> None:
    # A gamma law of order 3 has the variance 3 τ².
    assert variance(pulse.template(shaped("laser", 3.3947 * NS), NS, None)) == pytest.approx(3, rel=1e-4)
    assert variance(pulse.template(shaped("gaussian", WIDER * NS), NS, None)) == pytest.approx(1, rel=1e-4)


def test_the_response_halves_the_power_at_the_bandwidth() -> None:
    sigma = pulse.response_deviation(71e6)
    # The transform of a normal curve of the deviation σ is exp(-(2πfσ)²/2).
    assert math.exp(-0.5 * (2 * math.pi * 71e6 * sigma) ** 2) ** 2 == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("shape", ["gaussian", "laser"])
@pytest.mark.parametrize("bandwidth", [40e6, 71e6, 200e6, 1e9])
def test_the_response_adds_its_variance_and_keeps_the_energy(shape: str, bandwidth: float) -> None:
    fwhm = 5 * NS
    tau = fwhm / 3.39467
    alone = (fwhm / WIDER) ** 2 if shape == "gaussian" else 3 * tau**2
    expected = alone + math.log(2) / (2 * math.pi * bandwidth) ** 2
    found = pulse.template(shaped(shape, fwhm), NS, bandwidth)
    assert variance(found) * NS**2 == pytest.approx(expected, rel=1e-4)
    assert found.power.sum() * NS / pulse.STEPS == pytest.approx(1, rel=1e-12)
    if shape == "gaussian":
        assert width(found) * NS == pytest.approx(WIDER * math.sqrt(expected), rel=2e-4)


@pytest.mark.parametrize("shape", ["gaussian", "laser"])
@pytest.mark.parametrize("bandwidth", [None, 71e6, 200e6])
def test_a_pulse_is_highest_where_it_says(shape: str, bandwidth: float | None) -> None:
    found = pulse.template(shaped(shape, 5 * NS), NS, bandwidth)
    assert found.power.argmax() == found.peak
    below, top, above = found.power[found.peak - 1 : found.peak + 2]
    assert abs(below - above) / (2 * (2 * top - below - above)) <= 1 / 16  # of a step: 1/512 bin
    assert found.power.min() >= 0
    assert max(found.power[0], found.power[-1]) < 1e-6 * top


def test_a_recorded_pulse_keeps_its_width_and_its_variance(tmp_path: Path) -> None:
    at = np.arange(-40, 41) * 0.25
    given = recorded(tmp_path, (4000 * np.exp(-0.5 * (at / 2) ** 2)).astype(np.int32), 0.25 * NS)
    found = pulse.template(given, NS, None)
    assert width(found) == pytest.approx(2 * WIDER, rel=2e-3)
    assert variance(found) == pytest.approx(4, rel=3e-3)
    assert found.power.sum() * NS / pulse.STEPS == pytest.approx(1, rel=1e-12)
    slow = pulse.template(given, NS, 71e6)
    response = math.log(2) / (2 * math.pi * 71e6) ** 2
    assert (variance(slow) - variance(found)) * NS**2 == pytest.approx(response, rel=1e-3)


def test_a_recorded_triangle_begins_and_ends_at_zero_and_loses_what_is_below(tmp_path: Path) -> None:
    found = pulse.template(recorded(tmp_path, np.array([-5.0, 1, 2, 1, -5])), NS, None)
    clipped = pulse.template(recorded(tmp_path, np.array([0.0, 1, 2, 1, 0])), NS, None)
    np.testing.assert_array_equal(found.power, clipped.power)
    # From 0 up to 40 in 40 steps and down again: the variance of a triangle is its half base squared over 6.
    steps = np.r_[1:41, 39:0:-1]
    assert variance(pulse.template(recorded(tmp_path, steps), NS, None)) == pytest.approx(40**2 / 6, rel=1e-3)


@pytest.mark.parametrize(
    "samples",
    [np.zeros(9), np.full(9, -1.0), np.array([1.0]), np.ones((3, 3)), np.array([1, np.nan, 1]), np.array(["a", "b"])],
)
def test_a_file_without_a_pulse_is_refused(tmp_path: Path, samples: Any) -> None:
    with pytest.raises(ValueError, match=r"^found .*, expected .*$"):
        pulse.template(recorded(tmp_path, samples), NS, 71e6)


# The air


@pytest.mark.parametrize(
    ("visibility", "per_km"),
    [
        # 3.91/V · (1.064/0.55)^-q, worked out by hand: ln(1.064/0.55) = 0.659872.
        (1, 3.91 * math.exp(-0.659872 * 0.585)),
        (5.999999, 0.651667 * math.exp(-0.659872 * 0.585 * 1.817121)),
        (6, 0.651667 * math.exp(-0.659872 * 1.3)),
        (23, 0.0720935),
        (50, 0.0782 * math.exp(-0.659872 * 1.3)),
        (50.000001, 0.0782 * math.exp(-0.659872 * 1.6)),
    ],
)
def test_extinction_is_kruses(visibility: float, per_km: float) -> None:
    assert atmosphere.extinction(visibility * KM, 1.064 * UM) * KM == pytest.approx(per_km, rel=3e-6)


@pytest.mark.parametrize("visibility", [0.5, 4, 6, 23, 50, 200])
def test_visibility_is_where_green_light_has_fallen_to_two_percent(visibility: float) -> None:
    away = visibility * KM
    assert math.exp(-atmosphere.extinction(away, 0.55 * UM) * away) == pytest.approx(0.02, rel=0.005)


def test_rytovs_variance_is_that_worked_out_by_hand() -> None:
    # k = 2π/1.55 µm = 4.053668e6, k^(7/6) = 5.11858e7; 1000^(11/6) = 10^5.5 = 3.162278e5.
    found = atmosphere.rytov_variance(1e-14, 1.55 * UM, [1000.0, 2000.0])
    assert found == pytest.approx([0.1990935, 0.1990935 * 2 ** (11 / 6)], rel=1e-5)


def test_turbulence_widens_a_beam_by_its_structure_constant() -> None:
    assert atmosphere.broadening(0, 1 * UM, 1000, 0.1) == 1
    assert atmosphere.broadening(1e-20, 1 * UM, 1000, 0.1) == pytest.approx(1, abs=1e-6)
    # Cn², k, R and ω put together: 1.33 · 1.23 · 2^(5/6) · Cn² k^(1/3) R^(8/3) ω^(-5/3).
    k = 2 * math.pi / 1e-6
    more = 2.91488 * 1e-13 * k ** (1 / 3) * 3000 ** (8 / 3) * 0.2 ** (-5 / 3)
    assert more > 1
    assert atmosphere.broadening(1e-13, 1 * UM, 3000, 0.2) == pytest.approx(math.sqrt(1 + more), rel=1e-5)


def test_a_point_scintillates_with_rytovs_variance_as_long_as_it_is_weak() -> None:
    for cn2 in (1e-18, 1e-17, 1e-16):
        weak = float(atmosphere.rytov_variance(cn2, 1 * UM, 1000))
        assert atmosphere.scintillation(cn2, 1 * UM, 1000, 0) == pytest.approx(weak, rel=0.01)


def test_scintillation_saturates_at_one() -> None:
    assert atmosphere.scintillation(1e-8, 1 * UM, 1e5, 0) == pytest.approx(1, rel=0.01)


def test_an_aperture_averages_scintillation_the_more_the_wider_it_is() -> None:
    diameter = np.geomspace(1e-3, 10, 60)
    found = atmosphere.scintillation(1e-14, 1 * UM, 1000, diameter)
    assert (np.diff(found) < 0).all()
    assert found[0] == pytest.approx(float(atmosphere.scintillation(1e-14, 1 * UM, 1000, 0)), rel=0.01)
    # Far wider than the Fresnel zone, it falls with D^(-7/3): Tatarskii.
    assert math.log(found[-1] / found[-10]) / math.log(diameter[-1] / diameter[-10]) == pytest.approx(-7 / 3, rel=1e-3)


@pytest.mark.parametrize("given", [1e-4, 0.04, 0.5])
def test_factors_of_scintillation_have_mean_one_and_the_variance_asked_for(given: float) -> None:
    found = atmosphere.scintillated(np.full(DRAWS, given), np.random.default_rng(1))
    assert found.min() > 0
    assert abs(found.mean() - 1) < 5 * standard_error(found, 1)
    assert abs(found.var() - given) < 5 * standard_error(found, 2)
    logarithm = np.log(found)
    third = ((logarithm - logarithm.mean()) ** 3).mean() / logarithm.std() ** 3
    assert abs(third) < 5 * math.sqrt(6 / DRAWS)


def test_without_scintillation_every_factor_is_one() -> None:
    assert atmosphere.scintillated(np.zeros(5), np.random.default_rng(1)).tolist() == [1] * 5


# What targets send back


@pytest.mark.parametrize("albedo", [0.05, 0.7, 1])
def test_a_diffuse_target_sends_its_albedo_into_the_half_space(albedo: float) -> None:
    def ring(angle: float) -> float:
        return reflection.backscatter(albedo / math.pi, 0.0, 1.0, math.cos(angle)) * 2 * math.pi * math.sin(angle)  # type: ignore[no-any-return]

    assert quad(ring, 0, math.pi / 2)[0] == pytest.approx(albedo, rel=1e-9)


def test_a_glint_falls_with_the_slope_that_facets_need() -> None:
    strength, slope = 0.8, 0.2
    at_slope = 1 / math.sqrt(1 + slope**2)
    assert reflection.backscatter(0.0, strength, slope**2, 1.0) == pytest.approx(strength)
    expected = strength * math.exp(-1) * (1 + slope**2) ** 3
    assert reflection.backscatter(0.0, strength, slope**2, at_slope) == pytest.approx(expected)
    assert reflection.backscatter(0.1, strength, slope**2, at_slope) == pytest.approx(0.1 * at_slope + expected)


def test_at_grazing_incidence_nothing_comes_back() -> None:
    found = [reflection.backscatter(0.1, 1.0, 0.04, cosine) for cosine in (0.0, 1e-300, 1e-9, 1e-5)]
    assert found == pytest.approx([0, 0, 1e-10, 1e-6], abs=1e-15)


@pytest.mark.parametrize(("diffuse", "specular", "slope"), [(0.1, 0, 1), (0, 0.5, 0.2), (0.15, 0.3, 0.7), (0.2, 1, 2)])
def test_leaves_send_back_the_mean_over_all_directions_that_they_face(
    diffuse: float, specular: float, slope: float
) -> None:
    def share(power: int) -> float:
        def ring(angle: float) -> float:
            cosine = math.cos(angle)
            tangent = min(math.tan(angle), 1e9)
            glint = specular * math.exp(-((tangent / slope) ** 2)) / cosine**6 if tangent < 26 * slope else 0.0
            sent = diffuse * cosine + glint if power else 1.0
            return sent * cosine * math.sin(angle)

        return float(quad(ring, 0, math.pi / 2, limit=500, epsabs=1e-13)[0])

    assert reflection.leaf_backscatter(diffuse, specular, slope**2) == pytest.approx(share(1) / share(0), rel=1e-6)


def test_facets_of_a_sea_are_those_of_cox_and_munk() -> None:
    assert reflection.sea_facets(8) == pytest.approx(0.04396, rel=1e-12)
    assert reflection.sea_facets(0) == 0.003


def test_the_order_of_speckle_is_how_many_grains_the_aperture_holds() -> None:
    # 10 cm: 7.853982e-3 m²; 25 cm: 4.908739e-2 m²; (1 µm · 500 m)² = 2.5e-7 m⁴.
    grains = 7.853982e-3 * 4.908739e-2 / 2.5e-7
    found = reflection.speckle_order(0.1, 1 * UM, [500.0, 1000.0, 1000.0], [0.25, 0.5, 0.25])
    assert found - 1 == pytest.approx([grains, grains, grains / 4], rel=1e-6)
    assert reflection.speckle_order(1e-9, 1 * UM, 500, 0.25) == pytest.approx(1)


@pytest.mark.parametrize("order", [1.0, 4.0, 50.0, 1500.0])
def test_speckle_has_mean_one_and_the_variance_of_its_order(order: float) -> None:
    found = reflection.speckle(order, (DRAWS,), np.random.default_rng(2))
    assert abs(found.mean() - 1) < 5 * standard_error(found, 1)
    assert abs(found.var() - 1 / order) < 5 * standard_error(found, 2)
    # Of a gamma law, the third moment over the deviation cubed is 2/√M.
    third = ((found - 1) / found.std()) ** 3
    assert abs(third.mean() - 2 / math.sqrt(order)) < 5 * standard_error(third, 1)


def test_each_waveform_has_speckle_of_its_own_order() -> None:
    order = np.array([[1.0], [100.0]])
    found = reflection.speckle(order, (2, DRAWS), np.random.default_rng(3))
    assert found.shape == (2, DRAWS)
    assert found.var(axis=1) == pytest.approx([1, 0.01], rel=0.05)


# The receiver


def test_every_photon_an_electron_is_an_ampere_a_watt_at_1_24_micrometres() -> None:
    assert receiver.responsivity(detector(), 1.239842 * UM) == pytest.approx(1, rel=1e-6)
    silicon = detector(quantum_efficiency=0.38)
    assert receiver.responsivity(silicon, 1.064 * UM) == pytest.approx(0.38 * 1.064 / 1.239842, rel=1e-6)
    assert receiver.responsivity(detector(quantum_efficiency=None, responsivity="0.9 A/W"), 1.064 * UM) == 0.9


@pytest.mark.parametrize(
    ("gain", "ratio", "factor"),
    [(1, 0, 1), (1, 0.3, 1), (1, 1, 1), (1e12, 0, 2), (100, 1, 100), (10, 0, 1.9), (100, 0.02, 2 + 0.98 * 1.99)],
)
def test_excess_noise_is_mcintyres(gain: float, ratio: float, factor: float) -> None:
    assert receiver.excess_noise(gain, ratio) == pytest.approx(factor, rel=1e-9)


def test_the_noise_bandwidth_is_the_integral_of_the_response() -> None:
    expected = 71e6 * quad(lambda f: 2.0 ** -(f**2), 0, np.inf)[0]
    assert receiver.noise_bandwidth(71e6) == pytest.approx(expected, rel=1e-9)


def test_shot_noise_of_a_perfect_detector_is_that_of_photons() -> None:
    # N photons vary by N; with N = P T/(hν) in T = 1/2B, power varies by 2B hν P.
    photon = PLANCK * LIGHT / 1.064e-6
    bandwidth = receiver.noise_bandwidth(100e6)
    assert receiver.shot_noise(detector(), 1.064 * UM) == pytest.approx(2 * bandwidth * photon, rel=1e-9)
    half = detector(quantum_efficiency=0.5)
    assert receiver.shot_noise(half, 1.064 * UM) == pytest.approx(4 * bandwidth * photon, rel=1e-9)


def test_shot_noise_is_that_of_the_current() -> None:
    # 1 µW makes 0.5 µA: 2eIB = 1.70558e-17 A² with B = 106.4467 MHz; times M² F, F = 0.02·50 + 0.98·1.98 = 2.9404.
    chain = detector(quantum_efficiency=None, responsivity="0.5 A/W", gain=50, ionisation_ratio=0.02)
    current = 2 * ELECTRON * 0.5e-6 * 106.4467e6 * 50**2 * 2.9404
    assert receiver.shot_noise(chain, 1.064 * UM) * 1e-6 * (0.5 * 50) ** 2 == pytest.approx(current, rel=1e-6)


def test_noise_without_light_is_that_of_both_dark_currents_and_of_the_load() -> None:
    chain = detector(
        quantum_efficiency=None,
        responsivity="0.5 A/W",
        gain=50,
        ionisation_ratio=0.02,
        surface_dark_current="50 nA",
        bulk_dark_current="0.1 nA",
        load_resistance="50 ohm",
        noise_figure="3 dB",
        temperature="290 K",
    )
    surface, bulk, thermal = (found * 25**2 for found in receiver.dark_noise(chain, 1.064 * UM))
    bandwidth = 106.4467e6
    assert surface == pytest.approx(2 * ELECTRON * 50e-9 * bandwidth, rel=1e-6)
    assert bulk == pytest.approx(2 * ELECTRON * 0.1e-9 * bandwidth * 2500 * 2.9404, rel=1e-6)
    # 50 Ω at 290 K make 3.20311e-22 A²/Hz, 17.9 pA a root hertz; 3 dB are a factor of 1.995262.
    assert thermal == pytest.approx(3.20311e-22 * bandwidth * 1.995262, rel=1e-5)


def test_a_receiver_without_load_or_dark_current_has_no_noise_without_light() -> None:
    assert receiver.dark_noise(detector(temperature="300 K", noise_figure=2), 1.064 * UM) == (0, 0, 0)


def test_sunlight_is_what_bright_ground_shines_into_the_field_of_view() -> None:
    # Radiance of a diffuse target, 0.5 W/m²/nm · 2 nm · 0.3/π, through π/4 · (1 mrad)² and π/4 · (10 cm)², half lost.
    chain = detector(filter_width="2 nm")
    expected = 0.5 * 2 * 0.3 / math.pi * (math.pi / 4 * 1e-6) * (math.pi / 4 * 0.01) * 0.5
    found = receiver.background(0.5e9, chain, [0.3 / math.pi, 0.3 / math.pi], [0.0, 0.7])
    assert found == pytest.approx([expected, expected * math.exp(-0.7)], rel=1e-6)


def test_light_at_the_detector_is_that_of_the_solid_angle_of_the_telescope() -> None:
    solid_angle = math.pi * 0.05**2 / 800**2
    through = math.exp(-2 * 1e-4 * 800)
    assert receiver.collected(0.1, 0.6) * receiver.range_law(800, 1e-4) == pytest.approx(solid_angle * 0.6 * through)
    assert pytest.approx(0.1498962 * 1e9) == receiver.BIN  # 15 cm a nanosecond


@pytest.mark.parametrize("samples", [40, 256])
@pytest.mark.parametrize("bandwidth", [15e6, 71e6, 200e6, 3e9])
def test_noise_is_correlated_as_the_response_says_in_records_of_any_length(samples: int, bandwidth: float) -> None:
    waveforms = 20_000
    found = receiver.correlated(np.random.default_rng(4), (waveforms, samples), NS, bandwidth)
    sigma = math.sqrt(math.log(2)) / (2 * math.pi * bandwidth) / NS
    assert found.shape == (waveforms, samples)
    for first in (0, (samples - 21) // 2, samples - 21):  # as everywhere in the record
        for lag in (0, 1, 2, 5, 20):
            product = found[:, first] * found[:, first + lag]
            expected = math.exp(-(lag**2) / (4 * sigma**2))
            assert abs(product.mean() - expected) < 5 * standard_error(product, 1) + 2e-4, (first, lag)
    assert abs(found.mean()) < 5 * math.sqrt(1 + 4 * sigma) / math.sqrt(found.size)


@pytest.mark.parametrize("bandwidth", [15e6, 71e6, 3e9])
def test_the_first_sample_knows_nothing_of_the_last(bandwidth: float) -> None:
    found = receiver.correlated(np.random.default_rng(5), (20_000, 256), NS, bandwidth)
    for first, last in ((0, -1), (0, -2), (1, -1)):
        product = found[:, first] * found[:, last]
        assert abs(product.mean()) < 5 * standard_error(product, 1)


def test_noise_of_a_single_sample_has_variance_one() -> None:
    found = receiver.correlated(np.random.default_rng(6), (DRAWS, 1), NS, 71e6)
    assert found.shape == (DRAWS, 1)
    assert abs(found.var() - 1) < 5 * standard_error(found, 2)


def test_waveforms_know_nothing_of_each_others_noise() -> None:
    found = receiver.correlated(np.random.default_rng(7), (2, DRAWS), NS, 71e6)
    assert abs((found[0] * found[1]).mean()) < 5 * math.sqrt(8 / DRAWS)


@pytest.mark.parametrize("bits", [8, 11, 16])
def test_counts_are_rounded_ties_to_even_and_clipped_to_the_bits(bits: int) -> None:
    full = 2**bits - 1
    given = [-1e9, -1, -0.5, 0.49, 0.5, 0.51, 1.5, 2.5, 3.5, full - 0.5, full + 0.4, full + 1, 1e9]
    expected = [0, 0, 0, 0, 0, 1, 2, 2, 4, full - 1, full, full, full]
    found = receiver.digitise(given, bits)
    assert found.dtype == np.uint16
    assert found.tolist() == expected
