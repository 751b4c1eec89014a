"""IEEE-754 arithmetic of the float units in any format up to 64 bits: exact integers, rounded once.

A finite number is an integer times a power of two, and so is every sum and product; a quotient is one with a remainder.
Each function forms that exact value in Python integers, without a limit of width, and rounds it to nearest even at the
end.
Words and flags are arrays; operands broadcast::

    words, flags = floating.add(a, b, floating.BINARY32)

There is one NaN: sign 0, exponent all ones, only the top bit of the fraction set. Tininess is detected after rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

INEXACT, UNDERFLOW, OVERFLOW, DIVIDE_BY_ZERO, INVALID = 1, 2, 4, 8, 16
"""Exception flags, in the order of Berkeley SoftFloat."""

Words = npt.NDArray[np.uint64]
Flags = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[Any]
"""Integers of any size: int64, uint64, or Python's in an object array."""


@dataclass(frozen=True)
class Format:
    """A binary format {sign, exponent, fraction}.

    Attributes
    ----------
    exp_w, frac_w : int
        Bits of the exponent, at least 3, and of the fraction, at least 2.
    """

    exp_w: int
    frac_w: int

    def __post_init__(self) -> None:
        """Refuse what has no infinity, NaN or normal number, and what does not fit an array of words."""
        if self.exp_w < 3 or self.frac_w < 2 or self.word_w > 64:
            raise ValueError(
                f"{self}: expected exp_w of at least 3, frac_w of at least 2, and at most 64 bits together"
            )

    @property
    def word_w(self) -> int:
        """Bits of a word."""
        return 1 + self.exp_w + self.frac_w

    @property
    def bias(self) -> int:
        """What an exponent is stored above its value."""
        return (1 << self.exp_w - 1) - 1

    @property
    def sign(self) -> int:
        """-0."""
        return 1 << self.word_w - 1

    @property
    def infinity(self) -> int:
        """+∞."""
        return ((1 << self.exp_w) - 1) << self.frac_w

    @property
    def nan(self) -> int:
        """The canonical quiet NaN."""
        return self.infinity | 1 << self.frac_w - 1

    @property
    def lowest(self) -> int:
        """Power of two of a subnormal's last place."""
        return 1 - self.bias - self.frac_w


BINARY16, BFLOAT16, BINARY32, BINARY64 = Format(5, 10), Format(8, 7), Format(8, 23), Format(11, 52)


@dataclass(frozen=True)
class _Numbers:
    """Words taken apart; a finite number is ±significand·2^power."""

    sign: Bools
    significand: Integers
    power: Integers
    infinite: Bools
    nan: Bools
    signalling: Bools

    @property
    def zero(self) -> Bools:
        result: Bools = self.significand == 0
        return result & ~self.infinite & ~self.nan


def add(a: Integers, b: Integers, form: Format, subtract: Bools | bool = False) -> tuple[Words, Flags]:
    """Sum, or difference where `subtract`.

    Parameters
    ----------
    a, b : (...) integer array
        Words.
    form : Format
        Of operands and result.
    subtract : (...) bool array or bool
        Whether to take b away.

    Returns
    -------
    words : (...) uint64 array
    flags : (...) uint8 array
    """
    x, y = _unpack(a, form), _unpack(b, form)
    minus = y.sign ^ np.asarray(subtract)
    power = np.minimum(x.power, y.power)
    total = _signed(x.sign, x.significand << x.power - power) + _signed(minus, y.significand << y.power - power)
    clash = x.infinite & y.infinite & (x.sign ^ minus)
    # The exact zero of two numbers is negative only if both are.
    sign = np.where(x.infinite, x.sign, np.where(y.infinite, minus, np.where(total == 0, x.sign & minus, total < 0)))
    return _finish(sign, abs(total), power, form, x, y, clash, x.infinite | y.infinite)


def mul(a: Integers, b: Integers, form: Format) -> tuple[Words, Flags]:
    """Product; arguments and results as for `add`."""
    x, y = _unpack(a, form), _unpack(b, form)
    clash = x.infinite & y.zero | x.zero & y.infinite
    product = x.significand * y.significand
    return _finish(x.sign ^ y.sign, product, x.power + y.power, form, x, y, clash, x.infinite | y.infinite)


def div(a: Integers, b: Integers, form: Format) -> tuple[Words, Flags]:
    """Quotient; arguments and results as for `add`."""
    x, y = _unpack(a, form), _unpack(b, form)
    clash = x.infinite & y.infinite | x.zero & y.zero
    by_zero = y.zero & ~x.zero & ~x.infinite & ~x.nan
    # Enough places for a quotient of a subnormal, and a last one for the remainder: it only has to be seen.
    places = 2 * form.frac_w + 4
    dividend = np.where(y.infinite, 0, x.significand) << places
    divisor = np.where(y.zero, 1, y.significand)
    quotient = dividend // divisor << 1 | (dividend % divisor != 0)
    infinite = x.infinite | y.zero
    words, flags = _finish(x.sign ^ y.sign, quotient, x.power - y.power - places - 1, form, x, y, clash, infinite)
    return words, flags | np.where(by_zero, DIVIDE_BY_ZERO, 0).astype(np.uint8)


def compare(a: Integers, b: Integers, form: Format) -> tuple[Bools, Bools, Bools, Flags]:
    """Quiet comparison: only a signalling NaN is invalid.

    Parameters
    ----------
    a, b : (...) integer array
        Words.
    form : Format
        Of both.

    Returns
    -------
    less, equal, unordered : (...) bool array
        At most one is set; none where a > b.
    flags : (...) uint8 array
    """
    x, y = _unpack(a, form), _unpack(b, form)
    power = np.minimum(x.power, y.power)
    left, right = (_signed(z.sign, z.significand << z.power - power) for z in (x, y))
    unordered = x.nan | y.nan
    # An infinity's significand and power are those that would follow the largest number, so order holds for it too.
    less, equal = (left < right) & ~unordered, (left == right) & ~unordered
    flags = np.where(x.signalling | y.signalling, INVALID, 0).astype(np.uint8)
    return less, equal, unordered, flags


def from_int(value: Integers, form: Format, scale: int = 0) -> tuple[Words, Flags]:
    """Integer times 2^scale, rounded once.

    Parameters
    ----------
    value : (...) integer array
        Of any size.
    form : Format
        Of the result.
    scale : int
        Power of two.

    Returns
    -------
    words : (...) uint64 array
    flags : (...) uint8 array
    """
    exact = np.asarray(value).astype(object)
    return _round(_bools(exact < 0), abs(exact), np.full(exact.shape, scale, object), form)


def to_fixed(a: Integers, form: Format, int_w: int, frac: int) -> tuple[Integers, Flags]:
    """Signed fixed point, rounded to nearest even, saturated.

    Parameters
    ----------
    a : (...) integer array
        Words.
    form : Format
        Of `a`.
    int_w, frac : int
        Bits before the point, with the sign, and behind it.

    Returns
    -------
    value : (...) object array
        Times 2^frac. What does not fit is invalid: the largest value for +∞ and NaN, too, and the smallest for -∞.
    flags : (...) uint8 array
    """
    x = _unpack(a, form)
    rounded, inexact = _nearest_even(x.significand, -(x.power + frac))
    largest = (1 << int_w + frac - 1) - 1
    value = _signed(x.sign, rounded)
    negative = x.sign & ~x.nan
    invalid = x.nan | x.infinite | _bools(value > largest) | _bools(value < -largest - 1)
    limit = largest - negative.astype(object) * (2 * largest + 1)
    value = np.where(invalid, limit, value)
    return value, np.where(invalid, INVALID, np.where(inexact, INEXACT, 0)).astype(np.uint8)


def _unpack(words: Integers, form: Format) -> _Numbers:
    exact = np.asarray(words).astype(object)
    fraction = exact & (1 << form.frac_w) - 1
    field = exact >> form.frac_w & (1 << form.exp_w) - 1
    special = _bools(field == (1 << form.exp_w) - 1)
    nan = special & _bools(fraction != 0)
    return _Numbers(
        sign=_bools(exact >> form.word_w - 1 != 0),
        significand=np.where(field == 0, 0, 1 << form.frac_w) + fraction,
        power=np.maximum(field, 1) - form.bias - form.frac_w,
        infinite=special & ~nan,
        nan=nan,
        signalling=nan & _bools(fraction < 1 << form.frac_w - 1),
    )


def _finish(
    sign: Bools,
    significand: Integers,
    power: Integers,
    form: Format,
    x: _Numbers,
    y: _Numbers,
    clash: Bools,
    infinite: Bools,
) -> tuple[Words, Flags]:
    """Round where the result is a finite number; infinities, NaNs and their flags elsewhere."""
    nan = x.nan | y.nan | clash
    words, flags = _round(sign, np.where(nan | infinite, 0, significand), power, form)
    words = np.where(infinite, words | np.uint64(form.infinity), words)
    words = np.where(nan, np.uint64(form.nan), words)
    return words, flags | np.where(x.signalling | y.signalling | clash, INVALID, 0).astype(np.uint8)


def _round(sign: Bools, significand: Integers, power: Integers, form: Format) -> tuple[Words, Flags]:
    """Word and flags of ±significand·2^power."""
    length = _bit_length(significand)
    # As if the exponent had no lower end: its last place, and whether it stays below the smallest normal number.
    free = length + power - form.frac_w - 1
    unbounded, _ = _nearest_even(significand, free - power)
    carried = _bools(unbounded >> form.frac_w + 1 != 0)
    tiny = (free + carried < form.lowest) & _bools(significand != 0)

    place = np.maximum(free, form.lowest)
    rounded, inexact = _nearest_even(significand, place - power)
    # The exponent counts from the smallest; a leading one adds the 1 that a subnormal lacks, a carry the next.
    magnitude = np.where(rounded == 0, 0, ((place - form.lowest) << form.frac_w) + rounded)
    overflow = _bools(magnitude >= form.infinity)
    words = np.where(overflow, form.infinity, magnitude) + sign.astype(object) * form.sign
    flags = np.where(overflow, OVERFLOW | INEXACT, np.where(inexact, INEXACT | np.where(tiny, UNDERFLOW, 0), 0))
    return words.astype(np.uint64), flags.astype(np.uint8)


def _nearest_even(significand: Integers, places: Integers) -> tuple[Integers, Bools]:
    """Drop `places` bits (none: append zeros), to nearest, ties to even; and whether that lost anything."""
    # One bit beyond the significand is as good as any number of them.
    down = np.minimum(np.maximum(places, 0), _bit_length(significand) + 1)
    shifted = significand << np.maximum(-places, 0)
    floor = shifted >> down
    rest, half = shifted - (floor << down), (1 << down) >> 1
    up = (rest > half) | (rest == half) & (floor & 1 == 1) & (down > 0)
    return floor + up, _bools(rest != 0)


def _signed(sign: Bools, magnitude: Integers) -> Integers:
    return np.where(sign, -magnitude, magnitude)


def _bit_length(values: Integers) -> Integers:
    return np.asarray(np.frompyfunc(int.bit_length, 1, 1)(values), object)


def _bools(values: Any) -> Bools:
    return np.asarray(values, bool)
