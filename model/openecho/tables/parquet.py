"""Tables of echoes as Parquet, with unit and meaning of each column in its metadata."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from openecho.decompose.columns import COLUMNS
from openecho.tables.table import Table, TableError

ROW_GROUP = 2**17
"""Echoes in a row group: a few megabytes, what readers skip or load at a time."""


def require(path: Path) -> Any:
    """Return pyarrow's Parquet module.

    Raises
    ------
    TableError
        If it is not installed.
    """
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise TableError(f"{path}: pyarrow is not installed, expected it: pip install 'openecho[parquet]'") from error
    return parquet


def write(path: Path, table: Table) -> int:
    """Write a ``.parquet``, compressed with zstd.

    Parameters
    ----------
    path : Path
        File to write.
    table : Table

    Returns
    -------
    int
        Echoes in it.

    Raises
    ------
    TableError
        If pyarrow is not installed.
    """
    parquet = require(path)
    import pyarrow as pa

    described = {column.name: {"unit": column.unit, "meaning": column.meaning} for column in COLUMNS}
    names = table.dtype.names or ()
    kinds = {
        name: pa.string() if table.dtype[name].kind == "U" else pa.from_numpy_dtype(table.dtype[name]) for name in names
    }
    metadata = {} if table.bin_ns is None else {"bin_ns": str(table.bin_ns)}
    schema = pa.schema([pa.field(name, kinds[name], False, described[name]) for name in names], metadata)
    with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for chunk in table.chunks(ROW_GROUP):
            writer.write_table(
                pa.Table.from_arrays([pa.array(chunk[name], kinds[name]) for name in names], schema=schema)
            )
    return table.rows
