"""Values of a scene's keys: quantities, whole numbers, files, and what an error says if they are something else."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic_core import PydanticCustomError, core_schema

from openecho.scene import units
from openecho.scene.units import Dimension, in_si, quoted, to_si


def wrong(message: str, key: str = "") -> PydanticCustomError:
    """What is wrong with a key below the place that is being validated."""
    return PydanticCustomError("scene", "{message}", {"key": key, "message": message})


@dataclass(frozen=True)
class Quantity:
    """A float that is written with its unit, within bounds in SI.

    Attributes
    ----------
    dimension : Dimension
        What it is of.
    low, high : float
        Bounds, which are allowed themselves.
    above : bool
        Whether `low` itself is not.
    """

    dimension: Dimension
    low: float = -math.inf
    high: float = math.inf
    above: bool = False

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        written = core_schema.plain_serializer_function_ser_schema(self.dumped)
        return core_schema.no_info_plain_validator_function(self.parsed, serialization=written)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": ["string", "number"] if not self.dimension.unit else "string", "format": self.text}

    def parsed(self, value: Any) -> float:
        """In SI, or an error that says what is expected."""
        try:
            number = to_si(value, self.dimension)
        except ValueError as error:
            raise wrong(str(error)) from error
        if not self.low <= number <= self.high or (self.above and number == self.low):
            raise wrong(f"found {quoted(value)}, expected {self.dimension.phrase}{self.range}")
        return number

    @property
    def range(self) -> str:
        """The bounds in words, empty if there are none."""
        low = f" {'above' if self.above else 'from'} {self.short(self.low)}" if math.isfinite(self.low) else ""
        return f"{low} to {self.short(self.high)}" if math.isfinite(self.high) else low

    @property
    def text(self) -> str:
        """What is to be written, in words, with the SI unit."""
        what = self.dimension.phrase.removeprefix("an ").removeprefix("a ")
        bare = not self.range and self.dimension.unit
        return f"{what} in {self.dimension.unit}" if bare else f"{what}{self.range}"

    def short(self, value: float) -> str:
        """A value in SI for the reader, an angle in degrees."""
        if self.dimension is units.ANGLE:
            return f"{math.degrees(value):.3g} deg"
        return f"{value:.6g} {self.dimension.unit}".strip()

    def dumped(self, value: float) -> float | str:
        """As YAML holds it."""
        return in_si(value, self.dimension) if self.dimension.unit else value


@dataclass(frozen=True)
class Whole:
    """A whole number within bounds, both of them allowed."""

    low: int
    high: int

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.parsed)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": "integer", "minimum": self.low, "maximum": self.high}

    def parsed(self, value: Any) -> int:
        """The number, or an error that says what is expected."""
        if not isinstance(value, int) or isinstance(value, bool) or not self.low <= value <= self.high:
            raise wrong(f"found {quoted(value)}, expected a {self.text}")
        return value

    @property
    def text(self) -> str:
        """What is to be written, in words."""
        return f"whole number from {self.low} to {self.high}"


@dataclass(frozen=True)
class File:
    """A file that is there, of one of some suffixes; a relative path is taken from the scene's own folder."""

    suffixes: tuple[str, ...]

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        written = core_schema.plain_serializer_function_ser_schema(str)
        return core_schema.with_info_plain_validator_function(self.parsed, serialization=written)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": "string", "format": self.text}

    def parsed(self, value: Any, info: ValidationInfo) -> Path:
        """The absolute path, or an error that says what is expected."""
        if not isinstance(value, (str, Path)) or Path(value).suffix.lower() not in self.suffixes:
            raise wrong(f"found {quoted(value)}, expected a {self.text}")
        path = Path((info.context or {}).get("folder", "."), value)
        try:
            path = path.resolve()
            there = path.is_file()
        except (OSError, ValueError, RuntimeError):  # a null character, a name too long, a circle of links
            there = False
        if not there:
            raise wrong(f"found no file {quoted(path, 200)}, expected one")
        return path

    @property
    def text(self) -> str:
        """What is to be written, in words."""
        return f"file ({', '.join(self.suffixes)})"


@dataclass(frozen=True)
class OnOff:
    """Off, on, or an order."""

    text: ClassVar[str] = "on, off or a number from 1"

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.parsed)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": ["boolean", "number"], "minimum": 1}

    def parsed(self, value: Any) -> bool | float:
        """A bool as it is, or a number."""
        if isinstance(value, bool):
            return value
        try:
            return Quantity(units.RATIO, 1).parsed(value)
        except PydanticCustomError as error:
            raise wrong(f"found {quoted(value)}, expected {self.text}") from error


@dataclass(frozen=True)
class Flag:
    """On or off."""

    text: ClassVar[str] = "on or off"

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.parsed)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": "boolean"}

    def parsed(self, value: Any) -> bool:
        """A bool as it is."""
        if not isinstance(value, bool):
            raise wrong(f"found {quoted(value)}, expected {self.text}")
        return value
