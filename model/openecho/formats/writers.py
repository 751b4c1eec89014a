"""Waveforms into files: ``.npz`` in the common form, or HDF5 as an LVIS L1B granule; in memory for one block."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from openecho.formats.recording import DataError
from openecho.tables.npz import EPOCH

EAST, NORTH = 6378137.0, 6335439.327
"""m, radii of the WGS 84 ellipsoid's equator and of its meridians there: where a scene without a place is put."""

AT_ONCE = 2**12
"""Shots whose number and pulse, which are in no block, are written at a time."""


@dataclass(frozen=True)
class Content:
    """Waveforms to write, column by column.

    Attributes
    ----------
    columns : dict
        Type and shape of each column. ``samples`` uint16 (n, m), ``time`` float64 (n,) in seconds, ``first`` and
        ``last`` float64 (n, 3), where the first and the last sample are, m; maybe ``length`` int32 (n,), if not all are
        m; ``noiseless`` float32 (n, m), counts; and ``truth``, a structured array.
    blocks : callable
        Pieces of a column in order, by its name; called once for each.
    bin_ns : float or None
        Sample interval.
    pulse : float64 (k,)
        As it is recorded, counts of a height of 1, one a sample.
    scene : str
        What was simulated, as YAML. Both alone of what was simulated.
    """

    columns: dict[str, tuple[np.dtype[Any], tuple[int, ...]]]
    blocks: Callable[[str], Iterator[NDArray[Any]]]
    bin_ns: float | None
    pulse: NDArray[np.float64] | None = None
    scene: str | None = None


def write_npz(path: Path, content: Content) -> None:
    """Write a ``.npz``: a member for each column, `length`, `bin_ns`, `pulse` and `scene`; stored, so quick to read."""
    waveforms, samples = content.columns["samples"][1]
    whole: dict[str, Any] = {"bin_ns": content.bin_ns, "pulse": content.pulse, "scene": content.scene}
    if "length" not in content.columns:
        whole = {"length": np.broadcast_to(np.int32(samples), waveforms)} | whole
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, (dtype, shape) in content.columns.items():
            header = {"descr": npy.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
            with archive.open(zipfile.ZipInfo(f"{name}.npy", EPOCH), "w", force_zip64=True) as member:
                npy.write_array_header_1_0(member, header)  # type: ignore[no-untyped-call, unused-ignore]
                for block in content.blocks(name):
                    member.write(np.ascontiguousarray(block).tobytes())
        for name, value in whole.items():
            if value is None:
                continue
            with archive.open(zipfile.ZipInfo(f"{name}.npy", EPOCH), "w") as member:
                npy.write_array(member, np.asarray(value))


def write_lvis(path: Path, content: Content) -> None:
    """Write HDF5 with the names of an LVIS L1B granule (lvis.gsfc.nasa.gov/Data/Data_Structure, LDS 2.0.4).

    x and y become longitude and latitude about the point 0, 0 where a metre is as long on the equator and on a
    meridian as WGS 84 has it. Beside those names, ``NOISELESS`` and ``TRUTH`` where they are there, and the attributes
    ``bin_ns`` and ``scene``, for no LVIS granule tells its sample interval.
    """
    assert content.pulse is not None  # an LVIS granule is only made of what was simulated
    waveforms, samples = content.columns["samples"][1]
    with h5py.File(path, "w", libver="latest") as file:
        file.attrs["bin_ns"], file.attrs["scene"] = content.bin_ns, content.scene
        # The transmitted pulse fills half of the 10 bits of LVIS.
        pulses = np.tile(np.rint(512 * content.pulse).astype(np.uint16), (min(AT_ONCE, waveforms), 1))
        shots = file.create_dataset("SHOTNUMBER", (waveforms,), np.uint32)
        sent = file.create_dataset("TXWAVE", (waveforms, len(content.pulse)), np.uint16)
        for first in range(0, waveforms, AT_ONCE):
            last = min(first + AT_ONCE, waveforms)
            shots[first:last], sent[first:last] = np.arange(first, last), pulses[: last - first]
        _fill(file, "TIME", content, "time")
        _fill(file, "RXWAVE", content, "samples")
        for column, number in (("first", 0), ("last", samples - 1)):
            for axis, (name, radius) in enumerate((("LON", EAST), ("LAT", NORTH), ("Z", None))):
                made = file.create_dataset(f"{name}{number}", (waveforms,), np.float64)
                scale = 1.0 if radius is None else 180 / math.pi / radius
                _each(made, content, column, partial(_along, axis, scale))
        for name in ("noiseless", "truth"):
            if name in content.columns:
                _fill(file, name.upper(), content, name)


def _fill(file: h5py.File, name: str, content: Content, column: str) -> None:
    dtype, shape = content.columns[column]
    _each(file.create_dataset(name, shape, dtype), content, column, lambda block: block)


def _each(made: h5py.Dataset, content: Content, column: str, change: Callable[[Any], Any]) -> None:
    first = 0
    for block in content.blocks(column):
        made[first : first + len(block)] = change(block)
        first += len(block)


def _along(axis: int, scale: float, places: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(places[:, axis] * scale)


WRITERS: dict[str, Callable[[Path, Content], None]] = {".npz": write_npz, ".h5": write_lvis, ".hdf5": write_lvis}
"""By the suffix of a file."""


def writer(path: Path) -> Callable[[Path, Content], None]:
    """What writes a file, by its suffix.

    Raises
    ------
    DataError
        If nothing does, or its folder is missing.
    """
    if path.suffix.lower() not in WRITERS:
        raise DataError(f"{path}: found the suffix {path.suffix or 'none'}, expected {', '.join(WRITERS)}")
    if not path.parent.is_dir():
        raise DataError(f"{path}: no folder {path.parent}, expected one")
    return WRITERS[path.suffix.lower()]
