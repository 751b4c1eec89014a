"""Compressed recordings: what was compressed comes back, and damage is never data."""

from __future__ import annotations

import io
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openecho import batch, codec, formats
from openecho.batch import Compression
from openecho.batch.simulate import Simulation, simulate_file
from openecho.formats import Block, Recording, compressed
from openecho.scene.schema import bundled, changed, load
from tests import fuzz
from tests.test_formats_hdf5 import gedi, lvis
from tests.test_formats_las import las
from tests.test_formats_pulsewaves import OUTGOING, VARIABLE, pulsewaves


def same(found: Block, expected: Block) -> None:
    """Every number of both blocks is the same, bit for bit."""
    assert found.first == expected.first
    for ours, theirs in zip(batch.compress._columns(found), batch.compress._columns(expected), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def packed(source: Path, name: str = "a.oec", mode: int = codec.PREDICTION) -> Path:
    made = source.with_name(name)
    batch.compress_file(Compression(source, made, mode))
    return made


def small(folder: Path, mode: int = codec.PREDICTION) -> Path:
    """A file of three chunks, with waveforms of several lengths and with positions."""
    rng = np.random.default_rng(0)
    length = rng.integers(1, 40, 7)
    place = rng.normal(0, 1e5, (2, 7, 3))
    samples = np.rint(20 + rng.normal(0, 1.5, (7, 40))).astype(np.uint16)
    np.savez(
        folder / "small.npz",
        samples=samples,
        length=length,
        bin_ns=1.0,
        first=place[0],
        last=place[1],
        time=np.arange(7.0),
    )
    return packed(folder / "small.npz", mode=mode)


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Chunks of a few waveforms, so that small files have several."""
    if "recorded" not in request.fixturenames:
        monkeypatch.setattr(compressed, "CHUNK", 120)


@pytest.mark.parametrize("name", ["gedi_cerrado", "lvis_arctic", "lvis_tx", "neon_harvard"])
@pytest.mark.parametrize("mode", [codec.PREDICTION, codec.THRESHOLD])
def test_recorded_files_come_back(mode: int, name: str, recorded: Path, tmp_path: Path) -> None:
    made = tmp_path / "a.oec"
    batch.compress_file(Compression(recorded / f"{name}.npz", made, mode))
    with formats.open(recorded / f"{name}.npz") as source, formats.open(made) as found:
        for first in (0, source.waveforms // 2, source.waveforms - 1):
            same(found.read(first, 3), source.read(first, 3))
        for one, other in zip(found.blocks(), source.blocks(), strict=True):
            same(one, other)


def test_everything_that_a_recording_tells_is_kept(tmp_path: Path) -> None:
    lvis(tmp_path / "lvis.h5", 432, 431)
    gedi(tmp_path / "gedi.h5", {"BEAM0000": [70, 50, 30], "BEAM0101": [20, 90]})
    las(tmp_path / "waves.las")
    pulsewaves(tmp_path / "waves.pls", [OUTGOING, VARIABLE])
    for name in ("lvis.h5", "gedi.h5", "waves.las", "waves.pls"):
        made = packed(tmp_path / name, f"{name}.oec")
        with formats.open(tmp_path / name) as source, formats.open(made) as found:
            for field in compressed.TELLS:
                expected = getattr(source, field)
                assert getattr(found, field) == (f"{expected}, compressed" if field == "format" else expected)
            assert [block.beam for block in found.blocks(2)] == [block.beam for block in source.blocks(2)]
            for one, other in zip(found.blocks(2), source.blocks(2), strict=True):
                same(one, other)


@pytest.mark.parametrize("name", bundled())
def test_what_was_simulated_comes_back(name: str, tmp_path: Path) -> None:
    source = tmp_path / "simulated.npz"
    simulate_file(Simulation(changed(load(name), shots=8), source))
    for mode in (codec.PREDICTION, codec.THRESHOLD):
        with formats.open(source) as before, formats.open(packed(source, mode=mode)) as found:
            for one, other in zip(found.blocks(7), before.blocks(7), strict=True):
                same(one, other)


def test_any_waveforms_are_the_same_read_alone_or_in_order(tmp_path: Path) -> None:
    made = small(tmp_path)
    with formats.open(tmp_path / "small.npz") as source, formats.open(made) as found:
        for first in range(7):
            for count in range(1, 9):
                same(found.read(first, count), source.read(first, count))


@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_waveforms_of_any_length_and_width_come_back(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    bits = data.draw(st.integers(1, 16))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    length = np.array(data.draw(st.lists(st.integers(1, 60), min_size=1, max_size=9)), np.int32)
    samples = rng.integers(0, 2**bits, (len(length), length.max())).astype(np.uint16)
    samples[np.arange(samples.shape[1]) >= length[:, None]] = 0
    path = tmp_path_factory.getbasetemp() / "any.npz"
    np.savez(path, samples=samples, length=length)
    made = packed(path, "any.oec", data.draw(st.sampled_from([codec.PREDICTION, codec.THRESHOLD])))
    found = fuzz.read_all(made)
    assert sum(len(block.length) for block in found) == len(length)
    for block in found:
        rows = slice(block.first, block.first + len(block.length))
        np.testing.assert_array_equal(block.samples, samples[rows, : block.samples.shape[1]])


@pytest.mark.parametrize("mode", [codec.PREDICTION, codec.THRESHOLD])
def test_every_bit_of_a_file_counts(mode: int, tmp_path: Path) -> None:
    whole = small(tmp_path, mode).read_bytes()
    damaged = tmp_path / "damaged.oec"
    for bit in range(8 * len(whole)):
        changed = bytearray(whole)
        changed[bit // 8] ^= 0x80 >> bit % 8
        damaged.write_bytes(changed)
        with pytest.raises(formats.DataError) as error:
            fuzz.read_all(damaged)
        assert "\n" not in str(error.value)
        assert "byte " in str(error.value) or bit < 8 * len(compressed.MAGIC)


def test_a_file_cut_anywhere_is_refused(tmp_path: Path) -> None:
    whole = small(tmp_path).read_bytes()
    cut = tmp_path / "cut.oec"
    for size in range(len(whole)):
        cut.write_bytes(whole[:size])
        with pytest.raises(formats.DataError, match=r"cut\.oec: (byte \d+: |empty file|starts with)"):
            formats.open(cut)


def _bytes_of_a_small_file(**changed: Any) -> bytes:
    """Three waveforms in two chunks, and a head of which some values are others; its checksum is right."""
    rng = np.random.default_rng(3)
    length = np.array([30, 40, 20], np.int32)
    samples = np.rint(20 + rng.normal(0, 2, (3, 40))).astype(np.uint16)
    blocks = {first: Block(first, samples[first : first + 2], length[first : first + 2]) for first in (0, 2)}
    told = dict.fromkeys(("bin_ns", "coordinates", "time_unit", "volts"))
    recording = Recording(Path(), "x", 3, 40, parts=((None, 3),), reader=None, closer=None, **told)  # type: ignore[arg-type]
    file = io.BytesIO()
    chunks = ((first, compressed.pack_chunk(block, 8, codec.PREDICTION)) for first, block in blocks.items())
    head = compressed.head(recording, 8)
    text = json.dumps(json.loads(head[12:-4]) | changed).encode()
    compressed.write(file, head[:8] + compressed._sealed(len(text).to_bytes(4) + text), chunks)
    return file.getvalue()


SMALL = _bytes_of_a_small_file()


def _sealed_again(content: bytes) -> bytes:
    """The same with all checksums put right, so that what is behind them is looked at."""
    data = bytearray(content)
    end = len(data) - 24
    index = int.from_bytes(data[end : end + 8])
    head = 8 + 4 + int.from_bytes(data[8:12])
    starts = [8, head + 4, *(int.from_bytes(data[at : at + 8]) for at in range(index + 16, end - 4, 16)), index]
    for start, stop in zip(starts, [*starts[1:], end], strict=True):
        if 0 <= start < stop - 4 <= len(data):
            data[stop - 4 : stop] = zlib.crc32(data[start : stop - 4]).to_bytes(4)
    return bytes(data)


@fuzz.fuzzed
@given(content=fuzz.damage(SMALL) | fuzz.damage(SMALL).map(_sealed_again))
def test_damaged_files_give_data_or_one_line(content: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.oec"
    path.write_bytes(content)
    fuzz.give_data_or_one_line(path)


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        (7, 2, "byte 7: version 2, expected 1"),
        (8, 0x7F, "byte 8: a head of "),
    ],
)
def test_what_this_version_does_not_know_is_told(at: int, value: int, message: str, tmp_path: Path) -> None:
    content = bytearray(SMALL)
    content[at] = value
    (tmp_path / "a.oec").write_bytes(content)
    with pytest.raises(formats.DataError, match=message):
        formats.open(tmp_path / "a.oec")


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        (5, 0x12, "byte 0: mode 2, expected 0 to 1"),
        (5, 0x21, "byte 0: version 2, expected 1"),
        (6, 0xF0, "samples of 16 bits, expected 8, as in the head"),
        (3, 9, "9 waveforms, columns 0, expected 2"),
        (4, 8, "columns 8, expected 2"),
    ],
)
def test_chunks_that_are_sealed_and_wrong_are_told(at: int, value: int, message: str, tmp_path: Path) -> None:
    content = bytearray(SMALL)
    chunk = 8 + 4 + int.from_bytes(content[8:12]) + 4
    content[chunk + at] = value
    (tmp_path / "a.oec").write_bytes(_sealed_again(bytes(content)))
    with formats.open(tmp_path / "a.oec") as recording, pytest.raises(formats.DataError, match=message) as error:
        recording.read(0, 1)
    assert f"byte {chunk}" in str(error.value)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"waveforms": 0}, "byte 12: waveforms 0, expected 1 or more"),
        ({"waveforms": "3"}, "byte 12: waveforms '3', expected 1 or more"),
        ({"waveforms": 4}, "byte 12: beams of 3 waveforms, expected 4 in all"),
        ({"waveforms": 4, "parts": [[None, 4]]}, "1 waveforms, columns 0, expected 2"),
        ({"waveforms": 10**15, "parts": [[None, 10**15]]}, "1000000000000000 waveforms in 118 bytes"),
        ({"waveforms": 10**30, "parts": [[None, 10**30]]}, "byte 12: waveforms 10{30}, expected"),
        ({"parts": [[None, -1], [None, 4]]}, "byte 12: parts .+, expected a name or null and 1 or more waveforms"),
        ({"parts": [[None, 1.5], [None, 1.5]]}, "byte 12: parts "),
        ({"parts": []}, "byte 12: beams of 0 waveforms, expected 3"),
        ({"longest": 0}, "byte 12: longest 0, expected 1 to 65536"),
        ({"longest": 65537}, "byte 12: longest 65537, expected 1 to 65536"),
        ({"longest": 40.5}, "byte 12: longest 40.5, expected 1 to 65536"),
        ({"longest": 39}, "lengths of 30 to 40, expected 1 to 39"),
        ({"bits": 17}, "byte 12: bits 17, expected 1 to 16"),
        ({"bits": None}, "byte 12: bits None, expected 1 to 16"),
        ({"bits": 9}, "samples of 8 bits, expected 9"),
        ({"bin_ns": -1}, "byte 12: bin_ns -1, expected a number above 0"),
        ({"bin_ns": float("nan")}, "byte 12: bin_ns nan, expected a number above 0"),
        ({"bin_ns": [1]}, r"byte 12: bin_ns \[1\], expected a number above 0"),
        ({"volts": [1]}, r"byte 12: volts \[1\], expected two numbers"),
        ({"resolution": "abc"}, "byte 12: resolution 'abc', expected three numbers"),
        ({"wkt": 5}, "byte 12: wkt 5, expected text"),
        ({"format": "a\nb"}, r"byte 12: format 'a\\\\nb', expected a line of text"),
        ({"time_unit": "seconds"}, "columns 0, expected also 1, as the head says"),
        ({"coordinates": "x, y, z (metres)"}, "columns 0, expected also 2, as the head says"),
    ],
)
def test_heads_that_are_sealed_and_wrong_are_told(told: dict[str, Any], message: str, tmp_path: Path) -> None:
    path = tmp_path / "a.oec"
    path.write_bytes(_bytes_of_a_small_file(**told))
    with pytest.raises(formats.DataError, match=message) as error:
        fuzz.read_all(path)
    assert "\n" not in str(error.value)
    with pytest.raises(formats.DataError, match=message):
        batch.decompress_file(path, tmp_path / "a.npz")
    assert [left.name for left in tmp_path.iterdir()] == ["a.oec"]
