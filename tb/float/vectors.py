"""Operands: every case that a unit treats on its own, then random ones that are dense where it is hard."""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt

from openecho.golden.floating import Format

Vectors = npt.NDArray[np.void]
"""Records of `VECTOR`."""
Words = npt.NDArray[np.uint64]
VECTOR = np.dtype([("control", "u1"), ("a", ">u8"), ("b", ">u8")])
"""As openecho_float_lane reads them."""
SUBTRACT, DIVIDE = 1, 2
"""Bits of `control`, which units that don't have the choice ignore; with DIVIDE, so is SUBTRACT."""


def pairs(form: Format, count: int, rng: np.random.Generator) -> Vectors:
    """Pairs of words, `count` of them and no fewer than the directed ones; control at random, but 0 for the first."""
    first = np.array([[form.bias << form.frac_w] * 2], np.uint64)  # 1 and 1, for the latency
    directed = np.concatenate([first, _special_pairs(form), _close_pairs(form, rng), _halfway_pairs(form, rng)])
    missing = max(count - len(directed), 0)
    return _vectors(np.concatenate([directed, _random_pairs(form, missing, rng)]), rng)


def all_pairs(form: Format) -> Vectors:
    """Every pair of words, to be added, then to be subtracted, then to be divided."""
    a, b = np.divmod(np.arange(1 << 2 * form.word_w), 1 << form.word_w)
    controls = (0, SUBTRACT, DIVIDE)
    vectors = np.zeros(len(controls) * a.size, VECTOR)
    vectors["a"], vectors["b"] = np.tile(a, len(controls)), np.tile(b, len(controls))
    vectors["control"] = np.repeat(controls, a.size)
    return vectors


def integers(int_w: int, count: int, rng: np.random.Generator) -> Vectors:
    """Signed integers as `a`: all if `count` allows, or else of every length, many with zeros at the end."""
    if 1 << int_w <= count:
        values = np.arange(-(1 << int_w - 1), 1 << int_w - 1)
    else:
        limits = [(1 << int_w - 1) - 1, -(1 << int_w - 1), 0, 1, -1]
        steps = [sign * (1 << k) + d for k in range(int_w - 1) for d in (-1, 0, 1) for sign in (1, -1)]
        n = max(count - len(limits) - len(steps), 0)
        noise = rng.integers(-(1 << 63), 1 << 63, n) >> 64 - rng.integers(1, int_w, n, endpoint=True)
        noise = noise & -(1 << rng.integers(0, int_w, n)) | rng.integers(0, 2, n)
        values = np.concatenate([limits, steps, noise])
    vectors = np.zeros(values.size, VECTOR)
    vectors["a"] = values.astype(np.int64).view(np.uint64)
    return vectors


def words(form: Format, int_w: int, frac: int, count: int, rng: np.random.Generator) -> Vectors:
    """Words as `a`: all if `count` allows, or else dense about the range and the last place of a fixed point."""
    chosen: Words
    if 1 << form.word_w <= count:
        chosen = np.arange(1 << form.word_w, dtype=np.uint64)
    else:
        special = specials(form)
        n = max(count - special.size, 0)
        exponent = rng.integers(form.bias - frac - 3, form.bias + int_w + 2, n).clip(0, (1 << form.exp_w) - 1)
        exponent = np.where(rng.random(n) < 0.1, rng.integers(0, 1 << form.exp_w, n), exponent)
        chosen = np.concatenate([special, _join(form, rng.integers(0, 2, n), exponent, _fractions(form, n, rng))])
    vectors = np.zeros(chosen.size, VECTOR)
    vectors["a"] = chosen
    return vectors


def alike(form: Format, count: int, rng: np.random.Generator) -> Vectors:
    """Pairs of random numbers from 1 to 16, control at random."""
    words = [
        _join(form, np.zeros(count, np.int64), form.bias + rng.integers(0, 4, count), _fractions(form, count, rng))
        for _ in range(2)
    ]
    return _vectors(np.column_stack(words), rng)


def specials(form: Format) -> Words:
    """Both signs of 0, least and greatest subnormal, least normal, 1, 1±ulp, greatest, infinity, NaNs of both kinds."""
    one, infinity = form.bias << form.frac_w, form.infinity
    quiet = 1 << form.frac_w - 1
    positive = [
        *(0, 1, (1 << form.frac_w) - 1, 1 << form.frac_w, one - 1, one, one + 1, infinity - 1, infinity),
        *(infinity | quiet, infinity | quiet | 1, infinity | 1, infinity | quiet - 1),
    ]
    return np.array([word | sign for word in positive for sign in (0, form.sign)], np.uint64)


def _special_pairs(form: Format) -> Words:
    return np.array(list(product(specials(form).tolist(), repeat=2)), np.uint64)


def _close_pairs(form: Format, rng: np.random.Generator) -> Words:
    """Exponents from equal to further apart than the fraction is wide; cancellation to every count of zeros."""
    rows = []
    top = (1 << form.exp_w) - 2
    for distance in range(form.frac_w + 6):
        high = rng.integers(min(distance + 1, top), top, 24, endpoint=True)
        low = np.maximum(high - distance, 0)
        for fractions in (_fractions(form, 24, rng), np.zeros(24, np.int64), np.full(24, (1 << form.frac_w) - 1)):
            a = _join(form, rng.integers(0, 2, 24), high, fractions)
            rows.append(np.column_stack([a, _join(form, rng.integers(0, 2, 24), low, _fractions(form, 24, rng))]))
            rows.append(rows[-1][:, ::-1])
    for zeros in range(form.frac_w + 1):
        a = _random_words(form, 24, rng)
        change = np.uint64(1) << np.uint64(form.frac_w - zeros)
        low = rng.integers(0, 1 << form.frac_w - zeros, 24).astype(np.uint64)
        # From a power of two the difference reaches into the exponent below.
        power = a & ~np.uint64((1 << form.frac_w) - 1)
        below = np.maximum(power & np.uint64(form.sign - 1), low + np.uint64(1)) - low - np.uint64(1)
        rows += [np.column_stack([a, b]) for b in (a ^ change, a ^ low, a ^ change ^ low)]
        rows.append(np.column_stack([power, below | power & np.uint64(form.sign)]))
    return np.concatenate(rows)


def _halfway_pairs(form: Format, rng: np.random.Generator) -> Words:
    """Sums half-way between two numbers or just beside it; products of a bit more than fits; exact quotients."""
    n, f = 200, form.frac_w
    rows = []
    high = rng.integers(min(f + 2, (1 << form.exp_w) - 2), (1 << form.exp_w) - 2, n, endpoint=True)
    for fraction in (0, 1, (1 << f) - 1):
        a = _join(form, rng.integers(0, 2, n), high, _fractions(form, n, rng))
        half = _join(form, rng.integers(0, 2, n), np.maximum(high - f - 1, 0), np.full(n, fraction))
        rows.append(np.column_stack([a, half]))
    for a_w in range(2, f + 2):
        # Odd significands of frac_w + 3 bits together: their product ends one or two bits behind the last place.
        b_w = f + 3 - a_w
        odd = (rng.integers(1 << bits - 1, 1 << bits, 40) | 1 for bits in (a_w, b_w))
        left, right = ((x << f + 1 - bits) & (1 << f) - 1 for x, bits in zip(odd, (a_w, b_w), strict=True))
        e = rng.integers(0, (1 << form.exp_w) - 1, 40)
        other = (form.bias - e + rng.integers(-f - 2, 4, 40)) % ((1 << form.exp_w) - 1)
        rows.append(np.column_stack([_join(form, rng.integers(0, 2, 40), e, left), _join(form, 0 * e, other, right)]))
        divisor = _join(form, rng.integers(0, 2, 40), other, 0 * e)
        rows.append(np.column_stack([_join(form, 0 * e, e, left), divisor]))
    return np.concatenate(rows)


def _random_pairs(form: Format, count: int, rng: np.random.Generator) -> Words:
    """A quarter each: any words; products and quotients about either end of the range; sums that overlap."""
    a = _random_words(form, count, rng)
    kind = rng.integers(0, 4, count)
    e = (a >> np.uint64(form.frac_w)).astype(np.int64) & (1 << form.exp_w) - 1
    low, high = -form.frac_w - 3, (1 << form.exp_w) + 2
    aim = np.where(rng.random(count) < 0.7, rng.integers(low, 4, count), rng.integers(high - 6, high, count))
    near = e + rng.integers(-form.frac_w - 4, form.frac_w + 5, count)
    exponent = np.choose(
        kind, [rng.integers(0, 1 << form.exp_w, count), aim - e + form.bias, e - aim + form.bias, near]
    )
    b = _join(form, rng.integers(0, 2, count), exponent.clip(0, (1 << form.exp_w) - 1), _fractions(form, count, rng))
    return np.column_stack([a, b])


def _random_words(form: Format, count: int, rng: np.random.Generator) -> Words:
    exponent = rng.integers(0, (1 << form.exp_w) - 1, count)
    exponent = np.where(rng.random(count) < 0.1, 0, exponent)
    return _join(form, rng.integers(0, 2, count), exponent, _fractions(form, count, rng))


def _fractions(form: Format, count: int, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Half of them any; the others with three neighbouring bits that differ from all the rest."""
    full = (1 << form.frac_w) - 1
    uniform = rng.integers(0, full, count, endpoint=True)
    sparse = (rng.integers(0, 8, count) << rng.integers(0, form.frac_w, count)) & full
    return np.where(rng.random(count) < 0.5, uniform, np.where(rng.random(count) < 0.5, sparse, full ^ sparse))


def _join(
    form: Format, sign: npt.NDArray[np.int64], exponent: npt.NDArray[np.int64], fraction: npt.NDArray[np.int64]
) -> Words:
    magnitude = (exponent.astype(np.uint64) << np.uint64(form.frac_w)) | fraction.astype(np.uint64)
    return magnitude | sign.astype(np.uint64) << np.uint64(form.word_w - 1)


def _vectors(words: Words, rng: np.random.Generator) -> Vectors:
    vectors = np.zeros(len(words), VECTOR)
    vectors["a"], vectors["b"] = words.T
    vectors["control"][1:] = rng.integers(0, SUBTRACT | DIVIDE, len(words) - 1, endpoint=True)
    return vectors
