"""What is checked: each float unit in each format, with its parameters, reference and latency."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from openecho.golden import floating
from openecho.golden.floating import BFLOAT16, BINARY16, BINARY32, BINARY64, Format
from openecho.hardware import MODULES, FloatUnit
from tb.float import softfloat
from tb.float.vectors import Vectors

UNITS = ("add", "mul", "div", "compare", "from_int", "to_fixed")
"""In the order of the parameter UNIT of openecho_float_lane."""
SMALL = Format(4, 3)
FORMATS = {"float8": SMALL, "float16": BINARY16, "bfloat16": BFLOAT16, "float32": BINARY32, "float64": BINARY64}


@dataclass(frozen=True)
class Lane:
    """A unit as it is built in the bench.

    Attributes
    ----------
    name : str
        Of its files.
    unit : str
        One of `UNITS`.
    built : FloatUnit
        Its format and other parameters.
    """

    name: str
    unit: str
    built: FloatUnit

    @property
    def form(self) -> Format:
        """Its format."""
        return self.built.form

    @property
    def parameters(self) -> Mapping[str, int]:
        """Its parameters besides the format."""
        return self.built.parameters

    @property
    def latency(self) -> int:
        """Cycles from the transfer of two normal numbers to that of their result (a quotient of at least 1)."""
        row = MODULES[f"float_{self.unit}"]
        assert row.latency is not None
        return row.latency["m"](self.built)

    @property
    def interval(self) -> int:
        """Cycles from one result to the next, for numbers as above."""
        return self.latency - 3 if self.parameters.get("ITERATIVE") else 1

    def expected(self, vectors: Vectors) -> tuple[np.ndarray, np.ndarray]:
        """Results as the lane writes them, and flags: by SoftFloat where it has the operation, or else by the model."""
        if softfloat.has(self.unit, self.form, self.parameters):
            return softfloat.expected(self.unit, self.form, self.parameters, vectors)
        return modelled(self.unit, self.form, self.parameters, vectors)


def modelled(unit: str, form: Format, parameters: Mapping[str, int], vectors: Vectors) -> tuple[np.ndarray, np.ndarray]:
    """Results as a lane writes them, and flags, by the golden model."""
    a, b = vectors["a"].astype(np.uint64), vectors["b"].astype(np.uint64)
    match unit:
        case "add":
            return floating.add(a, b, form, vectors["control"] == 1)
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
    rows = []
    for name, form in FORMATS.items():
        rows += [Lane(f"{name}_{unit}", unit, FloatUnit(form)) for unit in ("add", "mul", "compare")]
        rows += [
            Lane(f"{name}_div_{kind}", "div", FloatUnit(form, {"ITERATIVE": iterative}))
            for kind, iterative in (("iterative", 1), ("pipelined", 0))
        ]
        rows += [
            Lane(f"{name}_from_int{w}e{-scale}", "from_int", FloatUnit(form, {"INT_W": w, "SCALE": scale}))
            for w, scale in integers[name]
        ]
        rows += [
            Lane(f"{name}_to_fixed{w}_{frac}", "to_fixed", FloatUnit(form, {"INT_W": w, "FRAC": frac}))
            for w, frac in fixed[name]
        ]
    return {lane.name: lane for lane in rows}


LANES = _lanes()
