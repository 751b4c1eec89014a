"""Bit-exact model of the OpenEcho core: one function per RTL module, named as the module.

Equations are those of Zhou et al., LiDAR Echo Gaussian Decomposition Algorithm for FPGA Implementation, Sensors 22
(2022) 4628, doi:10.3390/s22124628 ("Zhou 2022"), with the corrections that each docstring names.
Every function takes and returns `Beats`: flat arrays with one entry a stream beat, all waveforms end to end, so that
a whole data set is one call::

    beats = golden.stream(samples, length, config)
    echoes = golden.decode_records(golden.core(beats, config)["record"], config)

The core calculates in fixed point or, if `Config.exp_w` is not 0, with IEEE-754 numbers: `arithmetic`, on the exact
model `floating` of the float units. `float64` is the same method straight from the equations, for judging either.
"""

from . import float64
from .beats import Beats, stream
from .config import (
    AMP_FRAC,
    ARITHMETICS,
    BAD_CHECK,
    BAD_FORM,
    BAD_LENGTH,
    NO_NOISE,
    NO_PEAK,
    NOISE_SAMPLES,
    RATIO_FRAC,
    ROOT_FRAC,
    SATURATED,
    TAP_FRAC,
    TOO_LONG,
    TOO_SHORT,
    TRUNCATED,
    Config,
)
from .core import core
from .decoder import decoder
from .encoder import encoder
from .filter import filter
from .inflection import inflection
from .output import output
from .parameters import parameters
from .reader import reader
from .records import decode_records
from .second_difference import second_difference
from .taps import MAX_TAPS, PAPER_TAPS, TAP_SETS, gaussian_taps

__all__ = [
    "AMP_FRAC",
    "ARITHMETICS",
    "BAD_CHECK",
    "BAD_FORM",
    "BAD_LENGTH",
    "MAX_TAPS",
    "NOISE_SAMPLES",
    "NO_NOISE",
    "NO_PEAK",
    "PAPER_TAPS",
    "RATIO_FRAC",
    "ROOT_FRAC",
    "SATURATED",
    "TAP_FRAC",
    "TAP_SETS",
    "TOO_LONG",
    "TOO_SHORT",
    "TRUNCATED",
    "Beats",
    "Config",
    "core",
    "decode_records",
    "decoder",
    "encoder",
    "filter",
    "float64",
    "gaussian_taps",
    "inflection",
    "output",
    "parameters",
    "reader",
    "second_difference",
    "stream",
]
