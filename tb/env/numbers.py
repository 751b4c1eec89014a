"""Numbers as the streams of a core carry them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.golden import Config, arithmetic

FRAC_FLOAT = 8
"""Fractional bits in which a test states the positions that it sends to a floating-point core."""


def any_value(greatest: int, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Random integers from 0 to the greatest that there is; one in five of them is at an end, or next to it."""
    anything = rng.integers(0, greatest, count, endpoint=True)
    return np.where(rng.random(count) < 0.2, rng.choice([0, 1, greatest - 1, greatest], count), anything)


def encoded(values: NDArray[np.int64], frac: int, config: Config) -> NDArray[np.int64]:
    """Integers times 2^-frac as floats of the configuration; in fixed point, the integers themselves."""
    return values if config.form is None else arithmetic.from_int(values, config.form, -frac)


def position_frac(config: Config) -> int:
    """Fractional bits in which to state a position that goes through `encoded`."""
    return config.frac if config.form is None else FRAC_FLOAT


def decoded(words: NDArray[Any], config: Config) -> NDArray[np.float64]:
    """Positions in bins from what a stream carried."""
    if config.form is None:
        return words.astype(np.int64) / (1 << config.frac)
    return arithmetic.decode(words.astype(np.int64), config.form)
