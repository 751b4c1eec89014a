"""NumPy files: ``.npz`` with `samples`, `length` and maybe more; or ``.npy`` with (n, m), every row full."""

from __future__ import annotations

import tempfile
import zipfile
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from openecho.formats.recording import (
    LARGEST_EXPANSION,
    Block,
    DataError,
    Geolocation,
    Recording,
    check_range,
    check_waveforms,
    printable,
    to_counts,
)

KEYS = ("samples", "length", "bin_ns", "first", "last", "time")
"""Members that are read."""

STEPS = (1e-3, 1e-3, 1e-3)
"""Metres, of coordinates."""

COPIED = 2**20
"""Bytes that are checked or decompressed at a time."""


def open_npy(path: Path) -> Recording:
    """Open a ``.npy``; its samples stay in the file and are mapped.

    Parameters
    ----------
    path : Path
        Two-dimensional array of integers.

    Returns
    -------
    Recording

    Raises
    ------
    DataError
        If it holds anything else; other exceptions stand for an unreadable file.
    """
    with path.open("rb") as file:
        samples = _map(path, "samples", file)
        return _recording(path, "npy", {"samples": samples}, ExitStack())


def open_npz(path: Path) -> Recording:
    """Open a ``.npz``: members are decompressed, and their checksums compared, into temporary files that are mapped.

    Memory stays bounded also for a compressed member; the temporary files take the decompressed size on disk until
    the recording is closed.

    Parameters
    ----------
    path : Path
        Archive with `samples` (n, m) and `length` (n,), stored or deflated; maybe `bin_ns`; maybe `first` and `last`
        (n, 3), where the first and the last bin are, x, y, z in metres; maybe `time` (n,), seconds from the first shot.

    Returns
    -------
    Recording

    Raises
    ------
    DataError
        If it holds anything else; other exceptions stand for an unreadable file.
    """
    with ExitStack() as stack, zipfile.ZipFile(path) as archive:
        members = keys(archive)
        missing = [key for key in ("samples", "length") if key not in members]
        if missing:
            raise DataError(
                f"{path}: no key {' or '.join(missing)}, expected samples and length, "
                f"found {printable(', '.join(members)) or 'none'}"
            )
        arrays = {key: unpacked(path, archive, members[key], stack) for key in KEYS if key in members}
        return _recording(path, "npz", arrays, stack.pop_all())


def _recording(path: Path, format: str, arrays: dict[str, NDArray[Any]], stack: ExitStack) -> Recording:
    samples, length = arrays["samples"], arrays.get("length")
    if samples.ndim != 2:
        raise DataError(f"{path}: samples have {samples.ndim} dimensions, expected 2, (waveform, sample)")
    check_waveforms(path, samples.shape[0], samples.shape[1])
    _check_integers(path, "samples", samples)
    if length is None:
        length = np.full(len(samples), samples.shape[1])
    if length.shape != (len(samples),):
        raise DataError(f"{path}: length has shape {length.shape}, expected ({len(samples)},), one for each waveform")
    _check_integers(path, "length", length)
    check_range(path, "length", length, 1, samples.shape[1])
    lengths = length.astype(np.int32)
    located = "first" in arrays and "last" in arrays
    for key, shape in (("first", (len(lengths), 3)), ("last", (len(lengths), 3)), ("time", (len(lengths),))):
        if key in arrays:
            _check_floats(path, key, arrays[key], shape)

    def read(first: int, count: int) -> Block:
        rows = slice(first, first + count)
        longest = int(lengths[rows].max())
        counts = to_counts(path, "samples", samples[rows, :longest], first, lengths[rows])
        ends = Geolocation(arrays["first"][rows], arrays["last"][rows]) if located else None
        return Block(first, counts, lengths[rows], arrays["time"][rows] if "time" in arrays else None, ends)

    return Recording(
        path=path,
        format=format,
        waveforms=len(lengths),
        longest=int(lengths.max()),
        bin_ns=_bin_ns(path, arrays.get("bin_ns")),
        coordinates="x, y, z (metres)" if located else None,
        time_unit="seconds since the first shot" if "time" in arrays else None,
        volts=None,
        parts=((None, len(lengths)),),
        reader=read,
        closer=stack.close,
        resolution=STEPS if located else None,
    )


def keys(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Members of an archive by the keys under which NumPy knows them."""
    return {info.filename.removesuffix(".npy"): info for info in archive.infolist()}


def unpacked(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, stack: ExitStack) -> NDArray[Any]:
    """Array of an archive, mapped from a temporary file; zipfile compares its checksum on the way.

    Parameters
    ----------
    path, archive, info : Path, ZipFile, ZipInfo
        Where it is.
    stack : ExitStack
        Closes the temporary file, which takes the decompressed size on disk.

    Returns
    -------
    array
        Of any shape and type but object.

    Raises
    ------
    DataError
        If it can't be as large as it claims, or is no array; other exceptions stand for an unreadable file.
    """
    key = printable(info.filename.removesuffix(".npy"))
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise DataError(f"{path}: {key}.npy has zip method {info.compress_type}, expected stored or deflated")
    if info.file_size > LARGEST_EXPANSION * info.compress_size or info.compress_size > path.stat().st_size:
        raise DataError(
            f"{path}: {key}.npy claims {info.file_size} bytes in {info.compress_size}, "
            f"expected at most {LARGEST_EXPANSION} from one and no more than the file has"
        )
    file = stack.enter_context(tempfile.TemporaryFile())  # noqa: SIM115, the stack closes it
    with archive.open(info) as member:
        while chunk := member.read(COPIED):
            file.write(chunk)
    file.flush()
    file.seek(0)
    return _map(path, key, file)


def _map(path: Path, name: str, file: IO[bytes]) -> NDArray[Any]:
    """Array of an open ``.npy`` file, mapped; its size is compared with the file's before anything is allocated."""
    version = npy.read_magic(file)
    read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
    if read_header is None:
        raise DataError(f"{path}: {name} in npy version {version[0]}.{version[1]}, expected 1.0 or 2.0")
    shape, fortran, dtype = read_header(file)
    if dtype.hasobject:
        raise DataError(f"{path}: {name} are of dtype object, expected numbers: allow_pickle is never set")
    start, end = file.tell(), file.seek(0, 2)
    needed = dtype.itemsize
    for side in shape:
        needed *= side
    if any(side < 0 for side in shape) or needed > end - start:
        raise DataError(
            f"{path}: {name} of shape {shape} need {needed} bytes, found {end - start}, expected a readable array"
        )
    if needed == 0:
        return np.zeros(shape, dtype)
    order = "F" if fortran else "C"
    return np.memmap(file, dtype, "r", start, shape, order)  # type: ignore[call-overload, no-any-return, unused-ignore]


def _check_integers(path: Path, name: str, array: NDArray[Any]) -> None:
    if not np.issubdtype(array.dtype, np.integer):
        raise DataError(f"{path}: {name} are of dtype {array.dtype}, expected integers")


def _check_floats(path: Path, name: str, array: NDArray[Any], shape: tuple[int, ...]) -> None:
    if array.dtype.kind != "f" or array.shape != shape:
        raise DataError(f"{path}: {name} has shape {array.shape} of {array.dtype}, expected {shape} of floats")


def _bin_ns(path: Path, value: NDArray[Any] | None) -> float | None:
    if value is None:
        return None
    if value.size != 1 or value.dtype.kind not in "iuf" or not 0 < float(value.reshape(())) < np.inf:
        raise DataError(f"{path}: bin_ns is {value.reshape(-1)[:4].tolist()}, expected one positive number")
    return float(value.reshape(()))
