"""PulseWaves 0.3, not compressed: pulses in a ``.pls``, their waveforms in the ``.wvs`` beside it.

Specification: github.com/PulseWaves/Specification, 0.3 revision 6. Where it is silent on signs, those of the
PulseWaves library: durations from the anchor are signed, numbers of segments and samples are not.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
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

PULSES_MAGIC = b"PulseWavesPulse\0"
WAVES_MAGIC = b"PulseWavesWaves\0"

HEADER_SIZE = 352
RECORD_HEADER = struct.Struct("<16sIIq64s")
"""User id, record id, reserved, length, description: before the payload of a VLR, after that of an AVLR."""

COMPOSITION = struct.Struct("<IIiHHfII")
"""Size, reserved, optical centre, extra waves bytes, samplings, sample units, scanner, compression."""

SAMPLING = struct.Struct("<IIBBBBffBBHIHHfI")
"""Size, reserved, type, channel, unused, bits of duration, its scale and offset, bits of segments and of samples,
segments, samples, bits per sample, lookup table, sample units, compression."""

DESCRIPTION = 64
"""Bytes of text that end a composition and a sampling record."""

DESCRIPTORS = 200_000
"""Record id of a pulse descriptor less its index, 1 to 255."""

FIRST_APPENDED = 0xFFFFFFFF
"""Record id of the empty AVLR that follows the pulses and ends the list, which is read from the end of the file."""

RETURNING = 2
"""Type of a sampling of a returning waveform; 1 is outgoing."""

UNITS_TO_TARGET = 1000
"""Sampling units from a pulse's anchor to its target."""

CHUNK = 2**20
"""Bytes of pulses that are read at a time."""


@dataclass(frozen=True)
class _Sampling:
    """How one waveform of a pulse is sampled; `units` are of time, in ns."""

    returning: bool
    duration_bits: int
    scale: float
    offset: float
    segment_bits: int
    count_bits: int
    segments: int
    samples: int
    bits: int
    units: float


@dataclass(frozen=True)
class _Descriptor:
    extra: int
    units: float
    samplings: tuple[_Sampling, ...]


def open_pulsewaves(path: Path) -> Recording:
    """Open a ``.pls`` and the ``.wvs`` beside it; each segment of a returning sampling is one waveform.

    The pulses and the segment headers are read once to find the waveforms, and an index of 37 bytes for each is kept.
    Outgoing waveforms are passed over, and so are pulses with descriptor index 0.

    Parameters
    ----------
    path : Path
        The ``.pls``.

    Returns
    -------
    Recording
        Position of a bin: anchor + (duration + i * sample units / pulse's sample units) * (target - anchor) / 1000.

    Raises
    ------
    DataError
        If it has no waveforms or they can't be used; other exceptions stand for an unreadable file.
    """
    with ExitStack() as stack:
        file = stack.enter_context(path.open("rb"))
        size = path.stat().st_size
        header = file.read(HEADER_SIZE)
        pulses = _check_header(path, header, size)
        beside = [path.with_suffix(suffix) for suffix in (".wvs", ".WVS")]
        existing = [candidate for candidate in beside if candidate.is_file()]
        if not existing:
            raise DataError(f"{beside[0]}: no such file, expected the waves of {path.name}")
        waves_path = existing[0]
        waves = stack.enter_context(waves_path.open("rb"))
        start = waves.read(HEADER)
        if len(start) < HEADER or not start.startswith(WAVES_MAGIC) or start[16:20] != bytes(4):
            raise DataError(
                f"{waves_path}: starts with {start[:20]!r}, expected {WAVES_MAGIC!r} and four zeros, not compressed, "
                f"in {HEADER} bytes"
            )
        payloads = _payloads(path, file, header, size)
        index = _index(path, waves_path, file, waves, pulses, payloads)
        check_waveforms(path, len(index), int(index["length"].max(initial=0)))
        units = np.unique(index["units"])
        if len(units) > 1:
            raise DataError(f"{path}: sample units of {units[:4].tolist()} ns, expected one for all waveforms")
        t_scale, t_offset = struct.unpack_from("<2d", header, 224)
        scale, offset = (np.frombuffer(header, "<f8", 3, at) for at in (256, 280))

        def read(first: int, count: int) -> Block:
            rows = index[first : first + count]
            records = _records(file, pulses, rows["pulse"])
            anchor, target = (records[name] * scale + offset for name in ("anchor", "target"))
            steps = np.stack([rows["duration"], rows["duration"] + (rows["length"] - 1) * rows["ratio"]])
            place = anchor + steps[:, :, None] * ((target - anchor) / UNITS_TO_TARGET)
            with one_line(waves_path, "whole segments"):
                counts = read_packets(waves, rows["start"], rows["length"], rows["bits"])
            return Block(
                first,
                counts,
                rows["length"].copy(),
                records["t"] * t_scale + t_offset,
                Geolocation(place[0], place[1]),
            )

        return Recording(
            path=path,
            format="PulseWaves",
            waveforms=len(index),
            longest=int(index["length"].max()),
            bin_ns=float(units[0]),
            coordinates="x, y, z in the units of the file's coordinate system",
            time_unit="GPS seconds, or seconds of the GPS week where the file's offset is 0",
            volts=None,
            parts=((None, len(index)),),
            reader=read,
            closer=stack.pop_all().close,
            resolution=tuple(scale.tolist()),
        )


@dataclass(frozen=True)
class _Pulses:
    """Where the pulse records are."""

    offset: int
    count: int
    dtype: np.dtype[Any]


def _check_header(path: Path, header: bytes, size: int) -> _Pulses:
    if len(header) < HEADER_SIZE:
        raise DataError(f"{path}: header of {len(header)} bytes, expected {HEADER_SIZE}")
    (header_size,) = struct.unpack_from("<H", header, 174)
    offset, count, pulse_format, _, pulse_size, compression = struct.unpack_from("<qqIIII", header, 176)
    if pulse_format != 0 or compression != 0:
        raise DataError(f"{path}: pulse format {pulse_format} and compression {compression}, expected 0 and 0")
    fields = {"t": "<i8", "waves": "<i8", "anchor": "<3i4", "target": "<3i4", "ends": "<2i2", "descriptor": "u1"}
    offsets = [0, 8, 16, 28, 40, 44]
    if not 48 <= pulse_size <= CHUNK:
        raise DataError(f"{path}: pulses of {pulse_size} bytes, expected at least 48")
    if not HEADER_SIZE <= header_size <= offset <= size:
        raise DataError(
            f"{path}: header of {header_size} bytes and pulses at byte {offset}, "
            f"expected one after the other in the file's {size}"
        )
    if not 0 <= count * pulse_size <= size - offset:
        raise DataError(
            f"{path}: {count} pulses of {pulse_size} bytes at byte {offset}, expected at most {size - offset} bytes"
        )
    dtype = np.dtype(
        {"names": list(fields), "formats": list(fields.values()), "offsets": offsets, "itemsize": pulse_size}
    )
    return _Pulses(offset, count, dtype)


def _payloads(path: Path, file: IO[bytes], header: bytes, size: int) -> dict[int, bytes]:
    """Payloads of the pulse descriptors by index; an appended one replaces one before the pulses."""
    (header_size,) = struct.unpack_from("<H", header, 174)
    offset, count, _, _, pulse_size = struct.unpack_from("<qqIII", header, 176)
    records, appended = struct.unpack_from("<Ii", header, 216)
    found: dict[int, bytes] = {}

    def keep(user: bytes, record: int, at: int, length: int) -> None:
        if user.rstrip(b"\0") == b"PulseWaves_Spec" and 1 <= record - DESCRIPTORS <= 255:
            file.seek(at)
            found[record - DESCRIPTORS] = file.read(length)

    at = header_size
    for number in range(records):
        if at + RECORD_HEADER.size > offset:
            raise DataError(f"{path}: record {number} at byte {at}, expected {records} before the pulses at {offset}")
        user, record, _, length, _ = _unpack(file, RECORD_HEADER, at)
        at += RECORD_HEADER.size
        if not 0 <= length <= offset - at:
            raise DataError(f"{path}: record of {length} bytes at byte {at}, expected 0 to {offset - at}")
        keep(user, record, at, length)
        at += length
    start, end = offset + count * pulse_size, size
    while appended != 0 and end - start >= RECORD_HEADER.size:
        end -= RECORD_HEADER.size
        user, record, _, length, _ = _unpack(file, RECORD_HEADER, end)
        if not 0 <= length <= end - start:
            raise DataError(f"{path}: record of {length} bytes before byte {end}, expected 0 to {end - start}")
        if record == FIRST_APPENDED:
            break
        end -= length
        keep(user, record, end, length)
        appended -= 1
    return found


def _unpack(file: IO[bytes], layout: struct.Struct, at: int) -> tuple[Any, ...]:
    file.seek(at)
    return layout.unpack(file.read(layout.size))


def _descriptor(path: Path, number: int, payload: bytes | None) -> _Descriptor:
    where = f"{path}: pulse descriptor {number}"
    if payload is None:
        raise DataError(f"{where} is missing, expected a record {DESCRIPTORS + number} of PulseWaves_Spec")
    if len(payload) < COMPOSITION.size + DESCRIPTION:
        raise DataError(f"{where} has {len(payload)} bytes, expected at least {COMPOSITION.size + DESCRIPTION}")
    at, _, _, extra, count, units, _, compression = COMPOSITION.unpack_from(payload)
    if compression != 0 or not 0 < units < math.inf:
        raise DataError(f"{where} has compression {compression} and sample units {units} ns, expected 0 and above 0")
    samplings = []
    for sampling in range(count):
        if at < COMPOSITION.size or at + SAMPLING.size + DESCRIPTION > len(payload):
            raise DataError(f"{where} has sampling {sampling} at byte {at} of {len(payload)}, expected it within")
        fields = SAMPLING.unpack_from(payload, at)
        samplings.append(_sampling(f"{where} sampling {sampling}", fields))
        if fields[0] < SAMPLING.size:
            raise DataError(f"{where} sampling {sampling} has {fields[0]} bytes, expected at least {SAMPLING.size}")
        at += fields[0]
    return _Descriptor(extra, units, tuple(samplings))


def _sampling(where: str, fields: tuple[Any, ...]) -> _Sampling:
    kind, duration_bits, scale, offset, segment_bits, count_bits = fields[2], *fields[5:10]
    segments, samples, bits, _, units, compression = fields[10:16]
    for name, value, allowed in (
        ("type", kind, (1, RETURNING)),
        ("bits for duration", duration_bits, (0, 8, 16, 32)),
        ("bits for segments", segment_bits, (0, 8, 16)),
        ("bits for samples", count_bits, (0, 8, 16)),
        ("bits per sample", bits, SAMPLE_BITS),
        ("compression", compression, (0,)),
    ):
        if value not in allowed:
            raise DataError(f"{where} has {name} {value}, expected {' or '.join(map(str, allowed))}")
    if not (0 < units < math.inf and math.isfinite(scale) and math.isfinite(offset)):
        raise DataError(
            f"{where} has units {units} ns, scale {scale}, offset {offset}, expected numbers, units above 0"
        )
    return _Sampling(
        kind == RETURNING, duration_bits, scale, offset, segment_bits, count_bits, segments, samples, bits, units
    )


INDEX = np.dtype(
    [
        ("pulse", "i8"),
        ("start", "i8"),
        ("length", "i4"),
        ("bits", "u1"),
        ("duration", "f8"),
        ("ratio", "f4"),
        ("units", "f4"),
    ]
)
"""Of each waveform: pulse, byte of its first sample, samples and their bits, sampling units of the pulse from anchor to
first sample and from sample to sample, ns from sample to sample."""


def _index(
    path: Path, waves_path: Path, file: IO[bytes], waves: IO[bytes], pulses: _Pulses, payloads: dict[int, bytes]
) -> NDArray[np.void]:
    """Find the waveforms of all pulses, and check that each lies in the file."""
    descriptors: dict[int, _Descriptor] = {}
    parts = [np.zeros(0, INDEX)]
    size, total = waves_path.stat().st_size, 0
    chunk = max(1, CHUNK // pulses.dtype.itemsize)
    for first in range(0, pulses.count, chunk):
        records = _read_records(file, pulses, first, min(chunk, pulses.count - first))
        found: list[tuple[int, int, int, int, float, float, float]] = []
        for row, (number, at) in enumerate(zip(records["descriptor"].tolist(), records["waves"].tolist(), strict=True)):
            if number == 0:
                continue
            if number not in descriptors:
                descriptors[number] = _descriptor(path, number, payloads.get(number))
            if not HEADER <= at <= size:
                raise DataError(f"{path}: waves of pulse {first + row} at byte {at}, expected {HEADER} to {size}")
            for start, length, duration, sampling in _segments(
                waves_path, waves, size, at, descriptors[number], first + row
            ):
                total += length * sampling.bits // 8
                # Segments that overlap could make a small file stand for any number of waveforms.
                if total > size:
                    raise DataError(f"{waves_path}: segments add up to {total} bytes or more, expected at most {size}")
                if sampling.returning:
                    ratio = sampling.units / descriptors[number].units
                    found.append((first + row, start, length, sampling.bits, duration, ratio, sampling.units))
        parts.append(np.array(found, INDEX))
    return np.concatenate(parts)


def _segments(
    path: Path, waves: IO[bytes], size: int, at: int, descriptor: _Descriptor, pulse: int
) -> Iterator[tuple[int, int, float, _Sampling]]:
    """Byte of the first sample, samples, duration and sampling of each segment of a pulse's waves from byte `at`."""

    def number(bits: int, signed: bool) -> int:
        nonlocal at
        found = os.pread(waves.fileno(), bits // 8, at)
        if len(found) < bits // 8:
            raise DataError(f"{path}: waves of pulse {pulse} end past byte {size}, the last")
        at += bits // 8
        return int.from_bytes(found, "little", signed=signed)

    at += descriptor.extra
    for sampling in descriptor.samplings:
        segments = number(sampling.segment_bits, False) if sampling.segment_bits else sampling.segments
        for _ in range(segments):
            raw = number(sampling.duration_bits, True) if sampling.duration_bits else 0
            length = number(sampling.count_bits, False) if sampling.count_bits else sampling.samples
            end = at + length * sampling.bits // 8
            if not 1 <= length <= MAX_LENGTH:
                raise DataError(
                    f"{path}: {length} samples in a segment of pulse {pulse} at byte {at}, expected 1 to {MAX_LENGTH}"
                )
            if end > size:
                raise DataError(f"{path}: segment of pulse {pulse} ends at byte {end}, expected at most {size}")
            duration = sampling.scale * raw + sampling.offset if sampling.duration_bits else 0.0
            yield at, length, duration, sampling
            at = end


def _read_records(file: IO[bytes], pulses: _Pulses, first: int, count: int) -> NDArray[np.void]:
    file.seek(pulses.offset + first * pulses.dtype.itemsize)
    content = file.read(count * pulses.dtype.itemsize)
    return np.frombuffer(content, pulses.dtype, count)


def _records(file: IO[bytes], pulses: _Pulses, wanted: NDArray[np.int64]) -> NDArray[np.void]:
    """Records of pulses in ascending order, repeats included, with no more than a chunk of others read at once."""
    chunk = max(1, CHUNK // pulses.dtype.itemsize)
    parts, done = [], 0
    while done < len(wanted):
        first = int(wanted[done])
        until = int(np.searchsorted(wanted, first + chunk))
        records = _read_records(file, pulses, first, int(wanted[until - 1]) - first + 1)
        parts.append(records[wanted[done:until] - first])
        done = until
    return np.concatenate(parts)
