"""The compiler that loops over samples need, and what to do where it is missing."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

try:
    import numba
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("numba is not installed, expected it: pip install 'openecho[fit]'") from error

__all__ = ["njit", "share"]

config: Any = numba.config

PACKAGE = Path(__file__).parent
ROOMS = ("codec", "decompose", "enhance", "scene", "surface")
"""Where there are functions to compile."""

WORTH_A_THREAD = 64
"""Waveforms: a thread takes longer to start than fewer of them to fit."""


def _folder() -> str:
    """Where compiled code is kept for the next start: a folder for each state of the sources.

    Numba looks at the file of a function alone, and would go on with the old code of another that it calls.
    """
    sources = b"".join(path.read_bytes() for room in ROOMS for path in sorted((PACKAGE / room).rglob("*.py")))
    return str(PACKAGE / "__pycache__" / f"compiled-{hashlib.sha256(sources).hexdigest()[:16]}")


FOLDER = _folder() if os.access(PACKAGE, os.W_OK) else config.CACHE_DIR


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function when it is first called, and keep the code on disk, so that a second start pays nothing."""

    def compiled(function: Callable[..., Any]) -> Any:
        before = config.CACHE_DIR
        config.CACHE_DIR = before or FOLDER
        try:
            return numba.njit(cache=True, **options)(function)
        finally:
            config.CACHE_DIR = before

    return compiled


def share(kernel: Callable[..., Any], waveforms: int, *arguments: Any, worth: int = WORTH_A_THREAD) -> None:
    """Call a compiled kernel, which holds no lock (`nogil`), for ranges of waveforms, on as many threads as numba has.

    Not with numba's own `prange`, for that takes no tuples of arrays.

    Parameters
    ----------
    kernel : callable
        Of the first waveform, the last and one, and the arguments.
    waveforms : int
        How many there are.
    *arguments
        What the kernel reads, and arrays that it fills.
    worth : int
        Waveforms that are worth a thread.
    """
    threads = max(1, min(numba.get_num_threads(), waveforms // worth))
    if threads == 1:
        kernel(0, waveforms, *arguments)
        return
    # Four ranges a thread: some waveforms take longer.
    edges = np.linspace(0, waveforms, min(4 * threads, waveforms) + 1).astype(np.int64)
    tasks = [_pool(threads).submit(kernel, *edge, *arguments) for edge in pairwise(edges)]
    for task in tasks:
        task.result()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads)
