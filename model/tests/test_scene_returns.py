"""Waveforms of scenes: what light comes back, when, and with how much noise, against what the physics says."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from scipy.integrate import quad

from openecho.scene.geometry.flight import beams
from openecho.scene.geometry.world import build
from openecho.scene.instrument import Instrument, instrument
from openecho.scene.physics import atmosphere
from openecho.scene.returns import Rays, Returned, returns
from openecho.scene.schema import Scene, loads
from openecho.scene.simulate import Simulated, Simulator, blocks, simulate, simulator

pytestmark = pytest.mark.filterwarnings("error")

Floats = NDArray[np.float64]

ELECTRON, BOLTZMANN, LIGHT = 1.602176634e-19, 1.380649e-23, 299792458.0
BIN = LIGHT / 2 * 1e-9
"""Range of a sample at 1 GS/s, m."""

BASE: dict[str, Any] = {
    "platform": {"altitude": "500 m", "speed": "60 m/s"},
    "laser": {
        "wavelength": "1064 nm",
        "energy": "20 µJ",
        "pulse": {"shape": "gaussian", "fwhm": "5 ns"},
        "divergence": "0.5 mrad",
        "rate": "10 kHz",
    },
    "receiver": {
        "aperture": "10 cm",
        "optics_efficiency": 0.6,
        "field_of_view": "2 mrad",  # e^-32 of the light is outside
        "responsivity": "0.5 A/W",
        "gain": 50,
        "ionisation_ratio": 0.02,
        "surface_dark_current": "50 nA",
        "bulk_dark_current": "0.1 nA",
        "load_resistance": "200 ohm",
        "noise_figure": 2,
        "temperature": "290 K",
        "bandwidth": "200 MHz",
    },
    "digitiser": {"rate": "1 GS/s", "bits": 12, "samples": 256, "gain": "80 counts/µW", "offset": "200 counts"},
    "seed": 1,
    "shots": 100,
}
GAIN = 80e6
"""Counts of a watt."""

GREY = {"albedo": 0.5}
PLANE = {"kind": "plane", "reflectance": GREY}
SENT = 20e-6 * 0.5 / math.pi * math.pi * 0.05**2 * 0.6
"""Energy that a white half of a flat target sends to the detector from a metre, J m²."""

QUIET: dict[str, Any] = {
    f"receiver__{key}": ... for key in ("surface_dark_current", "bulk_dark_current", "load_resistance")
}

RESPONSE = math.log(2) / (2 * math.pi * 0.2) ** 2
PULSE = math.sqrt(25 / (8 * math.log(2)) + RESPONSE)
"""Deviation of the recorded pulse, ns or bins."""


def scene(*targets: dict[str, Any], **changes: Any) -> Scene:
    """A scene with some targets and keys changed, dots as two underscores; ``...`` takes one away."""
    data = copy.deepcopy(BASE)
    data["targets"] = list(copy.deepcopy(targets))
    for key, value in changes.items():
        here = data
        *parts, last = key.split("__")
        for part in parts:
            here = here.setdefault(part, {})
        if value is ...:
            here.pop(last, None)
        else:
            here[last] = value
    return loads(yaml.safe_dump(data, allow_unicode=True), Path("a.yaml"))


def traced(given: Scene, *, adaptive: bool = True, shots: int = 1) -> tuple[Instrument, Returned]:
    """Waveforms of the first shots, with as many rays as needed or with all."""
    chain = instrument(given)
    rays = Rays(4096, adaptive, given.tolerance)
    return chain, returns(build(given), chain, beams(given, np.arange(shots)), rays)


def recorded(ready: Simulator) -> Simulated:
    """The first block."""
    return simulate(ready, *blocks(ready.scene)[0])


def energy(found: Returned) -> Floats:
    """On the detector, J."""
    return np.asarray(found.waveform.sum(axis=1) / GAIN * 1e-9)


def peak(waveform: Floats) -> float:
    """Where a normal curve is highest, bins."""
    top = int(waveform.argmax())
    below, middle, above = np.log(waveform[top - 1 : top + 2])
    return float(top + 0.5 * (below - above) / (below - 2 * middle + above))


def tilted(degrees: float, azimuth: float = 90.0, **more: Any) -> dict[str, Any]:
    """A plane that falls to the east."""
    return {**PLANE, "slope": f"{degrees} deg", "azimuth": f"{azimuth} deg", **more}


# When light comes back


@pytest.mark.parametrize("adaptive", [True, False])
def test_an_echo_of_a_flat_target_is_at_its_range(adaptive: bool) -> None:
    for altitude in np.random.default_rng(1).uniform(150, 3000, 50).tolist():
        given = scene(PLANE, platform__altitude=f"{altitude!r} m", laser__divergence="0.2 mrad")
        found = traced(given, adaptive=adaptive)[1]
        assert found.start[0] / BIN == pytest.approx(round(found.start[0] / BIN), abs=1e-6)
        assert peak(found.waveform[0]) == pytest.approx((altitude - found.start[0]) / BIN, abs=0.01)


def test_a_waveform_begins_64_samples_before_the_first_surface_or_where_it_is_told_to() -> None:
    found = traced(scene(PLANE))[1]
    assert found.start[0] == pytest.approx((math.floor(500 / BIN) - 64) * BIN)
    told = traced(scene(PLANE, digitiser__start="490 m"))[1]
    assert told.start.tolist() == [490]
    assert peak(told.waveform[0]) == pytest.approx(10 / BIN, abs=0.01)


def test_light_from_before_the_first_sample_and_after_the_last_is_not_recorded_but_its_tails_are() -> None:
    for start in (500 + 2 * BIN, 500 - 257 * BIN):
        found = traced(scene(PLANE, digitiser__start=f"{start!r} m"))[1]
        place = (500 - start) / BIN
        at = np.arange(256)
        expected = SENT / 500**2 * GAIN / 1e-9 * np.exp(-0.5 * ((at - place) / PULSE) ** 2)
        expected /= PULSE * math.sqrt(2 * math.pi)
        np.testing.assert_allclose(found.waveform[0], expected, atol=2e-3 * expected.max() + 1e-9)
    gone = traced(scene(PLANE, digitiser__start="560 m"))[1]
    assert not gone.waveform.any()


@pytest.mark.parametrize("adaptive", [True, False])
@pytest.mark.parametrize("degrees", [10, 30, 50])
@pytest.mark.parametrize("azimuth", [0, 70])
def test_a_sloping_plane_widens_the_echo_by_the_range_over_its_footprint(
    degrees: float, azimuth: float, adaptive: bool
) -> None:
    # A ray x to the side, x normal with half the radius to 1/e² as its deviation, is longer by x tan θ.
    given = scene(tilted(degrees, azimuth), laser__divergence="2 mrad", receiver__field_of_view="8 mrad", shots=5)
    found = traced(given, adaptive=adaptive, shots=5)[1]
    slope = math.tan(math.radians(degrees))
    spread = 500 * math.tan(1e-3) / 2 * slope / BIN
    width = math.hypot(PULSE, spread)
    if degrees == 50:
        assert spread > 1.5
    for number in range(5):
        # The platform has moved 6 mm a shot, at 60 m/s.
        range_ = 500 + slope * math.cos(math.radians(azimuth)) * 0.006 * number
        at = np.arange(256) - (range_ - found.start[number]) / BIN
        height = SENT * math.cos(math.radians(degrees)) / range_**2 * GAIN / 1e-9
        expected = height / (width * math.sqrt(2 * math.pi)) * np.exp(-0.5 * (at / width) ** 2)
        np.testing.assert_allclose(found.waveform[number], expected, atol=0.01 * expected.max())


@pytest.mark.parametrize("degrees", [0, 40])
def test_a_lasers_pulse_keeps_its_tail_and_is_highest_at_the_range(degrees: float) -> None:
    given = scene(
        tilted(degrees),
        laser__divergence="2 mrad",
        receiver__field_of_view="8 mrad",
        laser__pulse={"shape": "laser", "fwhm": "5 ns"},
    )
    found = traced(given)[1]
    step = 0.005  # ns
    time = np.arange(-40, 80, step)
    tau = 5 / 3.39467
    sent = np.where(time > 0, (time / tau) ** 2 * np.exp(-np.maximum(time, 0) / tau), 0)

    def blurred(variance: float) -> Floats:
        kernel = np.exp(-0.5 * np.arange(-20, 20 + step / 2, step) ** 2 / variance)
        return np.convolve(sent, kernel / kernel.sum(), "same")

    late = time[blurred(RESPONSE).argmax()]
    spread = 500 * math.tan(1e-3) / 2 * math.tan(math.radians(degrees)) / BIN
    curve = blurred(RESPONSE + spread**2)
    curve /= curve.sum() * step
    at = np.arange(256) - (500 - found.start[0]) / BIN
    height = SENT * math.cos(math.radians(degrees)) / 500**2 * GAIN / 1e-9
    expected = height * np.interp(at, time - late, curve, left=0, right=0)
    np.testing.assert_allclose(found.waveform[0], expected, atol=0.003 * expected.max())


# How much light comes back


@pytest.mark.parametrize("adaptive", [True, False])
@pytest.mark.parametrize("altitude", [300, 700, 3000])
def test_the_energy_falls_with_the_square_of_the_range(altitude: int, adaptive: bool) -> None:
    found = traced(scene(PLANE, platform__altitude=f"{altitude} m"), adaptive=adaptive)[1]
    assert energy(found) == pytest.approx([SENT / altitude**2], rel=1e-3)


@pytest.mark.parametrize("altitude", [300, 1000, 3000])
def test_air_takes_its_share_on_both_ways(altitude: int) -> None:
    given = scene(PLANE, platform__altitude=f"{altitude} m", atmosphere__visibility="10 km")
    sigma = 0.391e-3 * (1.064 / 0.55) ** -1.3
    expected = SENT / altitude**2 * math.exp(-2 * sigma * altitude)
    assert energy(traced(given)[1]) == pytest.approx([expected], rel=1e-3)
    assert energy(traced(given, adaptive=False)[1]) == pytest.approx([expected], rel=1e-3)


@pytest.mark.parametrize("adaptive", [True, False])
@pytest.mark.parametrize("degrees", [0, 30, 60])
def test_a_diffuse_target_sends_back_the_cosine_of_the_incidence(degrees: float, adaptive: bool) -> None:
    found = traced(scene(tilted(degrees)), adaptive=adaptive)[1]
    assert energy(found) == pytest.approx([SENT / 500**2 * math.cos(math.radians(degrees))], rel=1e-3)


def test_a_glint_adds_to_the_diffuse_light() -> None:
    bright = {**tilted(10), "reflectance": {"albedo": 0.5, "specular": 0.3, "facet_slope": 0.2}}
    slope = math.tan(math.radians(10))
    back = 0.5 / math.pi / math.sqrt(1 + slope**2) + 0.3 * math.exp(-((slope / 0.2) ** 2)) * (1 + slope**2) ** 3
    found = traced(scene(bright))[1]
    assert found.back == pytest.approx([back], rel=1e-3)
    assert energy(found) == pytest.approx([SENT / 500**2 * back / (0.5 / math.pi)], rel=1e-3)


@pytest.mark.parametrize("adaptive", [True, False])
def test_a_narrow_field_of_view_cuts_off_the_rim_of_the_footprint(adaptive: bool) -> None:
    found = traced(scene(PLANE, receiver__field_of_view="0.5 mrad"), adaptive=adaptive)[1]
    assert energy(found) == pytest.approx([SENT / 500**2 * (1 - math.exp(-2))], rel=1e-3)


@pytest.mark.parametrize("fidelity", ["plan", "full"])
def test_photons_are_kept_through_the_chain(fidelity: str) -> None:
    given = scene(tilted(25), atmosphere__visibility="5 km", digitiser__gain="7 counts/µW", shots=3)
    through = math.exp(-2 * 500 * 3.91 / 5e3 * (1.064 / 0.55) ** (-0.585 * 5 ** (1 / 3)))
    aperture = math.pi * 0.1**2 / 4 / 500**2
    expected = 20e-6 * 0.5 / math.pi * math.cos(math.radians(25)) * aperture * 0.6 * through
    found = recorded(simulator(given, fidelity))
    assert (found.noiseless.astype(float) - 200).sum(axis=1) / 7e6 * 1e-9 == pytest.approx([expected] * 3, rel=1e-3)
    assert found.truth["energy"] == pytest.approx([expected] * 3, rel=1e-3)


# Leaves


def crown(density: str = "0.5 m^2/m^3", albedo: float = 0.4, y: str = "0 m", **more: Any) -> dict[str, Any]:
    """A crown far wider than a footprint, 10 m deep."""
    return {
        "kind": "tree",
        "position": ["0 m", y, "0 m"],
        "crown": "cylinder",
        "crown_width": "60 m",
        "crown_base": "6 m",
        "height": "16 m",
        "leaf_area_density": density,
        "reflectance": {"albedo": albedo},
        **more,
    }


@pytest.mark.parametrize("fidelity", ["plan", "full"])
@pytest.mark.parametrize("degrees", [0, 30])
@pytest.mark.parametrize(("count", "density"), [(1, 0.1), (1, 0.5), (2, 0.15)])
def test_leaves_dim_the_ground_by_beer_and_lambert_and_send_back_what_they_take(
    count: int, density: float, degrees: float, fidelity: str
) -> None:
    slant = math.cos(math.radians(degrees))
    away = f"{500 * math.tan(math.radians(degrees))!r} m"
    trees = [crown(f"{density} m^2/m^3", y=away) for _ in range(count)]
    given = scene(PLANE, *trees, platform__attitude={"pitch": f"{degrees} deg"}, shots=1)
    found = recorded(simulator(given, fidelity))
    k = count * 0.5 * density / slant  # a metre of depth
    through = math.exp(-10 * k)
    ground = SENT * (slant / 500) ** 2 * slant * through
    # Leaves that face all directions alike send back 2/3 of what one does that faces the light.
    law = quad(lambda depth: k * math.exp(-k * depth) * (slant / (484 + depth)) ** 2, 0, 10)[0]
    leaves = SENT / 0.5 * 0.4 * 2 / 3 * law
    assert law == pytest.approx((1 - through) * (slant / 488) ** 2, rel=0.01)
    by_target = [found.truth["energy"][found.truth["target"] == number].sum() for number in range(count + 1)]
    assert by_target == pytest.approx([ground] + [leaves / count] * count, rel=3e-3)
    counts = found.noiseless[0].astype(float) - 200
    # Between them, 3 m above the ground, there is no light.
    between = 64 + round(13 / slant / BIN)
    assert counts[between] < 1e-3 * counts.max()
    both = counts[:between].sum() / GAIN * 1e-9, counts[between:].sum() / GAIN * 1e-9
    assert both == pytest.approx((leaves, ground), rel=3e-3)


def test_the_echo_of_a_crown_falls_exponentially_with_depth() -> None:
    found = traced(scene(PLANE, crown("0.6 m^2/m^3")))[1]
    k, depth = 0.3, (np.arange(256) * BIN + found.start[0]) - 484
    inside = (depth > 2) & (depth < 8)
    # An exponential, blurred by the pulse, is higher by exp(k²σ²/2).
    height = SENT / 0.5 * 0.4 * 2 / 3 / (484 + depth) ** 2 * k * np.exp(-k * depth) * BIN * GAIN / 1e-9
    expected = height * math.exp(0.5 * (k * PULSE * BIN) ** 2)
    np.testing.assert_allclose(found.waveform[0][inside], expected[inside], rtol=5e-3)


# As many rays as needed


EDGES: dict[str, list[dict[str, Any]]] = {
    "step": [
        {**PLANE, "position": ["10 m", "0 m", "3 m"], "size": ["200 m", "20 m"]},
        {**PLANE, "position": ["-10 m", "0 m", "0 m"], "size": ["200 m", "20 m"]},
    ],
    "gap": [
        {**PLANE, "position": ["10.05 m", "0 m", "0 m"], "size": ["200 m", "20 m"]},
        {**PLANE, "position": ["-10 m", "0 m", "0 m"], "size": ["200 m", "20 m"]},
        {**PLANE, "position": ["0 m", "0 m", "-1 m"]},
    ],
    "ball": [{"kind": "sphere", "position": ["0.05 m", "0 m", "1 m"], "radius": "0.4 m", "reflectance": GREY}, PLANE],
    "small ball": [
        {"kind": "sphere", "position": ["0 m", "0.02 m", "1 m"], "radius": "0.06 m", "reflectance": GREY},
        PLANE,
    ],
    "slope": [tilted(40, 30)],
    "ridge": [
        tilted(40, 90, position=["5 m", "0 m", "-4.195498 m"], size=["13.054073 m", "200 m"]),
        tilted(40, 270, position=["-5 m", "0 m", "-4.195498 m"], size=["13.054073 m", "200 m"]),
    ],
    "crown": [PLANE, {**crown(), "position": ["3.05 m", "0 m", "0 m"], "crown_width": "6 m"}],
    "cone": [PLANE, {**crown(), "position": ["0 m", "0 m", "0 m"], "crown_width": "2 m", "crown": "cone"}],
}


@pytest.mark.parametrize("name", list(EDGES))
def test_as_many_rays_as_needed_come_to_what_all_rays_do(name: str) -> None:
    # Across the edge, 30 waveforms in half a metre, over a footprint 25 cm wide.
    given = scene(
        *EDGES[name],
        platform__speed="170 m/s",
        platform__heading="60 deg",
        platform__start=["-0.2 m", "-0.12 m"],
        laser__divergence="0.5 mrad",
        shots=30,
    )
    chain, all_ = traced(given, adaptive=False, shots=30)
    found = traced(given, shots=30)[1]
    np.testing.assert_array_equal(found.start, all_.start)
    allowed = given.tolerance.allowed(chain.dark + chain.shot * all_.waveform)
    assert all_.waveform.max() > 100
    assert (abs(found.waveform - all_.waveform) / allowed).max() <= 1


def test_a_smooth_footprint_takes_no_rays() -> None:
    assert traced(scene(PLANE), shots=20)[1].rays.tolist() == [1] * 20
    assert traced(scene(tilted(30)), shots=20)[1].rays.tolist() == [1] * 20
    assert traced(scene(PLANE), adaptive=False)[1].rays.tolist() == [4096]


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, -0.5, 1.0])
def test_an_edge_shares_the_light_out_by_what_lies_on_either_side(share: float) -> None:
    # An edge x to the west of the axis, in deviations of a footprint of 250 mm: 62.5 mm.
    edge = f"{-share * 0.0625!r} m"
    step = [
        {**PLANE, "position": [f"{10 - share * 0.0625!r} m", "0 m", "3 m"], "size": ["200 m", "20 m"]},
        {**PLANE, "position": [edge, "0 m", "0 m"]},
    ]
    given = scene(*step, shots=1)
    found = recorded(simulator(given, "full"))
    high = 0.5 * (1 + math.erf(share * 500 / 497 / math.sqrt(2)))
    assert found.truth["target"].tolist() == [0, 1]
    expected = [SENT / 497**2 * high, SENT / 500**2 * (1 - high)]
    assert found.truth["energy"] == pytest.approx(expected, rel=5e-3)


# Nothing to see


@pytest.mark.parametrize("fidelity", ["plan", "full"])
def test_a_beam_that_meets_nothing_records_noise_and_has_no_truth(fidelity: str) -> None:
    aside = {**PLANE, "position": ["90 m", "0 m", "0 m"], "size": ["1 m", "1 m"]}
    for given in (scene(), scene(aside)):
        for adaptive in (True, False):
            found = traced(given, adaptive=adaptive, shots=3)[1]
            assert not found.waveform.any()
            assert found.rays.tolist() == [0, 0, 0]
            assert not found.back.any()
        one = recorded(simulator(given, fidelity))
        assert len(one.truth) == 0
        assert (one.noiseless == 200).all()
        assert one.samples.shape == (100, 256)


def test_only_the_beams_that_meet_something_have_truth() -> None:
    # 60 m/s at 10 kHz are 6 mm a shot; the field begins 30 cm to the north, 1.2 radii away.
    ahead = {**PLANE, "position": ["0 m", "51.5 m", "0 m"], "size": ["100 m", "100 m"]}
    found = recorded(simulator(scene(ahead, platform__speed="600 m/s")))
    assert found.truth["waveform"].tolist() == list(range(found.truth["waveform"][0], 100))
    assert 15 < found.truth["waveform"][0] < 25
    lit = (found.noiseless != 200).any(axis=1)
    np.testing.assert_array_equal(np.flatnonzero(lit), found.truth["waveform"])


# Recorded waveforms


def dark_variance() -> float:
    """Of the noise of `BASE` without light, counts², by the textbook: 2eIB, times M²F if multiplied, and 4kTBN/R."""
    width = 200e6 * quad(lambda f: 2.0 ** -(f**2), 0, np.inf)[0]
    factor = 0.02 * 50 + 0.98 * (2 - 1 / 50)
    currents = 2 * ELECTRON * width * (50e-9 + 0.1e-9 * 50**2 * factor)
    thermal = 4 * BOLTZMANN * 290 * width / 200 * 2
    return float((currents + thermal) * (GAIN / (0.5 * 50)) ** 2)


def test_noise_of_a_dark_scene_has_the_variance_of_the_textbook() -> None:
    found = recorded(simulator(scene(shots=2000, digitiser__gain="800 counts/µW"), "full"))
    expected = 100 * dark_variance()
    assert expected > 10
    square = ((found.samples - 200.0) ** 2).mean(axis=1)
    # Rounding adds a twelfth.
    assert abs(square.mean() - expected - 1 / 12) < 5 * square.std() / math.sqrt(len(square))
    means = found.samples.mean(axis=1)
    assert abs(means.mean() - 200) < 5 * means.std() / math.sqrt(len(means))


def test_noise_of_light_grows_with_the_light() -> None:
    given = scene(PLANE, shots=2000, platform__speed="0 m/s", digitiser__bits=16, digitiser__gain="800 counts/µW")
    found = recorded(simulator(given, "full"))
    top = int(found.noiseless[0].argmax())
    power = (float(found.noiseless[0, top]) - 200) / 800e6
    width = 200e6 * quad(lambda f: 2.0 ** -(f**2), 0, np.inf)[0]
    factor = 0.02 * 50 + 0.98 * (2 - 1 / 50)
    shot = 2 * ELECTRON * 0.5 * power * width * 50**2 * factor * (800e6 / 25) ** 2
    expected = 100 * dark_variance() + shot + 1 / 12
    assert shot > 100 * dark_variance()
    square = (found.samples[:, top] - float(found.noiseless[0, top])) ** 2
    assert abs(square.mean() - expected) < 5 * square.std() / math.sqrt(2000)


def test_neighbouring_samples_share_noise_as_the_response_says() -> None:
    given = scene(shots=2000, digitiser__gain="8000 counts/µW", digitiser__bits=16, digitiser__offset="5000 counts")
    off = recorded(simulator(given, "full")).samples - 5000.0
    for lag in (1, 2, 3):
        product = (off[:, :-lag] * off[:, lag:]).mean(axis=1) / (1e4 * dark_variance())
        expected = math.exp(-(lag**2) / (4 * RESPONSE))
        assert abs(product.mean() - expected) < 5 * product.std() / math.sqrt(2000)


def test_counts_are_clipped_at_full_scale_and_at_zero() -> None:
    given = scene(PLANE, digitiser__gain="800 counts/µW", digitiser__offset="0 counts")
    found = recorded(simulator(given, "full"))
    assert found.noiseless.max() > 4096
    assert (found.samples.max(axis=1) == 4095).all()
    assert (found.samples == 0).mean() > 0.3
    assert found.samples.dtype == np.uint16


def test_the_same_seed_makes_the_same_bytes_and_another_others() -> None:
    noisy = {"speckle": 4, "atmosphere__cn2": "1e-14 m^(-2/3)", "shots": 300}
    once, again, other = (recorded(simulator(scene(PLANE, seed=seed, **noisy))) for seed in (1, 1, 2))
    assert once.samples.tobytes() == again.samples.tobytes()
    assert once.noiseless.tobytes() == again.noiseless.tobytes()
    assert once.truth.tobytes() == again.truth.tobytes()
    assert once.samples.tobytes() != other.samples.tobytes()
    assert once.noiseless.tobytes() == other.noiseless.tobytes()


def test_blocks_have_noise_of_their_own_and_follow_one_another() -> None:
    ready = simulator(scene(PLANE, shots=5000))
    given = blocks(ready.scene)
    assert sum(shots for _, shots in given) == 5000
    assert [first for first, _ in given] == [sum(shots for _, shots in given[:k]) for k in range(len(given))]
    one, other = simulate(ready, *given[0]), simulate(ready, *given[1])
    assert one.samples[:500].tobytes() != other.samples[:500].tobytes()
    assert other.time[0] == pytest.approx(given[1][0] / 10e3)
    assert other.truth["waveform"][0] == given[1][0]


@pytest.mark.parametrize("order", [1, 4, 30])
def test_speckle_spreads_the_energy_of_a_flat_target_by_its_order(order: int) -> None:
    given = scene(PLANE, speckle=order, shots=2000, digitiser__bits=16, **QUIET)
    found = recorded(simulator(given, "full"))
    share = (found.samples - 200.0).sum(axis=1)
    share /= (found.noiseless.astype(float) - 200).sum(axis=1)
    assert abs(share.mean() - 1) < 5 * share.std() / math.sqrt(2000)
    square = (share - 1) ** 2
    assert abs(square.mean() - 1 / order) < 5 * square.std() / math.sqrt(2000)


def test_scintillation_spreads_the_energy_of_a_waveform() -> None:
    given = scene(
        PLANE, atmosphere__cn2="1e-13 m^(-2/3)", laser__divergence="0.1 mrad", shots=2000, digitiser__bits=16, **QUIET
    )
    found = recorded(simulator(given, "full"))
    share = (found.samples - 200.0).sum(axis=1)
    share /= (found.noiseless.astype(float) - 200).sum(axis=1)
    wide = 0.05 * float(atmosphere.broadening(1e-13, 1064e-9, 500, 0.025))
    expected = float(atmosphere.scintillation(1e-13, 1064e-9, 500, wide))
    assert 0.01 < expected < 0.2
    assert abs(share.mean() - 1) < 5 * share.std() / math.sqrt(2000)
    square = (share - 1) ** 2
    assert abs(square.mean() - expected) < 5 * square.std() / math.sqrt(2000)


def test_sunlight_lifts_every_sample_by_what_the_ground_sends_back() -> None:
    given = scene(
        PLANE, atmosphere__background="0.65 W/m^2/nm", receiver__filter_width="10 nm", digitiser__gain="80 counts/nW"
    )
    found = recorded(simulator(given, "full"))
    # Radiance of diffuse ground into π/4 · (2 mrad)², π/4 · (10 cm)², 60 %.
    power = 0.65 * 10 * 0.5 / math.pi * math.pi * 1e-6 * math.pi * 0.05**2 * 0.6
    assert found.noiseless[:, -1] - 200.0 == pytest.approx([power * 80e9] * 100, rel=1e-4)


@pytest.mark.parametrize("fidelity", ["plan", "full"])
def test_truth_tells_range_bin_spread_and_incidence(fidelity: str) -> None:
    given = scene(tilted(35), laser__divergence="2 mrad", receiver__field_of_view="8 mrad", shots=4)
    found = recorded(simulator(given, fidelity))
    truth = found.truth
    assert truth["waveform"].tolist() == [0, 1, 2, 3]
    assert truth["target"].tolist() == truth["object"].tolist() == [0] * 4
    # Mean over the footprint of R (1 + x tan θ + x² tan² θ + (x² + y²)/2), x and y of the deviation tan(1 mrad)/2.
    slope = math.tan(math.radians(35))
    assert truth["range"] == pytest.approx([500 * (1 + 0.25e-6 * (slope**2 + 1))] * 4, abs=2e-3)
    assert truth["spread"] == pytest.approx([0.25 * slope] * 4, rel=5e-3)
    assert truth["incidence"] == pytest.approx([math.radians(35)] * 4, abs=1e-3)
    start = 500 - found.first[:, 2]
    assert truth["bin"] == pytest.approx((truth["range"] - start) / BIN, abs=1e-6)


def test_the_first_and_the_last_sample_are_along_the_beam() -> None:
    given = scene(
        PLANE,
        platform__attitude={"pitch": "30 deg"},
        platform__start=["7 m", "-9 m"],
        digitiser__start="550 m",
        shots=2,
    )
    found = recorded(simulator(given))
    for place, away in ((found.first, 550), (found.last, 550 + 255 * BIN)):
        expected = [[7, -9 + 0.006 * shot + away / 2, 500 - away * math.sqrt(0.75)] for shot in range(2)]
        np.testing.assert_allclose(place, expected, atol=1e-6)


def test_objects_of_a_target_are_told_apart() -> None:
    stairs = {
        "kind": "terraces",
        "position": ["0 m", "-0.05 m", "0 m"],
        "steps": 3,
        "rise": "1 m",
        "run": "0.05 m",
        "width": "9 m",
        "reflectance": GREY,
    }
    truth = recorded(simulator(scene(PLANE, stairs, shots=1))).truth
    # Risers are upright, and so are the rays, but for a share of 1e-4.
    treads = truth[(truth["target"] == 1) & (truth["object"] < 3)]
    assert treads["object"].tolist() == [2, 1, 0]  # the highest first
    assert treads["range"] == pytest.approx([497, 498, 499], abs=1e-3)
    risers = truth[(truth["target"] == 1) & (truth["object"] >= 3)]
    assert risers["energy"].sum() < 1e-3 * treads["energy"].sum()


def test_a_crown_is_one_object_and_its_leaves_have_no_incidence() -> None:
    stand = {
        "kind": "stand",
        "size": ["6 m", "6 m"],
        "density": "0.3 /m^2",
        "height": "12 m",
        "deviation": "2 m",
        "crown": "ellipsoid",
        "crown_width": 0.5,
        "crown_base": 0.3,
        "leaf_area_density": "0.1 m^2/m^3",
        "reflectance": GREY,
    }
    found = recorded(simulator(scene(PLANE, stand, shots=20)))
    truth = found.truth
    leaves = truth[truth["target"] == 1]
    assert len(set(leaves["object"].tolist())) > 1
    assert np.isnan(leaves["incidence"]).all()
    assert not np.isnan(truth[truth["target"] == 0]["incidence"]).any()
    pairs = list(zip(leaves["waveform"].tolist(), leaves["object"].tolist(), strict=True))
    assert len(set(pairs)) == len(pairs)
    sums = np.bincount(truth["waveform"], truth["energy"], 20)
    # The range law at the mean range stands for that of each leaf: a crown 8 m deep, 490 m away.
    assert (found.noiseless.astype(float) - 200).sum(axis=1) / GAIN * 1e-9 == pytest.approx(sums, rel=1e-3)
