"""Which format a file has, by what is in it and never by its name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from numpy.lib import format as npy

from openecho.formats.compressed import MAGIC as COMPRESSED_MAGIC
from openecho.formats.compressed import open_compressed
from openecho.formats.hdf5 import open_hdf5
from openecho.formats.las import open_las
from openecho.formats.numpy_files import open_npy, open_npz
from openecho.formats.pulsewaves import PULSES_MAGIC, WAVES_MAGIC, open_pulsewaves
from openecho.formats.recording import DataError, Recording, one_line

OPENERS: tuple[tuple[bytes, str, Callable[[Path], Recording]], ...] = (
    (b"\x89HDF\r\n\x1a\n", "HDF5 of LVIS or GEDI", open_hdf5),
    (b"LASF", "LAS with waveform packets", open_las),
    (PULSES_MAGIC, "PulseWaves", open_pulsewaves),
    (COMPRESSED_MAGIC, "readable .oec", open_compressed),
    (b"PK\x03\x04", "readable .npz of integers", open_npz),
    (b"PK\x05\x06", "readable .npz of integers", open_npz),
    (npy.MAGIC_PREFIX, "readable .npy of integers", open_npy),
)
"""First bytes of a file, what an error says was expected of it, and what opens it."""

READABLE = "LVIS or GEDI L1B (HDF5), LAS with waveform packets, PulseWaves (.pls), .oec, .npz or .npy"


def open(path: str | Path) -> Recording:
    """Open recorded waveforms; what is held in memory is where they are, until blocks of them are asked for.

    Parameters
    ----------
    path : str or Path
        LVIS or GEDI L1B in HDF5, LAS with waveform packets (a ``.wdp`` is found beside it), PulseWaves
        (the ``.pls``; its ``.wvs`` is found beside it), ``.oec``, ``.npz`` or ``.npy``. The content decides, not the
        name.

    Returns
    -------
    Recording
        A context manager, which closes the file.

    Raises
    ------
    DataError
        If there is no such file or it can't be used.

    Examples
    --------
    >>> with formats.open("GEDI01_B.h5") as recording:  # doctest: +SKIP
    ...     for block in recording.blocks(4096):
    ...         print(block.first, block.samples.shape)
    """
    path = Path(path)
    with one_line(path, READABLE):
        if not path.exists():
            raise DataError(f"{path}: no such file, expected {READABLE}")
        if not path.is_file():
            raise DataError(f"{path}: not a file, expected {READABLE}")
        with path.open("rb") as file:
            start = file.read(16)
    if not start:
        raise DataError(f"{path}: empty file, expected {READABLE}")
    if start == WAVES_MAGIC:
        raise DataError(f"{path}: the waves of a PulseWaves file, expected its .pls")
    for magic, expected, opener in OPENERS:
        if start.startswith(magic):
            with one_line(path, expected):
                return opener(path)
    raise DataError(f"{path}: starts with {start!r}, expected {READABLE}")
