"""Berkeley SoftFloat as reference: results and flags of arrays of words, its NaNs made canonical."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import softfloatpy

from openecho.golden.floating import BINARY16, BINARY32, BINARY64, INVALID, Format
from tb.float.vectors import SUBTRACT, Vectors

_PREFIX = {BINARY16: "f16", BINARY32: "f32", BINARY64: "f64"}
_TYPES: dict[Format, Any] = {
    BINARY16: softfloatpy.Float16,
    BINARY32: softfloatpy.Float32,
    BINARY64: softfloatpy.Float64,
}


def has(unit: str, form: Format, parameters: Mapping[str, int]) -> bool:
    """Whether SoftFloat has this operation."""
    if form not in _PREFIX:
        return False
    match unit:
        case "from_int":
            return parameters["SCALE"] == 0
        case "to_fixed":
            return parameters["FRAC"] == 0 and parameters["INT_W"] in (32, 64)
        case _:
            return True


def expected(unit: str, form: Format, parameters: Mapping[str, int], vectors: Vectors) -> tuple[np.ndarray, np.ndarray]:
    """Results as a lane writes them, and flags."""
    match unit:
        case "compare":
            return _compare(form, vectors)
        case "from_int":
            integers = vectors["a"].astype(">i8").tobytes()
            convert = getattr(softfloatpy, f"i64_to_{_PREFIX[form]}")
            values = [softfloatpy.Int64.from_bytes(integers[at : at + 8]) for at in range(0, len(integers), 8)]
            return _words(form, *_run(lambda value, _: convert(value), values, values))
        case "to_fixed":
            return _to_fixed(form, parameters["INT_W"], vectors)
        case "add":
            return _chosen(("add", "sub"), vectors["control"] & SUBTRACT, form, vectors)
        case "serial":
            return _chosen(("add", "sub", "div", "div"), vectors["control"], form, vectors)
        case _:
            return _operation(unit, form, vectors)


def _chosen(names: Sequence[str], choice: np.ndarray, form: Format, vectors: Vectors) -> tuple[np.ndarray, np.ndarray]:
    words, flags = np.empty(len(vectors), np.uint64), np.empty(len(vectors), np.uint8)
    for k, name in enumerate(names):
        words[choice == k], flags[choice == k] = _operation(name, form, vectors[choice == k])
    return words, flags


def _operation(name: str, form: Format, vectors: Vectors) -> tuple[np.ndarray, np.ndarray]:
    operation = getattr(softfloatpy, f"{_PREFIX[form]}_{name}")
    return _words(form, *_run(operation, _objects(form, vectors["a"]), _objects(form, vectors["b"])))


def _compare(form: Format, vectors: Vectors) -> tuple[np.ndarray, np.ndarray]:
    a, b = _objects(form, vectors["a"]), _objects(form, vectors["b"])
    less, flags = _run(getattr(softfloatpy, f"{_PREFIX[form]}_lt_quiet"), a, b)
    equal, _ = _run(getattr(softfloatpy, f"{_PREFIX[form]}_eq"), a, b)
    unordered = [x.is_nan() or y.is_nan() for x, y in zip(a, b, strict=True)]
    return (4 * np.array(less) + 2 * np.array(equal) + np.array(unordered)).astype(np.uint64), flags


def _to_fixed(form: Format, int_w: int, vectors: Vectors) -> tuple[np.ndarray, np.ndarray]:
    """Integers. Where invalid, SoftFloat's value is up to the platform that it was built for: our limits instead."""
    convert = getattr(softfloatpy, f"{_PREFIX[form]}_to_i{int_w}")
    operands = _objects(form, vectors["a"])
    results, flags = _run(lambda value, _: convert(value), operands, operands)
    values = np.array([result.to_int() for result in results], np.int64)
    nan = np.array([operand.is_nan() for operand in operands])
    negative = (vectors["a"] >> np.uint64(form.word_w - 1) == 1) & ~nan
    largest = (1 << int_w - 1) - 1
    values = np.where(flags == INVALID, np.where(negative, -largest - 1, largest), values)
    return values.view(np.uint64), flags


def _objects(form: Format, words: np.ndarray) -> list[Any]:
    size = form.word_w // 8
    data = words.astype(f">u{size}").tobytes()
    convert = _TYPES[form].from_bytes
    return [convert(data[at : at + size]) for at in range(0, len(data), size)]


def _words(form: Format, results: list[Any], flags: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    data = b"".join([result.to_bytes() for result in results])
    words = np.frombuffer(data, f">u{form.word_w // 8}").astype(np.uint64)
    return np.where(words & np.uint64(form.sign - 1) > form.infinity, np.uint64(form.nan), words), flags


def _run(operation: Callable[[Any, Any], Any], a: list[Any], b: list[Any]) -> tuple[list[Any], np.ndarray]:
    clear, read = softfloatpy.set_exception_flags, softfloatpy.get_exception_flags
    softfloatpy.set_rounding_mode(softfloatpy.RoundingMode.NEAR_EVEN)
    softfloatpy.set_tininess_mode(softfloatpy.TininessMode.AFTER_ROUNDING)
    results, flags = [], bytearray()
    for x, y in zip(a, b, strict=True):
        clear(0)
        results.append(operation(x, y))
        flags.append(int(read()))
    return results, np.frombuffer(bytes(flags), np.uint8)
