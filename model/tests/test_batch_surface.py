"""A table of echoes to terrain, by the command: every result, and every mistake in one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio
import trimesh

from openecho.batch.surface import Surfacing, surface_file
from openecho.surface.points import GROUND, HIGH, LOW, UNCLASSIFIED, read
from openecho.tables import TableError

PROGRAM = Path(sys.executable).with_name("openecho")


def town(path: Path, east: float = 0.0, north: float = 0.0) -> np.ndarray:
    """Write echoes of flat ground at 100 m with houses of 8 m, two that are none, and one without a place."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 80, (2, 8000))
    house = (x % 40 > 10) & (x % 40 < 30) & (y % 40 > 10) & (y % 40 < 30)
    z = np.where(house, 108.0, 100.0)
    z[:3] = [400, -200, np.nan]
    columns = {
        "x": x + east,
        "y": y + north,
        "z": z,
        "amplitude": rng.uniform(5, 90, 8000),
        "width": np.full(8000, 4.0),
    }
    np.savez(path, waveform=np.arange(8000), number=np.zeros(8000, np.int32), **columns)
    truth = np.where(house, UNCLASSIFIED, GROUND)
    truth[:3] = [HIGH, LOW, HIGH]
    return truth


def openecho(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PROGRAM, "surface", *arguments], capture_output=True, text=True, check=False)


def grid(path: Path) -> np.ndarray:
    with rasterio.open(path) as file:
        band: np.ndarray = file.read(1, masked=True).filled(np.nan)
    return band


def test_every_result_of_the_command_is_what_was_there(tmp_path: Path) -> None:
    truth = town(tmp_path / "echoes.npz", 500_000, 4_500_000)
    names = {"--dsm": "dsm.tif", "--canopy": "canopy.tif", "--hillshade": "hillshade.tif"}
    names |= {"--points": "points.laz", "--mesh": "ground.ply"}
    options = [part for name, file in names.items() for part in (name, tmp_path / file)]
    done = openecho(tmp_path / "echoes.npz", "-o", tmp_path / "dem.tif", *options, "--system", "EPSG:32722")
    ground = np.count_nonzero(truth == GROUND)
    told = f"{tmp_path / 'dem.tif'}: 80 × 80 cells of 8000 points, {ground} of them ground, 3 none\n"
    assert (done.returncode, done.stdout, done.stderr) == (0, told, "")
    cloud = read(tmp_path / "points.laz")
    assert cloud.points["class"].tolist() == np.delete(truth, 2).tolist()
    with rasterio.open(tmp_path / "dem.tif") as file:
        assert file.crs.to_epsg() == 32722
        assert tuple(file.bounds) == (500_000, 4_500_000, 500_080, 4_500_080)
    assert np.nanmax(abs(grid(tmp_path / "dem.tif") - 100)) == 0
    # Row 0 is north: y of 70 to 80, between no houses.
    dsm, canopy = grid(tmp_path / "dsm.tif"), grid(tmp_path / "canopy.tif")
    assert (dsm[52:68, 12:28] == 108).all()
    assert (canopy[52:68, 12:28] == 8).all()
    assert np.nanmax(dsm[:8]) == 100
    # Level ground under a sun at 45 degrees.
    np.testing.assert_allclose(np.nanmedian(grid(tmp_path / "hillshade.tif")), 0.5**0.5, atol=1e-3)
    mesh = trimesh.load_mesh(tmp_path / "ground.ply", process=False)
    assert len(mesh.vertices) == ground
    assert mesh.area == pytest.approx(6400, rel=0.02)


def test_processes_change_no_byte(tmp_path: Path) -> None:
    town(tmp_path / "echoes.npz")
    for jobs in (1, 2):
        surface_file(Surfacing(tmp_path / "echoes.npz", tmp_path / f"{jobs}.tif", jobs=jobs))
    assert (tmp_path / "1.tif").read_bytes() == (tmp_path / "2.tif").read_bytes()


def test_progress_is_told_up_to_the_end(tmp_path: Path) -> None:
    town(tmp_path / "echoes.npz")
    told: list[tuple[str, int, int | None]] = []
    surface_file(Surfacing(tmp_path / "echoes.npz", tmp_path / "dem.tif"), lambda *one: told.append(one))
    assert told[0] == ("reading", 0, None)
    assert told[-2:] == [("filtering", 7997, 8000), ("writing", 0, None)]


def test_degrees_are_projected_or_refused(tmp_path: Path) -> None:
    from openecho.surface import files
    from openecho.surface.points import POINT, Cloud

    points = np.zeros(200, POINT)
    points["x"] = -51 + np.random.default_rng(0).uniform(0, 1e-3, 200)
    points["y"] = -15 + np.random.default_rng(1).uniform(0, 1e-3, 200)
    files.STEP, before = 1e-9, files.STEP
    try:
        files.write_points(tmp_path / "degrees.las", Cloud(points, rasterio.crs.CRS.from_epsg(4326).to_wkt()))
    finally:
        files.STEP = before
    with pytest.raises(TableError, match=r"degrees.las: found degrees, expected metres, or --system with what"):
        surface_file(Surfacing(tmp_path / "degrees.las", tmp_path / "dem.tif"))
    made = surface_file(Surfacing(tmp_path / "degrees.las", tmp_path / "dem.tif", system="EPSG:32722", cell=10.0))
    # The central meridian of zone 22 is at -51 degrees: x of 500,000 m there.
    assert 500_000 <= made.grid.west < 500_010
    assert made.grid.shape[0] in (11, 12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["-o", "dem.png"], "dem.png: found suffix '.png', expected .tif or .tiff"),
        (["-o", "dem.tif", "--points", "a.csv"], "a.csv: found suffix '.csv', expected .las or .laz"),
        (["-o", "dem.tif", "--mesh", "a.stl"], "a.stl: found suffix '.stl', expected .ply"),
        (["-o", "dem.tif", "--system", "EPSG:0"], "coordinate system: found 'EPSG:0', expected EPSG:NUMBER or WKT"),
        (["-o", "dem.tif", "--cell", "0"], "echoes.npz: cell: found 0.0, expected a number above 0"),
        (["-o", "dem.tif", "--building", "-3"], "--building: found -3.0, expected a number above 0 and below inf"),
        (["-o", "dem.tif", "--angle", "90"], "--angle: found 90.0, expected a number above 0 and below 90"),
        (["-o", "none/dem.tif"], "none/dem.tif: no folder none, expected one"),
        (["-o", "dem.tif", "--jobs", "2", "--scheduler", "a"], "found --jobs and --scheduler, expected one of them"),
    ],
)
def test_bad_input_is_one_line_and_no_file(tmp_path: Path, options: list[str], message: str) -> None:
    town(tmp_path / "echoes.npz")
    command: list[str | Path] = [PROGRAM, "surface", "echoes.npz", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error: {message}")
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["echoes.npz"]


def test_echoes_without_any_place_are_one_line(tmp_path: Path) -> None:
    np.savez(tmp_path / "echoes.npz", x=np.full(3, np.nan), y=np.zeros(3), z=np.zeros(3))
    with pytest.raises(TableError, match=r"echoes.npz: found 3 echoes, none with a position, expected some$"):
        surface_file(Surfacing(tmp_path / "echoes.npz", tmp_path / "dem.tif"))


def odd_clouds() -> dict[str, np.ndarray]:
    """Points (n, 3) that no terrain is made of as a rule."""
    rng = np.random.default_rng(3)
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0, 40.0), np.arange(0, 40.0)))
    hills = np.column_stack([x, y, 3 * np.sin(x / 9) + 100])
    wild, nowhere = hills.copy(), hills.copy()
    wild[::50, 2] = rng.choice([1e9, -1e9, 1e300, -1e300], len(wild[::50]))
    nowhere[::3] = np.nan
    wall = np.column_stack([np.full(2000, 5.0), rng.uniform(0, 30, 2000), rng.uniform(0, 60, 2000)])
    return {
        "flat": hills * (1, 1, 0),
        "single point": hills[:1],
        "two points": hills[:2],
        "collinear": np.column_stack([np.arange(300.0), np.arange(300.0), np.full(300, 7.0)]),
        "duplicates": np.repeat(hills[:60], 40, axis=0),
        "all one place": np.repeat(hills[:1], 500, axis=0),
        "wall alone": wall,
        "wall on ground": np.concatenate([hills, np.add(wall, (0, 0, 100))]),
        "wildly wrong": wild,
        "one in three nowhere": nowhere,
    }


@pytest.mark.parametrize("kind", odd_clouds())
def test_odd_clouds_have_a_valid_result(tmp_path: Path, kind: str) -> None:
    points = odd_clouds()[kind]
    columns = dict(zip("xyz", points.T, strict=True)) | {"amplitude": np.ones(len(points))}
    np.savez(tmp_path / "echoes.npz", waveform=np.arange(len(points)), number=np.zeros(len(points), int), **columns)
    paths = {"--dsm": tmp_path / "dsm.tif", "--points": tmp_path / "points.las"}
    options = [part for pair in paths.items() for part in pair]
    done = openecho(tmp_path / "echoes.npz", "-o", tmp_path / "dem.tif", *options)
    assert (done.returncode, done.stderr) == (0, "")
    heights, cloud = grid(tmp_path / "dem.tif"), read(tmp_path / "points.las")
    known = np.isfinite(points).all(axis=1)
    usual = known & (abs(points[:, 2]) < 1e6)
    low, high = points[usual, 2].min(), points[usual, 2].max()
    assert np.isfinite(heights).any()
    assert np.nanmin(heights) >= low - 1e-3
    assert np.nanmax(heights) <= high + 1e-3
    assert np.count_nonzero(cloud.points["class"] == GROUND) > 0
    if kind in ("flat", "duplicates", "one in three nowhere"):
        assert (cloud.points["class"] == GROUND).all()
    if kind == "wildly wrong":  # LAS has no room for the others
        assert len(cloud.points) == np.count_nonzero(usual)
        assert (cloud.points["class"] == GROUND).all()
    if kind == "wall on ground":
        assert (cloud.points["class"][: len(points) - 2000] == GROUND).mean() > 0.97
        assert (cloud.points["class"][len(points) - 2000 :] == GROUND).mean() < 0.1
