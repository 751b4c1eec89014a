"""A whole file of waveforms at once, for the simulators: every doubt about it settled before anything is run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from openecho.formats.detect import open
from openecho.formats.recording import check_bits, one_line


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
    """Read all waveforms and check that a core with `sample_w`-bit samples can take them.

    Parameters
    ----------
    path : str or Path
        Anything that `openecho.formats.open` takes.
    sample_w : int
        Width of the core's samples in bits, at most 16.

    Returns
    -------
    Waveforms
        Checked and zeroed past `length`; m is the longest.

    Raises
    ------
    DataError
        If the file can't be read, or doesn't hold what is described above.
    """
    with open(path) as recording:
        with one_line(recording.path, "a file that fits in memory"):
            samples = np.zeros((recording.waveforms, recording.longest), np.uint16)
            length = np.zeros(recording.waveforms, np.int32)
        for block in recording.blocks():
            check_bits(recording.path, block, sample_w)
            rows = slice(block.first, block.first + len(block.length))
            samples[rows, : block.samples.shape[1]] = block.samples
            length[rows] = block.length
        return Waveforms(samples, length, recording.bin_ns)
