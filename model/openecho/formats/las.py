"""LAS 1.3 and 1.4 with waveform packets: point formats 4, 5, 9, 10; packets in the file or in a ``.wdp`` beside it."""

from __future__ import annotations

import struct
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import laspy
import numpy as np
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray

from openecho.formats.packets import HEADER, SAMPLE_BITS, read_packets
from openecho.formats.recording import (
    MAX_LENGTH,
    Block,
    DataError,
    Geolocation,
    Recording,
    check_waveforms,
    one_line,
)

POINT_FORMATS = (4, 5, 9, 10)
"""Those with a wave packet (LAS 1.4 R15, tables 10 to 17)."""

DESCRIPTORS = range(100, 355)
"""Record ids of waveform packet descriptors; a point's descriptor index is the id less 99, 0 for no waveform."""

PACKETS = 65535
"""Record id of the waveform data packets, in the user id LASF_Spec."""

VLR_HEADER = 54
"""Bytes of the header of a variable length record."""

CHUNK = 2**24
"""Bytes of points that are read at a time."""


@dataclass(frozen=True)
class _Index:
    """Where each waveform is: `point` its first return, `start` the byte of its packet, `descriptor` its index."""

    point: NDArray[np.int64]
    start: NDArray[np.int64]
    descriptor: NDArray[np.uint8]


def open_las(path: Path) -> Recording:
    """Open a LAS file; each packet is one waveform, however many returns share it.

    The file's points are read once to find the packets, and an index of 17 bytes for each waveform is kept.
    The waveforms are in the order of their first returns in the file, whose GPS time and position they get: a bin of
    index i is at XYZ + (location - i * spacing) * (dx, dy, dz), with the return's location in the waveform in ps.
    The sign is that of LAS 1.4 R15, in which the anchor, the first bin, is at XYZ + location * (dx, dy, dz), and of
    LAStools: (dx, dy, dz) points back to the sensor.

    Parameters
    ----------
    path : Path
        LAS 1.3 or 1.4, not compressed.

    Returns
    -------
    Recording
        `volts` holds gain and offset of the digitiser where all descriptors in use agree.

    Raises
    ------
    DataError
        If it has no waveforms or they can't be used; other exceptions stand for an unreadable file.
    """
    with ExitStack() as stack:
        file = stack.enter_context(path.open("rb"))
        size = path.stat().st_size
        _check_header(path, file.read(375), size)
        file.seek(0)
        las = laspy.LasReader(file, closefd=False, read_evlrs=False)
        descriptors = _descriptors(path, las)
        packet_path, packets, base, end = _packets(path, file, las, size, stack)
        index = _index(path, las, descriptors, base, end)
        used = [descriptors[number] for number in np.unique(index.descriptor).tolist()]
        bits, samples = (np.zeros(256, np.int32) for _ in range(2))
        for number, descriptor in descriptors.items():
            bits[number], samples[number] = descriptor.bits_per_sample, descriptor.number_of_samples
        lengths = samples[index.descriptor]
        check_waveforms(path, len(lengths), int(lengths.max(initial=0)))
        spacings = sorted({descriptor.temporal_sample_spacing for descriptor in used})
        if len(spacings) > 1 or spacings[0] == 0:
            raise DataError(f"{path}: temporal spacings of {spacings} ps, expected one for all waveforms, above 0")
        scales = las.header.scales
        if not ((scales > 0) & np.isfinite(scales)).all():
            raise DataError(f"{path}: coordinates have scales {scales.tolist()}, expected numbers above 0")
        volts = {(descriptor.digitizer_gain, descriptor.digitizer_offset) for descriptor in used}

        def read(first: int, count: int) -> Block:
            rows = slice(first, first + count)
            time, xyz, location, direction = _returns(las, index.point[rows])
            span = (lengths[rows] - 1) * float(spacings[0])
            numbers = index.descriptor[rows]
            with one_line(packet_path, "whole waveform packets"):
                counts = read_packets(packets, index.start[rows], lengths[rows], bits[numbers].astype(np.uint8))
            return Block(
                first,
                counts,
                lengths[rows],
                time,
                Geolocation(
                    xyz + location[:, None] * direction,
                    xyz + (location - span)[:, None] * direction,
                ),
            )

        standard = bool(las.header.global_encoding.gps_time_type.value)
        return Recording(
            path=path,
            format="LAS waveform packets",
            waveforms=len(lengths),
            longest=int(lengths.max()),
            bin_ns=spacings[0] / 1000,
            coordinates="x, y, z in the units of the file's coordinate system",
            time_unit="GPS seconds less 1e9" if standard else "seconds of the GPS week",
            volts=volts.pop() if len(volts) == 1 else None,
            parts=((None, len(lengths)),),
            reader=read,
            closer=stack.pop_all().close,
            resolution=tuple(scales.tolist()),
            wkt=_wkt(las),
        )


def _wkt(las: laspy.LasReader) -> str | None:
    """Coordinate system as the file's OGC WKT record has it."""
    found = [vlr.string for vlr in las.header.vlrs if isinstance(vlr, WktCoordinateSystemVlr)]
    return found[0] if found else None


def _check_header(path: Path, header: bytes, size: int) -> None:
    """Compare what the header claims with the file's size, because laspy allocates by it."""
    version = tuple(header[24:26])
    if len(version) == 2 and version not in ((1, 3), (1, 4)):
        raise DataError(
            f"{path}: LAS version {version[0]}.{version[1]}, expected 1.3 or 1.4, which have waveform packets"
        )
    smallest = 375 if version == (1, 4) else 235
    if len(header) < smallest:
        raise DataError(f"{path}: LAS header of {len(header)} bytes, expected at least {smallest}")
    header_size, offset, vlrs, point_format, point_size, points = struct.unpack_from("<HIIBHI", header, 94)
    if version == (1, 4):
        (points,) = struct.unpack_from("<Q", header, 247)
    if point_format & 0xC0:
        raise DataError(f"{path}: compressed points (LAZ), expected LAS")
    if point_format not in POINT_FORMATS:
        raise DataError(f"{path}: point format {point_format}, expected 4, 5, 9 or 10, which have waveform packets")
    if not 235 <= header_size <= offset <= size:
        raise DataError(
            f"{path}: header of {header_size} bytes and points at byte {offset}, "
            f"expected one after the other in the file's {size}"
        )
    if vlrs * VLR_HEADER > offset - header_size:
        raise DataError(
            f"{path}: {vlrs} variable length records, expected at most {(offset - header_size) // VLR_HEADER}"
        )
    if points * point_size > size - offset:
        raise DataError(
            f"{path}: {points} points of {point_size} bytes at byte {offset}, expected at most {size - offset} bytes"
        )


def _descriptors(path: Path, las: laspy.LasReader) -> dict[int, Any]:
    """Waveform packet descriptors by the index that points have of them, checked."""
    found = {
        vlr.record_id - DESCRIPTORS.start + 1: vlr.parsed_record
        for vlr in las.header.vlrs
        if vlr.user_id == "LASF_Spec" and vlr.record_id in DESCRIPTORS
    }
    for number, descriptor in found.items():
        where = f"{path}: waveform packet descriptor {number + DESCRIPTORS.start - 1}"
        if descriptor.waveform_compression_type != 0:
            raise DataError(f"{where} has compression {descriptor.waveform_compression_type}, expected 0, none")
        if descriptor.bits_per_sample not in SAMPLE_BITS:
            raise DataError(f"{where} has {descriptor.bits_per_sample} bits per sample, expected 8 or 16")
        if not 1 <= descriptor.number_of_samples <= MAX_LENGTH:
            raise DataError(f"{where} has {descriptor.number_of_samples} samples, expected 1 to {MAX_LENGTH}")
    return found


def _packets(
    path: Path, file: IO[bytes], las: laspy.LasReader, size: int, stack: ExitStack
) -> tuple[Path, IO[bytes], int, int]:
    """File with the waveform data packet record, the record's first byte, and the byte after its last."""
    encoding, base = las.header.global_encoding, int(las.header.start_of_waveform_data_packet_record)
    if encoding.waveform_data_packets_internal or (base and not encoding.waveform_data_packets_external):
        packet_path = path
    else:
        # A name's case is kept from Windows, where these files are made.
        beside = [path.with_suffix(suffix) for suffix in (".wdp", ".WDP")]
        existing = [candidate for candidate in beside if candidate.is_file()]
        if not existing:
            raise DataError(f"{beside[0]}: no such file, expected the waveform packets of {path.name}")
        packet_path, base = existing[0], 0
        file, size = stack.enter_context(packet_path.open("rb")), packet_path.stat().st_size
    if base > size - HEADER:
        raise DataError(f"{packet_path}: waveform packets at byte {base}, expected before byte {size - HEADER}")
    file.seek(base)
    _, user, record, length, _ = struct.unpack("<H16sHQ32s", file.read(HEADER))
    if (user.rstrip(b"\0"), record) != (b"LASF_Spec", PACKETS):
        raise DataError(
            f"{packet_path}: record {record} of {user!r} at byte {base}, expected {PACKETS} of LASF_Spec, the packets"
        )
    if length > size - base - HEADER:
        raise DataError(
            f"{packet_path}: {length} bytes of waveform packets at byte {base}, expected at most {size - base - HEADER}"
        )
    return packet_path, file, base, base + HEADER + length


def _index(path: Path, las: laspy.LasReader, descriptors: dict[int, Any], base: int, end: int) -> _Index:
    """Find the waveforms among the points, and check every packet's place and size."""
    sizes = np.zeros(256, np.int64)
    for number, descriptor in descriptors.items():
        sizes[number] = descriptor.number_of_samples * (descriptor.bits_per_sample // 8)
    points, offsets, numbers = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0, np.uint8)]
    for first in range(0, las.header.point_count, _chunk(las)):
        las.seek(first)
        chunk = las.read_points(_chunk(las))
        mine = np.flatnonzero(np.asarray(chunk["wavepacket_index"]))
        index, offset, packet = (np.asarray(chunk[f"wavepacket_{name}"])[mine] for name in ("index", "offset", "size"))
        for wrong, name, values, expected in (
            (sizes[index] == 0, "descriptor index", index, f"one of {sorted(descriptors)}"),
            (packet != sizes[index], "packet size", packet, "that of its descriptor, {} bytes"),
            ((offset < HEADER) | (offset > end - base), "packet offset", offset, f"{HEADER} to {end - base}"),
            (offset + packet > end - base, "packet offset", offset, f"packets that end at byte {end - base}"),
        ):
            if wrong.any():
                at = int(np.argmax(wrong))
                raise DataError(
                    f"{path}: {name} of point {first + mine[at]} is {values[at]}, "
                    f"expected {expected.format(sizes[index[at]])}"
                )
        # Returns of a pulse follow one another, so this drops most of them already here.
        _, once = np.unique(offset, return_index=True)
        points.append(first + mine[once])
        offsets.append(offset[once].astype(np.int64))
        numbers.append(index[once])
    _, once = np.unique(np.concatenate(offsets), return_index=True)
    point = np.concatenate(points)[once]
    order = once[np.argsort(point)]
    found = _Index(np.concatenate(points)[order], base + np.concatenate(offsets)[order], np.concatenate(numbers)[order])
    total = int(sizes[found.descriptor].sum())
    if total > end - base - HEADER:
        raise DataError(f"{path}: packets add up to {total} bytes, expected at most {end - base - HEADER}")
    return found


def _returns(
    las: laspy.LasReader, points: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """GPS time (n,), position (n, 3), location in the waveform in ps (n,) and direction a ps (n, 3) of points."""
    columns = np.zeros((len(points), 8))
    done = 0
    while done < len(points):
        first = int(points[done])
        until = int(np.searchsorted(points, first + _chunk(las)))
        las.seek(first)
        chunk = las.read_points(int(points[until - 1]) - first + 1)
        for column, name in enumerate(("gps_time", "x", "y", "z", "return_point_wave_location", "x_t", "y_t", "z_t")):
            columns[done:until, column] = np.asarray(chunk[name])[points[done:until] - first]
        done = until
    return columns[:, 0], columns[:, 1:4], columns[:, 4], columns[:, 5:8]


def _chunk(las: laspy.LasReader) -> int:
    return max(1, CHUNK // int(las.header.point_format.size))
