"""The model of the float units against other implementations of IEEE 754: numpy, SoftFloat and exact fractions."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
import softfloatpy

from openecho.golden import floating
from openecho.golden.floating import BFLOAT16, BINARY16, BINARY32, BINARY64, INVALID, Format

DTYPES = {BINARY16: np.float16, BINARY32: np.float32, BINARY64: np.float64}
OPERATIONS: dict[str, Callable[..., Any]] = {"add": np.add, "mul": np.multiply, "div": np.divide}
SMALL = Format(4, 3)
NARROWEST = Format(3, 2)
TALL = Format(3, 10)  # its subnormals have a product that counts
COUNT = 20_000


def words(form: Format, count: int, seed: int) -> np.ndarray:
    """Random words, many with few ones or near the ends of the range."""
    rng = np.random.default_rng(seed)
    uniform = rng.integers(0, 1 << form.word_w, count, dtype=np.uint64)
    exponent = rng.choice([0, 1, 2, form.bias - 1, form.bias, form.bias + 1, (1 << form.exp_w) - 2], count)
    fraction = rng.integers(0, 4, count) << rng.integers(0, form.frac_w - 1, count)
    sparse = (exponent << form.frac_w | fraction).astype(np.uint64)
    return np.where(rng.random(count) < 0.5, uniform, sparse | uniform & np.uint64(form.sign))


def value(word: int, form: Format) -> Fraction | float:
    """Number that a word stands for: a fraction, or an infinity or NaN."""
    sign = -1 if word & form.sign else 1
    field, fraction = word >> form.frac_w & (1 << form.exp_w) - 1, word & (1 << form.frac_w) - 1
    if field == (1 << form.exp_w) - 1:
        return math.nan if fraction else sign * math.inf
    scaled = Fraction(fraction + (1 << form.frac_w if field else 0), 1 << form.frac_w)
    return sign * scaled * Fraction(2) ** (max(field, 1) - form.bias)


@cache
def magnitudes(form: Format) -> list[Fraction]:
    """Numbers of the positive words, and what infinity would stand for if the exponents went on."""
    finite = [value(word, form) for word in range(form.infinity)]
    return [number for number in finite if isinstance(number, Fraction)] + [Fraction(2) ** (form.bias + 1)]


def nearest(exact: Fraction, form: Format) -> int:
    """Word of the magnitude nearest to an exact one; ties to the even word, beyond the largest infinity."""
    above = bisect_left(magnitudes(form), abs(exact))
    candidates = [word for word in (above - 1, above) if 0 <= word <= form.infinity]
    return min(candidates, key=lambda word: (abs(abs(exact) - magnitudes(form)[word]), word & 1))


def is_tiny(exact: Fraction, form: Format) -> bool:
    """Whether it is below the smallest normal number once it is rounded as if the exponent had no lower end."""
    place = Fraction(2) ** (exact.numerator.bit_length() - exact.denominator.bit_length() - form.frac_w)
    place *= Fraction(2) ** ((abs(exact) >= place * 2 ** (form.frac_w + 1)) - (abs(exact) < place * 2**form.frac_w))
    return bool(0 < round(abs(exact) / place) * place < Fraction(2) ** (1 - form.bias))


def exact_result(name: str, x: int, y: int, form: Format) -> Fraction | None:
    """Exact result of finite operands, or None where there is none."""
    left, right = value(x, form), value(y, form)
    if not isinstance(left, Fraction) or not isinstance(right, Fraction) or (name == "div" and right == 0):
        return None
    return {"add": left.__add__, "sub": left.__sub__, "mul": left.__mul__, "div": left.__truediv__}[name](right)


def check_exactly(exact: Fraction, negative_zero: bool, word: int, raised: int, form: Format) -> None:
    """Compare a word and its flags with the exact result."""
    magnitude = nearest(exact, form)
    assert word == magnitude | (form.sign if exact < 0 or (exact == 0 and negative_zero) else 0)
    inexact = value(magnitude, form) != abs(exact)
    assert bool(raised & floating.INEXACT) == inexact
    assert bool(raised & floating.OVERFLOW) == (magnitude == form.infinity)
    assert bool(raised & floating.UNDERFLOW) == (inexact and is_tiny(exact, form))
    assert not raised & (INVALID | floating.DIVIDE_BY_ZERO)


@pytest.mark.parametrize("form", DTYPES, ids=str)
@pytest.mark.parametrize("name", OPERATIONS)
def test_results_are_those_of_numpy(name: str, form: Format) -> None:
    a, b = words(form, COUNT, 1), words(form, COUNT, 2)
    x, y = (operand.astype(f"u{form.word_w // 8}").view(DTYPES[form]) for operand in (a, b))
    with np.errstate(all="ignore"):
        result = OPERATIONS[name](x, y)
    expected = np.where(np.isnan(result), form.nan, result.view(f"u{form.word_w // 8}"))
    np.testing.assert_array_equal(getattr(floating, name)(a, b, form)[0], expected.astype(np.uint64))


@pytest.mark.parametrize("form", DTYPES, ids=str)
@pytest.mark.parametrize("name", ["add", "sub", "mul", "div"])
def test_results_and_flags_are_those_of_softfloat(name: str, form: Format) -> None:
    a, b = words(form, COUNT, 3), words(form, COUNT, 4)
    size, prefix = form.word_w // 8, f"f{form.word_w}"
    make, operation = getattr(softfloatpy, f"Float{form.word_w}"), getattr(softfloatpy, f"{prefix}_{name}")
    softfloatpy.set_tininess_mode(softfloatpy.TininessMode.AFTER_ROUNDING)
    expected, expected_flags = [], []
    for x, y in zip(a.tolist(), b.tolist(), strict=True):
        softfloatpy.set_exception_flags(0)
        result = operation(make.from_bytes(x.to_bytes(size)), make.from_bytes(y.to_bytes(size)))
        expected.append(form.nan if result.is_nan() else int.from_bytes(result.to_bytes()))
        expected_flags.append(int(softfloatpy.get_exception_flags()))
    if name == "sub":
        result_words, flags = floating.add(a, b, form, subtract=True)
    else:
        result_words, flags = getattr(floating, name)(a, b, form)
    np.testing.assert_array_equal(result_words, np.array(expected, np.uint64))
    np.testing.assert_array_equal(flags, expected_flags)


@pytest.mark.parametrize("form", [NARROWEST, SMALL, TALL], ids=str)
@pytest.mark.parametrize("name", ["add", "sub", "mul", "div"])
def test_every_pair_of_a_small_format_gives_the_word_nearest_to_the_exact_fraction(name: str, form: Format) -> None:
    if 2 * form.word_w <= 16:
        a, b = np.divmod(np.arange(1 << 2 * form.word_w), 1 << form.word_w)
    else:
        a, b = np.random.default_rng(5).integers(0, 1 << form.word_w, (2, 20_000))
    results, flags = floating.add(a, b, form, name == "sub") if name == "sub" else getattr(floating, name)(a, b, form)
    checked = 0
    for x, y, word, raised in zip(a.tolist(), b.tolist(), results.tolist(), flags.tolist(), strict=True):
        exact = exact_result(name, x, y, form)
        if exact is not None:
            signs = x & form.sign != 0, (y & form.sign != 0) ^ (name == "sub")
            negative = all(signs) if name in ("add", "sub") else signs[0] != signs[1]
            check_exactly(exact, negative, word, raised, form)
            checked += 1
    assert checked > a.size / 2


@pytest.mark.parametrize(("int_w", "scale"), [(8, 0), (19, -11), (10, -17)])
def test_integers_give_the_word_nearest_to_the_exact_fraction(int_w: int, scale: int) -> None:
    integers = np.arange(-(1 << int_w - 1), 1 << int_w - 1, 1 if int_w < 16 else 7)
    results, flags = floating.from_int(integers, SMALL, scale)
    for integer, word, raised in zip(integers.tolist(), results.tolist(), flags.tolist(), strict=True):
        check_exactly(integer * Fraction(2) ** scale, False, word, raised, SMALL)


def test_every_pair_of_a_small_format_is_ordered_as_its_fractions() -> None:
    a, b = np.divmod(np.arange(1 << 2 * SMALL.word_w), 1 << SMALL.word_w)
    numbers = [value(word, SMALL) for word in range(1 << SMALL.word_w)]
    less, equal, unordered, _ = floating.compare(a, b, SMALL)
    pairs = [(numbers[x], numbers[y]) for x, y in zip(a.tolist(), b.tolist(), strict=True)]
    np.testing.assert_array_equal(less, [x < y for x, y in pairs])
    np.testing.assert_array_equal(equal, [x == y for x, y in pairs])
    np.testing.assert_array_equal(unordered, [x != x or y != y for x, y in pairs])


@pytest.mark.parametrize(
    ("operation", "a", "b", "word", "flags"),
    [
        # 2^-126 (1 - 2^-46) rounds to the smallest normal number with an unbounded exponent, too: not tiny
        (floating.mul, 0x007FFFFF, 0x3F800001, 0x00800000, floating.INEXACT),
        # 2^-126 (1 - 2^-24) is exact with an unbounded exponent: tiny, although the bounded one rounds it up
        (floating.mul, 0x00FFFFFF, 0x3F000000, 0x00800000, floating.UNDERFLOW | floating.INEXACT),
        (floating.mul, 0x7F7FFFFF, 0x40000000, 0x7F800000, floating.OVERFLOW | floating.INEXACT),
        (floating.div, 0x3F800000, 0x80000000, 0xFF800000, floating.DIVIDE_BY_ZERO),
        (floating.div, 0x80000000, 0x00000000, 0x7FC00000, INVALID),
        (floating.div, 0xFF800000, 0x00000000, 0xFF800000, 0),
        (floating.mul, 0x7F800000, 0x80000000, 0x7FC00000, INVALID),
        (floating.add, 0x7F800000, 0xFF800000, 0x7FC00000, INVALID),
        (floating.add, 0xFFC12345, 0x3F800000, 0x7FC00000, 0),
        (floating.add, 0x7F812345, 0x3F800000, 0x7FC00000, INVALID),
        (floating.add, 0x3F800000, 0xBF800000, 0x00000000, 0),
        (floating.add, 0x80000000, 0x80000000, 0x80000000, 0),
        (floating.add, 0x80000000, 0x00000000, 0x00000000, 0),
    ],
)
def test_exceptions_are_as_ieee_754_has_them(
    operation: Callable[..., Any], a: int, b: int, word: int, flags: int
) -> None:
    result, raised = operation(np.array([a]), np.array([b]), BINARY32)
    assert (f"{result[0]:08x}", raised[0]) == (f"{word:08x}", flags)


@pytest.mark.parametrize("form", [BINARY16, BINARY32, BINARY64], ids=str)
def test_comparison_orders_as_numpy_and_only_signalling_nans_are_invalid(form: Format) -> None:
    ends = [0, 1, form.bias << form.frac_w, form.infinity - 1, form.infinity, form.nan, form.infinity | 1]
    special = np.array([word | sign for word in ends for sign in (0, form.sign)], np.uint64)
    a = np.concatenate([np.repeat(special, special.size), words(form, COUNT, 6)])
    b = np.concatenate([np.tile(special, special.size), words(form, COUNT, 7)])
    x, y = (operand.astype(f"u{form.word_w // 8}").view(DTYPES[form]) for operand in (a, b))
    less, equal, unordered, flags = floating.compare(a, b, form)
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(less, x < y)
        np.testing.assert_array_equal(equal, x == y)
        np.testing.assert_array_equal(unordered, np.isnan(x) | np.isnan(y))
    signalling = [
        (z & np.uint64(form.sign - 1) > form.infinity) & (z & np.uint64(1 << form.frac_w - 1) == 0) for z in (a, b)
    ]
    np.testing.assert_array_equal(flags, np.where(signalling[0] | signalling[1], INVALID, 0))


@pytest.mark.parametrize(
    ("form", "dtype"), [(BINARY16, np.float16), (BINARY32, np.float32), (BINARY64, np.float64)], ids=str
)
def test_scaled_integers_are_converted_in_one_rounding(form: Format, dtype: type[np.floating[Any]]) -> None:
    integers = np.concatenate(
        [np.arange(-300_000, 300_000, 7), np.random.default_rng(8).integers(-(2**18), 2**18, 5000)]
    )
    result, flags = floating.from_int(integers, form, -11)
    # numpy's integers of 19 bits are exact in float64, so is their scaling, and the cast rounds once.
    expected = (integers * 2.0**-11).astype(dtype)
    np.testing.assert_array_equal(result, expected.view(f"u{form.word_w // 8}").astype(np.uint64))
    np.testing.assert_array_equal(flags & floating.INEXACT != 0, expected.astype(float) != integers * 2.0**-11)


def test_the_largest_second_difference_is_finite_in_binary16_only_when_scaled() -> None:
    scaled, _ = floating.from_int(np.array([188_324]), BINARY16, -11)
    unscaled, flags = floating.from_int(np.array([188_324]), BINARY16)
    assert scaled[0] == np.float16(188_324 / 2048).view(np.uint16)
    assert unscaled[0] == BINARY16.infinity
    assert flags[0] == floating.OVERFLOW | floating.INEXACT


def test_fixed_point_rounds_to_even_and_saturates() -> None:
    numbers = np.array(
        [0.5, 1.5, 2.5, -0.5, -1.5, 127.4, 127.5, -128.5, -128.6, 1e30, -1e30, np.inf, -np.inf, np.nan, 1e-300]
    )
    value_out, flags = floating.to_fixed(numbers.view(np.uint64), BINARY64, 8, 0)
    assert value_out.tolist() == [0, 2, 2, 0, -2, 127, 127, -128, -128, 127, -128, 127, -128, 127, 0]
    inexact, invalid = floating.INEXACT, INVALID
    assert flags.tolist() == [inexact] * 6 + [invalid, inexact] + [invalid] * 6 + [inexact]


@pytest.mark.parametrize("form", [SMALL, TALL, BFLOAT16], ids=str)
def test_conversions_to_fixed_point_and_back_lose_nothing_where_all_bits_fit(form: Format) -> None:
    every = np.arange(1 << form.word_w)
    finite = every[(every & form.sign - 1) < form.infinity]
    finite = finite[(finite & form.sign - 1) != 0]
    int_w, frac = form.bias + 2, -form.lowest
    fixed, flags = floating.to_fixed(finite, form, int_w, frac)
    back, back_flags = floating.from_int(fixed, form, -frac)
    assert not flags.any()
    assert not back_flags.any()
    np.testing.assert_array_equal(back, finite)


@pytest.mark.parametrize(("exp_w", "frac_w"), [(2, 5), (3, 1), (11, 53)])
def test_formats_that_cannot_work_are_refused(exp_w: int, frac_w: int) -> None:
    with pytest.raises(ValueError, match="expected exp_w of at least 3"):
        Format(exp_w, frac_w)
