"""Decomposition of waveforms into echoes, on arrays; whole files are the work of `openecho.batch`."""

from openecho.decompose.choices import CRITERIA, STARTS, WIDTHS
from openecho.decompose.columns import COLUMNS, Column, columns, dtype
from openecho.decompose.decomposition import Decomposition, troubles
from openecho.decompose.engines import ENGINES, EngineError
from openecho.decompose.inflection import configure, tabulate
from openecho.decompose.methods import FITTED, METHODS, Method, decompose, prepare

__all__ = [
    "COLUMNS",
    "CRITERIA",
    "ENGINES",
    "FITTED",
    "METHODS",
    "STARTS",
    "WIDTHS",
    "Column",
    "Decomposition",
    "EngineError",
    "Method",
    "columns",
    "configure",
    "decompose",
    "dtype",
    "prepare",
    "tabulate",
    "troubles",
]
