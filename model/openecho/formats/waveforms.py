"""Reading waveforms with every doubt about a file settled before anything is simulated."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray


class DataError(ValueError):
    """A data file that can't be used: one line with the file, what was found and what was expected."""


@dataclass(frozen=True)
class Waveforms:
    """Digitised waveforms.

    Attributes
    ----------
    samples : uint16 (n, m)
        Counts; zero past `length`.
    length : int32 (n,)
        Samples in each row, 1 to m.
    bin_ns : float or None
        Sample interval in nanoseconds where the file tells it.
    """

    samples: NDArray[np.uint16]
    length: NDArray[np.int32]
    bin_ns: float | None = None


def load(path: str | Path, sample_w: int) -> Waveforms:
    """Read waveforms and check that a core with `sample_w`-bit samples can take them.

    Parameters
    ----------
    path : str or Path
        ``.npz`` with `samples` (n, m), `length` (n,) and maybe `bin_ns`; or ``.npy`` with (n, m), every row full.
        The content decides, not the name.
    sample_w : int
        Bits in a sample.

    Returns
    -------
    Waveforms
        Checked; samples past each row's length are set to zero.

    Raises
    ------
    DataError
        The file is missing, empty, of another format, lacks a key, or holds arrays of a wrong type, shape or range.
    """
    arrays = _read(Path(path))
    samples = arrays["samples"]
    if samples.ndim != 2:
        raise DataError(f"{path}: samples have {samples.ndim} dimensions, expected 2 (waveforms, samples)")
    _expect_integers(path, "samples", samples)
    if samples.size == 0:
        raise DataError(f"{path}: samples have shape {samples.shape}, expected at least one waveform of one sample")
    length = arrays.get("length", np.full(len(samples), samples.shape[1]))
    if length.shape != (len(samples),):
        raise DataError(f"{path}: length has shape {length.shape}, expected ({len(samples)},), one for each waveform")
    _expect_integers(path, "length", length)
    _expect_range(path, "length", length, 1, samples.shape[1])
    recorded = np.arange(samples.shape[1]) < length[:, None]
    samples = np.where(recorded, samples, 0)
    _expect_range(path, "samples", samples, 0, 2**sample_w - 1)
    return Waveforms(samples.astype(np.uint16), length.astype(np.int32), _bin_ns(path, arrays.get("bin_ns")))


def _read(path: Path) -> dict[str, np.ndarray]:
    """Arrays of a file by key; a plain ``.npy`` counts as `samples`."""
    if not path.exists():
        raise DataError(f"{path}: no such file, expected .npz or .npy")
    if not path.is_file():
        raise DataError(f"{path}: not a file, expected .npz or .npy")
    try:
        with path.open("rb") as file:
            start = file.read(max(len(npy.MAGIC_PREFIX), 4))
        if not start:
            raise DataError(f"{path}: empty file, expected .npz or .npy")
        # The first bytes are looked at here because np.load takes what it doesn't know for a pickle.
        if not start.startswith((npy.MAGIC_PREFIX, b"PK\x03\x04", b"PK\x05\x06")):
            raise DataError(f"{path}: starts with {start!r}, expected .npz or .npy")
        content = np.load(path, allow_pickle=False)
        if isinstance(content, np.ndarray):
            return {"samples": content}
        with content:
            missing = [key for key in ("samples", "length") if key not in content]
            if missing:
                raise DataError(
                    f"{path}: no key {' or '.join(missing)}, expected samples and length, "
                    f"found {', '.join(content.files) or 'none'}"
                )
            return {key: content[key] for key in ("samples", "length", "bin_ns") if key in content}
    except DataError:
        raise
    except (ValueError, EOFError, OSError, MemoryError, NotImplementedError, zipfile.BadZipFile, zlib.error) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DataError(f"{path}: {reason}, expected a readable .npz or .npy of integers") from error


def _expect_integers(path: str | Path, name: str, array: np.ndarray) -> None:
    if not np.issubdtype(array.dtype, np.integer):
        raise DataError(f"{path}: {name} are of dtype {array.dtype}, expected integers")


def _expect_range(path: str | Path, name: str, array: np.ndarray, low: int, high: int) -> None:
    """Raise for the first entry outside low to high, in the order of rows."""
    outside = np.argwhere((array < low) | (array > high))
    if len(outside):
        at = tuple(int(i) for i in outside[0])
        where = f"waveform {at[0]}" + (f" sample {at[1]}" if len(at) > 1 else "")
        raise DataError(f"{path}: {name} of {where} is {array[at]}, expected {low} to {high}")


def _bin_ns(path: str | Path, value: np.ndarray | None) -> float | None:
    if value is None:
        return None
    if value.size != 1 or value.dtype.kind not in "iuf" or not float(value.reshape(())) > 0:
        raise DataError(f"{path}: bin_ns is {np.array2string(value, threshold=3)}, expected one positive number")
    return float(value.reshape(()))
