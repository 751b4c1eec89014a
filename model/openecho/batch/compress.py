"""Compression of a whole recording without loss, and back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho import __version__, formats
from openecho.batch.decompose import Advance
from openecho.batch.store import open_store, written
from openecho.formats import Block, DataError, Recording, compressed
from openecho.formats.recording import check_bits
from openecho.formats.writers import Content, write_npz

METRES = "x, y, z (metres)"
"""Coordinates that an ``.npz`` has."""


@dataclass(frozen=True)
class Compression:
    """What is to be compressed, into what, and how.

    Attributes
    ----------
    source, output : Path
    mode : int
        Of `openecho.codec.MODES`, its number.
    bits : int or None
        N, of a sample; None: as many as the greatest count has.
    verify : bool
        Whether to decode everything and compare it with the source before the result is put in its place.
    """

    source: Path
    output: Path
    mode: int
    bits: int | None = None
    verify: bool = False


@dataclass(frozen=True)
class CompressionResult:
    """What became of it.

    Attributes
    ----------
    waveforms, samples, bits : int
        Waveforms, their samples, and bits of a sample.
    size : int
        Bytes of the result.
    resumed : int
        Waveforms that an interrupted run had compressed before.
    """

    waveforms: int
    samples: int
    bits: int
    size: int
    resumed: int


def compress_file(job: Compression, advance: Advance = lambda doing, done, total: None) -> CompressionResult:
    """Compress a recording of any size, in memory for a chunk.

    The result is in place only when it is complete. Finished chunks are kept beside it until then, so that the same job
    goes on where it was interrupted, to the same bytes.

    Parameters
    ----------
    job : Compression
    advance : callable, optional
        Told of the progress.

    Returns
    -------
    CompressionResult

    Raises
    ------
    DataError, StoreError
        One line with what was found and what was expected: in the recording, in the blocks of an earlier run; or if
        what was written does not give the samples back.
    OSError
        If something can't be written: disk full, no permission.
    """
    with formats.open(job.source) as recording:
        samples, bits = _surveyed(recording, job.bits, advance)
        plan = compressed.plan(recording)
        with open_store(job.output, _description(job, recording, bits)) as store:
            finished = store.finished()
            resumed = done = sum(plan[number][1] for number in finished)
            advance("compressing", done, recording.waveforms)
            for number, (first, count) in enumerate(plan):
                if number in finished:
                    continue
                chunk = compressed.pack_chunk(recording.read(first, count), bits, job.mode)
                store.put(number, chunk=np.frombuffer(chunk, np.uint8))
                done += count
                advance("compressing", done, recording.waveforms)
            made = store.folder / f"waveforms{job.output.suffix}"
            chunks = ((first, store.get(number, "chunk").tobytes()) for number, (first, _) in enumerate(plan))
            with written(made), made.open("wb") as file:
                compressed.write(file, compressed.head(recording, bits), chunks)
            if job.verify:
                _verify(recording, made, advance)
            size = made.stat().st_size
            store.finish(made)
    return CompressionResult(recording.waveforms, samples, bits, size, resumed)


def decompress_file(
    source: Path, output: Path, advance: Advance = lambda doing, done, total: None
) -> tuple[int, list[str]]:
    """Write a recording, compressed or not, as ``.npz``, in memory for a block.

    Parameters
    ----------
    source, output : Path
    advance : callable, optional
        Told of the progress.

    Returns
    -------
    waveforms : int
    left_out : list of str
        What the recording has and an ``.npz`` has no place for.

    Raises
    ------
    DataError
        If the source is damaged: one line with the byte.
    OSError
        If something can't be written.
    """
    with formats.open(source) as recording:
        left = {
            f"positions in {recording.coordinates}": recording.coordinates not in (None, METRES),
            "beams": recording.parts[0][0] is not None,
            "shot numbers": recording.read(0, 1).shot is not None,
            "volts": recording.volts is not None,
        }
        partial = output.with_name(f"{output.name}.partial")
        try:
            with written(partial):
                write_npz(partial, _content(recording, advance))
                partial.replace(output)
        finally:
            partial.unlink(missing_ok=True)
        return recording.waveforms, [name for name, found in left.items() if found]


def _surveyed(recording: Recording, given: int | None, advance: Advance) -> tuple[int, int]:
    """Samples of a recording, and the bits that hold the greatest, which must not be more than are given."""
    samples, greatest = 0, 0
    for block in recording.blocks():
        check_bits(recording.path, block, given)
        samples += int(block.length.sum(dtype=np.int64))
        greatest = max(greatest, int(block.samples.max()))
        advance("reading", block.first + len(block.length), recording.waveforms)
    return samples, given or max(1, greatest.bit_length())


def _description(job: Compression, recording: Recording, bits: int) -> dict[str, Any]:
    """Everything that the chunks depend on."""
    status = recording.path.stat()
    return {
        "version": __version__,
        "source": str(recording.path.resolve()),
        "bytes": status.st_size,
        "modified": status.st_mtime_ns,
        "mode": job.mode,
        "bits": bits,
    }


def _verify(recording: Recording, made: Path, advance: Advance) -> None:
    """Compare all that was written with its source.

    Raises
    ------
    DataError
        If anything differs.
    """
    with formats.open(made) as again:
        for block in recording.blocks():
            found = again.read(block.first, len(block.length))
            if not all(np.array_equal(*pair) for pair in zip(_columns(block), _columns(found), strict=True)):
                end = block.first + len(block.length) - 1
                raise DataError(
                    f"{made}: waveforms {block.first} to {end} differ from {recording.path}, expected the same"
                )
            advance("verifying", block.first + len(block.length), recording.waveforms)


def _columns(block: Block) -> list[NDArray[Any]]:
    """All numbers of a block; floats as bits, for which no number is unequal to itself."""
    place = block.geolocation
    real = [block.time] if place is None else [block.time, place.first, place.last]
    whole = [np.zeros(0) if column is None else np.ascontiguousarray(column).view(np.uint64) for column in real]
    return [block.samples, block.length, np.zeros(0) if block.shot is None else block.shot, *whole]


def _content(recording: Recording, advance: Advance) -> Content:
    """A recording as columns of an ``.npz``."""
    n, m = recording.waveforms, recording.longest
    pieces: dict[str, Callable[[Block], NDArray[Any]]] = {
        "samples": lambda block: np.pad(block.samples, ((0, 0), (0, m - block.samples.shape[1]))),
        "length": lambda block: block.length,
    }
    shapes: dict[str, tuple[np.dtype[Any], tuple[int, ...]]] = {
        "samples": (np.dtype(np.uint16), (n, m)),
        "length": (np.dtype(np.int32), (n,)),
    }
    if recording.time_unit is not None:
        pieces["time"] = lambda block: _known(block.time)
        shapes["time"] = np.dtype(np.float64), (n,)
    if recording.coordinates == METRES:
        pieces["first"] = lambda block: _known(block.geolocation).first
        pieces["last"] = lambda block: _known(block.geolocation).last
        shapes |= dict.fromkeys(("first", "last"), (np.dtype(np.float64), (n, 3)))

    def column(name: str) -> Iterator[NDArray[Any]]:
        for block in recording.blocks():
            yield pieces[name](block)
            advance(f"writing {name}", block.first + len(block.length), n)

    return Content(shapes, column, recording.bin_ns)


def _known(value: Any) -> Any:
    """What a recording says of itself that it has."""
    assert value is not None
    return value
