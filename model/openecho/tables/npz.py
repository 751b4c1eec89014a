"""Tables of echoes as a NumPy archive, a member for each column."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from openecho.tables.table import Table

EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of every member: a zip file begins there, and the same content gives the same bytes on any day."""


def write(path: Path, table: Table) -> int:
    """Write a ``.npz`` with a one-dimensional array for each column, and `bin_ns` where it is known.

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
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in table.dtype.names or ():
            column = table.dtype[name]
            header = {"descr": npy.dtype_to_descr(column), "fortran_order": False, "shape": (table.rows,)}
            with archive.open(_member(name), "w", force_zip64=True) as member:
                npy.write_array_header_1_0(member, header)  # type: ignore[no-untyped-call, unused-ignore]
                for block in table.blocks():
                    member.write(np.ascontiguousarray(block[name]).tobytes())
        if table.bin_ns is not None:
            with archive.open(_member("bin_ns"), "w") as member:
                npy.write_array(member, np.array(table.bin_ns))
    return table.rows


def _member(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(f"{name}.npy", EPOCH)
    info.compress_type = zipfile.ZIP_DEFLATED
    return info
