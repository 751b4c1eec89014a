"""A scene's targets as arrays that compiled code goes through."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from openecho.scene import schema
from openecho.scene.geometry import flight, random_heights
from openecho.scene.geometry.height_maps import Heights, enough_memory, read_map
from openecho.scene.geometry.trace import BALL, CONE, CYLINDER, ELLIPSOID, GRID, PLANE, STAIRS, below
from openecho.scene.geometry.triangles import Caster, Mesh, houses, read_mesh
from openecho.scene.physics.reflection import leaf_backscatter, sea_facets

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Extent = tuple[float, float, float, float]

LOWEST = -500.0
"""m: no land is lower; what a height map is read for before its heights are known."""

HIGHEST = 10_000.0
"""m: from where the ground is looked for that trees stand on; no mountain is higher."""

HEIGHT_BYTES, HOUSE_BYTES, TREE_BYTES = 48.0, 10_000.0, 300.0
"""What a height, a house and a tree take while they are made."""

CROWN_CELL = 5.0
"""m, a side of the cells in which crowns are looked up: about a crown."""

PROJECTION = 0.5
"""Share of the leaf area that faces a beam, G, of leaves that face all directions alike: J. Ross 1981."""

SCANNED = 721
"""Looks at a scan, in a period of it."""

GRAZING = 0.01
"""Sine of the angle below the horizon under which a beam has no end that matters."""

GROUND = ("plane", "terraces", "terrain")
"""Kinds of target that trees stand on."""

SHAPES = {"ellipsoid": ELLIPSOID, "cone": CONE, "cylinder": CYLINDER}
"""Of crowns."""


class World(NamedTuple):
    """Targets as arrays; a target is given by its number in the scene's list.

    Attributes
    ----------
    reflectance : float64 (targets, 4)
        Diffuse A/π, specular B, facets s², and that of leaves, 1/sr.
    shapes : float64 (shapes, 16)
        Kind (`PLANE` …) and target, then of a plane: point, normal, direction of the fall, across it, half sizes along
        both (∞: without end); of stairs: foot of the first riser, direction of the climb (x, y), steps, rise, run, half
        width; of a ball: centre, radius; of a grid: place of its first height in `heights`, rows, columns, x, y, cell,
        least and greatest height, 1 if it repeats.
    heights : float64 (k,)
        Of all grids, row by row.
    crowns : float64 (crowns, 9)
        x, y, base, top, radius, shape, extinction 1/m, target, number of the tree within it.
    frame : float64 (5,)
        Of the cells that crowns are looked up in: x, y, side, and the crowns' least and greatest height.
    cells : int64 (rows + 1, columns)
        Place of each cell's first crown in `members`.
    members : int64 (k,)
        Crowns, cell by cell; a cell ends where the next one begins.
    """

    reflectance: Floats
    shapes: Floats
    heights: Floats
    crowns: Floats
    frame: Floats
    cells: Ints
    members: Ints


@dataclass(frozen=True)
class Built:
    """A scene's targets, ready to be met.

    Attributes
    ----------
    world : World
        All but triangles.
    caster : Caster
        Those.
    spared : dict
        What no beam can meet, and was left out: from and to, by key.
    """

    world: World
    caster: Caster
    spared: dict[str, tuple[int, int]]


def build(scene: schema.Scene) -> Built:
    """Make a scene's targets, but for what is out of its beams' reach.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Built

    Raises
    ------
    SceneError
        If a file can't be used, or there is not enough memory: the key, what was found and what was expected.
    """
    return _Builder(scene).built()


def reach(scene: schema.Scene, low: float) -> Extent | None:
    """Ground that beams may meet down to some height, least and greatest x and y, m; None where it has no end."""
    platform, shots = scene.platform, scene.shots
    still = platform.scan is None or isinstance(platform.scan, schema.Raster)
    period = 0.0 if still else 1 / platform.scan.rate  # type: ignore[union-attr]
    aims = flight.aims(platform, np.linspace(0, period, SCANNED)).reshape(-1, 3)
    down, depth = -aims[:, 2], max(platform.altitude - low, 0.0)
    if down.min() < GRAZING:
        return None
    aside = aims[:, :2] / down[:, None] * depth
    # Two footprints, one for turbulence, on level ground; and what lies between two looks at the scan.
    margin = 2 * scene.laser.divergence * depth / down.min() ** 2 + np.ptp(aside, axis=0).max() * 4 / SCANNED
    length = platform.speed * (shots - 1) / scene.laser.rate
    ends = np.outer([0, length], [math.sin(platform.heading), math.cos(platform.heading)]) + platform.start
    least, most = ends.min(axis=0) + aside.min(axis=0) - margin, ends.max(axis=0) + aside.max(axis=0) + margin
    return float(least[0]), float(least[1]), float(most[0]), float(most[1])


def ground_heights(scene: schema.Scene, world: World, x: Floats, y: Floats) -> Floats:
    """Heights (n,) of what trees stand on, at places (n,), m; 0 where there is nothing."""
    stood_on = [scene.targets[int(number)].kind in GROUND for number in world.shapes[:, 1]]
    return np.asarray(below(world.shapes[stood_on], world.heights, x.copy(), y.copy(), HIGHEST))


class _Builder:
    """Collects the rows of a `World`, target by target."""

    def __init__(self, scene: schema.Scene) -> None:
        self.scene = scene
        self.reflectance = np.zeros((len(scene.targets), 4))
        self.shapes: list[tuple[float, ...]] = []
        self.heights: list[Floats] = []
        self.crowns: list[Floats] = []
        self.meshes: list[Mesh] = []
        self.owners: list[int] = []
        self.spared: dict[str, tuple[int, int]] = {}

    def built(self) -> Built:
        """Make all of them; trees last, for they stand on the others."""
        adders: dict[str, Callable[[Any, int], None]] = {
            "plane": self._plane,
            "terraces": self._terraces,
            "sphere": self._sphere,
            "sea": self._sea,
            "terrain": self._terrain,
            "roofs": self._roofs,
            "mesh": self._mesh,
        }
        for number, target in enumerate(self.scene.targets):
            self._reflect(number, target.reflectance)
            if target.kind in adders:
                adders[target.kind](target, number)
        ground = self._world()
        for number, target in enumerate(self.scene.targets):
            if target.kind == "tree":
                self._tree(target, number)
            elif target.kind == "stand":
                self._stand(target, number, ground)
        return Built(self._world(), Caster(self.meshes, self.owners), self.spared)

    def _seed(self, given: int | None, number: int) -> random_heights.Seed:
        """That of a target; those that have none of their own differ."""
        return [self.scene.seed, 1, number] if given is None else given

    def _reflect(self, number: int, reflectance: schema.Reflectance, facets: float | None = None) -> None:
        slope = reflectance.facet_slope**2 if facets is None and reflectance.facet_slope else facets or 1.0
        diffuse = reflectance.albedo / math.pi
        leaves = leaf_backscatter(diffuse, reflectance.specular, slope)
        self.reflectance[number] = diffuse, reflectance.specular, slope, leaves

    def _plane(self, plane: schema.Plane, number: int) -> None:
        east, north = math.sin(plane.azimuth), math.cos(plane.azimuth)
        sine, cosine = math.sin(plane.slope), math.cos(plane.slope)
        normal = (sine * east, sine * north, cosine)
        fall, across = (cosine * east, cosine * north, -sine), (north, -east, 0.0)
        half = (math.inf, math.inf) if plane.size is None else (plane.size[0] / 2, plane.size[1] / 2)
        self.shapes.append((PLANE, number, *plane.position, *normal, *fall, *across, *half))

    def _terraces(self, stairs: schema.Terraces, number: int) -> None:
        climb = math.sin(stairs.azimuth), math.cos(stairs.azimuth)
        sizes = stairs.steps, stairs.rise, stairs.run, stairs.width / 2
        self.shapes.append((STAIRS, number, *stairs.position, *climb, *sizes))

    def _sphere(self, ball: schema.Sphere, number: int) -> None:
        self.shapes.append((BALL, number, *ball.position, ball.radius))

    def _sea(self, sea: schema.Sea, number: int) -> None:
        waves, slope = random_heights.sea(sea, self._seed(sea.seed, number))
        # What the waves' own slopes tilt is no longer for the facets to do.
        facets = max(sea_facets(sea.wind) - slope, sea_facets(0.0))
        self._reflect(number, sea.reflectance, facets)
        self._grid(waves, number, repeats=True)

    def _terrain(self, terrain: schema.Terrain, number: int) -> None:
        key = f"targets[{number}]"
        if terrain.map is not None:
            heights = read_map(terrain.map, f"{key}.map", reach(self.scene, LOWEST))
        else:
            assert terrain.relief is not None
            rows, columns = random_heights.points(terrain.relief)
            around = random_heights.APART * terrain.relief.correlation_length / terrain.relief.cell
            what = f"{rows} × {columns} heights"
            enough_memory(f"{key}.relief.cell", what, HEIGHT_BYTES * (rows + around) * (columns + around))
            heights = random_heights.relief(terrain.relief, self._seed(terrain.relief.seed, number))
        if heights.z.size:
            self._grid(self._cropped(heights, key), number)

    def _cropped(self, heights: Heights, key: str) -> Heights:
        """What beams can meet of a terrain."""
        extent = reach(self.scene, float(np.nanmin(heights.z)))
        if extent is None:
            return heights
        rows, columns = heights.z.shape
        cell = heights.cell
        west, south = (max(math.floor(at / cell) - 1, 0) for at in (extent[0] - heights.x, extent[1] - heights.y))
        east, north = (math.ceil(at / cell) + 2 for at in (extent[2] - heights.x, extent[3] - heights.y))
        kept = heights.z[south : max(north, south + 2), west : max(east, west + 2)]
        if min(kept.shape) < 2:
            kept = np.full((2, 2), np.nan)
        self.spared[f"{key} heights"] = rows * columns, kept.size
        return Heights(kept, heights.x + west * cell, heights.y + south * cell, cell)

    def _grid(self, heights: Heights, number: int, *, repeats: bool = False) -> None:
        rows, columns = heights.z.shape
        first = sum(len(one) for one in self.heights)
        known = heights.z[np.isfinite(heights.z)]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
        frame = heights.x, heights.y, heights.cell
        self.shapes.append((GRID, number, first, rows, columns, *frame, low, high, repeats))
        self.heights.append(heights.z.ravel())

    def _roofs(self, roofs: schema.Roofs, number: int) -> None:
        room = np.add(roofs.size, roofs.street) / np.add(roofs.house, roofs.street)
        enough_memory(f"targets[{number}].size", f"{room.prod():.3g} houses", HOUSE_BYTES * room.prod())
        self.meshes.append(houses(roofs, self._seed(roofs.seed, number)))
        self.owners.append(number)

    def _mesh(self, mesh: schema.Mesh, number: int) -> None:
        self.meshes.append(read_mesh(mesh, f"targets[{number}]"))
        self.owners.append(number)

    def _tree(self, tree: schema.Tree, number: int) -> None:
        x, y, z = tree.position
        shape, leaves = SHAPES[tree.crown], PROJECTION * tree.leaf_area_density
        edges = z + tree.crown_base, z + tree.height
        self.crowns.append(np.array([(x, y, *edges, tree.crown_width / 2, shape, leaves, number, 0)]))

    def _stand(self, stand: schema.Stand, number: int, ground: World) -> None:
        rng = np.random.default_rng(self._seed(stand.seed, number))
        expected = stand.density * stand.size[0] * stand.size[1]
        enough_memory(f"targets[{number}].density", f"{expected:.3g} trees", TREE_BYTES * expected)
        count = rng.poisson(expected)
        place = (rng.random((count, 2)) - 0.5) * stand.size + stand.position
        height = np.clip(rng.normal(stand.height, stand.deviation, count), 0.5 * stand.height, 1.5 * stand.height)
        tree = np.arange(count)
        extent = reach(
            self.scene, min(float(np.min(ground.heights, initial=0.0, where=np.isfinite(ground.heights))), 0.0)
        )
        if extent is not None:
            far = 0.75 * stand.crown_width * stand.height
            near = (place > np.subtract(extent[:2], far)) & (place < np.add(extent[2:], far))
            tree = np.flatnonzero(near.all(axis=1))
            self.spared[f"targets[{number}] trees"] = count, len(tree)
        place, tall = place[tree], height[tree]
        foot = ground_heights(self.scene, ground, place[:, 0], place[:, 1])
        crowns = np.empty((len(tree), 9))
        crowns[:, :2] = place
        crowns[:, 2], crowns[:, 3] = foot + stand.crown_base * tall, foot + tall
        crowns[:, 4] = stand.crown_width * tall / 2
        crowns[:, 5:8] = SHAPES[stand.crown], PROJECTION * stand.leaf_area_density, number
        crowns[:, 8] = tree
        self.crowns.append(crowns)

    def _world(self) -> World:
        """All that there is by now."""
        shapes = np.zeros((len(self.shapes), 16))
        for row, shape in zip(shapes, self.shapes, strict=True):
            row[: len(shape)] = shape
        crowns = np.concatenate([np.zeros((0, 9)), *self.crowns])
        heights = np.concatenate([np.zeros(0), *self.heights])
        return World(self.reflectance, shapes, heights, crowns, *_cells(crowns))


def _cells(crowns: Floats) -> tuple[Floats, Ints, Ints]:
    """Which crowns a beam in a cell may meet."""
    if not len(crowns):
        return np.zeros(5), np.zeros((0, 0), np.int64), np.zeros(0, np.int64)
    least, most = ((crowns[:, :2] + sign * crowns[:, 4:5]) for sign in (-1, 1))
    corner = least.min(axis=0)
    # Cells of five metres, but not millions of them where two trees stand far apart.
    side = max(CROWN_CELL, float((most.max(axis=0) - corner).max()) / 2048)
    first = ((least - corner) / side).astype(np.int64)
    last = ((most - corner) / side).astype(np.int64)
    columns, rows = last.max(axis=0) + 1
    spans = last - first + 1
    each = spans.prod(axis=1)
    crown = np.repeat(np.arange(len(crowns)), each)
    turn = np.arange(len(crown)) - np.repeat(np.cumsum(each) - each, each)
    column = first[crown, 0] + turn % spans[crown, 0]
    row = first[crown, 1] + turn // spans[crown, 0]
    cell = row * columns + column
    order = np.argsort(cell, kind="stable")
    starts = np.searchsorted(cell[order], np.arange(rows * columns + 1))
    frame = np.array([*corner, side, crowns[:, 2].min(), crowns[:, 3].max()])
    # One row more, so that the end of the last cell is the start of another.
    table = np.full((rows + 1, columns), len(crown), np.int64)
    table.ravel()[: rows * columns + 1] = starts
    return frame, table, crown[order]
