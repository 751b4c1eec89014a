"""Quantities as text with their units, such as ``300 m`` or ``2 counts/nW``, and as floats in SI."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

try:
    import pint
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "pint is not installed, expected it: pip install 'openecho[scene]'", name="pint"
    ) from error

_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,4})?|[+-]?\.?(?:nan|inf)"
_FACTOR = r"[^\W\d]\w*?(?:(?:\^|\*\*)(?:-?\d|\(-?\d/\d\))|[²³])?|[%°]"
_UNIT = rf"(?:1?\s*/)?\s*(?:{_FACTOR})(?:\s*[/*·\s]\s*(?:{_FACTOR}))*"
_TEXT = re.compile(rf"({_NUMBER})\s*({_UNIT})?", re.IGNORECASE)
"""A number and products or quotients of units. Pint alone would work out any arithmetic, 9**9**9 m among it."""

_SAMPLES = re.compile(r"([kMG]?)(?:S|Sa|samples?)/s")
"""What digitisers' rates are written in; to Pint, S is a siemens."""

MOST = 1e30
"""In SI; what is greater, or less than its inverse but not 0, is a slip, and would take products out of float64."""

LONGEST = 60
"""Characters of a quantity, and of what an error quotes."""


@dataclass(frozen=True)
class Dimension:
    """What a quantity is of.

    Attributes
    ----------
    unit : str
        The SI unit that its float is in; empty for a plain number.
    phrase, example : str
        What an error expects.
    """

    unit: str
    phrase: str
    example: str


LENGTH = Dimension("m", "a length", "300 m")
SPEED = Dimension("m/s", "a speed", "60 m/s")
ANGLE = Dimension("rad", "an angle", "0.5 mrad")
TIME = Dimension("s", "a time", "5 ns")
RATE = Dimension("Hz", "a rate", "1 GHz")
ENERGY = Dimension("J", "an energy", "20 µJ")
CURRENT = Dimension("A", "a current", "2 nA")
RESISTANCE = Dimension("ohm", "a resistance", "50 ohm")
TEMPERATURE = Dimension("K", "a temperature", "293 K")
RESPONSIVITY = Dimension("A/W", "a responsivity", "0.3 A/W")
COUNTS = Dimension("count", "counts", "200 counts")
GAIN = Dimension("count/W", "counts per power", "2 counts/nW")
RATIO = Dimension("", "a number", "0.3 or 30 %")
IRRADIANCE = Dimension("W/m^2/m", "a spectral irradiance", "0.6 W/m^2/nm")
TURBULENCE = Dimension("m^(-2/3)", "a turbulence structure constant", "1e-14 m^(-2/3)")
AREA_DENSITY = Dimension("1/m^2", "a number per area", "400 /ha")
VOLUME_DENSITY = Dimension("1/m", "an area per volume", "0.5 m^2/m^3")


def to_si(value: Any, dimension: Dimension) -> float:
    """Give a quantity as a float in SI.

    Parameters
    ----------
    value : object
        Text such as ``300 m``; a number will do where `dimension` has no unit.
    dimension : Dimension
        What it has to be of.

    Returns
    -------
    float
        In `dimension.unit`, finite: 0, or from 1/`MOST` to `MOST` either side of it.

    Raises
    ------
    ValueError
        If it is anything else: what was found, and what is expected.
    """
    expected = f"{dimension.phrase}, as {dimension.example}"
    if isinstance(value, (int, float)) and not isinstance(value, bool) and not dimension.unit:
        number = _float(value)
    else:
        text = value.strip() if isinstance(value, str) else ""
        match = _TEXT.fullmatch(text) if len(text) <= LONGEST else None
        if match is None:
            raise ValueError(f"found {quoted(value)}, expected {expected}")
        number = _converted(float(match[1].replace(".nan", "nan").replace(".inf", "inf")), match[2] or "", dimension)
    if number and not 1 / MOST <= abs(number) <= MOST:
        raise ValueError(f"found {quoted(value)}, expected {expected}")
    return number


def in_si(value: float, dimension: Dimension) -> str:
    """Write a float in SI as `to_si` reads it, without the loss of a bit."""
    return f"{value!r} {dimension.unit}".strip()


def quoted(value: Any, most: int = LONGEST) -> str:
    """What a document holds, for an error: short, printable, and without what a list or mapping contains."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple, set)):
        return "a list"
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) and value.bit_length() > 200:
        return "a number of more than 60 digits"
    text = str(value)
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:most])
    return shown + "…" * (len(text) > most) if shown else "an empty text"


def _float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _converted(number: float, unit: str, dimension: Dimension) -> float:
    """In the unit of the dimension; NaN if that can't be."""
    registry = _registry()
    unit = _SAMPLES.sub(r"\1Hz", unit).replace("·", "*")
    try:
        quantity = registry.Quantity(number, registry.parse_units(f"1{unit}" if unit.startswith("/") else unit))
        if not _alike(quantity, registry.Quantity(1, dimension.unit)):
            return math.nan
        value = float(quantity.to(dimension.unit).magnitude)
    except (pint.PintError, ArithmeticError):
        return math.nan
    # 15 digits shed the rounding of the factor: 1064 nm is 1.064e-6 m. In SI there was none to shed.
    return number if value == number else float(f"{value:.15g}")


def _alike(one: Any, other: Any) -> bool:
    """Whether two quantities are of one kind. To Pint, angles and counts are plain numbers; here they are not."""
    units = [dict(quantity.to_root_units().unit_items()) for quantity in (one, other)]
    return all(abs(units[0].get(name, 0) - units[1].get(name, 0)) < 1e-9 for name in {*units[0], *units[1]})


@cache
def _registry() -> pint.UnitRegistry[Any]:
    return pint.UnitRegistry()
