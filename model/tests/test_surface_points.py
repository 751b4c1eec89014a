"""Points out of every table of echoes that the package writes, and out of LAS that others wrote."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import laspy
import numpy as np
import pytest

from openecho import tables
from openecho.decompose import dtype
from openecho.surface.points import GROUND, UNCLASSIFIED, read
from openecho.tables import Table, TableError

UTM = 'PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]]]]'


def table(known: tuple[str, ...] = ("geolocation",)) -> Table:
    """Five echoes of three waveforms, one without a place."""
    echoes = np.zeros(5, dtype(known))
    echoes["waveform"], echoes["number"] = [0, 0, 1, 3, 3], [0, 1, 0, 0, 1]
    echoes["amplitude"], echoes["width"] = [100.25, 3, 7, 8, 9], [4.5, 5, 6, 7, 8]
    if "geolocation" in known:
        echoes["x"], echoes["y"] = 500_000 + np.arange(5), 4_500_000.5
        echoes["z"] = [12.125, 3, np.nan, 7, 8]
    wkt = UTM if "geolocation" in known else None
    return Table(echoes.dtype, 5, lambda: iter([echoes]), 1.0, (1e-3,) * 3, wkt, (), None, dt.date(2026, 1, 1))


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet", ".las", ".laz"])
def test_points_of_every_table_are_its_echoes(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"echoes{suffix}"
    tables.write(path, table())
    cloud = read(path)
    here = slice(None) if suffix in (".csv", ".npz", ".parquet") else [0, 1, 3, 4]  # LAS has no place for nan
    points = np.array([(0, 1, 2), (0, 2, 2), (1, 1, 1), (3, 1, 2), (3, 2, 2)])[here]
    assert cloud.points["waveform"].tolist() == points[:, 0].tolist()
    assert cloud.points["number"].tolist() == points[:, 1].tolist()
    assert cloud.points["count"].tolist() == points[:, 2].tolist()
    np.testing.assert_array_equal(cloud.points["intensity"], np.array([100.25, 3, 7, 8, 9], np.float32)[here])
    np.testing.assert_array_equal(cloud.points["width"], np.array([4.5, 5, 6, 7, 8], np.float32)[here])
    np.testing.assert_allclose(cloud.places[:, 2], np.array([12.125, 3, np.nan, 7, 8])[here], atol=5e-4)
    np.testing.assert_allclose(cloud.places[:, 0], (500_000 + np.arange(5))[here], atol=5e-4)
    assert (cloud.points["class"] <= UNCLASSIFIED).all()
    assert (cloud.wkt is not None) == (suffix in (".las", ".laz"))


def test_las_of_others_keeps_its_classes(tmp_path: Path) -> None:
    las = laspy.create(point_format=6, file_version="1.4")
    las.x, las.y, las.z = [1.0, 2.0], [3.0, 4.0], [5.0, 6.0]
    las.intensity, las.return_number, las.number_of_returns = [7, 8], [1, 2], [2, 2]
    las.classification = [GROUND, 5]
    las.write(tmp_path / "cloud.laz")
    cloud = read(tmp_path / "cloud.laz")
    assert cloud.points["class"].tolist() == [GROUND, 5]
    assert cloud.points["intensity"].tolist() == [7, 8]
    assert cloud.points["number"].tolist() == [1, 2]
    assert cloud.points["count"].tolist() == [2, 2]
    assert np.isnan(cloud.points["width"]).all()
    assert cloud.wkt is None


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_an_empty_table_is_no_points(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"echoes{suffix}"
    whole = table()
    tables.write(path, Table(whole.dtype, 0, lambda: iter([np.zeros(0, whole.dtype)]), *list(vars(whole).values())[3:]))
    assert len(read(path).points) == 0


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_echoes_without_positions_are_one_line(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"echoes{suffix}"
    tables.write(path, table(()))
    with pytest.raises(TableError, match=rf"^{path}: no column x, y, z, expected echoes with positions$"):
        read(path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("cloud.txt", b"", r"found suffix '.txt', expected one of .csv, .npz, .parquet, .las, .laz$"),
        ("cloud.csv", b"", r"no column x, y, z, expected echoes with positions$"),
        ("cloud.csv", b"x,y,z\n1,2\n", r"list index out of range, expected numbers in each row"),
        ("cloud.csv", b"x,y,z\n1,2,three\n", r"could not convert string to float: 'three', expected numbers"),
        ("cloud.csv", b"\xff\xfe", r"'utf-8' codec .*, expected numbers in each row"),
        ("cloud.npz", b"", r".*, expected an archive of columns$"),
        ("cloud.npz", b"not a zip file", r".*, expected an archive of columns$"),
        ("cloud.parquet", b"not Parquet at all", r".*, expected Parquet$"),
        ("cloud.las", b"", r".*, expected LAS or LAZ$"),
        ("cloud.laz", b"LASF and no more", r".*, expected LAS or LAZ$"),
    ],
)
def test_what_is_no_table_is_one_line(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(TableError, match=message) as error:
        read(tmp_path / name)
    assert str(error.value).startswith(str(tmp_path / name))
    assert "\n" not in str(error.value)
