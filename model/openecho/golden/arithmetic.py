"""Arithmetic of the floating-point core: IEEE-754 numbers in any format, each result rounded once, to nearest even.

A number is its word read as a two's complement integer, in int64. A positive number is then a positive integer, and
neither zero is: the sign tests of the state machine are the same on floating and on fixed point.

binary16, binary32 and binary64 are numpy's; any other format is the exact model of the float units, `floating`.
No result of the core overflows or is NaN, as `Config` refuses a format with too small an exponent: an operation that
overflows, divides by zero or is invalid raises FloatingPointError. Underflow and inexact results are ordinary.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from . import floating
from .beats import Array, FloatArray, IntArray
from .floating import BINARY16, BINARY32, BINARY64, Flags, Format, Words

DTYPES: dict[Format, type[np.floating[Any]]] = {BINARY16: np.float16, BINARY32: np.float32, BINARY64: np.float64}
"""The formats that numpy calculates in."""

_EXCEPTIONS = {
    floating.OVERFLOW: "overflow",
    floating.DIVIDE_BY_ZERO: "division by zero",
    floating.INVALID: "invalid operation",
}


def add(a: IntArray, b: IntArray, form: Format) -> IntArray:
    """Sum.

    Parameters
    ----------
    a, b : (...) int64 array
        Numbers; they broadcast.
    form : Format
        Of operands and result.

    Returns
    -------
    (...) int64 array

    Raises
    ------
    FloatingPointError
        If a result overflows or is invalid.
    """
    return _calculate(np.add, floating.add, a, b, form)


def sub(a: IntArray, b: IntArray, form: Format) -> IntArray:
    """Difference a − b; as `add`."""
    return _calculate(np.subtract, partial(floating.add, subtract=True), a, b, form)


def div(a: IntArray, b: IntArray, form: Format) -> IntArray:
    """Quotient a / b; as `add`, and raises if one divides by zero."""
    return _calculate(np.divide, floating.div, a, b, form)


def magnitude(a: IntArray, form: Format) -> IntArray:
    """Number without its sign, exact."""
    return a & (form.sign - 1)


def from_int(value: IntArray | int, form: Format, scale: int = 0) -> IntArray:
    """Integer times 2^scale, in one rounding.

    Parameters
    ----------
    value : (...) int64 array or int
        Of a magnitude up to 2^53.
    form : Format
        Of the result.
    scale : int
        Power of two.

    Returns
    -------
    (...) int64 array
        Of one entry for an int.

    Raises
    ------
    FloatingPointError
        If a result overflows.
    """
    if form not in DTYPES:
        return _checked(*floating.from_int(np.atleast_1d(value), form, scale), form)
    with _raising():
        return _words(np.ldexp(np.atleast_1d(value).astype(np.float64), scale).astype(DTYPES[form]), form)


def constant(value: Decimal, form: Format) -> IntArray:
    """Nearest number to a decimal of 50 digits, in an array of one entry.

    What is cut below 2⁻¹⁵⁰ decides the rounding of no constant that the core has.
    """
    scale = 150
    return _checked(*floating.from_int(np.array([int(Fraction(value) * 2**scale)]), form, -scale), form)


def decode(words: Array, form: Format) -> FloatArray:
    """Numbers as float64, exact.

    Parameters
    ----------
    words : (...) integer array
        Numbers; bits above the format's are not looked at.
    form : Format
        With at most 11 bits of exponent and 52 of fraction.

    Returns
    -------
    (...) float64 array
    """
    fraction = words & ((1 << form.frac_w) - 1)
    field = words >> form.frac_w & ((1 << form.exp_w) - 1)
    significand = np.where(field == 0, fraction, fraction | 1 << form.frac_w)
    special = np.where(fraction == 0, np.inf, np.nan)
    size = np.where(field == (1 << form.exp_w) - 1, special, significand)
    size = np.ldexp(size, np.maximum(field, 1) - form.bias - form.frac_w)
    numbers: FloatArray = np.where(words >> (form.word_w - 1) & 1, -size, size)
    return numbers


def _calculate(
    in_numpy: Callable[..., Any],
    exactly: Callable[[IntArray, IntArray, Format], tuple[Words, Flags]],
    a: IntArray,
    b: IntArray,
    form: Format,
) -> IntArray:
    if form not in DTYPES:
        return _checked(*exactly(a, b, form), form)
    x, y = (operand.astype(f"i{form.word_w // 8}").view(DTYPES[form]) for operand in (a, b))
    with _raising():
        return _words(in_numpy(x, y), form)


def _raising() -> np.errstate:
    """Condition under which numpy raises the exceptions that the core never has."""
    return np.errstate(over="raise", divide="raise", invalid="raise", under="ignore")


def _words(numbers: Array, form: Format) -> IntArray:
    """Words of numpy's floats."""
    return np.asarray(numbers).view(f"i{form.word_w // 8}").astype(np.int64)


def _checked(words: Words, flags: Flags, form: Format) -> IntArray:
    """Words of the float units' model as two's complement integers, unless a flag is up that the core never raises."""
    raised = np.bitwise_or.reduce(flags, axis=None)
    for flag, name in _EXCEPTIONS.items():
        if raised & flag:
            raise FloatingPointError(f"{name} in {form}")
    above = 64 - form.word_w
    return (words << np.uint64(above)).view(np.int64) >> above
