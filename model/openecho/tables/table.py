"""A table of echoes on its way into a file: made of blocks, never whole in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import date
from typing import Any

import numpy as np


class TableError(ValueError):
    """A table that can't be written as asked: one line with the file, what was found and what was expected."""


@dataclass(frozen=True)
class Table:
    """Echoes of a recording.

    Attributes
    ----------
    dtype : dtype
        Columns, of `COLUMNS`.
    rows : int
        How many echoes.
    blocks : callable
        Gives the echoes anew each time it is called: structured arrays of `dtype`, in order, each with all echoes of
        its waveforms.
    bin_ns : float or None
        Sample interval in nanoseconds.
    resolution : (float, float, float) or None
        Steps of x, y and z in the recording, for files that hold whole numbers of steps.
    wkt : str or None
        Coordinate system as OGC WKT, where the recording tells it.
    beams : tuple of str
        Names of the beams, in alphabetical order.
    time_unit : str or None
        Unit and origin of the times of the shots.
    date : date
        Of the recording: the same echoes give the same bytes on any day.
    """

    dtype: np.dtype[Any]
    rows: int
    blocks: Callable[[], Iterator[np.ndarray]]
    bin_ns: float | None
    resolution: tuple[float, float, float] | None
    wkt: str | None
    beams: tuple[str, ...]
    time_unit: str | None
    date: date

    def chunks(self, size: int) -> Iterator[np.ndarray]:
        """Yield the blocks joined to at least `size` rows each, but for the last; at least one chunk, maybe empty."""
        gathered: list[np.ndarray] = []
        count = 0
        for block in self.blocks():
            gathered.append(block)
            count += len(block)
            if count >= size:
                yield np.concatenate(gathered)
                gathered, count = [], 0
        if count or not self.rows:
            yield np.concatenate([np.zeros(0, self.dtype), *gathered])
