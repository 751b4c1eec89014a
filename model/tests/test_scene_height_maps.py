"""Height maps: what is read out of each format, exactly, and one line for whatever can't be."""

from __future__ import annotations

import math
import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import hypothesis
import numpy as np
import psutil
import pytest
import rasterio
from numpy.typing import NDArray
from rasterio.transform import Affine

from openecho.scene.document import SceneError
from openecho.scene.geometry.height_maps import Heights, read_map
from openecho.scene.schema import HeightMap
from tests.fuzz import damage, fuzzed

pytestmark = pytest.mark.filterwarnings("error")

Z = np.arange(20, dtype=np.float32).reshape(4, 5) / 4 + 100
"""Rows from south to north, as they come back."""

CELL, WEST, SOUTH = 2.0, 4e5, 5e6
NORTH_UP = Affine(CELL, 0, WEST, 0, -CELL, SOUTH + 4 * CELL)
SUFFIXES = [".tif", ".tiff", ".asc", ".npy"]


def tiff(path: Path, z: NDArray[Any] = Z, transform: Affine | None = NORTH_UP, **options: Any) -> HeightMap:
    """Write a GeoTIFF; its first row is the northernmost, unless the transform says otherwise."""
    rows = z if transform is not None and transform.e > 0 else z[::-1]
    options |= {} if transform is None else {"transform": transform}
    shape = {"height": z.shape[0], "width": z.shape[1], "count": 1, "dtype": z.dtype}
    with rasterio.open(path, "w", driver="GTiff", **shape, **options) as file:
        file.write(rows, 1)
    return HeightMap(file=path)


def grid(path: Path, z: NDArray[Any] = Z, nodata: float = -9999) -> HeightMap:
    """Write an ASCII grid."""
    head = f"ncols {z.shape[1]}\nnrows {z.shape[0]}\nxllcorner {WEST}\nyllcorner {SOUTH}\ncellsize {CELL}\n"
    rows = "\n".join(" ".join(f"{value}" for value in row) for row in z[::-1].tolist())
    path.write_text(f"{head}nodata_value {nodata}\n{rows}\n")
    return HeightMap(file=path)


def array(path: Path, z: NDArray[Any] = Z) -> HeightMap:
    """Write a NumPy array."""
    np.save(path, z[::-1])
    return npy(path)


def npy(path: Path) -> HeightMap:
    """A NumPy array where the other formats' maps are."""
    return HeightMap.model_validate({"file": path, "cell": f"{CELL} m", "corner": [f"{WEST} m", f"{SOUTH} m"]})


def written(folder: Path, suffix: str, z: NDArray[Any] = Z) -> HeightMap:
    """Write a map in one of the formats."""
    write = {".asc": grid, ".npy": array}.get(suffix, tiff)
    return write(folder / f"dem{suffix}", z)


def refusal(given: HeightMap) -> str:
    """What is said of a map that can't be used, without key and file in front: a single short line."""
    with pytest.raises(SceneError) as caught:
        read_map(given, "targets[3].map")
    line = str(caught.value)
    start = f"targets[3].map.file: {given.file}: "
    assert line.startswith(start)
    assert line.isprintable()
    assert len(line) < 600
    return line.removeprefix(start)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_samples_are_in_the_middle_of_their_cells_from_the_south_west(suffix: str, tmp_path: Path) -> None:
    heights = read_map(written(tmp_path, suffix), "map")
    assert (heights.x, heights.y, heights.cell) == (WEST + 1, SOUTH + 1, 2)
    assert heights.z.dtype == np.float64
    assert heights.z.flags.c_contiguous
    np.testing.assert_array_equal(heights.z, Z)


def test_a_geotiff_whose_first_row_is_the_southernmost_is_read_alike(tmp_path: Path) -> None:
    given = tiff(tmp_path / "dem.tif", transform=Affine(CELL, 0, WEST, 0, CELL, SOUTH))
    extent = WEST + 3, SOUTH + 5, WEST + 3, SOUTH + 5
    assert_same(read_map(given, "map"), read_map(tiff(tmp_path / "up.tif"), "map"))
    assert_same(read_map(given, "map", extent), read_map(tiff(tmp_path / "up.tif"), "map", extent))


def assert_same(one: Heights, other: Heights) -> None:
    """Two maps are the same, bit by bit."""
    assert (one.x, one.y, one.cell) == (other.x, other.y, other.cell)
    np.testing.assert_array_equal(one.z, other.z)


def test_a_geotiff_of_points_has_its_samples_where_it_says(tmp_path: Path) -> None:
    """Its transform is that of the samples themselves, not of corners of cells."""
    with rasterio.Env(GTIFF_POINT_GEO_IGNORE=True):
        given = tiff(tmp_path / "dem.tif")
        with rasterio.open(given.file, "r+") as file:
            file.update_tags(AREA_OR_POINT="Point")
            file.transform = NORTH_UP
    heights = read_map(given, "map")
    assert (heights.x, heights.y) == (WEST, SOUTH + 2)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    ("extent", "rows", "columns"),
    [
        ((2.5, 4.5, 3.5, 5.5), (1, 4), (0, 3)),  # within a cell
        ((2.0, 2.5, 3.5, 2.5), (0, 3), (0, 3)),  # at the edge of one: its neighbour is touched, too
        ((4.5, 0.5, 7.5, 3.5), (0, 3), (1, 5)),
        ((-9.0, -9.0, 0.0, 0.0), (0, 2), (0, 2)),  # touches the corner
        ((10.0, 8.0, 99.0, 99.0), (2, 4), (3, 5)),
        ((-math.inf, -1e30, math.inf, 1e30), (0, 4), (0, 5)),
    ],
)
def test_a_window_is_the_part_of_the_whole_that_touches_and_one_around(
    suffix: str,
    extent: tuple[float, ...],
    rows: tuple[int, int],
    columns: tuple[int, int],
    tmp_path: Path,
) -> None:
    west, south, east, north = extent
    part = read_map(written(tmp_path, suffix), "map", (WEST + west, SOUTH + south, WEST + east, SOUTH + north))
    np.testing.assert_array_equal(part.z, Z[slice(*rows), slice(*columns)])
    assert (part.x, part.y) == (WEST + 1 + 2 * columns[0], SOUTH + 1 + 2 * rows[0])


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("extent", [(-2.0, 0.0, -0.1, 8.0), (0.0, 8.1, 10.0, 9.0), (10.1, 9.0, math.inf, math.inf)])
def test_beside_the_map_there_are_no_heights(suffix: str, extent: tuple[float, ...], tmp_path: Path) -> None:
    west, south, east, north = extent
    part = read_map(written(tmp_path, suffix), "map", (WEST + west, SOUTH + south, WEST + east, SOUTH + north))
    assert part.z.shape == (0, 0)


def test_a_window_without_heights_is_empty_even_though_the_map_has_some(tmp_path: Path) -> None:
    z = Z.copy()
    z[:, :3] = np.nan
    part = read_map(array(tmp_path / "dem.npy", z), "map", (WEST + 0.5, SOUTH + 0.5, WEST + 1, SOUTH + 1))
    assert part.z.shape == (0, 0)


def test_only_the_window_is_read_of_a_map_that_is_larger_than_memory(tmp_path: Path) -> None:
    """Four terabytes, in a file that takes none of the disk."""
    path = tmp_path / "dem.npy"
    side = 2**20
    header = np.lib.format.header_data_from_array_1_0(np.zeros((1, 1), np.float32)) | {"shape": (side, side)}
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, header)
        file.truncate(file.tell() + 4 * side * side)
    far = WEST + CELL * side - 1, SOUTH + 1
    assert read_map(npy(path), "map", (*far, *far)).z.tolist() == [[0, 0], [0, 0]]
    assert refusal(npy(path)).startswith("found 1099511627776 samples, which take 1.76e+04 GB, expected at most ")


def test_more_memory_than_there_is_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=319))
    for suffix in SUFFIXES:
        line = "found 20 samples, which take 3.2e-07 GB, expected at most 3.19e-07 GB"
        assert refusal(written(tmp_path, suffix)) == line


@pytest.mark.parametrize("suffix", [".tif", ".asc"])
def test_no_data_is_nan(suffix: str, tmp_path: Path) -> None:
    z = Z.copy()
    z[0, 1] = z[3, 4] = -9999
    path = tmp_path / f"dem{suffix}"
    given = grid(path, z) if suffix == ".asc" else tiff(path, z, nodata=-9999)
    np.testing.assert_array_equal(read_map(given, "map").z, np.where(z == -9999, np.nan, z))


def test_no_data_of_whole_numbers_and_of_arrays_is_nan(tmp_path: Path) -> None:
    whole = np.array([[1, 2], [-32768, 4]], np.int16)
    expected = [[1, 2], [np.nan, 4]]
    np.testing.assert_array_equal(read_map(tiff(tmp_path / "a.tif", whole, nodata=-32768), "map").z, expected)
    np.testing.assert_array_equal(read_map(array(tmp_path / "a.npy", np.array(expected)), "map").z, expected)


@pytest.mark.parametrize("kind", [">f4", "<f8", "<f2", "u1", ">i8"])
def test_an_array_may_have_any_numbers_in_any_order(kind: str, tmp_path: Path) -> None:
    z = np.asfortranarray(Z.astype(kind))
    np.testing.assert_array_equal(read_map(array(tmp_path / "dem.npy", z), "map").z, z.astype(np.float64))


def test_an_ascii_grid_keeps_its_digits(tmp_path: Path) -> None:
    z = np.array([[1234.567890123, 2], [3, 4]])
    np.testing.assert_array_equal(read_map(grid(tmp_path / "dem.asc", z), "map").z, z)


def test_scale_and_offset_of_the_band_are_applied(tmp_path: Path) -> None:
    given = tiff(tmp_path / "dem.tif", np.array([[100, 200], [0, 400]], np.int16), nodata=0)
    with rasterio.open(given.file, "r+") as file:
        file.scales, file.offsets = (0.25,), (-10.0,)
    np.testing.assert_array_equal(read_map(given, "map").z, [[15, 40], [np.nan, 90]])


@pytest.mark.parametrize(
    ("transform", "crs", "line"),
    [
        (None, None, "found no transform, expected one that tells the place of its cells"),
        (
            NORTH_UP @ Affine.rotation(10),
            None,
            "found a rotated or sheared map, expected rows from west to east",
        ),
        (NORTH_UP @ Affine.shear(10), None, "found a rotated or sheared map, expected rows from west to east"),
        (NORTH_UP @ Affine.scale(-1, 1), None, "found a rotated or sheared map, expected rows from west to east"),
        (NORTH_UP @ Affine.scale(1, 1.5), None, "found cells of 2 × 3, expected square ones"),
        (
            Affine(1e-4, 0, 8, 0, -1e-4, 47),
            "EPSG:4326",
            "found coordinates in degrees, expected projected ones in metres",
        ),
        (NORTH_UP, "EPSG:2263", "found coordinates in US survey foot, expected ones in metres"),
    ],
)
def test_cells_that_are_no_squares_in_metres_are_one_line(
    transform: Affine | None, crs: str | None, line: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        given = tiff(tmp_path / "dem.tif", transform=transform, crs=crs)
    capfd.readouterr()
    assert refusal(given) == line
    assert capfd.readouterr() == ("", "")


def test_a_corner_that_is_nowhere_is_one_line(tmp_path: Path) -> None:
    given = grid(tmp_path / "dem.asc")
    given.file.write_text(given.file.read_text().replace(f"xllcorner {WEST}", "xllcorner nan"))
    assert refusal(given).startswith("found no ")


def test_projected_coordinates_and_nearly_square_cells_are_taken(tmp_path: Path) -> None:
    given = tiff(tmp_path / "dem.tif", transform=NORTH_UP @ Affine.scale(1, 1 + 1e-9), crs="EPSG:32632")
    assert read_map(given, "map").cell == CELL


@pytest.mark.parametrize(
    ("z", "line"),
    [
        (np.zeros((2, 2, 2)), "found a 3-D array of float64, expected a 2-D one of numbers"),
        (np.zeros((2, 2), np.bool_), "found a 2-D array of bool, expected a 2-D one of numbers"),
        (np.zeros((2, 2), np.complex64), "found a 2-D array of complex64, expected a 2-D one of numbers"),
        (np.array([["a", "b"]]), "found a 2-D array of <U1, expected a 2-D one of numbers"),
        (np.zeros((1, 5)), "found 1 × 5 samples, expected at least 2 × 2"),
        (np.zeros((0, 0)), "found 0 × 0 samples, expected at least 2 × 2"),
        (np.array([[1, np.inf], [-np.inf, 2]]), "found 2 infinite heights, expected finite ones"),
        (np.full((3, 2), np.nan), "found no height in 6 samples, expected some"),
    ],
)
def test_an_array_that_is_no_map_is_one_line(z: NDArray[Any], line: str, tmp_path: Path) -> None:
    assert refusal(array(tmp_path / "dem.npy", z)) == line


def test_a_geotiff_without_heights_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "dem.tif"
    assert refusal(tiff(path, Z[:, :1])) == "found 4 × 1 samples, expected at least 2 × 2"
    assert refusal(tiff(path, Z * np.float32(np.inf))) == "found 20 infinite heights, expected finite ones"
    assert refusal(tiff(path, Z * 0, nodata=0)) == "found no height in 20 samples, expected some"


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("content", [b"", b"junk" * 50, b"II*\0" + b"junk" * 50, b"\x93NUMPY\1\0junk", b"PK\3\4junk"])
def test_a_file_that_is_no_map_is_one_line(
    suffix: str, content: bytes, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"dem{suffix}"
    path.write_bytes(content)
    line = refusal(npy(path) if suffix == ".npy" else HeightMap(file=path))
    assert line.startswith("found no heights (")
    assert line.endswith("), expected some")
    assert capfd.readouterr() == ("", "")


def test_a_list_of_other_files_is_not_followed(tmp_path: Path) -> None:
    """A virtual raster could name any file or address."""
    other = tiff(tmp_path / "other.tif").file
    source = f"<SimpleSource><SourceFilename>{other}</SourceFilename><SourceBand>1</SourceBand></SimpleSource>"
    band = f'<VRTRasterBand dataType="Float32" band="1">{source}</VRTRasterBand>'
    text = f'<VRTDataset rasterXSize="5" rasterYSize="4">{band}</VRTDataset>'
    for suffix in (".tif", ".asc"):
        path = tmp_path / f"dem{suffix}"
        path.write_text(text)
        assert refusal(HeightMap(file=path)).startswith("found no heights (")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_damaged_map_is_a_map_or_one_line(suffix: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    given = written(tmp_path, suffix)
    whole = given.file.read_bytes()

    @hypothesis.settings(fuzzed, max_examples=100)
    @hypothesis.given(content=damage(whole))
    def check(content: bytes) -> None:
        given.file.write_bytes(content)
        map_or_one_line(given)

    check()
    assert capfd.readouterr() == ("", "")


def map_or_one_line(given: HeightMap) -> None:
    """Read a damaged map."""
    line = ""
    try:
        z = read_map(given, "map", (WEST, SOUTH, WEST + 20, SOUTH + 20)).z
        assert not np.isinf(z).any()
    except SceneError as error:
        line = str(error)
    assert not line or line.startswith(f"map.file: {given.file}: found ")
    assert not line or line.isprintable()


def test_without_rasterio_only_arrays_are_read(tmp_path: Path) -> None:
    tiff(tmp_path / "dem.tif")
    np.save(tmp_path / "dem.npy", Z)
    program = """
import sys
sys.modules["rasterio"] = None
from openecho.scene.geometry.height_maps import read_map
from openecho.scene.schema import HeightMap
assert read_map(HeightMap(file="dem.npy", cell="1 m", corner=["0 m", "0 m"]), "map").z.shape == (4, 5)
read_map(HeightMap(file="dem.tif"), "map")
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    expected = "ModuleNotFoundError: rasterio is not installed, expected it: pip install 'openecho[scene]'"
    assert done.stderr.splitlines()[-1] == expected
