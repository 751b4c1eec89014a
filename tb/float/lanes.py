"""What is checked: each float unit in each format, with its parameters, reference and latency."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from openecho.golden import ARITHMETICS, floating
from openecho.golden.floating import BFLOAT16, BINARY16, BINARY32, BINARY64, Format
from openecho.hardware import MODULES, FloatUnit
from tb.float import softfloat, vectors
from tb.float.vectors import DIVIDE, SUBTRACT, Vectors

UNITS = ("add", "mul", "div", "compare", "from_int", "to_fixed", "serial")
"""In the order of the parameter UNIT of openecho_float_lane."""
SMALL = Format(4, 3)
FORMATS = {"float8": SMALL, "float16": BINARY16, "bfloat16": BFLOAT16, "float32": BINARY32, "float64": BINARY64}


@dataclass(frozen=True)
class Lane:
    """A unit as it is built in the bench.

    Attributes
    ----------
    arithmetic : str
        Key of `FORMATS`.
    unit : str
        One of `UNITS`.
    parameters : mapping of str to int
        Those of the unit besides its format.
    """

    arithmetic: str
    unit: str
    parameters: Mapping[str, int] = field(default_factory=dict)

    @property
    def module(self) -> str:
        """Row of the module table."""
        return f"float_{self.unit}"

    @property
    def form_name(self) -> str:
        """Which form of a unit that comes in two."""
        return {None: "", 0: "pipelined", 1: "iterative"}[self.parameters.get("ITERATIVE")]

    @property
    def name(self) -> str:
        """Of its files."""
        integers = [f"{name}{value}" for name, value in self.parameters.items() if name != "ITERATIVE"]
        return re.sub(r"\W+", "_", " ".join(filter(None, (self.arithmetic, self.unit, *integers, self.form_name))))

    @property
    def built(self) -> FloatUnit:
        """Its format and parameters."""
        return FloatUnit(self.form, self.parameters)

    @property
    def form(self) -> Format:
        """Its format."""
        return FORMATS[self.arithmetic]

    @property
    def iterative(self) -> bool:
        """Whether it works on one operation at a time."""
        return self.unit == "serial" or bool(self.parameters.get("ITERATIVE"))

    @property
    def latencies(self) -> dict[int, int]:
        """Cycles from the transfer of two of `operand` to that of their result, by `control` if that matters."""
        latency = _latency(self.unit, self.built)
        if self.unit != "serial":
            return {0: latency}
        return {0: _latency("add", FloatUnit(self.form, {"ITERATIVE": 1})), DIVIDE: latency}

    @property
    def operand(self) -> int:
        """What latency is stated for: 1, or the most negative integer."""
        if self.unit == "from_int":
            return (1 << 64) - (1 << self.parameters["INT_W"] - 1)
        return self.form.bias << self.form.frac_w

    def interval(self, latency: int) -> int:
        """Cycles from one result to the next, for numbers that take that latency."""
        return latency - 1 if self.iterative else 1

    def expected(self, sent: Vectors) -> tuple[np.ndarray, np.ndarray]:
        """Results as the lane writes them, and flags: by SoftFloat where it has the operation, or else by the model."""
        if softfloat.has(self.unit, self.form, self.parameters):
            return softfloat.expected(self.unit, self.form, self.parameters, sent)
        return modelled(self.unit, self.form, self.parameters, sent)


def stimulus(lane: Lane, count: int) -> Vectors:
    """Vectors for a lane: all that there are, or `count` directed and random ones, the same each time."""
    rng = np.random.default_rng(zlib.crc32(lane.name.encode()))
    if lane.unit == "from_int":
        return vectors.integers(lane.parameters["INT_W"], count, rng)
    if lane.unit == "to_fixed":
        return vectors.words(lane.form, lane.parameters["INT_W"], lane.parameters["FRAC"], count, rng)
    if lane.form == SMALL and count >= 1 << 2 * SMALL.word_w:
        return vectors.all_pairs(lane.form)
    return vectors.pairs(lane.form, count, rng)


def ordinary(lane: Lane, count: int) -> Vectors:
    """Random integers of any size, or random numbers from 1 to 16."""
    rng = np.random.default_rng(zlib.crc32(lane.name.encode()))
    if lane.unit == "from_int":
        return vectors.integers(lane.parameters["INT_W"], count, rng)[-count:]
    return vectors.alike(lane.form, count, rng)


def _latency(unit: str, built: FloatUnit) -> int:
    row = MODULES[f"float_{unit}"]
    assert row.latency is not None
    return row.latency["m"](built)


def modelled(unit: str, form: Format, parameters: Mapping[str, int], sent: Vectors) -> tuple[np.ndarray, np.ndarray]:
    """Results as a lane writes them, and flags, by the golden model."""
    a, b = sent["a"].astype(np.uint64), sent["b"].astype(np.uint64)
    subtract, divide = (sent["control"] & bit != 0 for bit in (SUBTRACT, DIVIDE))
    match unit:
        case "add":
            return floating.add(a, b, form, subtract)
        case "serial":
            total, total_flags = floating.add(a, b, form, subtract)
            quotient, quotient_flags = floating.div(a, b, form)
            return np.where(divide, quotient, total), np.where(divide, quotient_flags, total_flags)
        case "mul":
            return floating.mul(a, b, form)
        case "div":
            return floating.div(a, b, form)
        case "compare":
            less, equal, unordered, flags = floating.compare(a, b, form)
            return (less * 4 + equal * 2 + unordered).astype(np.uint64), flags
        case "from_int":
            return floating.from_int(a.view(np.int64), form, parameters["SCALE"])
        case _:
            value, flags = floating.to_fixed(a, form, parameters["INT_W"], parameters["FRAC"])
            return value.astype(np.int64).view(np.uint64), flags


def _lanes() -> dict[str, Lane]:
    integers = {  # INT_W, SCALE
        "float8": ((8, 0), (19, -11), (10, -17)),
        "float16": ((16, 0), (19, -11), (24, -30)),
        "bfloat16": ((32, 0), (19, -11)),
        "float32": ((32, 0), (19, -11), (64, 0)),
        "float64": ((64, 0), (19, -11)),
    }
    fixed = {  # INT_W, FRAC
        "float8": ((3, 2), (9, 12), (2, 0)),
        "float16": ((32, 0), (14, 16), (5, 3)),
        "bfloat16": ((32, 0), (14, 16)),
        "float32": ((32, 0), (64, 0), (14, 16)),
        "float64": ((32, 0), (64, 0), (14, 16)),
    }
    both = ({"ITERATIVE": 1}, {"ITERATIVE": 0})
    rows = []
    for name in FORMATS:
        rows += [Lane(name, unit) for unit in ("mul", "compare", "serial")]
        rows += [Lane(name, unit, form) for unit in ("add", "div") for form in both]
        rows += [
            Lane(name, "from_int", {"INT_W": w, "SCALE": scale} | form) for w, scale in integers[name] for form in both
        ]
        rows += [Lane(name, "to_fixed", {"INT_W": w, "FRAC": frac}) for w, frac in fixed[name]]
    return {lane.name: lane for lane in rows}


LANES = _lanes()

_OTHERS = ((19, -11), (14, 16))
SHOWN = tuple(
    lane
    for lane in LANES.values()
    if lane.arithmetic in ARITHMETICS
    and ("INT_W" not in lane.parameters or tuple(lane.parameters.values())[:2] in _OTHERS)
)
"""Lanes that reports show: of the conversions, those that the core has, or could have."""
