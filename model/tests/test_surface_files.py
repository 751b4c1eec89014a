"""Surfaces in files, read back with the libraries that others read them with."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pytest
import rasterio
import trimesh

from openecho.surface import files
from openecho.surface.points import GROUND, HIGH, POINT, Cloud, read
from openecho.surface.terrain import Grid
from openecho.tables import TableError

GRID = Grid(500_000.0, 4_500_030.0, 10.0, (3, 4))


def test_a_grid_has_its_place_system_and_values(tmp_path: Path) -> None:
    heights = np.arange(12.0).reshape(3, 4)
    heights[1, 2] = np.nan
    files.write_grid(tmp_path / "dem.tif", heights, GRID, "EPSG:32722")
    with rasterio.open(tmp_path / "dem.tif") as file:
        assert file.crs.to_epsg() == 32722
        assert tuple(file.bounds) == (500_000, 4_500_000, 500_040, 4_500_030)
        assert file.res == (10, 10)
        band = file.read(1, masked=True)
        assert [value for (value,) in file.sample([(500_035, 4_500_025)])] == [3]
    np.testing.assert_array_equal(band.filled(np.nan), heights)
    assert band.mask.sum() == 1
    assert [path.name for path in tmp_path.iterdir()] == ["dem.tif"]


def test_a_grid_of_no_known_system_has_metres(tmp_path: Path) -> None:
    files.write_grid(tmp_path / "dem.tif", np.zeros((3, 4)), GRID, None)
    with rasterio.open(tmp_path / "dem.tif") as file:
        assert file.crs is not None
        assert 'UNIT["metre",1' in file.crs.to_wkt()


def test_an_unknown_system_is_one_line_and_no_file(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"^coordinate system: found 'EPSG:0', expected EPSG:NUMBER or WKT$"):
        files.write_grid(tmp_path / "dem.tif", np.zeros((3, 4)), GRID, "EPSG:0")
    assert not list(tmp_path.iterdir())


def test_a_mesh_has_the_points_and_covers_them(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0))
    points = np.column_stack([x.ravel() + 5e5, y.ravel() + 4.5e6, (x + 2 * y).ravel()])
    files.write_mesh(tmp_path / "ground.ply", points)
    mesh = trimesh.load_mesh(tmp_path / "ground.ply", process=False)
    assert b"\ncomment offset 500000 4500000 0\n" in (tmp_path / "ground.ply").read_bytes()
    np.testing.assert_allclose(mesh.vertices + np.array([5e5, 4.5e6, 0]), points, atol=1e-6)
    assert mesh.area == pytest.approx(12 * 6**0.5)  # of a plane that rises 1 to the east and 2 to the north
    with pytest.raises(TableError, match=r"found 2 points of the ground, expected three or more, not in line$"):
        files.write_mesh(tmp_path / "none.ply", points[:2])


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_points_keep_place_class_and_all_else(tmp_path: Path, suffix: str) -> None:
    points = np.zeros(4, POINT)
    points["x"], points["y"], points["z"] = 500_000 + np.arange(4) / 8, 4_500_000.125, [1.5, 2, np.nan, 4]
    points["class"], points["waveform"] = [GROUND, 1, HIGH, HIGH], [7, 8, 9, 10]
    points["intensity"], points["width"] = [3.4, 70_000, 1, np.nan], [4.5, 5, 6, np.nan]
    points["number"], points["count"] = [1, 2, 1, 17], [2, 2, 1, 17]
    path = tmp_path / f"cloud{suffix}"
    system = rasterio.crs.CRS.from_epsg(32722).to_wkt()
    files.write_points(path, Cloud(points, system))
    found, kept = read(path), points[[0, 1, 3]]
    np.testing.assert_allclose(found.places, Cloud(kept).places, atol=5e-4)
    for name in ("class", "waveform"):
        np.testing.assert_array_equal(found.points[name], kept[name])
    np.testing.assert_array_equal(found.points["width"], kept["width"])
    with laspy.open(path) as file:
        las = file.read()
    assert las.intensity.tolist() == [3, 65_535, 0]
    assert np.asarray(las.return_number).tolist() == [1, 2, 15]
    assert found.wkt is not None
    assert rasterio.crs.CRS.from_wkt(found.wkt).to_epsg() == 32722
