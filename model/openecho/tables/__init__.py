"""Tables of echoes, and the files that hold them."""

from openecho.tables.files import WRITERS, check, write
from openecho.tables.table import Table, TableError

__all__ = ["WRITERS", "Table", "TableError", "check", "write"]
