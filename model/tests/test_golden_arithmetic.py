"""The arithmetic of the floating-point core, against numpy's floats and exact fractions."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from openecho.golden import arithmetic
from openecho.golden.floating import BFLOAT16, BINARY16, BINARY32, BINARY64, Format
from openecho.golden.parameters import TIME_DIVISOR, time_divisor

DTYPES = {BINARY16: np.float16, BINARY32: np.float32, BINARY64: np.float64}
ODD = Format(6, 17)
FORMATS = [*DTYPES, BFLOAT16, ODD]


@pytest.fixture(params=["numpy", "exact"])
def either_way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a test in numpy's arithmetic and in that of `floating`."""
    if request.param == "exact":
        monkeypatch.setattr(arithmetic, "DTYPES", {})


def random_words(form: Format, count: int, seed: int) -> np.ndarray:
    """Words of any kind, two's complement."""
    print(f"seed {seed}")
    half = 1 << (form.word_w - 1)
    return np.random.default_rng(seed).integers(-half, half - 1, count, dtype=np.int64, endpoint=True)


def number(value: float, form: Format) -> np.ndarray:
    """Word of a short binary fraction."""
    return arithmetic.from_int(int(value * 16), form, -4)


@pytest.mark.parametrize("form", DTYPES, ids=str)
def test_words_decode_as_numpys_floats(form: Format) -> None:
    words = random_words(form, 20_000, seed=1)
    bits = words.astype(f"i{form.word_w // 8}")
    special = np.array([0, 1, form.infinity, form.infinity - 1, form.nan, 1 << form.frac_w], np.int64)
    bits = np.concatenate([bits, special.astype(bits.dtype), ~special.astype(bits.dtype)])
    with np.errstate(invalid="ignore"):
        expected = bits.view(DTYPES[form]).astype(np.float64)
    np.testing.assert_array_equal(arithmetic.decode(bits.astype(np.int64), form), expected)


def test_every_bfloat16_decodes_as_the_upper_half_of_a_binary32() -> None:
    words = np.arange(-(1 << 15), 1 << 15)
    with np.errstate(invalid="ignore"):
        expected = (words.astype(np.int32) << 16).view(np.float32).astype(np.float64)
    np.testing.assert_array_equal(arithmetic.decode(words, BFLOAT16), expected)


def test_bits_above_a_number_are_not_looked_at() -> None:
    words = random_words(ODD, 1000, seed=2)
    np.testing.assert_array_equal(
        arithmetic.decode(words & ((1 << ODD.word_w) - 1), ODD), arithmetic.decode(words, ODD)
    )


@pytest.mark.usefixtures("either_way")
@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_only_positive_numbers_are_positive_words(form: Format) -> None:
    integers = np.arange(-3, 4)
    words = arithmetic.from_int(integers, form, -2)
    np.testing.assert_array_equal(words > 0, integers > 0)
    np.testing.assert_array_equal(words < 0, integers < 0)
    assert arithmetic.decode(words, form).tolist() == (integers / 4).tolist()
    minus_zero = arithmetic.div(number(0, form), number(-1, form), form)
    assert minus_zero.tolist() == [-(1 << (form.word_w - 1))]


@pytest.mark.usefixtures("either_way")
@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_short_fractions_are_calculated_exactly(form: Format) -> None:
    a, b = number(6.5, form), number(-1.625, form)
    results = {arithmetic.add: 4.875, arithmetic.sub: 8.125, arithmetic.div: -4.0}
    for operation, expected in results.items():
        assert arithmetic.decode(operation(a, b, form), form).tolist() == [expected]
    assert arithmetic.decode(arithmetic.magnitude(b, form), form).tolist() == [1.625]


@pytest.mark.parametrize("form", DTYPES, ids=str)
@pytest.mark.parametrize("name", ["add", "sub", "div"])
def test_numpy_and_the_exact_model_agree(name: str, form: Format, monkeypatch: pytest.MonkeyPatch) -> None:
    operation: Callable[..., np.ndarray] = getattr(arithmetic, name)
    integers = np.random.default_rng(3).integers(-(1 << 18), 1 << 18, (2, 5000))
    integers[1, integers[1] == 0] = 1
    operands = [arithmetic.from_int(values, form, -11) for values in integers]
    quick = operation(*operands, form)
    monkeypatch.setattr(arithmetic, "DTYPES", {})
    for values, words in zip(integers, operands, strict=True):
        np.testing.assert_array_equal(arithmetic.from_int(values, form, -11), words)
    np.testing.assert_array_equal(operation(*operands, form), quick)


@pytest.mark.usefixtures("either_way")
@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_what_the_core_never_does_raises(form: Format) -> None:
    largest, infinity = np.array([form.infinity - 1]), np.array([form.infinity])
    for operation, a, b in (
        (arithmetic.add, largest, largest),
        (arithmetic.sub, infinity, infinity),
        (arithmetic.div, largest, number(0.5, form)),
        (arithmetic.div, number(1, form), number(0, form)),
        (arithmetic.div, number(0, form), number(0, form)),
    ):
        with pytest.raises(FloatingPointError):
            operation(a, b, form)


@pytest.mark.usefixtures("either_way")
def test_an_integer_beyond_the_format_raises() -> None:
    assert arithmetic.decode(arithmetic.from_int(65519, BINARY16), BINARY16).tolist() == [65504]
    with pytest.raises(FloatingPointError, match="overflow"):
        arithmetic.from_int(65520, BINARY16)


@pytest.mark.usefixtures("either_way")
def test_underflow_is_ordinary() -> None:
    least = np.array([1])
    assert arithmetic.div(least, number(4, BINARY16), BINARY16).tolist() == [0]
    assert arithmetic.div(least, number(-1.5, BINARY16), BINARY16).tolist() == [1 - (1 << 15)]


@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_the_divisor_of_the_echo_time_is_the_nearest_number(form: Format) -> None:
    nearest = Fraction(arithmetic.decode(arithmetic.constant(TIME_DIVISOR, form), form).item())
    assert_nearest_divisor(nearest, form.frac_w)


@pytest.mark.parametrize("frac", [11, 28, 40])
def test_the_divisor_of_the_echo_time_is_the_nearest_in_fixed_point(frac: int) -> None:
    assert_nearest_divisor(Fraction(time_divisor(frac), 1 << frac), frac)


def assert_nearest_divisor(found: Fraction, frac: int) -> None:
    # K² = 2/ln 2, and ln 2 = Σ 1/(k·2^k): the square lies between those of the middles to the neighbours.
    squared = 2 / sum(Fraction(1, k << k) for k in range(1, 200))
    half_place = Fraction(1, 2 << frac)
    assert (found - half_place) ** 2 < squared < (found + half_place) ** 2
