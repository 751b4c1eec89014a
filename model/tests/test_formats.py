"""What `openecho.formats.load` takes, the line it answers with when it doesn't, and NumPy files block by block."""

from __future__ import annotations

import io
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import hypothesis
import numpy as np
import pytest

from openecho import formats
from openecho.formats import DataError, load
from tests import fuzz

SAMPLES = np.array([[1, 2, 3, 0], [4, 5, 6, 7]], np.int64)
LENGTH = np.array([3, 4])


def npz(path: Path, **arrays: object) -> Path:
    with path.open("wb") as file:
        np.savez(file, **{"samples": SAMPLES, "length": LENGTH, **arrays})  # type: ignore[arg-type]
    return path


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int32, np.int64])
def test_npz_gives_samples_length_and_bin_width(tmp_path: Path, dtype: type) -> None:
    waveforms = load(npz(tmp_path / "a.npz", samples=SAMPLES.astype(dtype), bin_ns=np.float32(2)), 11)
    np.testing.assert_array_equal(waveforms.samples, SAMPLES)
    np.testing.assert_array_equal(waveforms.length, LENGTH)
    assert waveforms.samples.dtype == np.uint16
    assert waveforms.length.dtype == np.int32
    assert waveforms.bin_ns == 2.0


def test_npy_rows_are_full(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", SAMPLES)
    waveforms = load(tmp_path / "a.npy", 11)
    np.testing.assert_array_equal(waveforms.samples, SAMPLES)
    np.testing.assert_array_equal(waveforms.length, [4, 4])
    assert waveforms.bin_ns is None


def test_content_decides_not_the_name(tmp_path: Path) -> None:
    np.testing.assert_array_equal(load(npz(tmp_path / "a.dat"), 11).samples, SAMPLES)


def test_samples_past_the_length_are_ignored(tmp_path: Path) -> None:
    samples = SAMPLES.copy()
    samples[0, 3] = -1
    np.testing.assert_array_equal(load(npz(tmp_path / "a.npz", samples=samples), 11).samples, SAMPLES)


def test_widest_count_is_taken_and_the_next_is_not(tmp_path: Path) -> None:
    assert load(npz(tmp_path / "a.npz", samples=np.full((2, 4), 255)), 8).samples.max() == 255
    with pytest.raises(DataError, match=r"samples of waveform 0 sample 0 is 256, expected 0 to 255"):
        load(npz(tmp_path / "b.npz", samples=np.full((2, 4), 256)), 8)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"samples": np.zeros(4, int)}, "samples have 1 dimensions, expected 2"),
        ({"samples": np.zeros((2, 4))}, "samples are of dtype float64, expected integers"),
        ({"samples": np.zeros((2, 4), bool)}, "samples are of dtype bool, expected integers"),
        ({"samples": np.zeros((0, 4), int), "length": np.zeros(0, int)}, "expected at least one waveform"),
        ({"samples": np.zeros((2, 0), int)}, "expected at least one waveform of one sample"),
        ({"samples": -SAMPLES}, "samples of waveform 0 sample 0 is -1, expected 0 to 65535"),
        ({"samples": SAMPLES * 1000}, "samples of waveform 0 sample 2 is 3000, expected 0 to 2047"),
        ({"length": np.array([3, 5])}, "length of waveform 1 is 5, expected 1 to 4"),
        ({"length": np.array([0, 4])}, "length of waveform 0 is 0, expected 1 to 4"),
        ({"length": np.array([3, -4])}, "length of waveform 1 is -4, expected 1 to 4"),
        ({"length": np.array([3.0, 4.0])}, "length are of dtype float64, expected integers"),
        ({"length": np.array([3])}, r"length has shape \(1,\), expected \(2,\)"),
        ({"length": np.array(3)}, r"length has shape \(\), expected \(2,\)"),
        ({"bin_ns": np.float32(0)}, r"bin_ns is \[0.0\], expected one positive number"),
        ({"bin_ns": np.array([1, 2])}, r"bin_ns is \[1, 2\], expected one positive number"),
        ({"samples": np.array([[{}]])}, "allow_pickle"),
    ],
)
def test_bad_arrays_are_named(tmp_path: Path, arrays: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(DataError, match=message) as error:
        load(npz(tmp_path / "a.npz", **arrays), 11)
    assert str(error.value).startswith(str(tmp_path / "a.npz"))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("key", ["samples", "length"])
def test_missing_key_is_named(tmp_path: Path, key: str) -> None:
    arrays = {"samples": SAMPLES, "length": LENGTH}
    arrays["other"] = arrays.pop(key)
    np.savez(tmp_path / "a.npz", **arrays)  # type: ignore[arg-type]
    with pytest.raises(DataError, match=f"no key {key}, expected samples and length, found .*other"):
        load(tmp_path / "a.npz", 11)


def _truncated(path: Path) -> None:
    content = npz(path).read_bytes()
    path.write_bytes(content[: len(content) // 2])


def _flipped(path: Path) -> None:
    content = bytearray(npz(path).read_bytes())
    content[200] ^= 0xFF
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: None, "no such file"),
        (lambda path: path.mkdir(), "not a file"),
        (lambda path: path.write_bytes(b""), "empty file"),
        (lambda path: path.write_text("1,2,3\n"), r"starts with b'1,2,3\\n', expected .*npz"),
        (lambda path: path.write_bytes(np.lib.format.MAGIC_PREFIX), "expected readable .np"),
        (_truncated, "expected readable .np"),
        (_flipped, "expected readable .np"),
    ],
    ids=["missing", "folder", "empty", "text", "header only", "truncated", "flipped"],
)
def test_unreadable_files_give_one_line(tmp_path: Path, make: Callable[[Path], object], message: str) -> None:
    path = tmp_path / "a.npz"
    make(path)
    with pytest.raises(DataError, match=message) as error:
        load(path, 11)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_load_takes_every_format(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a", "w") as file:
        file["RXWAVE"] = SAMPLES
    waveforms = load(tmp_path / "a", 11)
    np.testing.assert_array_equal(waveforms.samples, SAMPLES)
    with pytest.raises(DataError, match="samples of waveform 1 sample 0 is 4, expected 0 to 3"):
        load(tmp_path / "a", 2)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_blocks_are_as_wide_as_their_longest(tmp_path: Path, save: Callable[..., None]) -> None:
    save(tmp_path / "a.npz", samples=SAMPLES, length=LENGTH, bin_ns=2)
    with formats.open(tmp_path / "a.npz") as recording:
        described = recording.format, recording.waveforms, recording.longest, recording.bin_ns, recording.coordinates
        blocks = list(recording.blocks(1))
    assert described == ("npz", 2, 4, 2.0, None)
    for block, row, length in zip(blocks, SAMPLES, LENGTH, strict=True):
        np.testing.assert_array_equal(block.samples, row[None, :length])


@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_blocks_read_back_in_either_order(tmp_path: Path, order: str) -> None:
    samples = np.arange(21, dtype=">u2").reshape(7, 3)
    np.save(tmp_path / "a.npy", np.asarray(samples, order=order))  # type: ignore[call-overload]
    blocks = fuzz.read_all(tmp_path / "a.npy")
    assert [block.first for block in blocks] == [0, 3, 6]
    np.testing.assert_array_equal(np.concatenate([block.samples for block in blocks]), samples)


@pytest.mark.parametrize("name", ["npy", "npz", "compressed"])
def test_memory_follows_the_block_and_not_the_file(tmp_path: Path, name: str) -> None:
    samples = np.zeros((50_000, 512), np.uint16)
    samples[:] = np.arange(len(samples))[:, None]
    path = tmp_path / name
    with path.open("wb") as file:
        if name == "npy":
            np.save(file, samples)
        else:
            save = np.savez_compressed if name == "compressed" else np.savez
            save(file, samples=samples, length=np.full(len(samples), 512))
    tracemalloc.start()
    with formats.open(path) as recording:
        for block in recording.blocks(1000):
            np.testing.assert_array_equal(block.samples[:, -1], block.first + np.arange(1000))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10e6, "of the 51 MB in the file"


@pytest.mark.parametrize("shape", [(2**40, 2**20), (10**30, 1), (3, 5)])
def test_a_shape_beyond_the_bytes_stored_is_refused_before_allocating(tmp_path: Path, shape: tuple[int, int]) -> None:
    with (tmp_path / "a.npy").open("wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<u2", "fortran_order": False, "shape": shape})
        file.write(bytes(28))
    with pytest.raises(DataError, match=r"samples of shape .* need \d+ bytes, found 28"):
        formats.open(tmp_path / "a.npy")


def test_a_member_that_claims_more_than_deflate_can_hold_is_refused(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", samples=SAMPLES, length=LENGTH)
    content = (tmp_path / "a.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        claimed = archive.getinfo("samples.npy").file_size.to_bytes(4, "little")
    entry = content.index(b"PK\x01\x02")
    at = content.index(claimed, entry)
    (tmp_path / "a.npz").write_bytes(content[:at] + (2**31).to_bytes(4, "little") + content[at + 4 :])
    with pytest.raises(DataError, match=r"samples.npy claims 2147483648 bytes in \d+, expected at most 1100 from one"):
        formats.open(tmp_path / "a.npz")


@pytest.mark.parametrize("name", ["gedi_cerrado.npz", "lvis_arctic.npz", "lvis_tx.npz", "neon_harvard.npz"])
def test_recorded_files_read_back(name: str, recorded: Path) -> None:
    with np.load(recorded / name) as stored:
        samples, length = stored["samples"], stored["length"]
    row = 0
    for block in fuzz.read_all(recorded / name):
        for found, expected in zip(block.samples, block.length, strict=True):
            assert expected == length[row]
            np.testing.assert_array_equal(found[:expected], samples[row, :expected])
            row += 1
    assert row == len(length)


def test_names_in_an_archive_cannot_break_the_line(tmp_path: Path) -> None:
    arrays: dict[str, Any] = {"one\ntwo" + "o" * 1000: SAMPLES}
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(DataError, match=r"found one\\ntwoo+$") as error:
        formats.open(tmp_path / "a.npz")
    assert len(str(error.value)) < 500


def _content(save: Callable[..., None], *arrays: object, **named: object) -> bytes:
    file = io.BytesIO()
    save(file, *arrays, **named)
    return file.getvalue()


@fuzz.fuzzed
@hypothesis.given(
    fuzz.damage(_content(np.savez, samples=SAMPLES, length=LENGTH, bin_ns=np.float32(1)))
    | fuzz.damage(_content(np.savez_compressed, samples=SAMPLES, length=LENGTH))
    | fuzz.damage(_content(np.save, SAMPLES.astype(np.uint16)))
)
def test_damaged_numpy_files_give_data_or_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    fuzz.give_data_or_one_line(tmp_path / "a")
