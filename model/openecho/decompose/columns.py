"""Columns of a table of echoes: what each is called, holds and means, stated once for every file format."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Column:
    """A column of a table of echoes.

    Attributes
    ----------
    name : str
        As it is called in every file.
    dtype : str
        NumPy's name of the type.
    unit : str
        Empty where there is none, or where only the recording tells it.
    meaning : str
        A few words, at most 32 characters, for LAS has no room for more.
    needs : str
        What a recording must tell for it: ``bin_ns``, ``geolocation``, ``time``, ``shot``, ``beam``; or whether it is
        a matter of the ``core`` or of a ``fit``; empty: nothing.
    """

    name: str
    dtype: str
    unit: str
    meaning: str
    needs: str = ""


COLUMNS = (
    Column("waveform", "i8", "", "waveform of the file, from 0"),
    Column("number", "i4", "", "echo of the waveform, from 0"),
    Column("centre", "f8", "bins", "midpoint of the inflections"),
    Column("peak", "f8", "bins", "maximum of the echo"),
    Column("time", "f8", "bins", "echo time, centre - FWHM / 4"),
    Column("width", "f8", "bins", "sigma; core: of filtered echo"),
    Column("fwhm", "f8", "bins", "full width at half maximum"),
    Column("corrected_width", "f8", "bins", "filter taken out; 0: narrower", "core"),
    Column("amplitude", "f8", "counts", "height over the noise mean"),
    Column("centre_error", "f8", "bins", "standard error", "fit"),
    Column("width_error", "f8", "bins", "standard error", "fit"),
    Column("amplitude_error", "f8", "counts", "standard error", "fit"),
    Column("flags", "u1", "", "1 saturated 2 truncated 4 nopeak"),
    Column("centre_ns", "f8", "ns", "centre since the first bin", "bin_ns"),
    Column("peak_ns", "f8", "ns", "peak since the first bin", "bin_ns"),
    Column("time_ns", "f8", "ns", "echo time since the first bin", "bin_ns"),
    Column("x", "f8", "", "of the peak; or longitude", "geolocation"),
    Column("y", "f8", "", "of the peak; or latitude", "geolocation"),
    Column("z", "f8", "", "of the peak; or elevation", "geolocation"),
    Column("shot_time", "f8", "", "time of the shot", "time"),
    Column("shot", "u8", "", "the instrument's own number", "shot"),
    Column("beam", "U8", "", "name of the beam", "beam"),
)
"""All columns, in the order in which files have them. Bins count from 0, the first recorded sample."""


def columns(known: Collection[str]) -> tuple[Column, ...]:
    """Columns of a recording that tells what is `known`, of the words in `Column.needs`."""
    return tuple(column for column in COLUMNS if not column.needs or column.needs in known)


def dtype(known: Collection[str]) -> np.dtype[Any]:
    """Structured type of a table of echoes with `columns(known)`."""
    return np.dtype([(column.name, column.dtype) for column in columns(known)])
