"""Decomposition of a whole file into a table of echoes."""

from __future__ import annotations

import ctypes
import datetime as dt
import os
import threading
from collections.abc import Callable, Collection, Iterator
from dataclasses import asdict, dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np

from openecho import __version__, formats, tables
from openecho.batch.distribute import run
from openecho.batch.store import Store, open_store, written
from openecho.decompose import Decomposition, Method, dtype, prepare, troubles
from openecho.formats import Block, Recording
from openecho.formats.recording import check_bits
from openecho.tables import Table

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""glibc's names of two settings of its allocator: see mallopt(3)."""

KEPT = 2**28
"""Bytes of freed memory that a process keeps at most: more than a block takes."""

WORTH_A_CLUSTER = 2**28
"""Samples from which on a local cluster, which takes a second to start, is faster even with two processors."""

Advance: TypeAlias = Callable[[str, int, int | None], object]
"""What is told of progress: what is being done, to how many waveforms, and of how many, if that is known."""


@dataclass(frozen=True)
class Job:
    """What is to be decomposed, into what, and how.

    Attributes
    ----------
    source : Path
        Recorded waveforms.
    output : Path
        Table of echoes; its suffix names the format.
    method : str
        One of `openecho.decompose.METHODS`.
    bin_ns : float or None
        Sample interval in nanoseconds, for recordings that don't tell it.
    settings : dict
        Of the method, as `openecho.decompose.prepare` takes them.
    jobs : int or None
        Processes on this machine; None: as many as finish first.
    scheduler : str or None
        Address of a Dask cluster.
    """

    source: Path
    output: Path
    method: str
    bin_ns: float | None
    settings: dict[str, Any]
    jobs: int | None = None
    scheduler: str | None = None


@dataclass(frozen=True)
class Result:
    """What became of a job.

    Attributes
    ----------
    waveforms, echoes, written : int
        Waveforms decomposed, echoes found in them, and echoes in the file: those without a position are in no LAS.
    resumed : int
        Waveforms that an interrupted run had decomposed before.
    troubles : dict
        Waveforms that could not be treated as any other, by what was the matter.
    """

    waveforms: int
    echoes: int
    written: int
    resumed: int
    troubles: dict[str, int]


def decompose_file(job: Job, advance: Advance = lambda doing, done, total: None) -> Result:
    """Decompose a file of any size and write its echoes, in memory for a few blocks.

    The result is in place only when it is complete. Finished blocks are kept beside it until then, so that the same
    job goes on where it was interrupted; its bytes depend neither on that, nor on processes or machines.

    Parameters
    ----------
    job : Job
    advance : callable, optional
        Told of the progress.

    Returns
    -------
    Result

    Raises
    ------
    DataError, TableError, StoreError, EngineError, DistributionError, ValueError, ModuleNotFoundError
        One line with what was found and what was expected: in the recording, of the output, of the blocks of an
        earlier run, of the engine, of the cluster, of a setting.
    OSError
        If something can't be written: disk full, no permission.
    """
    with formats.open(job.source) as recording:
        method = prepare(job.method, recording.longest, job.settings)
        bin_ns = recording.bin_ns if job.bin_ns is None else job.bin_ns
        known = (*method.columns, *_known(recording, bin_ns))
        tables.check(job.output, known)
        plan = recording.plan()
        with open_store(job.output, _description(job, recording, len(plan), method, bin_ns)) as store:
            finished = store.finished()
            resumed = done = sum(plan[number][1] for number in finished)
            advance("decomposing", done, recording.waveforms)
            processes = _processes(job, recording)
            alone = processes == 1 and job.scheduler is None
            source = recording if alone else _Shared(recording.path.resolve(), recording.path.stat().st_mtime_ns)
            left = (
                (number, (source, first, count, known, method, bin_ns))
                for number, (first, count) in enumerate(plan)
                if number not in finished
            )
            for number, found in run(_decompose_rows, left, processes, job.scheduler):
                store.put(number, echoes=found.echoes, waveforms=found.waveforms)
                done += plan[number][1]
                advance("decomposing", done, recording.waveforms)
            advance("writing", 0, None)
            return _write(recording, store, len(plan), known, bin_ns, resumed)


def decompose_block(block: Block, known: Collection[str], method: Method, bin_ns: float | None) -> Decomposition:
    """Decompose a block, and add to its echoes what the recording tells of their waveforms.

    Parameters
    ----------
    block : Block
    known : collection of str
        What the recording and the method tell, of the words in `Column.needs`.
    method : Method
        With its settings.
    bin_ns : float or None
        Sample interval in nanoseconds.

    Returns
    -------
    Decomposition
        Its echoes have the columns of `known`, and `waveform` counts through the whole recording.
    """
    found = method(block.samples, block.length, bin_ns)
    row = found.echoes["waveform"]
    echoes = np.zeros(len(row), dtype(known))
    for name in found.echoes.dtype.names or ():
        echoes[name] = found.echoes[name]
    echoes["waveform"] += block.first
    if block.geolocation is not None and "geolocation" in known:
        first, last = block.geolocation.first[row], block.geolocation.last[row]
        # An echo needs several samples, so a waveform of one sample, which has no direction, has none.
        share = echoes["peak"] / (block.length[row] - 1)
        for axis, name in enumerate("xyz"):
            echoes[name] = first[:, axis] + share * (last[:, axis] - first[:, axis])
    for need, name, values in (("time", "shot_time", block.time), ("shot", "shot", block.shot)):
        if need in known and values is not None:
            echoes[name] = values[row]
    if "beam" in known:
        echoes["beam"] = block.beam
    return Decomposition(echoes, found.waveforms, found.pulse)


def _known(recording: Recording, bin_ns: float | None) -> tuple[str, ...]:
    """What the recording tells of all its waveforms, of the words in `Column.needs`."""
    starts = np.cumsum([0, *(count for _, count in recording.parts)])[:-1]
    tells = {
        "bin_ns": bin_ns is not None,
        "geolocation": recording.coordinates is not None,
        "time": recording.time_unit is not None,
        "shot": all(recording.read(int(first), 1).shot is not None for first in starts),
        "beam": recording.parts[0][0] is not None,
    }
    return tuple(need for need, told in tells.items() if told)


@dataclass(frozen=True)
class _Shared:
    """A recording that every worker opens itself: what crosses the network is where it is, and its echoes."""

    path: Path
    modified: int


_reading = threading.Lock()
"""Held while a recording is read: a worker may have several threads, and files have one place where they are read."""


@lru_cache(maxsize=1)
def _opened(shared: _Shared) -> Recording:
    """Recording as this worker has opened it, once for all blocks."""
    return formats.open(shared.path)


@cache
def _keep_freed_memory() -> None:
    """Tell glibc to keep what a block frees for the next one, where it can be told.

    Else the kernel clears the same few megabytes again for every array: that was a third of all time in one process,
    and more than half on Dask's workers, which return memory at once.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_TRIM_THRESHOLD, KEPT)
        mallopt(M_MMAP_THRESHOLD, KEPT)


def _decompose_rows(
    source: Recording | _Shared,
    first: int,
    count: int,
    known: Collection[str],
    method: Method,
    bin_ns: float | None,
) -> Decomposition:
    """Read a block and decompose it, here or on a worker."""
    _keep_freed_memory()
    with _reading:
        recording = _opened(source) if isinstance(source, _Shared) else source
        block = recording.read(first, count)
    check_bits(recording.path, block, method.sample_w)
    return decompose_block(block, known, method, bin_ns)


def _description(job: Job, recording: Recording, blocks: int, method: Method, bin_ns: float | None) -> dict[str, Any]:
    """Everything that the blocks depend on."""
    status = recording.path.stat()
    settings = asdict(cast(Any, method))
    settings |= settings.pop("config", {})
    return {
        "version": __version__,
        "source": str(recording.path.resolve()),
        "bytes": status.st_size,
        "modified": status.st_mtime_ns,
        "blocks": blocks,
        "bin_ns": bin_ns,
        "method": job.method,
        **settings,
    }


def _processes(job: Job, recording: Recording) -> int:
    """Processes on this machine: as asked for, or all processors if there is enough for them to do."""
    if job.jobs is not None:
        return job.jobs
    return len(os.sched_getaffinity(0)) if recording.waveforms * recording.longest >= WORTH_A_CLUSTER else 1


def _write(
    recording: Recording, store: Store, blocks: int, known: Collection[str], bin_ns: float | None, resumed: int
) -> Result:
    """Join the blocks into the table."""
    waveforms = np.concatenate([store.get(number, "waveforms") for number in range(blocks)])
    echoes = int(waveforms["echoes"].sum())

    def all_blocks() -> Iterator[np.ndarray]:
        return (store.get(number, "echoes") for number in range(blocks))

    table = Table(
        dtype=dtype(known),
        rows=echoes,
        blocks=all_blocks,
        bin_ns=bin_ns,
        resolution=recording.resolution,
        wkt=recording.wkt,
        beams=tuple(sorted(name for name, _ in recording.parts if name is not None)),
        time_unit=recording.time_unit,
        date=dt.datetime.fromtimestamp(recording.path.stat().st_mtime, dt.UTC).date(),
    )
    made = store.folder / f"table{store.result.suffix}"
    with written(made):
        count = tables.write(made, table)
    store.finish(made)
    return Result(len(waveforms), echoes, count, resumed, troubles(waveforms))
