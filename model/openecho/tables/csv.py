"""Tables of echoes as text: a line of names, then an echo a line, numbers in as many digits as they need."""

from __future__ import annotations

import csv
from pathlib import Path

from openecho.tables.table import Table


def write(path: Path, table: Table) -> int:
    """Write a ``.csv``, every number so that reading it gives the same bits.

    Parameters
    ----------
    path : Path
        File to write.
    table : Table

    Returns
    -------
    int
        Echoes in it.
    """
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.dtype.names or ())
        for block in table.blocks():
            writer.writerows(block.tolist())
    return table.rows
