"""Calls of one function on many blocks: in this process, on several of this machine, or on a Dask cluster."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from typing import Any

AHEAD = 3
"""Blocks in flight for each thread of the workers: one at work, one on its way there, one on its way back."""

TIMEOUT = 20
"""Seconds in which a scheduler must answer."""


class DistributionError(RuntimeError):
    """A cluster that can't be used: one line with its address, what was found and what was expected."""


def run(
    function: Callable[..., Any], calls: Iterable[tuple[int, tuple[Any, ...]]], jobs: int, scheduler: str | None
) -> Iterator[tuple[int, Any]]:
    """Call a function on many arguments and yield what it returns, in whatever order it comes.

    Parameters
    ----------
    function : callable
        Of a module that the workers have too.
    calls : iterable of (int, tuple)
        Number and arguments of each call; taken only as fast as they are worked off.
    jobs : int
        Processes on this machine: 1 is this one, more are workers of a local Dask cluster.
    scheduler : str or None
        Address of an existing Dask cluster, whose workers are taken instead.

    Yields
    ------
    (int, object)
        Number and result.

    Raises
    ------
    DistributionError
        If the scheduler does not answer or is lost. What `function` raises comes through as it is.
    """
    if scheduler is None and jobs == 1:
        for number, arguments in calls:
            yield number, function(*arguments)
        return
    yield from _on_dask(function, calls, jobs, scheduler)


def _on_dask(
    function: Callable[..., Any], calls: Iterable[tuple[int, tuple[Any, ...]]], jobs: int, scheduler: str | None
) -> Iterator[tuple[int, Any]]:
    # A second to import, for which nobody waits who does not use it; and without types.
    distributed: Any = importlib.import_module("distributed")

    with ExitStack() as stack:
        if scheduler is None:
            scheduler = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=jobs,
                    threads_per_worker=1,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )
            )
        try:
            client = stack.enter_context(distributed.Client(scheduler, timeout=TIMEOUT, set_as_default=False))
        except (OSError, TimeoutError, ValueError) as error:
            raise DistributionError(f"{scheduler}: no answer within {TIMEOUT} s, expected a Dask scheduler") from error
        threads = sum(client.nthreads().values())
        if not threads:
            raise DistributionError(f"{scheduler}: found no workers, expected at least one")
        calls = iter(calls)
        numbers: dict[str, int] = {}
        done = distributed.as_completed(loop=client.loop)

        def submit_next() -> None:
            for number, arguments in calls:
                future = client.submit(function, *arguments, pure=False)
                numbers[future.key] = number
                done.add(future)
                return

        for _ in range(AHEAD * threads):
            submit_next()
        try:
            for future in done:
                result = future.result()
                submit_next()
                yield numbers.pop(future.key), result
        except distributed.CancelledError as error:
            raise DistributionError(f"{scheduler}: lost the cluster, expected it to stay") from error
