"""LVIS and GEDI level 1B granules in HDF5, told apart by the names of their datasets."""

from __future__ import annotations

import re
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from openecho.formats.packets import cut_rows
from openecho.formats.recording import (
    LARGEST_EXPANSION,
    MAX_LENGTH,
    Block,
    DataError,
    Geolocation,
    Recording,
    check_range,
    check_waveforms,
    printable,
    to_counts,
)

LVIS_BIN_NS = {431: 2.0, 1023: 1.0, 1215: 1.0}
"""Sample interval by the number in LON431, LON1023, LON1215: a granule names its data structure (LDS) in no other way.

1215 and 1023: LDS 2.0.3 and 2.0.4 state "1216 [1024] bins @ 1GHz" (lvis.gsfc.nasa.gov/Data/Data_Structure). 431: LDS
1.03, the first digitiser's 500 MHz (Blair, Rabine & Hofton 1999). 527 and 351: LDS 1.04 and 1.05 state no rate.
"""

GEDI_BIN_NS = 1.0
"""GEDI's digitiser samples at 1 GHz in every granule (GEDI waveform geolocation ATBD); none states it."""

LARGEST_CHUNK = 2**28
"""Bytes of a chunk, which HDF5 decompresses whole; larger ones would break the promise of bounded memory."""

SCANNED = 2**16
"""Shots of which counts and indices are checked at a time when a GEDI granule is opened."""

STEPS = (1e-7, 1e-7, 1e-3)
"""Degrees, degrees and metres: about a centimetre on the ground and a millimetre of height."""

WGS_84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],'
    'AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],'
    'UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]'
)
"""EPSG 4326 as OGC WKT of 2001, which LAS 1.4 asks for; heights above the ellipsoid have no place in it."""

DEGREES = "longitude (degrees east), latitude (degrees north), elevation (metres above the WGS 84 ellipsoid)"


def open_hdf5(path: Path) -> Recording:
    """Open an L1B granule of LVIS (a dataset `rxwave`) or GEDI (groups ``BEAMxxxx`` with `rxwaveform`).

    Parameters
    ----------
    path : Path
        HDF5 file. Names count in any case.

    Returns
    -------
    Recording

    Raises
    ------
    DataError
        If it holds neither, or what it holds contradicts itself; other exceptions stand for an unreadable file.
    """
    with ExitStack() as stack:
        file = stack.enter_context(h5py.File(path, "r"))
        names = {name.casefold(): name for name in file}
        beams = sorted(name for name in file if re.fullmatch(r"BEAM[01]{4}", name.upper()))
        if "rxwave" in names:
            return _open_lvis(path, file, names, stack)
        if beams:
            return _open_gedi(path, file, beams, stack)
        found = printable(", ".join(names.values())) or "nothing"
        raise DataError(f"{path}: found {found}, expected rxwave (LVIS L1B) or BEAMxxxx/rxwaveform (GEDI L1B)")


def _open_lvis(path: Path, file: h5py.File, names: dict[str, str], stack: ExitStack) -> Recording:
    rxwave = dataset(path, file, names["rxwave"], 2, None)
    waveforms, length = rxwave.shape
    check_waveforms(path, waveforms, length)

    def column(name: str) -> h5py.Dataset | None:
        return dataset(path, file, names[name], 1, waveforms) if name in names else None

    time, shot = column("time"), column("shotnumber")
    last_bin, ends = _lvis_geolocation(path, file, names, waveforms)

    def read(first: int, count: int) -> Block:
        rows = slice(first, first + count)
        lengths = np.full(count, length, np.int32)
        geolocation = None
        if ends:
            start, end = (np.stack([_floats(one[rows]) for one in side], 1) for side in ends)
            # The last bin is where its name says; were a row to end elsewhere, it ends on the same straight line.
            geolocation = Geolocation(start, start + (end - start) * ((length - 1) / last_bin))
        return Block(
            first,
            to_counts(path, rxwave.name, rxwave[rows], first, lengths),
            lengths,
            None if time is None else _floats(time[rows]),
            geolocation,
            None if shot is None else shot[rows].astype(np.uint64),
        )

    return Recording(
        path=path,
        format="LVIS L1B",
        waveforms=waveforms,
        longest=length,
        bin_ns=_lvis_bin_ns(path, file, last_bin),
        coordinates=DEGREES if ends else None,
        time_unit=None if time is None else "seconds of the UTC day",
        volts=None,
        parts=((None, waveforms),),
        reader=read,
        closer=stack.pop_all().close,
        resolution=STEPS if ends else None,
        wkt=WGS_84 if ends else None,
    )


def _lvis_geolocation(
    path: Path, file: h5py.File, names: dict[str, str], waveforms: int
) -> tuple[int, tuple[list[h5py.Dataset], list[h5py.Dataset]] | None]:
    """Number of the bin that LON<last>, LAT<last> and Z<last> tell of, 0 if none; and both ends' datasets."""
    numbers = {int(found[1]) for name in names if (found := re.fullmatch(r"(?:lon|lat|z)(\d{1,6})", name))}
    if not numbers:
        return 0, None
    last = max(numbers)
    if last == 0:
        raise DataError(f"{path}: found the position of bin 0 alone, expected also LON, LAT and Z of the last bin")
    sides = []
    for number in (0, last):
        side = []
        for axis in ("lon", "lat", "z"):
            name = f"{axis}{number}"
            if name not in names:
                raise DataError(f"{path}: no dataset {name.upper()}, expected positions of bins 0 and {last}")
            side.append(dataset(path, file, names[name], 1, waveforms))
        sides.append(side)
    return last, (sides[0], sides[1])


def _lvis_bin_ns(path: Path, file: h5py.File, last_bin: int) -> float | None:
    """Sample interval by the attribute ``bin_ns``, which simulated granules have, or by the data structure."""
    if "bin_ns" not in file.attrs:
        return LVIS_BIN_NS.get(last_bin)
    told = np.asarray(file.attrs["bin_ns"])
    if told.size != 1 or told.dtype.kind not in "iuf" or not 0 < float(told.reshape(())) < np.inf:
        raise DataError(f"{path}: bin_ns is {told.reshape(-1)[:4].tolist()}, expected one positive number")
    return float(told.reshape(()))


@dataclass(frozen=True)
class _Beam:
    """One beam of a GEDI granule; datasets of `shots` rows but for the flat `rxwaveform`."""

    name: str
    shots: int
    longest: int
    rxwaveform: h5py.Dataset
    start: h5py.Dataset
    count: h5py.Dataset
    time: h5py.Dataset | None
    shot: h5py.Dataset | None
    ends: tuple[list[h5py.Dataset], list[h5py.Dataset]] | None


def _open_gedi(path: Path, file: h5py.File, names: list[str], stack: ExitStack) -> Recording:
    beams = [beam for name in names if (beam := _beam(path, file, name)).shots]
    waveforms = sum(beam.shots for beam in beams)
    longest = max((beam.longest for beam in beams), default=0)
    check_waveforms(path, waveforms, longest)

    def read(first: int, count: int) -> Block:
        row = first
        for beam in beams:
            if row < beam.shots:
                break
            row -= beam.shots
        return _read_beam(path, beam, row, count, first)

    located = all(beam.ends for beam in beams)
    timed = all(beam.time is not None for beam in beams)
    return Recording(
        path=path,
        format="GEDI L1B",
        waveforms=waveforms,
        longest=longest,
        bin_ns=GEDI_BIN_NS,
        coordinates=DEGREES if located else None,
        time_unit="seconds since 2018-01-01 00:00 UTC" if timed else None,
        volts=None,
        parts=tuple((beam.name, beam.shots) for beam in beams),
        reader=read,
        closer=stack.pop_all().close,
        resolution=STEPS if located else None,
        wkt=WGS_84 if located else None,
    )


def _beam(path: Path, file: h5py.File, name: str) -> _Beam:
    """Datasets of a beam, with every count and start index checked, so that a block can't surprise."""
    group = member(path, file, name)
    if not isinstance(group, h5py.Group):
        raise DataError(f"{path}: {name} is no group, expected a group with rxwaveform")
    rxwaveform = dataset(path, group, "rxwaveform", 1, None)
    count = dataset(path, group, "rx_sample_count", 1, None, "iu")
    shots = len(count)
    start = dataset(path, group, "rx_sample_start_index", 1, shots, "iu")
    total, longest = 0, 0
    for first in range(0, shots, SCANNED):
        rows = slice(first, first + SCANNED)
        counts = count[rows]
        check_range(path, count.name, counts, 1, MAX_LENGTH, first)
        starts = start[rows]
        check_range(path, start.name, starts, 1, len(rxwaveform), first)
        ends = starts.astype(np.int64) + counts - 1
        past = np.flatnonzero(ends > len(rxwaveform))
        if len(past):
            raise DataError(
                f"{path}: {start.name} of waveform {first + past[0]} ends at sample {ends[past[0]]}, "
                f"expected 1 to {len(rxwaveform)}, the samples in {rxwaveform.name}"
            )
        total += int(counts.sum(dtype=np.int64))
        longest = max(longest, int(counts.max()))
    if total > len(rxwaveform):
        raise DataError(
            f"{path}: {count.name} adds up to {total} samples, expected at most {len(rxwaveform)}, "
            f"the samples in {rxwaveform.name}"
        )
    return _Beam(
        name,
        shots,
        longest,
        rxwaveform,
        start,
        count,
        _optional(path, group, "delta_time", shots) or _optional(path, group, "geolocation/delta_time", shots),
        _optional(path, group, "shot_number", shots, "iu"),
        _gedi_geolocation(path, group, shots),
    )


def _gedi_geolocation(
    path: Path, group: h5py.Group, shots: int
) -> tuple[list[h5py.Dataset], list[h5py.Dataset]] | None:
    """Longitude, latitude and elevation of both ends, None if a file has none of the six."""
    sides = [
        [f"geolocation/{axis}_{end}" for axis in ("longitude", "latitude", "elevation")] for end in ("bin0", "lastbin")
    ]
    if not any(name in group for side in sides for name in side):
        return None
    first, last = ([dataset(path, group, name, 1, shots) for name in side] for side in sides)
    return first, last


def _read_beam(path: Path, beam: _Beam, row: int, count: int, first: int) -> Block:
    rows = slice(row, row + count)
    lengths = beam.count[rows].astype(np.int32)
    starts = beam.start[rows].astype(np.int64) - 1
    samples = cut_rows(lambda low, high: beam.rxwaveform[low:high], starts, lengths, beam.rxwaveform.dtype)
    geolocation = None
    if beam.ends:
        geolocation = Geolocation(*(np.stack([_floats(one[rows]) for one in side], 1) for side in beam.ends))
    return Block(
        first,
        to_counts(path, beam.rxwaveform.name, samples, first, lengths),
        lengths,
        None if beam.time is None else _floats(beam.time[rows]),
        geolocation,
        None if beam.shot is None else beam.shot[rows].astype(np.uint64),
        beam.name,
    )


def _floats(values: NDArray[Any]) -> NDArray[np.float64]:
    return values.astype(np.float64)


def _optional(path: Path, group: h5py.Group, name: str, rows: int, kinds: str = "iuf") -> h5py.Dataset | None:
    return dataset(path, group, name, 1, rows, kinds) if name in group else None


def member(path: Path, group: h5py.Group, name: str) -> Any:
    """Member of a group that is in this file.

    Raises
    ------
    DataError
        If there is none, or a link leads out of the file.
    """
    if name not in group:
        where = f"{group.name.rstrip('/')}/{name}"
        raise DataError(f"{path}: no dataset {where}, expected it, found {printable(', '.join(group)) or 'nothing'}")
    for depth in range(1, name.count("/") + 2):
        link = group.get("/".join(name.split("/")[:depth]), getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise DataError(f"{path}: {name} is a {type(link).__name__}, expected a dataset in the file itself")
    return group[name]


def dataset(
    path: Path, group: h5py.Group, name: str, dimensions: int, rows: int | None, kinds: str = "iuf"
) -> h5py.Dataset:
    """Dataset of numbers whose shape is believed only as far as its bytes in the file go.

    Parameters
    ----------
    path, group, name : Path, Group, str
        Where it is.
    dimensions : int
        1 or 2.
    rows : int or None
        Length of the first, None if any will do.
    kinds : str
        NumPy's letters of the types that will do.

    Raises
    ------
    DataError
        If it is missing, of another type or shape, outside this file, or claims more than the file can hold.
    """
    found = member(path, group, name)
    where = f"{path}: {group.name.rstrip('/')}/{name}"
    if not isinstance(found, h5py.Dataset) or found.shape is None:
        raise DataError(f"{where} is a {type(found).__name__} without a shape, expected a dataset")
    if found.dtype.kind not in kinds or found.dtype.itemsize > 8:
        expected = "integers or floats" if "f" in kinds else "integers"
        raise DataError(f"{where} is of dtype {printable(str(found.dtype))}, expected {expected} of at most 8 bytes")
    if found.ndim != dimensions or rows not in (None, found.shape[0]):
        shapes = ("(n,)", "(waveform, sample)") if rows is None else (f"({rows},)", f"({rows}, m)")
        raise DataError(f"{where} has shape {found.shape}, expected {shapes[dimensions - 1]}")
    if found.is_virtual or found.external:
        raise DataError(f"{where} refers to other files, expected its data in the file itself")
    if found.chunks is not None:
        chunk = found.dtype.itemsize
        for side in found.chunks:
            chunk *= side
        if chunk > LARGEST_CHUNK:
            raise DataError(f"{where} has chunks of {chunk} bytes, expected at most {LARGEST_CHUNK}")
    size = found.dtype.itemsize
    for side in found.shape:
        size *= side
    stored = min(found.id.get_storage_size(), path.stat().st_size)
    held = stored * (LARGEST_EXPANSION if found.chunks is not None else 1)
    if size > held:
        raise DataError(
            f"{where} of shape {found.shape} needs {size} bytes, expected at most {held} from {stored} stored"
        )
    return found
