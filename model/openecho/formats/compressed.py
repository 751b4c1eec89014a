r"""Compressed recordings, ``.oec``: chunks of records of the lossless codec, with an index for random access.

All numbers are big-endian and unsigned; a CRC is that of zlib, over all bytes of its part before it.

======= =============== ==============================================================================================
part    bytes           content
======= =============== ==============================================================================================
start   8               ``\x89OEC\r\n\x1a`` and the version of this format, 1
head    4               size of what follows
head    ...             what `Recording` tells of the whole, and `bits` of a sample: JSON in UTF-8
head    4               CRC
chunk   4               waveforms
chunk   1               columns beside the samples: 1 time, 2 first and last position, 4 shot number
chunk   8               words 0 and 1 of a record (`openecho.codec`), the same for all waveforms of the chunk
chunk   4, ...          size of the lengths, and they, as a column of 32-bit integers
chunk   4, ...          size of the payload, and it: codes of each waveform, with zeros to the end of a byte
chunk   4, ... each     size of a column, and it
chunk   4               CRC
index   16 a chunk      byte at which it starts, and its first waveform, 8 each
index   4               CRC
end     8, 8            byte at which the index starts, chunks
end     8               ``OECINDEX``
======= =============== ==============================================================================================

A column is compressed by zlib: differences from row to row, of the bits of floats as integers, the bytes of equal
weight together. A chunk is of one beam, and has one waveform or at most 2^18 samples, as if all were of the longest.
What a file has beside its `Recording`, as references or the transmitted pulse, is not kept.
"""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from openecho.formats.recording import (
    LARGEST_COUNT,
    MAX_LENGTH,
    Block,
    DataError,
    Geolocation,
    Recording,
    one_line,
    printable,
)

MAGIC = b"\x89OEC\r\n\x1a"
VERSION = 1
END = b"OECINDEX"
CHUNK = 2**18
"""Samples of a chunk, if it has more than one waveform: what is decoded to reach one of them, a millisecond or two."""
LARGEST_HEAD = 2**24
FORM_BYTES = 8
TIME, PLACE, SHOT = 1, 2, 4
TELLS = ("format", "waveforms", "longest", "bin_ns", "coordinates", "time_unit", "volts", "parts", "resolution", "wkt")
"""Fields of `Recording` that are kept."""


def _whole(value: Any, least: int, most: int) -> bool:
    return type(value) is int and least <= value <= most


def _numbers(value: Any, count: int) -> bool:
    return isinstance(value, list) and len(value) == count and all(type(one) in (int, float) for one in value)


def _line(value: Any) -> bool:
    return isinstance(value, str) and value.isprintable()


def _beams(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(beam, list) and len(beam) == 2 and isinstance(beam[0], str | None) and _whole(beam[1], 1, 2**63 - 1)
        for beam in value
    )


NEEDED: dict[str, tuple[Callable[[Any], bool], str]] = {
    "bits": (lambda value: _whole(value, 1, LARGEST_COUNT.bit_length()), f"1 to {LARGEST_COUNT.bit_length()}"),
    "format": (_line, "a line of text"),
    "waveforms": (lambda value: _whole(value, 1, 2**63 - 1), "1 or more"),
    "longest": (lambda value: _whole(value, 1, MAX_LENGTH), f"1 to {MAX_LENGTH}"),
    "parts": (_beams, "a name or null and 1 or more waveforms, each"),
}
KNOWN: dict[str, tuple[Callable[[Any], bool], str]] = {
    "bin_ns": (lambda value: _numbers([value], 1) and 0 < value < float("inf"), "a number above 0"),
    "coordinates": (_line, "a line of text"),
    "time_unit": (_line, "a line of text"),
    "volts": (lambda value: _numbers(value, 2), "two numbers"),
    "resolution": (lambda value: _numbers(value, 3), "three numbers"),
    "wkt": (lambda value: isinstance(value, str), "text"),
}
"""What a head always has, and what it may have or not: whether a value can be, and what an error says of it."""


def head(recording: Recording, bits: int) -> bytes:
    """Start and head of a file."""
    told = {name: getattr(recording, name) for name in TELLS}
    told["format"] = recording.format.removesuffix(", compressed")
    text = json.dumps({"bits": bits} | {name: value for name, value in told.items() if value is not None}).encode()
    return MAGIC + bytes([VERSION]) + _sealed(len(text).to_bytes(4) + text)


def plan(recording: Recording) -> list[tuple[int, int]]:
    """First waveform of each chunk and their number."""
    return recording.plan(max(1, CHUNK // recording.longest))


def pack_chunk(block: Block, bits: int, mode: int) -> bytes:
    """A block as a chunk.

    Parameters
    ----------
    block : Block
        Of at most `CHUNK` samples, or of one waveform.
    bits, mode : int
        As of `openecho.codec.Form`; thresholds and baselines are those that suit the block.

    Raises
    ------
    CodecError
        If a sample has more bits.
    """
    from openecho import codec  # which needs a compiler

    form = codec.choose(block.samples, block.length, bits, mode)
    payload, _ = codec.pack(block.samples, block.length, form)
    columns = [(TIME, block.time), (SHOT, block.shot)]
    if block.geolocation is not None:
        columns[1:1] = [(PLACE, block.geolocation.first), (PLACE, block.geolocation.last)]
    kept = [(flag, column) for flag, column in columns if column is not None]
    flags = sum({flag for flag, _ in kept})
    parts = [_packed(block.length), payload, *(_packed(column) for _, column in kept)]
    return _sealed(
        struct.pack(">IB", len(block.length), flags)
        + form.header()
        + b"".join(len(part).to_bytes(4) + part for part in parts)
    )


def write(file: IO[bytes], start: bytes, chunks: Iterable[tuple[int, bytes]]) -> None:
    """Write a whole file: start and head, then each chunk with its first waveform, in order."""
    entries = []
    file.write(start)
    for first, chunk in chunks:
        entries.append((file.tell(), first))
        file.write(chunk)
    at = file.tell()
    file.write(_sealed(b"".join(struct.pack(">QQ", *entry) for entry in entries)))
    file.write(struct.pack(">QQ", at, len(entries)) + END)


def open_compressed(path: Path) -> Recording:
    """Open a ``.oec``; head and index are read, chunks when they are asked for.

    Raises
    ------
    DataError
        If it is damaged, with the byte where that was found, or of another version.
    """
    file = path.open("rb")
    try:
        return _recording(path, file)
    except BaseException:
        file.close()
        raise


@dataclass(frozen=True)
class _Chunks:
    """An open file, what its head says of every chunk, and their bytes and first waveforms, each with the last's end.

    `columns` are those that every chunk has; a beam may have more.
    """

    path: Path
    file: IO[bytes]
    bits: int
    longest: int
    columns: int
    starts: NDArray[np.int64]
    firsts: NDArray[np.int64]

    def read(self, number: int) -> Block:
        """One chunk as a block."""
        start, end = (int(byte) for byte in self.starts[number : number + 2])
        self.file.seek(start)
        first, end_row = (int(row) for row in self.firsts[number : number + 2])
        return _unpack_chunk(self, start, self.file.read(end - start), first, end_row - first)


def _recording(path: Path, file: IO[bytes]) -> Recording:
    size = file.seek(0, io.SEEK_END)
    file.seek(0)
    start = file.read(len(MAGIC) + 5)
    if len(start) < len(MAGIC) + 5:
        raise _damaged(path, size, "the file ends", "a head")
    if start[len(MAGIC)] != VERSION:
        raise _damaged(path, len(MAGIC), f"version {start[len(MAGIC)]}", str(VERSION))
    length = int.from_bytes(start[-4:])
    at = len(MAGIC) + 1
    if length > min(size, LARGEST_HEAD):
        raise _damaged(path, at, f"a head of {length} bytes", f"at most {min(size, LARGEST_HEAD)}")
    text = _unsealed(path, at, start[-4:] + file.read(length + 4))[4:]
    bits, told = _told(path, at + 4, text)
    starts, firsts = _index(path, file, size, file.tell(), told["waveforms"])
    columns = TIME * (told["time_unit"] is not None) | PLACE * (told["coordinates"] is not None)
    chunks = _Chunks(path, file, bits, told["longest"], columns, starts, firsts)
    told["format"] = f"{told['format']}, compressed"
    return Recording(path=path, reader=partial(_read, chunks, told["parts"]), closer=file.close, **told)


def _told(path: Path, at: int, text: bytes) -> tuple[int, dict[str, Any]]:
    """Bits of a sample, and fields of a `Recording`, each of a type and in a range that it can have."""
    with one_line(path, f"a head in JSON at byte {at}"):
        found = json.loads(text)
    if not isinstance(found, dict):
        raise _damaged(path, at, "a head that has no keys", "one with keys")
    for name, (sound, expected) in {**NEEDED, **KNOWN}.items():
        value = found.get(name)
        if not sound(value) and (value is not None or name in NEEDED):
            raise _damaged(path, at, f"{name} {printable(repr(value))}", expected)
    told: dict[str, Any] = {name: found.get(name) for name in TELLS}
    told |= {name: None if told[name] is None else tuple(told[name]) for name in ("volts", "resolution")}
    told["parts"] = tuple((name, count) for name, count in found["parts"])
    total = sum(count for _, count in told["parts"])
    if total != told["waveforms"]:
        raise _damaged(path, at, f"beams of {total} waveforms", f"{told['waveforms']} in all")
    return found["bits"], told


def _index(
    path: Path, file: IO[bytes], size: int, start: int, waveforms: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where chunks start and with which waveform, each with its end."""
    end = size - len(END) - 16
    if end < start:
        raise _damaged(path, size, "the file ends", "an index")
    file.seek(end)
    at, count, mark = struct.unpack(">QQ8s", file.read())
    if mark != END:
        raise _damaged(path, end + 16, printable(repr(mark)), f"{END!r}: the file was cut")
    if not start < at < end or 16 * count + 4 != end - at or count > waveforms:
        raise _damaged(path, end, f"an index of {count} chunks at byte {at}", f"one from there to byte {end}")
    file.seek(at)
    entries = np.frombuffer(_unsealed(path, at, file.read(end - at)), ">u8").reshape(-1, 2).astype(np.int64)
    starts, firsts = np.append(entries[:, 0], at), np.append(entries[:, 1], waveforms)
    if starts[0] != start or firsts[0] != 0 or (np.diff(starts) <= 0).any() or (np.diff(firsts) <= 0).any():
        raise _damaged(path, at, "chunks out of order", "each behind the one before")
    # So that what is made room for by their number is bounded by the file.
    if (np.diff(firsts) > np.diff(starts)).any():
        raise _damaged(path, at, f"{waveforms} waveforms in {at - start} bytes", "a byte for each, in every chunk")
    return starts, firsts


def _read(chunks: _Chunks, parts: tuple[tuple[str | None, int], ...], first: int, count: int) -> Block:
    """Waveforms of one beam, out of the chunks that have them."""
    ends = np.cumsum([size for _, size in parts])
    beam = parts[int(np.searchsorted(ends, first, "right"))][0]
    number = int(np.searchsorted(chunks.firsts, first, "right")) - 1
    blocks = []
    while number < len(chunks.starts) - 1 and chunks.firsts[number] < first + count:
        blocks.append(_cut(chunks.read(number), first, first + count))
        number += 1
    return replace(_joined(first, blocks), beam=beam)


def _cut(block: Block, first: int, end: int) -> Block:
    """Rows of a block, of waveforms from first to end."""
    rows = slice(max(first - block.first, 0), end - block.first)
    length = block.length[rows]
    place = block.geolocation
    return Block(
        max(first, block.first),
        block.samples[rows, : length.max()],
        length,
        None if block.time is None else block.time[rows],
        None if place is None else Geolocation(place.first[rows], place.last[rows]),
        None if block.shot is None else block.shot[rows],
    )


def _joined(first: int, blocks: Sequence[Block]) -> Block:
    """Blocks end to end."""
    if len(blocks) == 1:
        return blocks[0]
    samples = np.zeros(
        (sum(len(block.length) for block in blocks), max(block.samples.shape[1] for block in blocks)), np.uint16
    )
    row = 0
    for block in blocks:
        samples[row : row + len(block.length), : block.samples.shape[1]] = block.samples
        row += len(block.length)
    places = [block.geolocation for block in blocks]
    return Block(
        first,
        samples,
        np.concatenate([block.length for block in blocks]),
        _together([block.time for block in blocks]),
        None
        if None in places
        else Geolocation(*(_together([getattr(p, e) for p in places]) for e in ("first", "last"))),
        _together([block.shot for block in blocks]),
    )


def _together(columns: Sequence[NDArray[Any] | None]) -> Any:
    return None if any(column is None for column in columns) else np.concatenate(columns)  # type: ignore[arg-type]


def _unpack_chunk(chunks: _Chunks, at: int, data: bytes, first: int, count: int) -> Block:
    from openecho import codec  # which needs a compiler

    path = chunks.path
    body = _unsealed(path, at, data)
    fixed = 5 + FORM_BYTES
    if len(body) < fixed:
        raise _damaged(path, at, f"a chunk of {len(data)} bytes", f"at least {fixed}")
    found, flags = struct.unpack(">IB", body[:5])
    if found != count or flags & ~(TIME | PLACE | SHOT):
        raise _damaged(path, at, f"{found} waveforms, columns {flags}", f"{count}, as the index says, and 0 to 7")
    if chunks.columns & ~flags:
        raise _damaged(path, at, f"columns {flags}", f"also {chunks.columns & ~flags}, as the head says")
    try:
        form = codec.Form.parse(body[5:fixed])
        parts = _parts(path, at, body, fixed, 2 + bin(flags & (TIME | SHOT)).count("1") + 2 * bool(flags & PLACE))
        length = _unpacked(path, at, parts[0], np.dtype(np.int32), (count,))
        _check_lengths(chunks, at, length, len(parts[1]), form.bits)
        samples = codec.unpack(parts[1], length, form)
    except codec.CodecError as error:
        raise DataError(f"{path}: chunk at byte {at}: {error}") from error
    rest = iter(parts[2:])
    real, whole = np.dtype(np.float64), np.dtype(np.uint64)
    time = _unpacked(path, at, next(rest), real, (count,)) if flags & TIME else None
    place = None
    if flags & PLACE:
        place = Geolocation(*(_unpacked(path, at, next(rest), real, (count, 3)) for _ in range(2)))
    shot = _unpacked(path, at, next(rest), whole, (count,)) if flags & SHOT else None
    return Block(first, samples, length, time, place, shot)


def _parts(path: Path, at: int, body: bytes, start: int, count: int) -> list[bytes]:
    """Parts of a chunk, each behind its size, which fill it."""
    parts = []
    for _ in range(count):
        size = int.from_bytes(body[start : start + 4])
        parts.append(body[start + 4 : start + 4 + size])
        start += 4 + size
    if start != len(body):
        raise _damaged(path, at, f"parts of {start} bytes", f"{len(body)}, as the chunk has")
    return parts


def _check_lengths(chunks: _Chunks, at: int, length: NDArray[np.int32], payload: int, bits: int) -> None:
    """Refuse lengths that the payload can't have, for a sample takes a bit, before room is made for their samples."""
    path, longest = chunks.path, int(length.max())
    if bits != chunks.bits:
        raise _damaged(path, at, f"samples of {bits} bits", f"{chunks.bits}, as in the head")
    if not 1 <= length.min() <= longest <= chunks.longest or int(length.sum(dtype=np.int64)) > 8 * payload:
        raise _damaged(
            path, at, f"lengths of {length.min()} to {longest}", f"1 to {chunks.longest}, as the payload has bits"
        )
    if len(length) > 1 and longest * len(length) > CHUNK:
        raise _damaged(path, at, f"{len(length)} waveforms of up to {longest} samples", f"at most {CHUNK} samples")


def _packed(column: NDArray[Any]) -> bytes:
    """A column of numbers of 4 or 8 bytes."""
    whole = np.ascontiguousarray(column).view(f"u{column.itemsize}").reshape(len(column), -1)
    steps = np.diff(whole, axis=0, prepend=np.zeros((1, whole.shape[1]), whole.dtype))
    planes = steps.astype(steps.dtype.newbyteorder(">")).view(np.uint8).reshape(len(column), -1).T
    return zlib.compress(planes.tobytes(), 6)


def _unpacked(path: Path, at: int, data: bytes, dtype: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    count = int(np.prod(shape))
    expected = dtype.itemsize * count
    with one_line(path, f"a column in the chunk at byte {at}"):
        stream = zlib.decompressobj()
        planes = stream.decompress(data, expected + 1)
    if len(planes) != expected or not stream.eof or stream.unused_data:
        raise _damaged(path, at, f"a column of {len(planes)} bytes or more", str(expected))
    whole = np.frombuffer(planes, np.uint8).reshape(-1, shape[0]).T
    steps = np.ascontiguousarray(whole).view(f">u{dtype.itemsize}").astype(f"u{dtype.itemsize}")
    return np.cumsum(steps, axis=0, dtype=steps.dtype).view(dtype).reshape(shape)


def _sealed(data: bytes) -> bytes:
    return data + zlib.crc32(data).to_bytes(4)


def _unsealed(path: Path, at: int, data: bytes) -> bytes:
    """What stands before a CRC, if that is right."""
    found, expected = int.from_bytes(data[-4:]), zlib.crc32(data[:-4])
    if len(data) < 4 or found != expected:
        raise _damaged(path, at, f"CRC {found:#010x}", f"{expected:#010x} of the {max(len(data) - 4, 0)} bytes before")
    return data[:-4]


def _damaged(path: Path, at: int, found: str, expected: str) -> DataError:
    return DataError(f"{path}: byte {at}: {found}, expected {expected}")
