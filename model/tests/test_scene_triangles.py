"""Triangles: what is read out of each format, houses, and ranges against closed forms."""

from __future__ import annotations

import importlib
import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import hypothesis
import numpy as np
import psutil
import pytest
from numpy.typing import NDArray

from openecho.scene import schema
from openecho.scene.document import SceneError
from openecho.scene.geometry.triangles import Caster, Mesh, houses, read_mesh
from tests.fuzz import damage, fuzzed

trimesh: Any = importlib.import_module("trimesh")
"""Not all of it has types."""

# trimesh leaves open the file of a glTF that it writes.
pytestmark = [pytest.mark.filterwarnings("error"), pytest.mark.filterwarnings("ignore::ResourceWarning")]

Floats = NDArray[np.float64]

SUFFIXES = [".stl", ".obj", ".ply", ".glb", ".gltf"]
REFLECTANCE = {"reflectance": {"albedo": 0.3}}
ROOFS = {
    "size": ["300 m", "200 m"],
    "house": ["14 m", "10 m"],
    "street": "8 m",
    "heights": ["6 m", "18 m"],
    "pitch": "30 deg",
}
UTM = (4e5, 5e6, 100.0)
DOWN = np.array([0.0, 0.0, -1.0])


def box(*size: float) -> Any:
    """A box about the origin."""
    return trimesh.creation.box(size)


def exported(path: Path, mesh: Any) -> Path:
    """Write a mesh or a scene; the buffers of glTF go beside it."""
    mesh.export(path)
    return path


def bare(vertices: Any, faces: Any) -> Any:
    """A mesh with all that it is given, even if that makes no sense."""
    return trimesh.Trimesh(vertices, faces, process=False, validate=False)


def given(path: Path, **more: Any) -> schema.Mesh:
    """The section of a mesh."""
    return schema.Mesh.model_validate({"kind": "mesh", "file": path, **REFLECTANCE, **more})


def town(**more: Any) -> schema.Roofs:
    """The section of a town."""
    return schema.Roofs.model_validate({"kind": "roofs", **REFLECTANCE, **ROOFS, **more})


def refusal(path: Path, **more: Any) -> str:
    """What is said of a mesh that can't be used, without key and file in front: a single short line."""
    with pytest.raises(SceneError) as caught:
        read_mesh(given(path, **more), "targets[2]")
    line = str(caught.value)
    start = f"targets[2].file: {path}: "
    assert line.startswith(start)
    assert line.isprintable()
    assert len(line) < 600
    return line.removeprefix(start)


def placed(*rows: tuple[float, float, float]) -> list[list[float]]:
    """Corners in an order that does not depend on that in the file."""
    return sorted(np.array(rows).tolist())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_box_is_read_out_of_every_format(suffix: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    mesh = read_mesh(given(exported(tmp_path / f"a{suffix}", box(1, 2, 4))), "mesh")
    assert sorted(mesh.vertices.tolist()) == placed(*((x, y, z) for x in (-0.5, 0.5) for y in (-1, 1) for z in (-2, 2)))
    assert [values.dtype.str for values in (mesh.vertices, mesh.faces, mesh.object)] == ["<f8", "<i8", "<i8"]
    assert mesh.faces.shape == (12, 3)
    assert mesh.object.tolist() == [0] * 12
    assert bare(mesh.vertices, mesh.faces).volume == 8
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_scene_graph_is_joined(suffix: str, tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for x in (0, 10):
        scene.add_geometry(box(2, 2, 2), transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    mesh = read_mesh(given(exported(tmp_path / f"a{suffix}", scene)), "mesh")
    assert (len(mesh.vertices), len(mesh.faces)) == (16, 24)
    assert (mesh.vertices[:, 0].min(), mesh.vertices[:, 0].max()) == (-1, 11)


def test_it_is_first_scaled_then_rotated_about_x_y_and_z_then_moved(tmp_path: Path) -> None:
    """A corner far out on x and one on y: x stays, goes to -z and stays there; y goes to z, to x and to y."""
    path = exported(tmp_path / "a.ply", bare([[0, 0, 0], [2, 0, 0], [0, 4, 0]], [[0, 1, 2]]))
    turned = given(path, scale=0.5, rotation=["90 deg"] * 3, position=["10 m", "20 m", "30 m"], sheet=True)
    vertices = read_mesh(turned, "mesh").vertices
    np.testing.assert_allclose(sorted(vertices.tolist()), placed((10, 20, 30), (10, 20, 29), (10, 22, 30)), atol=1e-14)


def test_what_is_neither_scaled_nor_turned_nor_moved_keeps_every_bit(tmp_path: Path) -> None:
    corners = np.random.default_rng(1).random((3, 3)).astype(np.float32).astype(np.float64)
    path = exported(tmp_path / "a.ply", bare(corners, [[0, 1, 2]]))
    assert sorted(read_mesh(given(path, sheet=True), "mesh").vertices.tolist()) == sorted(corners.tolist())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_hole_is_one_line_unless_it_is_a_sheet(suffix: str, tmp_path: Path) -> None:
    cube = box(1, 1, 1)
    path = exported(tmp_path / f"a{suffix}", bare(cube.vertices, cube.faces[1:]))
    assert refusal(path) == "found 3 edges of one triangle, expected none: a closed mesh"
    assert len(read_mesh(given(path, sheet=True), "mesh").faces) == 11


def test_boxes_that_share_an_edge_have_no_hole(tmp_path: Path) -> None:
    other = box(1, 1, 1).apply_translation([1, 1, 0])
    path = exported(tmp_path / "a.stl", trimesh.util.concatenate([box(1, 1, 1), other]))
    assert len(read_mesh(given(path), "mesh").vertices) == 14


def test_a_triangle_that_is_but_a_line_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n")
    assert len(read_mesh(given(path, sheet=True), "mesh").faces) == 1


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_vertex_that_is_not_finite_is_one_line(suffix: str, value: float, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    with np.errstate(invalid="ignore"):
        exported(path, bare([[0, 0, 0], [1, 0, 0], [0, 1, 0], [value, 1, 1]], [[0, 1, 2], [0, 1, 3]]))
    assert refusal(path, sheet=True) == "found 1 vertices that are not finite, expected none"


@pytest.mark.parametrize("content", [b"", b"junk" * 40, b"glTF\2\0\0\0junk", b"{}", b"ply\nformat ascii 1.0\njunk"])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_that_is_no_mesh_is_one_line(
    suffix: str, content: bytes, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    line = refusal(path)
    assert line.startswith("found no triangles")
    assert line.endswith(", expected some")
    assert capfd.readouterr() == ("", "")


def test_points_or_vertices_that_are_not_there_are_no_mesh(tmp_path: Path) -> None:
    assert refusal(exported(tmp_path / "a.ply", trimesh.PointCloud(np.ones((4, 3))))) == (
        "found no triangles, expected some"
    )
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n")
    assert refusal(tmp_path / "a.obj").startswith("found no triangles (index 6 is out of bounds")
    missing = "3 1 2 7"
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    body = f"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n{missing}\n"
    (tmp_path / "a.ply").write_text(head + body)
    assert refusal(tmp_path / "a.ply").startswith("found ")


def test_materials_that_are_missing_do_not_matter(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = exported(tmp_path / "a.obj", box(1, 1, 1))
    path.write_text(f"mtllib none.mtl\nusemtl brick\n{path.read_text()}")
    assert len(read_mesh(given(path), "mesh").faces) == 12
    assert capfd.readouterr() == ("", "")


def test_more_memory_than_there_is_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = exported(tmp_path / "a.stl", box(1, 1, 1))
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=13679))
    line = "found 684 bytes of triangles, which take 1.37e-05 GB, expected at most 1.37e-05 GB"
    assert refusal(path) == line


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_damaged_mesh_is_a_mesh_or_one_line(suffix: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = exported(tmp_path / f"a{suffix}", box(1, 1, 1))
    whole = path.read_bytes()

    @hypothesis.settings(fuzzed, max_examples=100)
    @hypothesis.given(content=damage(whole))
    def check(content: bytes) -> None:
        path.write_bytes(content)
        mesh_or_one_line(path)

    check()
    assert capfd.readouterr() == ("", "")


def mesh_or_one_line(path: Path) -> None:
    """Read a damaged mesh."""
    line = ""
    try:
        mesh = read_mesh(given(path, sheet=True), "mesh")
        assert np.isfinite(mesh.vertices[mesh.faces]).all()
    except SceneError as error:
        line = str(error)
    assert not line or line.startswith(f"mesh.file: {path}: found ")
    assert not line or line.isprintable()


def test_as_many_houses_stand_in_a_town_as_there_is_room_for() -> None:
    """Fourteen along x and eleven along y: 14 · 14 m + 13 · 8 m is all of the 300 m, 11 · 10 m + 10 · 8 m is 190 m."""
    mesh = houses(town(position=["1000 m", "2000 m", "5 m"]), 1)
    assert mesh.object.max() + 1 == 14 * 11
    assert np.bincount(mesh.object).tolist() == [14] * 14 * 11
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert (low.tolist(), high[:2].tolist()) == ([850, 1905, 5], [1150, 2095])


def test_a_town_that_is_too_small_has_no_houses() -> None:
    mesh = houses(town(size=["13 m", "100 m"]), 1)
    assert (mesh.vertices.shape, mesh.faces.shape, mesh.object.shape) == ((0, 3), (0, 3), (0,))
    assert houses(town(size=["14 m", "10 m"]), 1).object.max() == 0


def test_walls_are_as_high_as_drawn_row_by_row_and_ridges_as_steep_as_the_roof() -> None:
    mesh = houses(town(), [7, 1])
    corners = mesh.vertices.reshape(11, 14, 10, 3)
    walls = np.random.default_rng([7, 1]).uniform(6, 18, (11, 14))
    np.testing.assert_array_equal(corners[:, :, 4:8, 2], np.repeat(walls[:, :, None], 4, axis=2))
    np.testing.assert_allclose(corners[:, :, 8:, 2] - walls[:, :, None], math.tan(math.radians(30)) * 5, rtol=1e-14)
    middle = corners[:, :, :4, :2].mean(axis=2)
    assert np.diff(middle[:, :, 0], axis=1).tolist() == [[22] * 13] * 11
    assert np.diff(middle[:, :, 1], axis=0).tolist() == [[18] * 14] * 10
    ridge = corners[:, :, 8:, :2] - middle[:, :, None]
    assert ridge.tolist() == [[[[-7, 0], [7, 0]]] * 14] * 11


def test_a_house_has_a_hole_at_its_foot_alone() -> None:
    mesh = houses(town(size=["14 m", "10 m"]), 1)
    edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edge, count = np.unique(edges, axis=0, return_counts=True)
    assert edge[count == 1].tolist() == [[0, 1], [0, 3], [1, 2], [2, 3]]
    assert set(count.tolist()) == {1, 2}


def test_a_seed_gives_one_town_and_another_a_different_one() -> None:
    np.testing.assert_array_equal(houses(town(), 3).vertices, houses(town(), 3).vertices)
    assert (houses(town(), 3).vertices != houses(town(), 4).vertices).any()


def test_flat_roofs_are_level_and_met_at_the_height_of_the_walls() -> None:
    mesh = houses(town(pitch="0 deg"), 5)
    caster = Caster([mesh], [2])
    corners = mesh.vertices.reshape(-1, 10, 3)
    origin = corners[:, :4].mean(axis=1) + np.array([1.5, 2.5, 500])
    distance, triangle = caster.nearest(origin, np.tile(DOWN, (len(origin), 1)))
    np.testing.assert_allclose(distance, 500 - corners[:, 4, 2], rtol=0, atol=1e-12)
    assert caster.object[triangle].tolist() == list(range(14 * 11))
    np.testing.assert_array_equal(np.abs(caster.normal[triangle]), np.tile(-DOWN, (len(origin), 1)))


def plane_of(point: Floats, slope: float, half: float) -> tuple[Mesh, Floats]:
    """A square of two triangles that falls to the east, and its normal."""
    along = half * np.array([math.cos(slope), 0, -math.sin(slope)])
    across = half * np.array([0.0, 1, 0])
    corners = point + np.array([-along - across, along - across, along + across, across - along])
    normal = np.array([math.sin(slope), 0, math.cos(slope)])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.array([3, 4])), normal


def aims(count: int, most: float) -> Floats:
    """Unit vectors within an angle of straight down."""
    rng = np.random.default_rng(1)
    angle, azimuth = most * np.sqrt(rng.random(count)), 2 * math.pi * rng.random(count)
    side = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1) * np.sin(angle)[:, None]
    return np.column_stack([side, -np.cos(angle)])


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), UTM])
@pytest.mark.parametrize("height", [500.0, 500e3])
@pytest.mark.parametrize("slope", [0.0, 30.0])
def test_ranges_are_exact_to_a_nanometre_from_any_height(place: tuple[float, ...], height: float, slope: float) -> None:
    """At these coordinates a bit of the places themselves is 1e-9 m; aims are compared with the plane's closed form."""
    point = np.array(place)
    mesh, normal = plane_of(point, math.radians(slope), 100.0)
    direction = aims(2000, 50 / height)
    origin = np.tile(point - height * DOWN, (2000, 1))
    distance, triangle = Caster([mesh], [0]).nearest(origin, direction)
    assert (triangle >= 0).all()
    expected = (point - origin[0]) @ normal / (direction @ normal)
    np.testing.assert_allclose(distance, expected, rtol=0, atol=1e-9)


def test_the_nearest_of_several_targets_is_met_and_known() -> None:
    low, normal = plane_of(np.array([0.0, 0, 0]), math.radians(20), 50)
    high, _ = plane_of(np.array([0.0, 0, 30]), math.radians(20), 5)
    caster = Caster([low, high], [6, 2])
    origin = np.array([[1.0, -0.5, 100], [20, 22, 100], [1, -1.5, 100]])
    distance, triangle = caster.nearest(origin, np.tile(DOWN, (3, 1)))
    np.testing.assert_allclose(distance, 100 - np.array([30, 0, 30]) + math.tan(math.radians(20)) * origin[:, 0])
    assert caster.target[triangle].tolist() == [2, 6, 2]
    assert caster.object[triangle].tolist() == [3, 4, 3]
    np.testing.assert_allclose(caster.normal[triangle], np.tile(normal, (3, 1)), atol=1e-15)


def test_a_ray_beside_or_away_or_along_a_triangle_meets_nothing() -> None:
    caster = Caster([plane_of(np.array(UTM), 0.0, 10)[0]], [0])
    origin = np.array([[11.0, 0, 50], [0, 0, 50], [0, 0, -50], [-50, 0, 0], [0, 0, 50]]) + UTM
    direction = np.array([DOWN, -DOWN, DOWN, [1, 0, 0], [1, 0, 0]])
    distance, triangle = caster.nearest(origin, direction)
    assert distance.tolist() == [math.inf] * 5
    assert triangle.tolist() == [-1] * 5


def test_rays_from_within_a_box_meet_its_walls() -> None:
    cube = box(2, 2, 2)
    mesh = Mesh(np.asarray(cube.vertices) + UTM, np.asarray(cube.faces, np.int64), np.zeros(12, np.int64))
    caster = Caster([mesh], [0])
    direction = aims(1000, 3.0)
    distance, triangle = caster.nearest(np.tile(np.array(UTM), (1000, 1)), direction)
    np.testing.assert_allclose(distance, 1 / np.abs(direction).max(axis=1), rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.abs(caster.normal[triangle]).max(axis=1), 1)


def test_no_ray_slips_through_an_edge() -> None:
    rows, columns = np.mgrid[:50, :50]
    z = np.random.default_rng(2).random((50, 50))
    vertices = np.stack([columns, rows, z], axis=-1).reshape(-1, 3).astype(np.float64)
    corner = (rows * 50 + columns)[:-1, :-1].reshape(-1, 1)
    faces = np.concatenate([corner + np.array([0, 1, 51]), corner + np.array([0, 51, 50])])
    caster = Caster([Mesh(vertices, faces, np.zeros(len(faces), np.int64))], [0])
    inner = np.flatnonzero(((rows > 9) & (rows < 40) & (columns > 9) & (columns < 40)).ravel())
    share = np.linspace(0.01, 0.99, 99)[:, None, None]
    points = (share * vertices[inner] + (1 - share) * vertices[inner + 1]).reshape(-1, 3)
    direction = aims(len(points), 0.02)
    _, triangle = caster.nearest(points - 300 * direction, direction)
    assert (triangle >= 0).all()


@pytest.mark.parametrize("meshes", [0, 1])
def test_without_triangles_nothing_is_met(meshes: int) -> None:
    empty = houses(town(size=["1 m", "1 m"]), 1)
    caster = Caster([empty] * meshes, [0] * meshes)
    distance, triangle = caster.nearest(np.zeros((3, 3)), np.tile(DOWN, (3, 1)))
    assert (distance.tolist(), triangle.tolist()) == ([math.inf] * 3, [-1] * 3)
    assert (caster.normal.shape, caster.target.shape, caster.object.shape) == ((0, 3), (0,), (0,))
    assert triangle.dtype == caster.target.dtype == caster.object.dtype == np.int64


def test_no_rays_meet_nothing() -> None:
    caster = Caster([houses(town(), 1)], [0])
    distance, triangle = caster.nearest(np.zeros((0, 3)), np.zeros((0, 3)))
    assert distance.shape == triangle.shape == (0,)


@pytest.mark.parametrize(
    ("package", "call"),
    [
        ("trimesh", "read_mesh(Mesh(kind='mesh', file='a.stl', reflectance={'albedo': 1}), 'mesh')"),
        ("embreex", "Caster([triangles.Mesh(numpy.eye(3), numpy.array([[0, 1, 2]]), numpy.array([0]))], [0])"),
    ],
)
def test_a_missing_package_is_one_line(package: str, call: str, tmp_path: Path) -> None:
    exported(tmp_path / "a.stl", box(1, 1, 1))
    program = f"""
import sys
sys.modules[{package!r}] = None
import numpy
from openecho.scene.geometry import triangles
from openecho.scene.geometry.triangles import Caster, read_mesh
from openecho.scene.schema import Mesh
{call}
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    expected = f"ModuleNotFoundError: {package} is not installed, expected it: pip install 'openecho[scene]'"
    assert done.stderr.splitlines()[-1] == expected
