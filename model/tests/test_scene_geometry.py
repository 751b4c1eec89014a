"""Beams, footprints and what rays meet, against closed forms and against brute force."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import yaml
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad
from scipy.special import exp1

from openecho.scene.geometry import footprint, random_heights, trace
from openecho.scene.geometry.flight import aims, beams
from openecho.scene.geometry.world import World, build
from openecho.scene.schema import Platform, Relief, Scene, Sea, loads

pytestmark = pytest.mark.filterwarnings("error")

Floats = NDArray[np.float64]

DOWN = (0.0, 0.0, -1.0)
GRAVITY = 9.80665
GREY = {"albedo": 0.5}


def scene(*targets: dict[str, Any], **platform: Any) -> Scene:
    """A scene with some targets, 500 m above them, with a platform that is changed."""
    data = {
        "platform": {"altitude": "500 m", "speed": "60 m/s", **platform},
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
            "field_of_view": "2 mrad",
            "quantum_efficiency": 0.4,
            "bandwidth": "200 MHz",
        },
        "digitiser": {
            "rate": "1 GS/s",
            "bits": 12,
            "samples": 256,
            "gain": "80 counts/µW",
            "offset": "200 counts",
            "channels": 64,
        },
        "shots": 1000,
        "targets": [{"reflectance": GREY, **target} for target in targets],
    }
    return loads(yaml.safe_dump(data, allow_unicode=True), Path("a.yaml"))


def platform(**changes: Any) -> Platform:
    """A platform at rest."""
    return Platform.model_validate({"altitude": "500 m", "speed": "0 m/s", **changes})


class Met(NamedTuple):
    """What a ray meets."""

    range: float
    cosine: float
    target: int
    object: int


def unit(vector: ArrayLike) -> Floats:
    """The same direction."""
    vector = np.asarray(vector, np.float64)
    return np.asarray(vector / np.linalg.norm(vector))


def meet(world: World, origin: ArrayLike, direction: ArrayLike) -> Met:
    """First surface that a ray meets."""
    place, way = np.asarray(origin, np.float64), unit(direction)
    return Met(*trace.surface(world.shapes, world.heights, *place.tolist(), *way.tolist()))


def grids(*given: tuple[Floats, float, float, float, bool]) -> World:
    """Grids of heights: z, x, y, cell, and whether it repeats."""
    shapes, first = np.zeros((len(given), 16)), 0
    for number, (z, x, y, cell, repeats) in enumerate(given):
        low, high = float(np.nanmin(z)), float(np.nanmax(z))
        shapes[number, :11] = trace.GRID, number, first, *z.shape, x, y, cell, low, high, repeats
        first += z.size
    heights = np.concatenate([z.ravel() for z, *_ in given])
    empty = build(scene()).world
    return empty._replace(shapes=shapes, heights=heights)


def bilinear(z: Floats, x: Floats, y: Floats) -> Floats:
    """Heights between those at the corners of cells of a metre; NaN beyond."""
    rows, columns = z.shape
    inside = (x >= 0) & (y >= 0) & (x <= columns - 1) & (y <= rows - 1)
    j, i = (np.clip(np.floor(at).astype(int), 0, most - 2) for at, most in ((x, columns), (y, rows)))
    u, v = x - j, y - i
    south, north = z[i, j] * (1 - u) + z[i, j + 1] * u, z[i + 1, j] * (1 - u) + z[i + 1, j + 1] * u
    return np.where(inside, south * (1 - v) + north * v, np.nan)


def march(z: Floats, origin: Floats, way: Floats, far: float, step: float = 2e-3) -> float:
    """First range at which a ray passes through a grid with cells of a metre, found by going along it."""

    def above(t: ArrayLike) -> Floats:
        at = origin + np.asarray(t, np.float64)[..., None] * way
        return np.asarray(at[..., 2] - bilinear(z, at[..., 0], at[..., 1]))

    t = np.arange(0, far, step)
    sign = np.sign(above(t))
    crossings = np.flatnonzero(sign[:-1] * sign[1:] < 0)
    if not len(crossings):
        return math.inf
    low, high = t[crossings[0]], t[crossings[0] + 1]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if np.sign(above(middle)) != sign[crossings[0]] else (middle, high)
    return float(low)


def hills(side: int, seed: int, height: float = 4.0) -> Floats:
    """Smooth hills at random, which repeat after `side` cells, the last row and column the first again."""
    rng = np.random.default_rng(seed)
    k = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None, :]) * side
    z = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((side, side))) * np.exp(-((k / 5) ** 2)), (side, side))
    z *= height / abs(z).max()
    return np.pad(z, ((0, 1), (0, 1)), "wrap")


# The flight


def test_without_a_scan_the_beam_goes_straight_down() -> None:
    np.testing.assert_allclose(aims(platform(), np.array([0, 1.0]))[:, 0], [DOWN, DOWN], atol=1e-15)


@pytest.mark.parametrize(
    ("kind", "shares"),
    [("line", [-1, -0.5, 0, 0.5, -1, -0.8]), ("zigzag", [-1, 0, 1, 0, -1, -0.6])],
)
def test_a_mirror_sweeps_at_constant_angular_speed_from_left_to_right(kind: str, shares: list[float]) -> None:
    flown = platform(scan={"kind": kind, "half_angle": "20 deg", "rate": "50 Hz"})
    found = aims(flown, np.array([0, 0.25, 0.5, 0.75, 1, 1.1]) / 50)
    angle = np.radians(20) * np.array(shares)
    assert found.shape == (6, 1, 3)
    # Flying north, the right is east.
    expected = np.stack([np.sin(angle), np.zeros(6), -np.cos(angle)], axis=1)
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-12)


def test_an_array_of_beams_is_centred_and_goes_row_by_row_from_the_rear_left() -> None:
    flown = platform(scan={"kind": "raster", "rows": 3, "columns": 4, "spacing": "2 deg"})
    found = aims(flown, np.array([0, 7.0]))
    assert found.shape == (2, 12, 3)
    np.testing.assert_array_equal(found[0], found[1])
    along, across = np.degrees(np.arcsin(found[0, :, 1])), np.degrees(np.arctan2(found[0, :, 0], -found[0, :, 2]))
    np.testing.assert_allclose(along, np.repeat([-2, 0, 2], 4), atol=1e-12)
    np.testing.assert_allclose(across, np.tile([-3, -1, 1, 3], 3), atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"attitude": {"roll": "10 deg"}}, (-math.sin(math.radians(10)), 0, -math.cos(math.radians(10)))),
        ({"attitude": {"pitch": "10 deg"}}, (0, math.sin(math.radians(10)), -math.cos(math.radians(10)))),
        ({"attitude": {"yaw": "10 deg"}}, DOWN),
        # Flying east, the left is north and forward is east.
        ({"heading": "90 deg", "attitude": {"roll": "90 deg"}}, (0, 1, 0)),
        ({"heading": "90 deg", "attitude": {"pitch": "90 deg"}}, (1, 0, 0)),
        # Rolled by 30° first, the beam is then pitched by 20° about the wings.
        (
            {"attitude": {"roll": "30 deg", "pitch": "20 deg"}},
            (-0.5, math.sin(math.radians(20)) * math.sqrt(0.75), -math.cos(math.radians(20)) * math.sqrt(0.75)),
        ),
    ],
)
def test_attitude_turns_a_beam_that_goes_down(changes: dict[str, Any], expected: tuple[float, ...]) -> None:
    np.testing.assert_allclose(aims(platform(**changes), np.zeros(1))[0, 0], expected, atol=1e-12)


def test_yaw_and_heading_turn_a_beam_on_the_right_clockwise() -> None:
    scan = {"kind": "zigzag", "half_angle": "30 deg", "rate": "1 Hz"}
    right = np.array([0.5])  # where the swing is furthest to the right
    yawed = aims(platform(scan=scan, attitude={"yaw": "90 deg"}), right)[0, 0]
    headed = aims(platform(scan=scan, heading="90 deg"), right)[0, 0]
    south = [0, -0.5, -math.sqrt(0.75)]
    np.testing.assert_allclose([yawed, headed], [south, south], atol=1e-12)
    little = aims(platform(scan=scan, attitude={"yaw": "10 deg"}), right)[0, 0]
    azimuth = math.radians(100)
    expected = [0.5 * math.sin(azimuth), 0.5 * math.cos(azimuth), -math.sqrt(0.75)]
    np.testing.assert_allclose(little, expected, atol=1e-12)


def test_aims_are_unit_vectors_whatever_the_attitude() -> None:
    flown = platform(
        heading="77 deg",
        attitude={"roll": "-13 deg", "pitch": "4 deg", "yaw": "5 deg"},
        scan={"kind": "raster", "rows": 7, "columns": 9, "spacing": "10 deg"},
    )
    np.testing.assert_allclose(np.linalg.norm(aims(flown, np.zeros(1)), axis=-1), 1, rtol=1e-14)


def test_a_platform_flies_along_its_heading_from_its_start() -> None:
    given = scene(
        heading="60 deg", start=["100 m", "-20 m"], scan={"kind": "raster", "rows": 1, "columns": 2, "spacing": "1 deg"}
    )
    found = beams(given, np.array([0, 500, 999]))
    assert found.waveform.tolist() == [0, 1, 1000, 1001, 1998, 1999]
    np.testing.assert_allclose(found.time, np.repeat([0, 0.05, 0.0999], 2), rtol=1e-12)
    way = np.repeat([0, 3, 5.994], 2)
    expected = np.stack([100 + way * math.sqrt(0.75), -20 + way / 2, np.full(6, 500)], axis=1)
    np.testing.assert_allclose(found.origin, expected, rtol=1e-12)


# The footprint


@pytest.mark.parametrize("count", [64, 256, 1024, 4096])
@pytest.mark.parametrize("cut", [1.0, 2.0, 4.0])
def test_rays_have_the_moments_of_the_light_within_the_field_of_view(count: int, cut: float) -> None:
    found = footprint.rays(4096, cut)[:count]
    energy = quad(lambda r: 4 * r * math.exp(-2 * r**2), 0, cut)[0]
    square = quad(lambda r: 4 * r**3 * math.exp(-2 * r**2), 0, cut)[0] / energy / 2
    assert footprint.seen(cut) == pytest.approx(energy, rel=1e-12)
    assert np.hypot(*found.T).max() <= cut
    assert (found**2).mean(axis=0) == pytest.approx([square, square], rel=4 / count + 0.002)
    assert abs(found.mean(axis=0)).max() < 0.1 / math.sqrt(count)
    if cut == 4:
        assert square == pytest.approx(0.25, rel=1e-9)


def test_a_circle_holds_its_share_of_the_rays() -> None:
    radius = np.hypot(*footprint.rays(4096, 4).T)
    for edge in (0.3, 1.0, 1.5):
        # 86 % of the energy is within the radius to 1/e².
        assert (radius < edge).mean() == pytest.approx(1 - math.exp(-2 * edge**2), abs=1 / 4096)


def test_probes_integrate_polynomials_of_the_fifth_degree() -> None:
    points, weights = footprint.probes(4.0)
    moments = {0: 1.0, 1: 0.0, 2: 1 / 4, 3: 0.0, 4: 3 / 16, 5: 0.0}
    for m in range(6):
        for n in range(6 - m):
            found = weights @ (points[:, 0] ** m * points[:, 1] ** n)
            assert found == pytest.approx(moments[m] * moments[n], abs=1e-12), (m, n)


@pytest.mark.parametrize("cut", [0.7, 1.0, 4.0])
def test_probes_have_the_variance_of_what_the_field_of_view_leaves(cut: float) -> None:
    points, weights = footprint.probes(cut)
    energy = quad(lambda r: r * math.exp(-2 * r**2), 0, cut)[0]
    square = quad(lambda r: r**3 * math.exp(-2 * r**2), 0, cut)[0] / energy / 2
    assert weights @ points**2 == pytest.approx([square, square], rel=1e-9)


@pytest.mark.parametrize("cut", [1.0, 4.0])
def test_guards_stand_around_the_footprint_and_weigh_nothing(cut: float) -> None:
    points, weights = footprint.probes(cut)
    guards = points[weights == 0]
    assert guards[0].tolist() == [0, 0]
    np.testing.assert_allclose(np.hypot(*guards[1:].T), min(2, cut))
    assert (weights >= 0).all()


# Surfaces of closed form


@pytest.mark.parametrize("azimuth", [0, 90, 200])
@pytest.mark.parametrize("slope", [0, 20, 60])
def test_a_plane_falls_towards_its_azimuth(azimuth: float, slope: float) -> None:
    place = ["3 m", "-4 m", "10 m"]
    world = build(
        scene({"kind": "plane", "slope": f"{slope} deg", "azimuth": f"{azimuth} deg", "position": place})
    ).world
    toward = np.array([math.sin(math.radians(azimuth)), math.cos(math.radians(azimuth))])
    for x, y in ((3, -4), (20, 5), (-7, 30)):
        height = 10 - math.tan(math.radians(slope)) * (toward @ [x - 3, y + 4])
        found = meet(world, (x, y, 500), DOWN)
        assert found.range == pytest.approx(500 - height, abs=1e-9)
        assert found.cosine == pytest.approx(math.cos(math.radians(slope)), rel=1e-12)
        assert (found.target, found.object) == (0, 0)
        # Aimed at the same point from aside, and from below.
        for origin in ((x + 100.0, y - 50.0, 400.0), (x - 1.0, y + 3.0, -300.0)):
            way = np.array([x, y, height]) - origin
            slanted = meet(world, origin, way)
            normal = np.array([*(math.sin(math.radians(slope)) * toward), math.cos(math.radians(slope))])
            assert slanted.range == pytest.approx(np.linalg.norm(way), rel=1e-12)
            assert slanted.cosine == pytest.approx(abs(normal @ unit(way)), rel=1e-9)


def test_a_rectangle_is_as_long_on_its_own_surface_as_it_says() -> None:
    # 20 m along the fall at 60°: 10 m on the map; it falls to the east.
    world = build(
        scene(
            {"kind": "plane", "slope": "60 deg", "azimuth": "90 deg", "size": ["20 m", "6 m"], "position": ["0 m"] * 3}
        )
    ).world
    inside = [(4.99, 0), (-4.99, 0), (0, 2.99), (0, -2.99), (4.99, -2.99)]
    outside = [(5.01, 0), (-5.01, 0), (0, 3.01), (0, -3.01), (-5.01, 3.01)]
    assert [meet(world, (x, y, 500), DOWN).range for x, y in inside] == pytest.approx(
        [500 + x * math.sqrt(3) for x, _ in inside]
    )
    assert all(math.isinf(meet(world, (x, y, 500), DOWN).range) for x, y in outside)


def test_a_ray_that_meets_nothing_goes_on_for_ever() -> None:
    world = build(
        scene({"kind": "plane"}, {"kind": "sphere", "position": ["9 m", "0 m", "9 m"], "radius": "1 m"})
    ).world
    for way in ((0, 0, 1), (1, 0, 0), (0, 1, 1e-9)):
        found = meet(world, (0, 0, 20), way)
        assert (found.range, found.target) == (math.inf, trace.NOWHERE)
    assert meet(build(scene()).world, (0, 0, 20), DOWN) == (math.inf, 0, trace.NOWHERE, 0)


def test_a_ray_does_not_meet_the_surface_that_it_starts_from() -> None:
    world = build(scene({"kind": "plane"})).world
    assert math.isinf(meet(world, (0, 0, 0), DOWN).range)
    assert math.isinf(meet(world, (0, 0, 0), (0, 1, 1)).range)


def test_the_nearest_of_several_targets_is_met() -> None:
    world = build(
        scene(
            {"kind": "plane", "position": ["0 m", "0 m", "2 m"], "size": ["4 m", "4 m"]},
            {"kind": "plane"},
            {"kind": "sphere", "position": ["0 m", "0 m", "5 m"], "radius": "1 m"},
        )
    ).world
    found = [meet(world, (x, 0, 500), DOWN) for x in (0, 1.5, 3)]
    assert [(one.range, one.target) for one in found] == [(494, 2), (498, 0), (500, 1)]


def test_stairs_have_treads_and_risers() -> None:
    # Four steps of 2 m up and 3 m deep, 10 m wide, climbing to the east from x = 1 m.
    world = build(
        scene(
            {
                "kind": "terraces",
                "position": ["1 m", "0 m", "5 m"],
                "azimuth": "90 deg",
                "steps": 4,
                "rise": "2 m",
                "run": "3 m",
                "width": "10 m",
            }
        )
    ).world
    for k in range(4):
        for x in (1.01 + 3 * k, 3.99 + 3 * k):
            assert meet(world, (x, 4.99, 100), DOWN) == pytest.approx((95 - 2 * (k + 1), 1, 0, k))
        for z in (5.01 + 2 * k, 6.99 + 2 * k):
            assert meet(world, (-50, -4.99, z), (1, 0, 0)) == pytest.approx((51 + 3 * k, 1, 0, 4 + k))
    assert all(
        math.isinf(meet(world, (x, y, 100), DOWN).range) for x, y in ((0.99, 0), (13.01, 0), (5, 5.01), (5, -5.01))
    )
    # Down at 45° against the climb: the first riser is met half-way up, 1 m above its foot and 99 m before it.
    slanted = meet(world, (1 - 99, 0, 6 + 99), (1, 0, -1))
    assert slanted == pytest.approx((99 * math.sqrt(2), math.sqrt(0.5), 0, 4))
    over = meet(world, (3 - 50, 0, 7 + 50), (1, 0, -1))
    assert over == pytest.approx((50 * math.sqrt(2), math.sqrt(0.5), 0, 0))


@pytest.mark.parametrize("away", [30.0, 1e3, 5e5])
def test_a_ball_is_met_where_it_is_however_far_it_is(away: float) -> None:
    world = build(scene({"kind": "sphere", "position": ["5 m", "-3 m", "2 m"], "radius": "1.5 m"})).world
    rng = np.random.default_rng(1)
    centre = np.array([5, -3, 2.0])
    for _ in range(100):
        origin = centre + away * unit(rng.standard_normal(3))
        normal = unit(rng.standard_normal(3))
        point = centre + 1.5 * normal
        facing = unit(point - origin) @ normal
        if facing > -0.01:
            continue
        found = meet(world, origin, point - origin)
        assert found.range == pytest.approx(math.dist(point, origin), abs=1e-6)
        assert found.cosine == pytest.approx(-facing, abs=1e-6)
        past = centre + 1.51 * unit(normal - (normal @ unit(centre - origin)) * unit(centre - origin))
        assert math.isinf(meet(world, origin, past - origin).range) or away < 100
        assert math.isinf(meet(world, origin, origin - point).range)


def test_from_within_a_ball_its_far_side_is_met() -> None:
    world = build(scene({"kind": "sphere", "position": ["0 m", "0 m", "0 m"], "radius": "2 m"})).world
    assert meet(world, (0, 0, 1), DOWN) == pytest.approx((3, 1, 0, 0))


# Grids of heights


@pytest.mark.parametrize("origin", [(3.3, 4.4, 500.0), (-2000.0, 700.0, 900.0), (3e5, 0.0, 4e5)])
def test_a_flat_grid_is_a_level_plane(origin: tuple[float, float, float]) -> None:
    world = grids((np.full((9, 12), 7.0), -1.0, -2.0, 1.5, False))
    rng = np.random.default_rng(2)
    for _ in range(100):
        point = np.array([*(np.array([-1, -2]) + rng.random(2) * [16.5, 12]), 7])
        found = meet(world, origin, point - origin)
        assert found.range == pytest.approx(math.dist(point, origin), rel=1e-14, abs=1e-9)
        assert found.cosine == pytest.approx(abs(unit(point - origin)[2]), rel=1e-12)


@pytest.mark.parametrize("away", [50.0, 800.0, 5e5])
def test_a_tilted_plane_on_a_grid_is_met_wherever_a_ray_goes(away: float) -> None:
    x, y = np.meshgrid(np.arange(30) * 2.0, np.arange(20) * 2.0)
    world = grids((0.3 * x - 0.5 * y + 4, 0.0, 0.0, 2.0, False))
    normal = unit([-0.3, 0.5, 1])
    rng = np.random.default_rng(3)
    places = rng.random((300, 2)) * [58, 38]
    places[100:200] = np.round(places[100:200] / 2) * 2  # through a corner of cells
    places[200:, 0] = np.round(places[200:, 0] / 2) * 2  # through an edge
    places = np.clip(places, 0.01, [57.99, 37.99])
    for px, py in places:
        point = np.array([px, py, 0.3 * px - 0.5 * py + 4])
        way = unit(rng.standard_normal(3) * [1, 1, 0.3] + 0.5 * normal)
        if abs(way @ normal) < 0.05:
            continue
        origin = point + away * way * np.sign(way @ normal)
        found = meet(world, origin, point - origin)
        assert found.range == pytest.approx(away, abs=1e-9 * max(1, away / 50))
        assert found.cosine == pytest.approx(abs(way @ normal), abs=1e-9)


def test_rays_meet_hills_where_marching_along_them_does() -> None:
    z = hills(32, 4)
    world = grids((z, 0.0, 0.0, 1.0, False))
    rng = np.random.default_rng(5)
    hit = 0
    for turn in range(200):
        # From all around, and flat enough that many graze hills or come in at the side, below the surface.
        origin = np.array([*(rng.random(2) * 60 - 14), (6, 15, -8)[turn % 3]])
        point = np.array([*(rng.random(2) * 32), rng.uniform(-4, 4)])
        way = unit(point - origin)
        expected = march(z, origin, way, 90)
        found = meet(world, origin, way)
        hit += math.isfinite(expected)
        assert found.range == pytest.approx(expected, abs=1e-8), turn
    assert 120 < hit < 200


def test_no_ray_slips_through_between_two_cells() -> None:
    z = hills(32, 4, 1.0)  # no slope is as steep as the rays
    world = grids((z, 0.0, 0.0, 1.0, False))
    rng = np.random.default_rng(10)
    for turn in range(5000):
        place = rng.integers(1, 31, 2).astype(float)
        place[turn % 2] += rng.random() * (turn % 3 > 0)  # on an edge of a cell, or on a corner
        point = np.array([*place, bilinear(z, place[:1], place[1:])[0]])
        away, tilt, azimuth = rng.uniform(20, 900), math.radians(rng.uniform(0, 30)), rng.uniform(0, 2 * math.pi)
        way = np.array([math.sin(tilt) * math.sin(azimuth), math.sin(tilt) * math.cos(azimuth), -math.cos(tilt)])
        found = meet(world, point - away * way, way)
        assert found.range == pytest.approx(away, abs=1e-6), turn


def test_a_ray_straight_down_meets_the_height_between_the_corners() -> None:
    z = np.array([[1.0, 3], [5, 13]])
    world = grids((z, 10.0, 20.0, 4.0, False))
    for u, v in ((0, 0), (1, 0), (0, 1), (1, 1), (0.25, 0.5), (0.9, 0.1)):
        height = 1 + 2 * u + 4 * v + 6 * u * v
        assert meet(world, (10 + 4 * u, 20 + 4 * v, 100), DOWN).range == pytest.approx(100 - height, abs=1e-9)


def test_the_normal_of_a_grid_is_that_of_the_surface_that_was_sampled() -> None:
    x, y = np.meshgrid(np.arange(0, 40.25, 0.25), np.arange(0, 40.25, 0.25))
    world = grids((np.sin(x / 4) + np.cos(y / 5), 0.0, 0.0, 0.25, False))
    rng = np.random.default_rng(6)
    for px, py in rng.random((200, 2)) * 36 + 2:
        slope = math.cos(px / 4) / 4, -math.sin(py / 5) / 5
        expected = 1 / math.sqrt(1 + slope[0] ** 2 + slope[1] ** 2)
        assert meet(world, (px, py, 100), DOWN).cosine == pytest.approx(expected, abs=1e-4)


def test_a_ray_passes_where_there_are_no_heights() -> None:
    z = np.full((6, 6), 2.0)
    z[2, 3] = np.nan
    world = grids((z, 0.0, 0.0, 1.0, False), (np.zeros((2, 2)), -10.0, -10.0, 30.0, False))
    for x in np.arange(0.5, 5):
        for y in np.arange(0.5, 5):
            without = 2 < x < 4 and 1 < y < 3  # the four cells around the corner (3, 2)
            found = meet(world, (x, y, 50), DOWN)
            assert (found.range, found.cosine, found.target) == ((50, 1, 1) if without else (48, 1, 0))
    # In through the hole and up against the surface from below: from (3, 2, 1) at 45° to the east, met at x = 4.
    found = meet(world, (2.9, 2.1, 1.5), (1, 0, 0.4))
    assert found.range == pytest.approx(math.hypot(1.25, 0.5))
    assert found.target == 0


def test_a_grid_that_repeats_is_the_same_laid_side_by_side() -> None:
    z = hills(16, 7, 2.0)
    once = grids((z, 5.0, -3.0, 1.0, True))
    tiled = np.pad(np.tile(z[:-1, :-1], (15, 15)), ((0, 1), (0, 1)), "wrap")
    wide = grids((tiled, 5.0 - 7 * 16, -3.0 - 7 * 16, 1.0, False))
    rng = np.random.default_rng(8)
    for _ in range(200):
        origin = np.array([*(rng.random(2) * 40 - 20), 6.0])
        way = unit([*rng.standard_normal(2), -rng.uniform(0.15, 1)])
        one, other = meet(once, origin, way), meet(wide, origin, way)
        assert math.isfinite(one.range)
        assert one.range == pytest.approx(other.range, abs=1e-9)
        assert one.cosine == pytest.approx(other.cosine, abs=1e-9)


# Crowns


def wood(*trees: dict[str, Any]) -> World:
    """Trees."""
    return build(scene(*({"kind": "tree", "leaf_area_density": "0.5 m^2/m^3", **tree} for tree in trees))).world


def tree(
    x: float, y: float, shape: str, *, width: float = 6.0, base: float = 5.0, height: float = 20.0
) -> dict[str, Any]:
    """A tree on level ground."""
    return {
        "position": [f"{x!r} m", f"{y!r} m", "0 m"],
        "crown": shape,
        "crown_width": f"{width!r} m",
        "crown_base": f"{base!r} m",
        "height": f"{height!r} m",
    }


def passed(
    world: World, origin: ArrayLike, direction: ArrayLike, far: float = math.inf
) -> dict[int, tuple[float, float]]:
    """Where a ray enters and leaves each crown; a crown that is reported twice is a failure."""
    n = len(world.crowns)
    enters, leaves, which = np.empty(3 * n), np.empty(3 * n), np.full(3 * n, -1)
    place, way = np.asarray(origin, np.float64).tolist(), unit(direction).tolist()
    lookup = world.crowns, world.frame, world.cells, world.members
    count = trace.crowns(*lookup, *place, *way, far, 1, np.zeros(n, np.int64), enters, leaves, which)
    assert len(set(which[:count].tolist())) == count
    return {int(world.crowns[which[k], 7]): (float(enters[k]), float(leaves[k])) for k in range(count)}


def leafy(given: dict[str, Any], at: Floats) -> NDArray[np.bool_]:
    """Whether points are in a crown, by what its shape is."""
    x, y = (float(place.split()[0]) for place in given["position"][:2])
    base, height, radius = (float(given[key].split()[0]) for key in ("crown_base", "height", "crown_width"))
    radius /= 2
    out, up = np.hypot(at[:, 0] - x, at[:, 1] - y), (at[:, 2] - base) / (height - base)
    inside = (up >= 0) & (up <= 1)
    if given["crown"] == "cylinder":
        return inside & (out <= radius)
    if given["crown"] == "cone":
        return inside & (out <= radius * (1 - up))
    return (out / radius) ** 2 + (2 * up - 1) ** 2 <= 1


@pytest.mark.parametrize("shape", ["ellipsoid", "cone", "cylinder"])
def test_ways_through_crowns_are_those_of_points_along_rays(shape: str) -> None:
    rng = np.random.default_rng(9)
    trees = [
        tree(x, y, shape, width=rng.uniform(2, 14), base=rng.uniform(0, 8), height=rng.uniform(10, 25))
        for x, y in rng.uniform(-20, 20, (12, 2)).tolist()
    ]
    world = wood(*trees)
    step = 5e-3
    t = np.arange(step / 2, 120, step)
    met = 0
    for turn in range(300):
        if turn % 3 == 0:  # through the wood, level or nearly so, from aside or from within
            origin = np.array([*rng.uniform(-40, 40, 2), rng.uniform(1, 24)])
            way = unit([*rng.standard_normal(2), (0, 0.05, -0.3)[turn // 3 % 3]])
        else:
            origin = np.array([*rng.uniform(-40, 40, 2), 40])
            way = unit(np.array([*rng.uniform(-20, 20, 2), rng.uniform(0, 20)]) - origin)
        far = 120.0 if turn % 2 else 35.0
        found = passed(world, origin, way, far)
        at = origin + t[t < far, None] * way
        for number, one in enumerate(trees):
            inside = np.flatnonzero(leafy(one, at))
            if number not in found:
                assert len(inside) <= 2
                continue
            met += 1
            enter, leave = found[number]
            assert leave - enter == pytest.approx(len(inside) * step, abs=2 * step)
            if len(inside) > 2:
                assert enter == pytest.approx(t[inside[0]], abs=step)
                assert leave == pytest.approx(t[inside[-1]], abs=step)
    assert met > 60


@pytest.mark.parametrize(("shape", "at_half"), [("ellipsoid", 15 * math.sqrt(0.75)), ("cone", 7.5), ("cylinder", 15.0)])
def test_a_ray_straight_down_goes_through_all_of_the_crown_on_its_axis(shape: str, at_half: float) -> None:
    world = wood(tree(4, -7, shape))
    enter, leave = passed(world, (4, -7, 500), DOWN)[0]
    assert (enter, leave) == pytest.approx((480, 495), abs=1e-9)
    enter, leave = passed(world, (4, -7, 0), (0, 0, 1))[0]
    assert (enter, leave) == pytest.approx((5, 20), abs=1e-9)
    enter, leave = passed(world, (5.5, -7, 500), DOWN)[0]
    assert leave - enter == pytest.approx(at_half, abs=1e-9)
    assert not passed(world, (7.001, -7, 500), DOWN)
    assert passed(world, (4, -7, 500), DOWN, 490)[0] == pytest.approx((480, 490), abs=1e-9)
    assert not passed(world, (4, -7, 500), DOWN, 479)


@pytest.mark.parametrize("shape", ["ellipsoid", "cone", "cylinder"])
def test_a_crown_is_met_as_exactly_from_orbit(shape: str) -> None:
    world = wood(tree(0, 0, shape))
    way = unit([3, -2, -9])
    near = passed(world, np.array([0.5, 0.3, 12]) - 100 * way, way)[0]
    far = passed(world, np.array([0.5, 0.3, 12]) - 5e5 * way, way)[0]
    assert far[0] - 5e5 == pytest.approx(near[0] - 100, abs=1e-6)
    assert far[1] - 5e5 == pytest.approx(near[1] - 100, abs=1e-6)


def test_a_crown_in_many_cells_is_reported_once() -> None:
    world = wood(tree(0, 0, "cylinder", width=80.0), tree(3, 2, "ellipsoid", width=50.0), tree(100, 0, "cone"))
    assert len(world.members) > 200
    found = passed(world, (-60, -11, 30), (1, 0.3, -0.2))
    assert sorted(found) == [0, 1]
    assert sorted(passed(world, (-60, 0.1, 10), (1, 0, 0))) == [0, 1, 2]
    assert sorted(passed(world, (60, 0.1, 10), (-1, 0, 0))) == [0, 1]


def test_a_wood_that_a_ray_passes_by_is_not_met() -> None:
    world = wood(tree(0, 0, "cylinder"), tree(30, 0, "cone"))
    for origin, way in (
        ((15, 0, 50), DOWN),
        ((0, 0, 50), (0, 0, 1)),
        ((-50, 0, 30), (1, 0, 0)),
        ((-9, -50, 10), (0, 1, 0)),
    ):
        assert not passed(world, origin, way)
    assert not passed(build(scene()).world, (0, 0, 50), DOWN)


# Heights at random


def relief(**changes: Any) -> Relief:
    """Random terrain, 200 m by 160 m."""
    data = {
        "deviation": "3 m",
        "correlation_length": "8 m",
        "roughness": 0.5,
        "cell": "1 m",
        "size": ["200 m", "160 m"],
    }
    return Relief.model_validate({**data, **changes})


def waves(wind: float, **changes: Any) -> Sea:
    """A sea."""
    return Sea.model_validate({"kind": "sea", "wind": f"{wind} m/s", "reflectance": GREY, **changes})


@pytest.mark.parametrize("roughness", [0, 0.5, 1])
def test_the_deviation_of_relief_is_the_one_asked_for(roughness: float) -> None:
    square = np.array([(random_heights.relief(relief(roughness=roughness), seed).z ** 2).mean() for seed in range(30)])
    assert abs(square.mean() - 9) < 5 * square.std() / math.sqrt(30)
    assert square.std() < 9 / 3


def test_relief_of_half_roughness_is_correlated_exponentially() -> None:
    # Von Kármán's correlation with the Hurst exponent 1/2 is exp(-r/L).
    found: dict[int, list[float]] = {4: [], 8: [], 16: []}
    for seed in range(30):
        z = random_heights.relief(relief(), seed).z / 3
        for lag, products in found.items():
            products += [float((z[:, lag:] * z[:, :-lag]).mean()), float((z[lag:] * z[:-lag]).mean())]
    for lag, products in found.items():
        assert np.mean(products) == pytest.approx(math.exp(-lag / 8), abs=0.03), lag


def test_relief_is_laid_around_its_position() -> None:
    found = random_heights.relief(relief(position=["100 m", "-30 m", "700 m"], deviation="0 m"), 1)
    assert (found.x, found.y, found.cell) == (0, -110, 1)
    assert found.z.shape == (161, 201)
    assert (found.z == 700).all()


def test_edges_of_relief_are_no_more_alike_than_places_two_correlation_lengths_apart() -> None:
    z = np.array([random_heights.relief(relief(), seed).z for seed in range(60)]) / 3
    for products in ((z[:, :, 0] * z[:, :, -1]).mean(axis=1), (z[:, 0] * z[:, -1]).mean(axis=1)):
        assert products.mean() < math.exp(-2) + 3 * products.std() / math.sqrt(60)


@pytest.mark.parametrize("seed", [3, [1, 2]])
def test_a_seed_always_makes_the_same_heights(seed: int | list[int]) -> None:
    once, again = (random_heights.relief(relief(), seed).z for _ in range(2))
    np.testing.assert_array_equal(once, again)
    assert not np.array_equal(once, random_heights.relief(relief(), 4).z)
    np.testing.assert_array_equal(random_heights.sea(waves(8), seed)[0].z, random_heights.sea(waves(8), seed)[0].z)


@pytest.mark.parametrize("wind", [3.0, 12.0])
def test_the_variance_of_a_sea_is_that_of_its_spectrum(wind: float) -> None:
    fields = [random_heights.sea(waves(wind, level="2 m", direction="30 deg"), seed) for seed in range(12)]
    tile = [heights.z[:-1, :-1] for heights, _ in fields]
    cell = fields[0][0].cell
    least = 0.74 * (GRAVITY / ((1.026 * wind) ** 2 * 2 * math.pi / (random_heights.SHORTEST * cell))) ** 2
    expected = 0.0081 * (1.026 * wind) ** 4 / (4 * 0.74 * GRAVITY**2) * math.exp(-least)
    square = np.array([((z - 2) ** 2).mean() for z in tile])
    assert abs(square.mean() - expected) < 5 * square.std() / math.sqrt(12)
    assert square.mean() == pytest.approx(expected, rel=0.15)
    assert [z.mean() for z in tile] == pytest.approx([2] * 12, abs=1e-9)
    # Slopes: ∫ α/2 k^-1 exp(-0.74 (g/U²k)²) dk up to the shortest wave is an exponential integral.
    assert fields[0][1] == pytest.approx(0.0081 / 4 * exp1(least), rel=0.02)


def test_waves_run_with_the_wind() -> None:
    along, across = [], []
    for seed in range(6):
        heights, slope = random_heights.sea(waves(8, direction="90 deg"), seed)
        east, north = (np.diff(heights.z, axis=axis) / heights.cell for axis in (1, 0))
        along.append((east**2).mean())
        across.append((north**2).mean())
        assert along[-1] + across[-1] == pytest.approx(slope, rel=0.1)
    # Of cos² to both sides, slopes along the wind are ∫cos⁴/∫cos²sin² = 3 times those across.
    assert np.mean(along) / np.mean(across) == pytest.approx(3, rel=0.1)


def test_a_sea_has_no_seam() -> None:
    heights, _ = random_heights.sea(waves(8), 1)
    np.testing.assert_array_equal(heights.z[0], heights.z[-1])
    np.testing.assert_array_equal(heights.z[:, 0], heights.z[:, -1])
    inner = abs(np.diff(heights.z[:-1], axis=0)).max(axis=1)
    assert abs(heights.z[-1] - heights.z[-2]).max() <= inner.max()


def test_without_wind_a_sea_is_flat() -> None:
    heights, slope = random_heights.sea(waves(0, level="-3 m"), 1)
    assert (heights.z == -3).all()
    assert slope == 0
    world = build(scene({"kind": "sea", "wind": "0 m/s", "level": "-3 m"})).world
    assert meet(world, (123.4, -999.9, 500), DOWN) == pytest.approx((503, 1, 0, 0))
