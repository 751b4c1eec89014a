"""Triangles: out of a file, of houses, and which of them a ray meets first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from openecho.scene import schema
from openecho.scene.document import MOST_SAID, SceneError
from openecho.scene.geometry.height_maps import enough_memory, readable, required
from openecho.scene.units import quoted

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GROWTH = 20
"""Bytes of memory that a byte of a file takes while it is read."""

HOUSE = np.array(
    [
        *((0, 1, 5), (0, 5, 4), (2, 3, 7), (2, 7, 6)),  # walls below the eaves
        *((1, 2, 6), (1, 6, 5), (3, 0, 4), (3, 4, 7)),  # walls below the gables
        *((5, 6, 9), (7, 4, 8)),  # gables
        *((4, 5, 9), (4, 9, 8), (6, 7, 8), (6, 8, 9)),  # roof
    ],
    np.int64,
)
"""Triangles of a house: corners 0 to 3 of the foot, south-western first and anticlockwise, 4 to 7 of the eaves above
them, and 8 and 9, the western and the eastern end of the ridge."""


@dataclass(frozen=True)
class Mesh:
    """Triangles of a target.

    Attributes
    ----------
    vertices : float64 (v, 3)
        m.
    faces : int64 (f, 3)
        Numbers of the vertices of each triangle.
    object : int64 (f,)
        Number of the object that it belongs to, within its target.
    """

    vertices: Floats
    faces: Ints
    object: Ints


def read_mesh(given: schema.Mesh, key: str) -> Mesh:
    """Read the triangles of a target.

    Parameters
    ----------
    given : Mesh
        The file, and what is done with it.
    key : str
        Of `given` in the scene, for errors.

    Returns
    -------
    Mesh
        One object; vertices at the same place are one.

    Raises
    ------
    SceneError
        If the file can't be used, has a hole that it should not have, or takes more memory than there is: one line with
        the key, the file, what was found and what was expected.
    ModuleNotFoundError
        If trimesh is not installed.
    """
    name = f"{key}.file: {quoted(given.file, MOST_SAID)}"
    trimesh = required("trimesh")
    with readable(name, "triangles"):
        size = given.file.stat().st_size
        enough_memory(name, f"{size} bytes of triangles", GROWTH * size)
        # As it is in the file: trimesh would silently drop what is not finite.
        raw = trimesh.load_scene(given.file, process=False, skip_materials=True).to_mesh()
        vertices = np.array(raw.vertices, np.float64).reshape(-1, 3)
        faces = np.array(raw.faces, np.int64).reshape(-1, 3)
    _check(vertices, faces, name)
    vertices, faces = _merged(vertices, faces)
    if not len(faces):
        raise SceneError(f"{name}: found no triangles, expected some")
    holes = 0 if given.sheet else _open_edges(faces)
    if holes:
        raise SceneError(f"{name}: found {holes} edges of one triangle, expected none: a closed mesh")
    turned = Rotation.from_euler("xyz", given.rotation).apply(vertices * given.scale)
    return Mesh(turned + given.position, faces, np.zeros(len(faces), np.int64))


def houses(given: schema.Roofs, seed: int | list[int]) -> Mesh:
    """Make houses with gable roofs, in rows along x with streets between.

    Parameters
    ----------
    given : Roofs
    seed : int or list of int
        Of the heights of their walls.

    Returns
    -------
    Mesh
        As many whole houses as there is room for, without floors; each an object, numbered row by row, from the
        south-western one to the east.
    """
    pitch = np.add(given.house, given.street)
    # Sizes are decimals: three houses and two streets may be a few bits longer than the town that they fill.
    columns, rows = np.floor(np.add(given.size, given.street) / pitch + 1e-9).astype(np.int64)
    row, column = np.divmod(np.arange(rows * columns), max(columns, 1))
    middle = np.stack([column - (columns - 1) / 2, row - (rows - 1) / 2], axis=1) * pitch + given.position[:2]
    walls = np.random.default_rng(seed).uniform(*given.heights, len(middle))

    half = np.divide(given.house, 2)
    corners = np.zeros((len(middle), 10, 3))
    around = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners[:, :, :2] = middle[:, None] + half * np.concatenate([around, around, [(-1, 0), (1, 0)]])
    corners[:, 4:, 2] = walls[:, None]
    corners[:, 8:, 2] += math.tan(given.pitch) * half[1]
    corners[:, :, 2] += given.position[2]

    number = np.arange(len(middle))
    faces = HOUSE + 10 * number[:, None, None]
    return Mesh(corners.reshape(-1, 3), faces.reshape(-1, 3), np.repeat(number, len(HOUSE)))


class Caster:
    """The triangles of all targets, and which of them rays meet first.

    Those without an area are left out, for nothing can meet them.

    Parameters
    ----------
    meshes : sequence of Mesh
    owner : sequence of int
        Number of the target of each.

    Attributes
    ----------
    normal : float64 (f, 3)
        Unit vectors; to which side is as the order of the vertices has it.
    target, object : int64 (f,)
        Numbers of the target of each triangle, and of the object within it.

    Raises
    ------
    ModuleNotFoundError
        If embreex is not installed.
    """

    def __init__(self, meshes: Sequence[Mesh], owner: Sequence[int]) -> None:
        corners = np.concatenate([np.zeros((0, 3, 3)), *(mesh.vertices[mesh.faces] for mesh in meshes)])
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        twice = np.linalg.norm(normal, axis=1)
        flat = twice > 0
        counts = [len(mesh.faces) for mesh in meshes]
        none = np.zeros(0, np.int64)
        self.normal: Floats = normal[flat] / twice[flat, None]
        self.target: Ints = np.repeat(np.array(owner, np.int64), counts)[flat]
        self.object: Ints = np.concatenate([none, *(mesh.object for mesh in meshes)])[flat]
        self._corner: Floats = corners[flat, 0]
        if len(self.normal):
            self._commit(corners[flat])

    def nearest(self, origin: Floats, direction: Floats) -> tuple[Floats, Ints]:
        """Which triangle each ray meets first, and where.

        Parameters
        ----------
        origin, direction : float64 (n, 3)
            m, and unit vectors.

        Returns
        -------
        range : float64 (n,)
            m, exact but for the rounding of float64; infinite where nothing is met.
        triangle : int64 (n,)
            Its number; -1 where nothing is met.
        """
        if not len(self.normal):
            return np.full(len(origin), np.inf), np.full(len(origin), -1)
        # Embree works in float32, which from 500 km away would be off by centimetres: rays start close by.
        middle = origin - self._middle
        before = np.maximum(-np.einsum("ij,ij->i", middle, direction) - self._radius, 0.0)
        start = (middle + before[:, None] * direction).astype(np.float32)
        triangle = self._scene.run(start, direction.astype(np.float32), query="INTERSECT").astype(np.int64)

        normal = self.normal[triangle]
        facing = np.einsum("ij,ij->i", normal, direction)
        height = np.einsum("ij,ij->i", normal, self._corner[triangle] - origin)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = height / facing
        met = (triangle >= 0) & (distance > 0) & np.isfinite(distance)
        return np.where(met, distance, np.inf), np.where(met, triangle, -1)

    def _commit(self, corners: Floats) -> None:
        """Hand all triangles to Embree, as one mesh, so that their numbers count through."""
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self._middle: Floats = (low + high) / 2
        self._radius = float(np.linalg.norm(high - low)) / 2
        # Unless it is robust, one in seven rays at a vertex passes between the triangles.
        self._scene = required("embreex.rtcore_scene").EmbreeScene(robust=True)
        vertices = (corners - self._middle).astype(np.float32).reshape(-1, 3)
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        required("embreex.mesh_construction").TriangleMesh(self._scene, vertices, faces)
        # The first ray has the tree built; were it one of several threads', they would all build it.
        self._scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))


def _check(vertices: Floats, faces: Ints, name: str) -> None:
    """Raise a SceneError if vertices are not finite or missing."""
    odd = np.count_nonzero(~np.isfinite(vertices).all(axis=1))
    if odd:
        raise SceneError(f"{name}: found {odd} vertices that are not finite, expected none")
    if faces.min(initial=0) < 0 or faces.max(initial=-1) >= len(vertices):
        raise SceneError(f"{name}: found a triangle without its vertices, expected {len(vertices)} to be enough")


def _merged(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Make vertices at the same place one: STL has three for each triangle. Triangles with fewer than three go."""
    vertices, number = np.unique(vertices, axis=0, return_inverse=True)
    faces = number.reshape(-1)[faces]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return vertices, faces[whole]


def _open_edges(faces: Ints) -> int:
    """How many edges belong to one triangle alone."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    number = edges[:, 0] * (faces.max() + 1) + edges[:, 1]
    _, triangles = np.unique(number, return_counts=True)
    return int(np.count_nonzero(triangles == 1))
