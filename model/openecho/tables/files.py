"""Which file formats a table of echoes can have, by the suffix of the file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from openecho.tables import csv, las, npz, parquet
from openecho.tables.table import Table, TableError

WRITERS: Mapping[str, Callable[[Path, Table], int]] = {
    ".csv": csv.write,
    ".parquet": parquet.write,
    ".npz": npz.write,
    ".las": las.write,
    ".laz": las.write,
}
"""What writes which suffix, and returns how many echoes it wrote."""


def check(path: Path, known: Collection[str]) -> None:
    """Refuse what can't be written, before any work is done.

    Parameters
    ----------
    path : Path
        Where the table is to be.
    known : collection of str
        What the recording tells, of the words in `Column.needs`.

    Raises
    ------
    TableError
        For an unknown suffix, a missing folder or library, or points without positions.
    """
    suffix = path.suffix.casefold()
    if suffix not in WRITERS:
        raise TableError(f"{path}: found suffix {path.suffix!r}, expected one of {', '.join(WRITERS)}")
    if not path.parent.is_dir():
        raise TableError(f"{path}: no folder {path.parent}, expected one")
    if path.is_dir():
        raise TableError(f"{path}: is a folder, expected a file or nothing")
    if WRITERS[suffix] is las.write and "geolocation" not in known:
        raise TableError(f"{path}: the recording tells no positions, expected them for {suffix} (or -o echoes.csv)")
    if WRITERS[suffix] is parquet.write:
        parquet.require(path)


def write(path: Path, table: Table) -> int:
    """Write a table in the format that its suffix names.

    Parameters
    ----------
    path : Path
        File to write; whoever calls sees to it that an incomplete one is never taken for the result.
    table : Table

    Returns
    -------
    int
        Echoes in the file: all of them, or those with a position where the format holds nothing else.

    Raises
    ------
    TableError, OSError
        If the table can't be written.
    """
    return WRITERS[path.suffix.casefold()](path, table)
