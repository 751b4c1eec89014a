"""Decomposition of waveforms into echoes, on arrays; whole files are the work of `openecho.batch`."""

from openecho.decompose.columns import COLUMNS, Column, columns, dtype
from openecho.decompose.engines import ENGINES, EngineError
from openecho.decompose.inflection import Decomposition, configure, decompose, tabulate, troubles

__all__ = [
    "COLUMNS",
    "ENGINES",
    "Column",
    "Decomposition",
    "EngineError",
    "columns",
    "configure",
    "decompose",
    "dtype",
    "tabulate",
    "troubles",
]
