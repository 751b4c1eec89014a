"""What `openecho.formats.load` takes, and the line it answers with when it doesn't."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from openecho.formats import DataError, load

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
        ({"samples": -SAMPLES}, "samples of waveform 0 sample 0 is -1, expected 0 to 2047"),
        ({"samples": SAMPLES * 1000}, "samples of waveform 0 sample 2 is 3000, expected 0 to 2047"),
        ({"length": np.array([3, 5])}, "length of waveform 1 is 5, expected 1 to 4"),
        ({"length": np.array([0, 4])}, "length of waveform 0 is 0, expected 1 to 4"),
        ({"length": np.array([3, -4])}, "length of waveform 1 is -4, expected 1 to 4"),
        ({"length": np.array([3.0, 4.0])}, "length are of dtype float64, expected integers"),
        ({"length": np.array([3])}, r"length has shape \(1,\), expected \(2,\)"),
        ({"length": np.array(3)}, r"length has shape \(\), expected \(2,\)"),
        ({"bin_ns": np.float32(0)}, "bin_ns is 0.*, expected one positive number"),
        ({"bin_ns": np.array([1, 2])}, "bin_ns is .*, expected one positive number"),
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
        (lambda path: path.write_text("1,2,3\n"), "expected .npz or .npy"),
        (lambda path: path.write_bytes(np.lib.format.MAGIC_PREFIX), "expected a readable"),
        (_truncated, "expected a readable"),
        (_flipped, "expected a readable"),
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
