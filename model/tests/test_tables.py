"""Tables of echoes, written in every format and read back bit for bit with the format's own library."""

from __future__ import annotations

import csv
import datetime as dt
import itertools
import sys
import time
import zipfile
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray
from pyarrow import parquet

from openecho import tables
from openecho.decompose import COLUMNS, columns, dtype
from openecho.tables import Table, TableError

KNOWN = ("core", "fit", "bin_ns", "geolocation", "time", "shot", "beam")
BEAMS = ("BEAM0000", "BEAM0101", "BEAM1011")
ALWAYS = ["waveform", "number", "centre", "peak", "time", "width", "fwhm", "amplitude", "flags"]
NAMES = [
    *["waveform", "number", "centre", "peak", "time", "width", "fwhm", "corrected_width", "amplitude"],
    *["centre_error", "width_error", "amplitude_error", "flags"],
    *["centre_ns", "peak_ns", "time_ns", "x", "y", "z", "shot_time", "shot", "beam"],
]
KINDS = ["i8", "i4", *["f8"] * 10, "u1", *["f8"] * 7, "u8", "U8"]
LAS_HAS = ("x", "y", "z", "beam")
"""Columns that need no extra dimension in LAS."""

GEOGRAPHIC = 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],UNIT["degree",0.01745]]'
PROJECTED = f'PROJCS["WGS 84 / UTM zone 33N",{GEOGRAPHIC},PROJECTION["Transverse_Mercator"],UNIT["metre",1]]'
RETURNS = [3, 1, 17, 2, 0, 5, 16, 1, 15, 4]
"""Echoes of each waveform."""

CUTS = [4, 4, 21, 28]
"""Where the echoes are cut into blocks, between waveforms: the second block is empty."""

SUFFIXES = [".csv", ".parquet", ".npz", ".las", ".laz"]


def made(known: Collection[str] = KNOWN, returns: list[int] = RETURNS, seed: int = 1) -> NDArray[Any]:
    """Echoes with any float64 in the columns of floats, but positions within a kilometre."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    n = sum(returns)
    echoes = np.zeros(n, dtype(known))
    for name in echoes.dtype.names or ():
        if echoes.dtype[name] == np.float64:
            echoes[name] = rng.standard_normal(n) * 10.0 ** rng.integers(-300, 300, n)
    echoes["waveform"] = 2**40 + np.repeat(np.arange(len(returns)), returns)
    echoes["number"] = [number for count in returns for number in range(count)]
    echoes["flags"] = rng.integers(0, 256, n)
    echoes["centre"][: min(n, 5)] = [-0.0, 5e-324, 0.1, 1.7976931348623157e308, 1 / 3][: min(n, 5)]
    if "geolocation" in known:
        for name, low in (("x", 500_000), ("y", 4_000_000), ("z", -100)):
            echoes[name] = low + rng.uniform(0, 1000, n)
    if "shot" in known:
        echoes["shot"] = rng.integers(0, 2**64, n, np.uint64)
        echoes["shot"][:2] = [2**64 - 1, 2**63][: min(n, 2)]
    if "beam" in known:
        echoes["beam"] = np.array(BEAMS)[np.sort(rng.integers(0, len(BEAMS), len(returns)))].repeat(returns)
    return echoes


def table_of(echoes: NDArray[Any], cuts: Collection[int] = (), **changed: Any) -> Table:
    blocks = np.split(echoes, list(cuts))
    table = Table(
        dtype=echoes.dtype,
        rows=len(echoes),
        blocks=lambda: iter(blocks),
        bin_ns=0.3,
        resolution=(0.01, 0.001, 0.0005),
        wkt=None,
        beams=BEAMS if "beam" in (echoes.dtype.names or ()) else (),
        time_unit=None,
        date=dt.date(2022, 6, 24),
    )
    return replace(table, **changed)


def located(x: Collection[float], y: float = 0, z: float = 0) -> NDArray[Any]:
    """Echoes at given places, each the only one of its waveform."""
    echoes = np.zeros(len(x), dtype(["geolocation"]))
    echoes["waveform"] = np.arange(len(x))
    echoes["x"], echoes["y"], echoes["z"] = list(x), y, z
    return echoes


def read_csv(path: Path) -> dict[str, NDArray[Any]]:
    with path.open(newline="") as file:
        names, *rows = csv.reader(file)
    kinds = dtype(KNOWN)
    convert = {"f": float, "i": int, "u": int, "U": str}
    return {
        name: np.array([convert[kinds[name].kind](row[at]) for row in rows], kinds[name])
        for at, name in enumerate(names)
    }


def read_parquet(path: Path) -> dict[str, NDArray[Any]]:
    read = parquet.read_table(path)
    found = {}
    for name, column in zip(read.column_names, read.columns, strict=True):
        assert column.null_count == 0
        found[name] = column.to_numpy()
        if found[name].dtype == object:
            assert str(read.schema.field(name).type) == "string"
            found[name] = found[name].astype("U8")
    return found


def read_npz(path: Path) -> dict[str, NDArray[Any]]:
    with np.load(path) as archive:
        return {name: archive[name] for name in archive.files if name != "bin_ns"}


READERS = {".csv": read_csv, ".parquet": read_parquet, ".npz": read_npz}


def assert_same(found: dict[str, NDArray[Any]], echoes: NDArray[Any]) -> None:
    """Names in order, types, and every bit."""
    assert list(found) == list(echoes.dtype.names or ())
    for name, values in found.items():
        assert values.dtype == echoes.dtype[name], name
        assert values.shape == echoes.shape, name
        assert values.tobytes() == echoes[name].tobytes(), name


def extra_dimensions(data: laspy.LasData) -> dict[str, tuple[np.dtype[Any], str]]:
    dimensions = data.point_format.extra_dimensions
    return {dimension.name: (data[dimension.name].dtype, dimension.description) for dimension in dimensions}


def test_names_are_unique_and_meanings_fit_las() -> None:
    assert len({column.name for column in COLUMNS}) == len(COLUMNS)
    for column in COLUMNS:
        assert 0 < len(column.meaning.encode("ascii")) <= 32, column.name
        assert 0 < len(column.name.encode("ascii")) <= 32
        assert column.needs in ("", *KNOWN)


def test_columns_are_those_the_recording_tells_in_one_order() -> None:
    assert [column.name for column in columns(KNOWN)] == NAMES
    assert dtype(KNOWN) == np.dtype(list(zip(NAMES, KINDS, strict=True)))
    assert dtype(()).names == tuple(ALWAYS)
    assert dtype(["shot", "bin_ns"]).names == (*ALWAYS, "centre_ns", "peak_ns", "time_ns", "shot")
    assert dtype({"geolocation", "beam"}).names == (*ALWAYS, "x", "y", "z", "beam")
    assert dtype(["time"]).names == (*ALWAYS, "shot_time")


@pytest.mark.parametrize("suffix", READERS)
@pytest.mark.parametrize("cuts", [[], CUTS, [0, *CUTS, 64, 64]], ids=["whole", "blocks", "empty_ends"])
def test_every_column_is_read_back_bit_for_bit(tmp_path: Path, suffix: str, cuts: list[int]) -> None:
    echoes, path = made(), tmp_path / f"echoes{suffix}"
    assert len(echoes) == 64
    assert tables.write(path, table_of(echoes, cuts)) == 64
    assert_same(READERS[suffix](path), echoes)


@pytest.mark.parametrize("suffix", READERS)
@pytest.mark.parametrize("known", [(), ("bin_ns",), ("shot", "geolocation"), ("beam", "time")], ids="-".join)
def test_only_columns_that_are_known_are_written(tmp_path: Path, suffix: str, known: tuple[str, ...]) -> None:
    echoes, path = made(known), tmp_path / f"echoes{suffix}"
    tables.write(path, table_of(echoes, CUTS))
    assert_same(READERS[suffix](path), echoes)


@pytest.mark.parametrize("suffix", READERS)
def test_echoes_without_a_position_are_kept_where_the_format_can(tmp_path: Path, suffix: str) -> None:
    echoes, path = made(), tmp_path / f"echoes{suffix}"
    for name in ("x", "y", "z", "shot_time"):
        echoes[name][4:21] = np.nan
    echoes["z"][30:32] = [np.inf, -np.inf]
    assert tables.write(path, table_of(echoes, CUTS)) == 64
    assert_same(READERS[suffix](path), echoes)


@pytest.mark.parametrize("suffix", READERS)
@pytest.mark.parametrize("cuts", [[], [0, 0]], ids=["one_block", "three_blocks"])
def test_a_table_without_echoes_has_its_columns(tmp_path: Path, suffix: str, cuts: list[int]) -> None:
    echoes, path = made(returns=[]), tmp_path / f"echoes{suffix}"
    assert tables.write(path, table_of(echoes, cuts)) == 0
    assert_same(READERS[suffix](path), echoes)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_table_without_blocks_is_an_empty_one(tmp_path: Path, suffix: str) -> None:
    path, echoes = tmp_path / f"echoes{suffix}", made(returns=[])
    assert tables.write(path, table_of(echoes, blocks=lambda: iter(()))) == 0
    if suffix in READERS:
        assert_same(READERS[suffix](path), echoes)
    else:
        data = laspy.read(path)
        assert len(data.points) == 0
        assert list(extra_dimensions(data)) == [name for name in NAMES if name not in LAS_HAS]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_same_table_gives_the_same_bytes_on_another_day(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = table_of(made(), CUTS, wkt=PROJECTED)
    first, later = tmp_path / f"first{suffix}", tmp_path / f"later{suffix}"
    tables.write(first, table)
    moved, today = time.time() + 100 * 86400, dt.date.today()
    monkeypatch.setattr(time, "time", lambda: moved)
    assert (dt.date.today() - today).days in (99, 100, 101), "the clock that zipfile and laspy read has not moved"
    tables.write(later, table)
    assert first.read_bytes() == later.read_bytes()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_suffix_in_upper_case_names_the_same_format(tmp_path: Path, suffix: str) -> None:
    table = table_of(made(), CUTS)
    lower, upper = tmp_path / f"lower{suffix}", tmp_path / f"upper{suffix.upper()}"
    tables.check(upper, KNOWN)
    assert tables.write(upper, table) == tables.write(lower, table) == 64
    assert upper.read_bytes() == lower.read_bytes()


@pytest.mark.parametrize(("size", "expected"), [(1, 4), (5, 3), (21, 2), (22, 2), (28, 2), (29, 1), (64, 1), (65, 1)])
def test_chunks_join_whole_blocks_to_at_least_the_size(size: int, expected: int) -> None:
    echoes = made()
    chunks = list(table_of(echoes, CUTS).chunks(size))
    assert np.concatenate(chunks).tobytes() == echoes.tobytes()
    assert all(len(chunk) >= size for chunk in chunks[:-1])
    ends = np.cumsum([len(chunk) for chunk in chunks])
    assert set(ends.tolist()) <= {*CUTS, 64}
    assert len(chunks) == expected


@pytest.mark.parametrize("cuts", [[], [0, 0]], ids=["one_block", "three_blocks"])
def test_a_table_without_echoes_is_one_empty_chunk(cuts: list[int]) -> None:
    for table in (table_of(made(returns=[]), cuts), table_of(made(returns=[]), blocks=lambda: iter(()))):
        (chunk,) = table.chunks(5)
        assert (chunk.shape, chunk.dtype) == ((0,), table.dtype)


@pytest.mark.parametrize(("suffix", "size"), [(".parquet", "parquet.ROW_GROUP"), (".las", "las.POINTS")])
def test_rows_are_the_same_however_many_are_converted_at_a_time(
    tmp_path: Path, suffix: str, size: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = table_of(made(), CUTS)
    whole, chunked = tmp_path / f"whole{suffix}", tmp_path / f"chunked{suffix}"
    tables.write(whole, table)
    monkeypatch.setattr(f"openecho.tables.{size}", 5)
    tables.write(chunked, table)
    if suffix == ".las":
        assert laspy.read(whole).points.array.tobytes() == laspy.read(chunked).points.array.tobytes()
    else:
        assert parquet.ParquetFile(chunked).num_row_groups == 3
        assert_same(read_parquet(chunked), made())


def test_csv_is_a_line_of_names_and_numbers_in_as_many_digits_as_they_need(tmp_path: Path) -> None:
    echoes = np.zeros(2, dtype(["core", "shot", "beam"]))
    echoes[0] = (7, 0, 100.5, 0.1, -0.0, 1 / 3, 1e300, np.nan, 250, 5, 2**64 - 1, "BEAM0000")
    path = tmp_path / "echoes.csv"
    tables.write(path, table_of(echoes))
    assert path.read_bytes().decode("ascii") == (
        "waveform,number,centre,peak,time,width,fwhm,corrected_width,amplitude,flags,shot,beam\n"
        "7,0,100.5,0.1,-0.0,0.3333333333333333,1e+300,nan,250.0,5,18446744073709551615,BEAM0000\n"
        "0,0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0,0,\n"
    )


def test_parquet_tells_unit_and_meaning_of_every_column(tmp_path: Path) -> None:
    path = tmp_path / "echoes.parquet"
    tables.write(path, table_of(made()))
    schema = parquet.read_schema(path)
    assert schema.names == NAMES
    kinds = {"i8": "int64", "i4": "int32", "f8": "double", "u1": "uint8", "u8": "uint64", "U8": "string"}
    assert [str(field.type) for field in schema] == [kinds[kind] for kind in KINDS]
    for column, field in zip(COLUMNS, schema, strict=True):
        assert field.metadata[b"unit"].decode() == column.unit
        assert field.metadata[b"meaning"].decode() == column.meaning
        assert not field.nullable
    assert [field.metadata[b"unit"] for field in schema][2:15] == [
        *[b"bins"] * 6,
        b"counts",
        *[b"bins"] * 2,
        b"counts",
        b"",
        *[b"ns"] * 2,
    ]


def test_parquet_tells_the_sample_interval_where_it_is_known(tmp_path: Path) -> None:
    known, unknown = tmp_path / "known.parquet", tmp_path / "unknown.parquet"
    tables.write(known, table_of(made(), bin_ns=1 / 3))
    tables.write(unknown, table_of(made(()), bin_ns=None))
    assert float(parquet.read_schema(known).metadata[b"bin_ns"]) == 1 / 3
    assert b"bin_ns" not in (parquet.read_schema(unknown).metadata or {})


def test_npz_has_the_sample_interval_where_it_is_known(tmp_path: Path) -> None:
    known, unknown = tmp_path / "known.npz", tmp_path / "unknown.npz"
    tables.write(known, table_of(made(), CUTS, bin_ns=1 / 3))
    tables.write(unknown, table_of(made(()), CUTS, bin_ns=None))
    with np.load(known) as archive:
        assert archive.files == [*NAMES, "bin_ns"]
        bin_ns = archive["bin_ns"]
    assert (bin_ns.shape, bin_ns.dtype, float(bin_ns)) == ((), np.float64, 1 / 3)
    with np.load(unknown) as archive:
        assert archive.files == ALWAYS


def test_npz_is_a_sound_compressed_archive(tmp_path: Path) -> None:
    path = tmp_path / "echoes.npz"
    tables.write(path, table_of(made(), CUTS))
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        assert {member.compress_type for member in archive.infolist()} == {zipfile.ZIP_DEFLATED}


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_is_of_version_1_4_and_point_format_6(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"echoes{suffix}"
    assert tables.write(path, table_of(made(), CUTS)) == 64
    with laspy.open(path) as reader:
        header = reader.header
        assert (str(header.version), header.point_format.id, header.point_count) == ("1.4", 6, 64)
        assert (header.creation_date, header.generating_software) == (dt.date(2022, 6, 24), "OpenEcho")
        assert header.are_points_compressed == (suffix == ".laz")
        assert header.scales.tolist() == [0.01, 0.001, 0.0005]


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("known", [KNOWN, ("geolocation",), ("geolocation", "shot")], ids="-".join)
def test_las_has_every_other_column_as_an_extra_dimension_bit_for_bit(
    tmp_path: Path, suffix: str, known: tuple[str, ...]
) -> None:
    echoes, path = made(known), tmp_path / f"echoes{suffix}"
    tables.write(path, table_of(echoes, CUTS))
    data = laspy.read(path)
    expected = {
        column.name: (np.dtype(column.dtype), column.meaning)
        for column in COLUMNS
        if column.name in (echoes.dtype.names or ()) and column.name not in LAS_HAS
    }
    assert extra_dimensions(data) == expected
    assert list(extra_dimensions(data)) == list(expected)
    for name in expected:
        assert np.array(data[name]).tobytes() == echoes[name].tobytes(), name


def test_las_states_no_range_of_an_extra_dimension_but_the_true_one(tmp_path: Path) -> None:
    path = tmp_path / "echoes.las"
    tables.write(path, table_of(made(), CUTS))
    data = laspy.read(path)
    for described in data.header.vlrs.get("ExtraBytesVlr")[0].extra_bytes_structs:
        values = np.array(data[described.format_name()])
        assert described.min is None or described.min.tolist() == [values.min()], described.format_name()
        assert described.max is None or described.max.tolist() == [values.max()], described.format_name()


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize(
    ("resolution", "steps"),
    [((0.01, 0.001, 0.0005), (0.01, 0.001, 0.0005)), (None, (0.001, 0.001, 0.001))],
    ids=["resolution", "millimetres"],
)
def test_las_positions_are_within_half_a_step(
    tmp_path: Path, suffix: str, resolution: tuple[float, float, float] | None, steps: tuple[float, float, float]
) -> None:
    echoes, path = made(), tmp_path / f"echoes{suffix}"
    tables.write(path, table_of(echoes, CUTS, resolution=resolution))
    data = laspy.read(path)
    assert tuple(data.header.scales) == steps
    for name, step in zip("xyz", steps, strict=True):
        apart = np.abs(np.array(data[name]) - echoes[name])
        assert (apart <= step / 2 + 4 * np.spacing(np.abs(echoes[name]))).all(), name
        assert len(np.unique(data[name])) == 64
        assert getattr(data.header, f"{name}_min") == np.array(data[name]).min()
        assert getattr(data.header, f"{name}_max") == np.array(data[name]).max()


def test_laz_holds_the_points_of_las(tmp_path: Path) -> None:
    echoes = made()
    echoes["z"][21:28] = np.nan
    table = table_of(echoes, CUTS, wkt=PROJECTED, time_unit="GPS seconds less 1e9")
    assert tables.write(tmp_path / "a.las", table) == tables.write(tmp_path / "a.laz", table) == 57
    las, laz = laspy.read(tmp_path / "a.las"), laspy.read(tmp_path / "a.laz")
    assert las.points.array.dtype == laz.points.array.dtype
    assert las.points.array.tobytes() == laz.points.array.tobytes()
    assert las.header.offsets.tolist() == laz.header.offsets.tolist()
    assert [vlr.record_data_bytes() for vlr in las.vlrs] == [vlr.record_data_bytes() for vlr in laz.vlrs]
    assert (tmp_path / "a.laz").read_bytes() != (tmp_path / "a.las").read_bytes()


def test_intensity_is_the_amplitude_in_whole_counts_within_16_bits(tmp_path: Path) -> None:
    echoes = located(np.arange(7))
    echoes["amplitude"] = [5.25, 99.5, 100.5, 65534.75, 65535.4, 1e6, -3]
    tables.write(tmp_path / "a.las", table_of(echoes))
    data = laspy.read(tmp_path / "a.las")
    assert np.array(data.intensity).tolist() == [5, 100, 100, 65535, 65535, 65535, 0]
    assert np.array(data["amplitude"]).tolist() == echoes["amplitude"].tolist()


def test_returns_are_numbered_up_to_the_15_of_las(tmp_path: Path) -> None:
    tables.write(tmp_path / "a.las", table_of(made(), CUTS))
    data = laspy.read(tmp_path / "a.las")
    number = [min(number + 1, 15) for count in RETURNS for number in range(count)]
    assert np.array(data.return_number).tolist() == number
    assert np.array(data.number_of_returns).tolist() == [min(count, 15) for count in RETURNS for _ in range(count)]
    assert data.header.number_of_points_by_return.tolist() == [number.count(n) for n in range(1, 16)]
    assert np.array(data["number"]).max() == 16


def test_point_source_is_the_beam_from_1_or_0_without_beams(tmp_path: Path) -> None:
    echoes = made()
    assert set(echoes["beam"].tolist()) == set(BEAMS)
    tables.write(tmp_path / "beams.las", table_of(echoes, CUTS))
    source = np.array(laspy.read(tmp_path / "beams.las").point_source_id)
    assert source.tolist() == [1 + BEAMS.index(beam) for beam in echoes["beam"].tolist()]
    tables.write(tmp_path / "none.las", table_of(made(["geolocation"]), CUTS))
    assert not np.array(laspy.read(tmp_path / "none.las").point_source_id).any()


@pytest.mark.parametrize(
    ("unit", "taken", "standard"),
    [
        (None, False, 0),
        ("seconds of the UTC day", False, 0),
        ("seconds since 2018-01-01 00:00 UTC", False, 0),
        ("GPS seconds less 1e9", True, 1),
        ("GPS seconds, or seconds of the GPS week where the file's offset is 0", True, 0),
        ("seconds of the GPS week", True, 0),
    ],
)
def test_gps_time_is_the_shots_only_where_their_unit_is_gps(
    tmp_path: Path, unit: str | None, taken: bool, standard: int
) -> None:
    known = ("geolocation",) if unit is None else ("geolocation", "time")
    echoes = made(known)
    if unit is not None:
        echoes["shot_time"] = 345_600.125 + np.arange(64) / 7
    tables.write(tmp_path / "a.las", table_of(echoes, CUTS, time_unit=unit))
    data = laspy.read(tmp_path / "a.las")
    assert int(data.header.global_encoding.gps_time_type) == standard
    assert np.array(data.gps_time).tolist() == (echoes["shot_time"].tolist() if taken else [0.0] * 64)
    if unit is not None:
        assert np.array(data["shot_time"]).tobytes() == echoes["shot_time"].tobytes()


@pytest.mark.parametrize("wkt", [GEOGRAPHIC, PROJECTED], ids=["geographic", "projected"])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_the_coordinate_system_is_in_a_record_and_flagged(tmp_path: Path, suffix: str, wkt: str) -> None:
    path = tmp_path / f"echoes{suffix}"
    tables.write(path, table_of(located([12.5, 12.25]), wkt=wkt, resolution=(1e-7, 1e-7, 1e-3)))
    data = laspy.read(path)
    assert data.header.global_encoding.wkt
    assert [vlr.string for vlr in data.vlrs if isinstance(vlr, WktCoordinateSystemVlr)] == [wkt]


def test_no_coordinate_system_is_made_up(tmp_path: Path) -> None:
    tables.write(tmp_path / "a.las", table_of(located([12.5]), wkt=None))
    assert not [vlr for vlr in laspy.read(tmp_path / "a.las").vlrs if isinstance(vlr, WktCoordinateSystemVlr)]


EAST = [0, 12.3456789, 179.5, 180.5, 270.0, 359.75, -0.25, -179.5]


@pytest.mark.parametrize(
    ("wkt", "expected"),
    [
        (GEOGRAPHIC, [0, 12.3456789, 179.5, -179.5, -90, -0.25, -0.25, -179.5]),
        (PROJECTED, EAST),
        (None, EAST),
    ],
    ids=["geographic", "projected", "none"],
)
def test_longitudes_are_from_minus_180_to_180_degrees(tmp_path: Path, wkt: str | None, expected: list[float]) -> None:
    steps = (1e-6, 1e-6, 1e-3)
    tables.write(tmp_path / "a.las", table_of(located(EAST, y=-45.5, z=1234.5), wkt=wkt, resolution=steps))
    data = laspy.read(tmp_path / "a.las")
    assert np.abs(np.array(data.x) - expected).max() <= 0.5000001e-6
    np.testing.assert_allclose(data.y, -45.5, rtol=0, atol=1e-12)
    np.testing.assert_allclose(data.z, 1234.5, rtol=0, atol=1e-9)


@pytest.mark.parametrize("x", [[179.5, -179.5], [-179.5, 179.5], [180.5, 179.5], [179.5, 180.5], [-180, 180, 0]])
def test_degrees_on_both_sides_of_the_date_line_are_in_one_file(tmp_path: Path, x: list[float]) -> None:
    tables.write(tmp_path / "a.las", table_of(located(x), wkt=GEOGRAPHIC, resolution=(1e-7, 1e-7, 1e-3)))
    found = np.array(laspy.read(tmp_path / "a.las").x)
    assert (np.abs(found) <= 180).all()
    assert np.abs(np.remainder(found - x + 180, 360) - 180).max() < 0.51e-7


@pytest.mark.parametrize("wkt", [GEOGRAPHIC, PROJECTED], ids=["geographic", "projected"])
def test_steps_finer_than_the_whole_earth_fit_echoes_that_are_near_each_other(tmp_path: Path, wkt: str) -> None:
    x = [103.51234567, 103.5, 103.62]
    tables.write(tmp_path / "a.las", table_of(located(x, y=-33.125), wkt=wkt, resolution=(1e-8, 1e-8, 1e-3)))
    data = laspy.read(tmp_path / "a.las")
    assert np.abs(np.array(data.x) - x).max() < 0.51e-8
    assert np.abs(np.array(data.y) + 33.125).max() < 0.51e-8


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_echoes_without_a_finite_position_are_left_out_and_not_counted(tmp_path: Path, suffix: str) -> None:
    echoes, path = made(), tmp_path / f"echoes{suffix}"
    kept = np.ones(64, bool)
    # The first waveform of the table, one whole block, and one within a block.
    for name, rows, value in (("x", slice(0, 3), np.nan), ("y", slice(4, 21), np.inf), ("z", slice(60, 64), -np.inf)):
        echoes[name][rows] = value
        kept[rows] = False
    assert tables.write(path, table_of(echoes, CUTS)) == 40
    data = laspy.read(path)
    assert len(data.points) == data.header.point_count == 40
    for name in extra_dimensions(data):
        assert np.array(data[name]).tobytes() == echoes[name][kept].tobytes(), name
    assert np.abs(np.array(data.x) - echoes["x"][kept]).max() < 0.0051
    assert (np.array(data.return_number) <= np.array(data.number_of_returns)).all()


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("cuts", [[], CUTS], ids=["whole", "blocks"])
def test_las_of_echoes_that_are_nowhere_has_no_points(tmp_path: Path, suffix: str, cuts: list[int]) -> None:
    echoes, path = made(), tmp_path / f"echoes{suffix}"
    echoes["y"] = np.nan
    assert tables.write(path, table_of(echoes, cuts)) == 0
    assert len(laspy.read(path).points) == 0


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_positions_reach_2_to_the_31_steps_from_the_first(tmp_path: Path, axis: str) -> None:
    echoes, path = located([100] * 3, y=100, z=100), tmp_path / "a.las"
    reach = (2**31 - 1) / 1000
    echoes[axis] = [100, 100 + reach, 100 - reach]
    table = table_of(echoes, [1, 2], resolution=(1e-3, 1e-3, 1e-3))
    assert tables.write(path, table) == 3
    assert np.array(laspy.read(path)[axis.upper()]).tolist() == [0, 2**31 - 1, -(2**31 - 1)]
    for beyond in (reach + 0.01, -reach - 0.01, 1e300):
        echoes[axis][2] = 100 + beyond
        with pytest.raises(TableError, match="found echoes too far apart, expected x, y and z within") as error:
            tables.write(path, table)
        assert str(error.value).startswith(str(path))
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "known", "message"),
    [
        ("echoes.txt", KNOWN, r"found suffix '\.txt', expected one of \.csv, \.parquet, \.npz, \.las, \.laz"),
        ("echoes", KNOWN, r"found suffix '', expected one of \.csv, .*"),
        (".csv", KNOWN, r"found suffix '', expected one of \.csv, .*"),
        ("echoes.csv.gz", KNOWN, r"found suffix '\.gz', expected one of \.csv, .*"),
        ("no/echoes.csv", KNOWN, r"no folder .*/no, expected one"),
        ("file/echoes.npz", KNOWN, r"no folder .*/file, expected one"),
        ("folder.csv", KNOWN, r"is a folder, expected a file or nothing"),
        ("folder.las", KNOWN, r"is a folder, expected a file or nothing"),
        ("echoes.las", ("time", "shot"), r"the recording tells no positions, expected them for \.las \(or -o .*\)"),
        ("echoes.LAZ", (), r"the recording tells no positions, expected them for \.laz \(or -o .*\)"),
    ],
)
def test_what_cant_be_written_is_told_in_one_line_before_any_work(
    tmp_path: Path, name: str, known: tuple[str, ...], message: str
) -> None:
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "folder.las").mkdir()
    (tmp_path / "file").touch()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(TableError, match=f"{message}$") as error:
        tables.check(tmp_path / name, known)
    assert str(error.value).startswith(f"{tmp_path / name}: ")
    assert "\n" not in str(error.value)
    assert sorted(tmp_path.rglob("*")) == before


def test_parquet_without_pyarrow_is_told_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "pyarrow"]:
        monkeypatch.setitem(sys.modules, name, None)
    path = tmp_path / "echoes.parquet"
    for refused in (lambda: tables.check(path, KNOWN), lambda: tables.write(path, table_of(made()))):
        with pytest.raises(TableError, match=r"pyarrow is not installed, expected it: pip install") as error:
            refused()
        assert str(error.value).startswith(f"{path}: ")
        assert "\n" not in str(error.value)
    assert not path.exists()
    for suffix in (".csv", ".npz", ".las", ".laz"):
        tables.check(path.with_suffix(suffix), KNOWN)


@pytest.mark.parametrize(("suffix", "known"), list(itertools.product([".csv", ".parquet", ".npz"], [(), KNOWN])))
def test_tables_that_need_no_positions_are_accepted_over_an_existing_file(
    tmp_path: Path, suffix: str, known: tuple[str, ...]
) -> None:
    path = tmp_path / f"echoes{suffix}"
    path.write_bytes(b"kept")
    tables.check(path, known)
    assert path.read_bytes() == b"kept"
