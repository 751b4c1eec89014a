"""What every reader of recorded waveforms gives: a `Recording` that hands out blocks, and the checks they share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

MAX_LENGTH = 65536
"""Samples in a waveform that are believed: sixteen times the core's default, beyond any digitiser's record."""

BLOCK = 2**20
"""Samples in a block if nobody asks for another size: two megabytes, and a hundred while the golden model works."""

LARGEST_COUNT = 2**16 - 1
"""Samples are handed out as uint16; no supported digitiser has more bits."""

LARGEST_EXPANSION = 1100
"""Bytes from one compressed byte: deflate can't exceed 1032, so a size that claims more is not to be allocated."""


class DataError(ValueError):
    """A data file that can't be used: one line with the file, what was found and what was expected."""


@dataclass(frozen=True)
class Geolocation:
    """Where the beam was at the first and the last recorded bin, in the units of `Recording.coordinates`.

    Attributes
    ----------
    first, last : float64 (n, 3)
        x, y, z; or longitude, latitude, elevation. Bins between are on the straight line.
    """

    first: NDArray[np.float64]
    last: NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """Consecutive waveforms of a recording.

    Attributes
    ----------
    first : int
        Index of row 0 in the recording.
    samples : uint16 (n, m)
        Counts; zero past `length`. m is the longest of these n.
    length : int32 (n,)
        Samples in each row, 1 to m.
    time : float64 (n,) or None
        In the units of `Recording.time_unit`.
    geolocation : Geolocation or None
        First and last bin of each row.
    shot : uint64 (n,) or None
        The instrument's own number of the shot.
    beam : str or None
        Name of the beam, where an instrument has several; a block never spans two.
    """

    first: int
    samples: NDArray[np.uint16]
    length: NDArray[np.int32]
    time: NDArray[np.float64] | None = None
    geolocation: Geolocation | None = None
    shot: NDArray[np.uint64] | None = None
    beam: str | None = None


@dataclass(frozen=True)
class Recording:
    """An open file of waveforms; a context manager, which closes it.

    Attributes
    ----------
    path : Path
        The file.
    format : str
        Instrument or file format, as ``GEDI L1B``.
    waveforms : int
        How many there are, at least 1.
    longest : int
        Samples of the longest, 1 to `MAX_LENGTH`.
    bin_ns : float or None
        Sample interval in nanoseconds, None where the file doesn't tell it.
    coordinates : str or None
        Names and units of the three coordinates, None where the file has none.
    time_unit : str or None
        Unit and origin of the times, None where the file has none.
    volts : (float, float) or None
        Gain and offset: volts are offset + gain * counts. None where the file doesn't tell them.
    parts : tuple of (str or None, int)
        Beams in the order of their waveforms, with how many each has; one nameless part where there are no beams.
    reader : callable
        (first, count) to Block, within one part; `read` checks and guards it.
    closer : callable
        Releases the file.
    resolution : (float, float, float) or None
        Steps in which the coordinates are known, None where the file has none.
    wkt : str or None
        Coordinate system as OGC WKT, None where the file doesn't tell it in this form.
    """

    path: Path
    format: str
    waveforms: int
    longest: int
    bin_ns: float | None
    coordinates: str | None
    time_unit: str | None
    volts: tuple[float, float] | None
    parts: tuple[tuple[str | None, int], ...]
    reader: Callable[[int, int], Block]
    closer: Callable[[], None]
    resolution: tuple[float, float, float] | None = None
    wkt: str | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.closer()

    def read(self, first: int, count: int) -> Block:
        """Read waveforms, fewer than `count` where the recording or the beam ends.

        Parameters
        ----------
        first : int
            Index of the first, 0 to `waveforms` - 1.
        count : int
            How many, at least 1.

        Returns
        -------
        Block
            Memory in proportion to `count`, whatever the file's size.

        Raises
        ------
        DataError
            If the file can't be read there, or holds what is not a count of a digitiser.
        IndexError
            If the caller asks for what is not in the recording.
        """
        if not (0 <= first < self.waveforms and count >= 1):
            raise IndexError(f"waveforms {first} and {count} on, expected 0 to {self.waveforms - 1} and at least 1")
        end = 0
        for _, size in self.parts:
            end += size
            if first < end:
                break
        # A damaged scale makes a position infinite, which is no reason to warn on the terminal.
        with one_line(self.path, f"readable {self.format}"), np.errstate(over="ignore", invalid="ignore"):
            return self.reader(first, min(count, end - first))

    def plan(self, size: int | None = None) -> list[tuple[int, int]]:
        """First waveform of each block and their number: at most `size`, or about `BLOCK` samples, and of one beam."""
        size = max(1, BLOCK // self.longest) if size is None else size
        plan, start = [], 0
        for _, count in self.parts:
            end = start + count
            plan += [(first, min(size, end - first)) for first in range(start, end, size)]
            start = end
        return plan

    def blocks(self, size: int | None = None) -> Iterator[Block]:
        """Yield all waveforms in the blocks of `plan`, each read when it is asked for."""
        for first, count in self.plan(size):
            yield self.read(first, count)


@contextmanager
def one_line(path: Path, expected: str) -> Iterator[None]:
    """Turn whatever a parser says of a file into one line.

    Raises
    ------
    DataError
        For every exception but those that are not about the file. Parsers of damaged files raise nearly everything:
        h5py alone OSError, KeyError, RuntimeError, ValueError, TypeError and OverflowError.
    """
    try:
        yield
    except DataError:
        raise
    except Exception as error:
        reason = printable((str(error).splitlines() or [""])[0]) or type(error).__name__
        raise DataError(f"{path}: {reason}, expected {expected}") from error


def printable(text: str) -> str:
    """What a file says of itself, for an error: without control characters and not longer than a line or two."""
    return text[:200].encode("unicode_escape").decode()


def to_counts(path: Path, name: str, values: NDArray[Any], first: int, length: NDArray[np.int32]) -> NDArray[np.uint16]:
    """Check samples and give them as counts, zero past each row's length.

    Parameters
    ----------
    path, name : Path, str
        What an error names.
    values : integer or float (n, m)
        Floats are rounded to the nearest count, ties to even: GEDI's corrected waveforms have fractions, and half a
        count is far below their noise of 1.7 counts.
    first : int
        Index of row 0, for the error.
    length : int32 (n,)
        Samples that were recorded.

    Returns
    -------
    uint16 (n, m)

    Raises
    ------
    DataError
        For a sample that is not a number or not within 0 to `LARGEST_COUNT`.
    """
    recorded = np.arange(values.shape[1]) < length[:, None]
    counts = np.where(recorded, np.rint(values) if values.dtype.kind == "f" else values, 0)
    check_range(path, name, counts, 0, LARGEST_COUNT, first)
    return counts.astype(np.uint16)


def check_range(path: Path, name: str, values: NDArray[Any], low: int, high: int, first: int = 0) -> None:
    """Raise a DataError for the first entry outside low to high or not a number, in the order of rows."""
    outside = np.argwhere(~((values >= low) & (values <= high)))
    if len(outside):
        at = tuple(int(i) for i in outside[0])
        where = f"waveform {first + at[0]}" + (f" sample {at[1]}" if len(at) > 1 else "")
        raise DataError(f"{path}: {name} of {where} is {values[at]}, expected {low} to {high}")


def check_bits(path: Path, block: Block, sample_w: int | None) -> None:
    """Raise a DataError for the first sample of a block that has more than `sample_w` bits; None: any are fine."""
    if sample_w is not None and block.samples.max() >> sample_w:
        check_range(path, "samples", block.samples, 0, 2**sample_w - 1, block.first)


def check_waveforms(path: Path, count: int, longest: int) -> None:
    """Raise a DataError for a recording without waveforms, or with longer ones than are believed."""
    if count < 1 or longest < 1:
        raise DataError(f"{path}: {count} waveforms of {longest} samples, expected at least one waveform of one sample")
    if longest > MAX_LENGTH:
        raise DataError(f"{path}: waveforms of {longest} samples, expected 1 to {MAX_LENGTH}")
