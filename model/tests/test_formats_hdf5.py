"""LVIS and GEDI granules, written here to NASA's data structures and read back sample for sample."""

from __future__ import annotations

import io
import tracemalloc
from pathlib import Path
from typing import Any

import h5py
import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray

from openecho import formats
from tests import fuzz

LEGACY, CURRENT = 431, 1023


def lvis(
    path: Path | io.BytesIO,
    length: int,
    last: int,
    *,
    waveforms: int = 5,
    case: str = "upper",
    seed: int = 0,
    **changed: Any,
) -> dict[str, NDArray[Any]]:
    """Write an LVIS L1B granule; a value of `changed` replaces a dataset, None leaves it out."""
    rng = np.random.default_rng(seed)
    data: dict[str, Any] = {
        "rxwave": rng.integers(0, 1024, (waveforms, length), np.uint16),
        "time": np.sort(rng.uniform(0, 86400, waveforms)),
        "shotnumber": np.arange(7, 7 + waveforms, dtype=np.uint32),
    }
    for axis, low, high in (("lon", 0, 360), ("lat", -90, 90), ("z", 0, 1000)):
        for number in (0, last):
            data[f"{axis}{number}"] = rng.uniform(low, high, waveforms).astype("f4" if axis == "z" else "f8")
    data |= changed
    with h5py.File(path, "w") as file:
        file.create_group("ancillary_data")
        for name, value in data.items():
            if value is not None:
                file[getattr(name, case)()] = value
    return data


def gedi(path: Path | io.BytesIO, lengths: dict[str, list[int]], *, kind: str = "f4", **changed: Any) -> dict[str, Any]:
    """Write a GEDI L1B granule; `changed` replaces datasets of every beam, None leaves them out."""
    rng = np.random.default_rng(0)
    written = {}
    with h5py.File(path, "w") as file:
        file.create_group("METADATA")
        for beam, counts in lengths.items():
            n = len(counts)
            data: dict[str, Any] = {
                "rxwaveform": rng.integers(200, 1500, sum(counts)).astype(kind),
                "rx_sample_count": np.array(counts, np.uint16),
                "rx_sample_start_index": (np.cumsum([1, *counts])[:n]).astype(np.uint64),
                "shot_number": np.arange(n, dtype=np.uint64) + 19640119100108615,
                "delta_time": rng.uniform(4e7, 5e7, n),
            }
            for end in ("bin0", "lastbin"):
                for axis in ("longitude", "latitude", "elevation"):
                    data[f"geolocation/{axis}_{end}"] = rng.uniform(-50, 50, n)
            data |= changed
            for name, value in data.items():
                if value is not None:
                    file[f"{beam}/{name}"] = value
            written[beam] = data
    return written


def joined(blocks: list[formats.Block], name: str) -> NDArray[Any]:
    return np.concatenate([getattr(block, name) for block in blocks])


@pytest.mark.parametrize("case", ["upper", "lower"])
@pytest.mark.parametrize(
    ("length", "last", "bin_ns"), [(432, 431, 2.0), (528, 527, None), (1024, 1023, 1.0), (1216, 1215, 1.0)]
)
def test_lvis_of_every_length_and_case_reads_back(
    tmp_path: Path, length: int, last: int, bin_ns: float | None, case: str
) -> None:
    written = lvis(tmp_path / "a", length, last, case=case)
    with formats.open(tmp_path / "a") as recording:
        blocks = list(recording.blocks(2))
        described = recording.format, recording.waveforms, recording.longest, recording.bin_ns
    assert described == ("LVIS L1B", 5, length, bin_ns)
    assert [(block.first, len(block.length)) for block in blocks] == [(0, 2), (2, 2), (4, 1)]
    np.testing.assert_array_equal(joined(blocks, "samples"), written["rxwave"])
    np.testing.assert_array_equal(joined(blocks, "length"), np.full(5, length))
    np.testing.assert_array_equal(joined(blocks, "time"), written["time"])
    np.testing.assert_array_equal(joined(blocks, "shot"), written["shotnumber"])
    for end, number in (("first", 0), ("last", last)):
        found = np.concatenate([getattr(block.geolocation, end) for block in blocks])
        expected = np.stack([written[f"{axis}{number}"] for axis in ("lon", "lat", "z")], 1)
        np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_lvis_rows_that_end_before_the_named_bin_end_on_the_same_line(tmp_path: Path) -> None:
    ends: dict[str, Any] = {"z0": np.full(5, 1023.0), "z1023": np.zeros(5)}
    lvis(tmp_path / "a", 1000, CURRENT, **ends)
    (block,) = fuzz.read_all(tmp_path / "a")[:1]
    assert block.geolocation is not None
    np.testing.assert_allclose(block.geolocation.last[:, 2], 1023 - 999)


def test_lvis_without_positions_times_and_numbers_is_waveforms_alone(tmp_path: Path) -> None:
    names = [f"{axis}{number}" for axis in ("lon", "lat", "z") for number in (0, CURRENT)]
    left_out: dict[str, Any] = dict.fromkeys([*names, "time", "shotnumber"])
    lvis(tmp_path / "a", 1024, CURRENT, **left_out)
    with formats.open(tmp_path / "a") as recording:
        block = recording.read(0, 9)
        assert (recording.bin_ns, recording.coordinates, recording.time_unit) == (None, None, None)
    assert (block.time, block.geolocation, block.shot) == (None, None, None)


def test_blocks_follow_one_another_and_equal_single_reads(tmp_path: Path) -> None:
    written = lvis(tmp_path / "a", 432, LEGACY)
    with formats.open(tmp_path / "a") as recording:
        assert [block.first for block in recording.blocks(2)] == [0, 2, 4]
        np.testing.assert_array_equal(recording.read(3, 1).samples, written["rxwave"][3:4])
        with pytest.raises(IndexError, match="waveforms 5 and 1 on, expected 0 to 4"):
            recording.read(5, 1)


def test_memory_follows_the_block_and_not_the_file(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a", "w") as file:
        rows = file.create_dataset("RXWAVE", (50_000, 1024), "u2")
        for first in range(0, len(rows), 4096):
            rows[first : first + 4096] = first >> 12
    tracemalloc.start()
    with formats.open(tmp_path / "a") as recording:
        for block in recording.blocks(4096):
            assert block.samples[0, 0] == block.samples[-1, -1] == block.first >> 12
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5 * 4096 * 1024 * 2, "of the 100 MB in the file"


@pytest.mark.parametrize("kind", ["f4", "f8", "u2", "i4"])
def test_gedi_beams_read_back_one_after_another(tmp_path: Path, kind: str) -> None:
    lengths = {"BEAM0000": [700, 1420, 3], "BEAM0101": [], "BEAM1011": [1, 750]}
    written = gedi(tmp_path / "a", lengths, kind=kind)
    with formats.open(tmp_path / "a") as recording:
        blocks = list(recording.blocks(2))
        described = recording.format, recording.waveforms, recording.longest, recording.bin_ns, recording.parts
    assert described == ("GEDI L1B", 5, 1420, 1.0, (("BEAM0000", 3), ("BEAM1011", 2)))
    assert [(block.first, block.beam, block.length.tolist()) for block in blocks] == [
        (0, "BEAM0000", [700, 1420]),
        (2, "BEAM0000", [3]),
        (3, "BEAM1011", [1, 750]),
    ]
    for beam, counts in lengths.items():
        mine = [block for block in blocks if block.beam == beam]
        rows = [row[:length] for block in mine for row, length in zip(block.samples, block.length, strict=True)]
        flat = written[beam]["rxwaveform"]
        for row, start, count in zip(rows, np.cumsum([0, *counts]), counts, strict=False):
            np.testing.assert_array_equal(row, flat[start : start + count])
        if mine:
            np.testing.assert_array_equal(joined(mine, "time"), written[beam]["delta_time"])
            np.testing.assert_array_equal(joined(mine, "shot"), written[beam]["shot_number"])
            for end, name in (("first", "bin0"), ("last", "lastbin")):
                found = np.concatenate([getattr(block.geolocation, end) for block in mine])
                axes = [written[beam][f"geolocation/{axis}_{name}"] for axis in ("longitude", "latitude", "elevation")]
                np.testing.assert_array_equal(found, np.stack(axes, 1))


def test_gedi_shots_out_of_order_and_far_apart_read_back(tmp_path: Path) -> None:
    flat = np.arange(1000, dtype=np.float32)
    starts = np.array([901, 1, 501], np.uint64)
    gedi(tmp_path / "a", {"BEAM0000": [9, 5, 7]}, rxwaveform=flat, rx_sample_start_index=starts)
    (block,) = fuzz.read_all(tmp_path / "a")
    for row, start, length in zip(block.samples, [900, 0, 500], [9, 5, 7], strict=True):
        np.testing.assert_array_equal(row[:length], np.arange(start, start + length))


def test_gedi_fractions_are_rounded_to_the_nearest_count(tmp_path: Path) -> None:
    gedi(tmp_path / "a", {"BEAM0000": [4]}, rxwaveform=np.array([227.1, 227.6, 2.5, 3.5], "f4"))
    (block,) = fuzz.read_all(tmp_path / "a")
    np.testing.assert_array_equal(block.samples, [[227, 228, 2, 4]])


def test_compressed_and_chunked_granules_read_back(tmp_path: Path) -> None:
    rows = np.random.default_rng(0).integers(0, 255, (5, 432), np.uint16)
    with h5py.File(tmp_path / "a", "w") as file:
        file.create_dataset("rxwave", data=rows, chunks=(2, 100), compression="gzip", shuffle=True)
    np.testing.assert_array_equal(joined(fuzz.read_all(tmp_path / "a")[:1], "samples"), rows[:3])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"rxwave": None}, "found LAT0, .*, ancillary_data, expected rxwave .LVIS L1B. or BEAMxxxx/rxwaveform"),
        ({"rxwave": np.zeros(5)}, r"/RXWAVE has shape \(5,\), expected \(waveform, sample\)"),
        ({"rxwave": np.zeros((0, 5))}, "0 waveforms of 5 samples, expected at least one"),
        ({"rxwave": np.zeros((5, 0))}, "5 waveforms of 0 samples, expected at least one"),
        ({"rxwave": np.zeros((5, 65537), "u1")}, "waveforms of 65537 samples, expected 1 to 65536"),
        ({"rxwave": np.full((5, 4), 65536)}, "/RXWAVE of waveform 0 sample 0 is 65536, expected 0 to 65535"),
        ({"rxwave": np.full((5, 4), -1, "i2")}, "/RXWAVE of waveform 0 sample 0 is -1, expected 0 to 65535"),
        ({"rxwave": np.full((5, 4), np.nan)}, "/RXWAVE of waveform 0 sample 0 is nan, expected 0 to 65535"),
        ({"rxwave": np.full((5, 4), b"text")}, r"/RXWAVE is of dtype \|S4, expected integers or floats"),
        ({"z1023": None}, "no dataset Z1023, expected positions of bins 0 and 1023"),
        ({"lat0": None}, "no dataset LAT0, expected positions of bins 0 and 1023"),
        ({"time": np.zeros(4)}, r"/TIME has shape \(4,\), expected \(5,\)"),
        ({"time": h5py.SoftLink("/SHOTNUMBER")}, "TIME is a SoftLink, expected a dataset in the file itself"),
        ({"time": h5py.ExternalLink("b", "/x")}, "TIME is a ExternalLink, expected a dataset in the file|no dataset"),
    ],
)
def test_bad_lvis_is_told_in_one_line(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    lvis(tmp_path / "a", 1024, CURRENT, **changed)
    with pytest.raises(formats.DataError, match=message) as error:
        fuzz.read_all(tmp_path / "a")
    assert str(error.value).startswith(str(tmp_path / "a"))
    assert "\n" not in str(error.value)


NAN = np.ones(12, "f4")
NAN[9] = np.nan


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"rxwaveform": None}, "no dataset /BEAM0000/rxwaveform, expected it, found delta_time, geolocation"),
        ({"rx_sample_count": None}, "no dataset /BEAM0000/rx_sample_count"),
        ({"rx_sample_start_index": None}, "no dataset /BEAM0000/rx_sample_start_index"),
        ({"geolocation/latitude_lastbin": None}, "no dataset /BEAM0000/geolocation/latitude_lastbin"),
        ({"rx_sample_count": [3, 0, 5]}, "rx_sample_count of waveform 1 is 0, expected 1 to 65536"),
        ({"rx_sample_count": [3, 4, 65537]}, "rx_sample_count of waveform 2 is 65537, expected 1 to 65536"),
        ({"rx_sample_count": [3.0, 4, 5]}, "rx_sample_count is of dtype float64, expected integers"),
        ({"rx_sample_start_index": [0, 4, 8]}, "start_index of waveform 0 is 0, expected 1 to 12"),
        ({"rx_sample_start_index": [1, 4, 9]}, "start_index of waveform 2 ends at sample 13, expected 1 to 12"),
        ({"rx_sample_start_index": [1, 4]}, r"start_index has shape \(2,\), expected \(3,\)"),
        ({"rx_sample_start_index": np.array([1, 4, 2**64 - 1], "u8")}, "waveform 2 is 18446744073709551615, expected"),
        (
            {"rx_sample_count": [5, 4, 5], "rx_sample_start_index": [1, 4, 8]},
            "rx_sample_count adds up to 14 samples, expected at most 12",
        ),
        ({"rxwaveform": NAN}, "/BEAM0000/rxwaveform of waveform 2 sample 2 is nan, expected 0 to 65535"),
        ({"rxwaveform": NAN * np.inf}, "rxwaveform of waveform 0 sample 0 is inf, expected 0 to 65535"),
        ({"rxwaveform": NAN * -1}, "rxwaveform of waveform 0 sample 0 is -1.0, expected 0 to 65535"),
        ({"rxwaveform": NAN * 65536}, "rxwaveform of waveform 0 sample 0 is 65536.0, expected 0 to 65535"),
    ],
)
def test_bad_gedi_is_told_in_one_line(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    gedi(tmp_path / "a", {"BEAM0000": [3, 4, 5]}, **changed)
    with pytest.raises(formats.DataError, match=message) as error:
        fuzz.read_all(tmp_path / "a")
    assert str(error.value).startswith(str(tmp_path / "a"))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("shape", [(2**40, 1024), (2**20, 65536)])
def test_a_shape_beyond_the_bytes_stored_is_refused_before_allocating(tmp_path: Path, shape: tuple[int, int]) -> None:
    with h5py.File(tmp_path / "a", "w") as file:
        file.create_dataset("rxwave", shape, "u2", chunks=(1, 1024))[0, :1024] = 1
    with pytest.raises(formats.DataError, match=r"rxwave of shape .* needs \d+ bytes, expected at most"):
        formats.open(tmp_path / "a")


def test_chunks_too_large_for_bounded_memory_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a", "w") as file:
        file.create_dataset("rxwave", (2**17, 2**11), "u2", chunks=(2**17, 2**11))
    with pytest.raises(formats.DataError, match="rxwave has chunks of 536870912 bytes, expected at most 268435456"):
        formats.open(tmp_path / "a")


@pytest.mark.parametrize("make", [lambda f: lvis(f, 64, 63), lambda f: gedi(f, {"BEAM0000": [30, 40]})])
def test_a_truncated_granule_is_told_in_one_line(tmp_path: Path, make: Any) -> None:
    make(tmp_path / "a")
    content = (tmp_path / "a").read_bytes()
    for size in (9, len(content) // 2, len(content) - 1):
        (tmp_path / "b").write_bytes(content[:size])
        with pytest.raises(formats.DataError, match="expected HDF5 of LVIS or GEDI") as error:
            formats.open(tmp_path / "b")
        assert "\n" not in str(error.value)


def content_of(make: Any) -> bytes:
    file = io.BytesIO()
    make(file)
    return file.getvalue()


LVIS_CONTENT = content_of(lambda file: lvis(file, 16, 15, waveforms=4))
GEDI_CONTENT = content_of(lambda file: gedi(file, {"BEAM0000": [5, 6], "BEAM1011": [7]}))


@fuzz.fuzzed
@hypothesis.given(fuzz.damage(LVIS_CONTENT))
def test_damaged_lvis_gives_data_or_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    fuzz.give_data_or_one_line(tmp_path / "a")


@fuzz.fuzzed
@hypothesis.given(fuzz.damage(GEDI_CONTENT))
def test_damaged_gedi_gives_data_or_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    fuzz.give_data_or_one_line(tmp_path / "a")


@fuzz.fuzzed
@hypothesis.given(
    st.lists(st.tuples(st.integers(0, 2**16), st.integers(0, 2**64 - 1) | st.integers(0, 40)), min_size=1, max_size=5),
    st.lists(st.floats(width=32) | st.integers(0, 2047).map(float), max_size=40),
)
def test_gedi_of_any_counts_and_indices_gives_data_or_one_line(
    tmp_path: Path, rows: list[tuple[int, int]], flat: list[float]
) -> None:
    counts, starts = zip(*rows, strict=True)
    gedi(
        tmp_path / "a",
        {"BEAM0000": [1] * len(rows)},
        rxwaveform=np.array(flat, "f4"),
        rx_sample_count=np.array(counts, "u4"),
        rx_sample_start_index=np.array(starts, "u8"),
    )
    fuzz.give_data_or_one_line(tmp_path / "a")
