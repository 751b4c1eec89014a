"""A case: something extreme, what is guaranteed there, how that is checked, and a fault that the check must catch."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy as np


@dataclass(frozen=True)
class Trial:
    """One run of a check.

    Attributes
    ----------
    full : bool
        Whether all that there is shall be tried, or as much as takes about a second.
    rng : Generator
        Where all that is random comes from.
    """

    full: bool
    rng: np.random.Generator


@dataclass(frozen=True)
class Outcome:
    """What came of a check.

    Attributes
    ----------
    held : bool
        Whether the guarantee did.
    found : str
        In a few words, with the figure that decided.
    """

    held: bool
    found: str


@dataclass(frozen=True)
class Case:
    """Something extreme.

    Attributes
    ----------
    name, area : str
        Of the case, and the part of the project that it is about.
    tried, guarantee : str
        What is done, and what holds there; of a bound, where it comes from.
    check : callable
        Tries it.
    fault : str
        A mistake that somebody could make.
    planted : callable
        Makes that mistake in the project for as long as the context that it returns is entered.
    """

    name: str
    area: str
    tried: str
    guarantee: str
    check: Callable[[Trial], Outcome]
    fault: str
    planted: Callable[[], AbstractContextManager[Any]]

    def run(self, seed: int, full: bool) -> Outcome:
        """Check the guarantee; a crash breaks it."""
        try:
            return self.check(Trial(full, np.random.default_rng([seed, *self.name.encode()])))
        except (ArithmeticError, AssertionError, IndexError, ValueError) as error:
            return Outcome(False, f"{type(error).__name__}: {error}")

    def broken(self, seed: int) -> Outcome:
        """Check it with the fault in place; the guarantee should not hold."""
        with self.planted():
            return self.run(seed, full=False)


def planted(target: Any, name: str, wrong: Any) -> Callable[[], AbstractContextManager[Any]]:
    """A fault: another value for something that a module calls by name.

    Parameters
    ----------
    target : module or class
    name : str
        Of its function.
    wrong : object
        What stands there instead.
    """
    return lambda: mock.patch.object(target, name, wrong)


def bounded(figure: float, bound: float, what: str) -> Outcome:
    """Outcome of a figure that must not exceed a bound."""
    return Outcome(bool(figure <= bound), f"{what} {figure:.3g}, bound {bound:.3g}")


def equal(differing: int, checked: int, what: str) -> Outcome:
    """Outcome of things of which none may differ."""
    return Outcome(differing == 0 and checked > 0, f"{differing:,} differences in {checked:,} {what}")
