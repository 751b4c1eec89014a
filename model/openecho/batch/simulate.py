"""Simulation of a whole scene into a file of waveforms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho import __version__
from openecho.batch.decompose import Advance
from openecho.batch.distribute import run
from openecho.batch.store import Store, open_store, written
from openecho.formats.writers import Content, writer
from openecho.scene.schema import Scene, Section, dumped, loads
from openecho.scene.simulate import TRUTH, Simulated, Simulator, blocks, simulate, simulator


@dataclass(frozen=True)
class Simulation:
    """What is to be simulated, into what, and how.

    Attributes
    ----------
    scene : Scene
    output : Path
        File of waveforms; its suffix names the format.
    fidelity : str
        One of `openecho.scene.plan.FIDELITIES`.
    rays : int or None
        Of every beam; None: as many as it takes.
    noiseless : bool
        Whether to keep the waveforms without noise, too.
    jobs : int
        Processes on this machine; each uses all processors that it can.
    scheduler : str or None
        Address of a Dask cluster.
    """

    scene: Scene
    output: Path
    fidelity: str = "plan"
    rays: int | None = None
    noiseless: bool = False
    jobs: int = 1
    scheduler: str | None = None


@dataclass(frozen=True)
class SimulationResult:
    """What became of it.

    Attributes
    ----------
    waveforms, surfaces, resumed : int
        Waveforms in the file, objects that they met, and waveforms that an interrupted run had made before.
    """

    waveforms: int
    surfaces: int
    resumed: int


def simulate_file(job: Simulation, advance: Advance = lambda doing, done, total: None) -> SimulationResult:
    """Simulate a scene of any number of shots, in memory for a few blocks.

    The result is in place only when it is complete. Finished blocks are kept beside it until then, so that the same
    job goes on where it was interrupted; its bytes depend neither on that, nor on processes or machines.

    Parameters
    ----------
    job : Simulation
    advance : callable, optional
        Told of the progress.

    Returns
    -------
    SimulationResult

    Raises
    ------
    DataError, SceneError, StoreError, DistributionError
        One line with what was found and what was expected: of the output, in the scene's files, of the blocks of an
        earlier run, of the cluster.
    OSError
        If something can't be read or written: a file that is gone, disk full, no permission.
    """
    write = writer(job.output)
    plan, each = blocks(job.scene), job.scene.beams
    shared = _Shared(dumped(job.scene), _files(job.scene), job.fidelity, job.rays)
    ready = _ready(shared)  # before anything is kept: its files may be of no use
    total = job.scene.shots * each
    with open_store(job.output, _description(job, shared)) as store:
        finished = store.finished()
        resumed = done = each * sum(plan[number][1] for number in finished)
        advance("simulating", done, total)
        left = ((number, (shared, *shots)) for number, shots in enumerate(plan) if number not in finished)
        for number, made in run(_simulate_block, left, job.jobs, job.scheduler):
            store.put(number, **_columns(made, noiseless=job.noiseless))
            done += each * plan[number][1]
            advance("simulating", done, total)
        advance("writing", 0, None)
        content = _content(job, ready, store, len(plan), shared.text)
        partial = store.folder / f"waveforms{job.output.suffix}"
        with written(partial):
            write(partial, content)
        store.finish(partial)
    return SimulationResult(total, content.columns["truth"][1][0], resumed)


@dataclass(frozen=True)
class _Shared:
    """What every worker makes its targets of.

    Attributes
    ----------
    text : str
        The scene as YAML.
    files : tuple of (str, int, int)
        Files that it names, with bytes and time of the last change, ns: of others, the targets are made anew.
    fidelity, rays
        As of `Simulation`.
    """

    text: str
    files: tuple[tuple[str, int, int], ...]
    fidelity: str
    rays: int | None


@lru_cache(maxsize=1)
def _ready(shared: _Shared) -> Simulator:
    """A scene's targets, made once for all blocks of a worker."""
    return simulator(loads(shared.text, Path("scene.yaml")), shared.fidelity, shared.rays)


def _simulate_block(shared: _Shared, first: int, shots: int) -> Simulated:
    return simulate(_ready(shared), first, shots)


def _files(scene: Scene) -> tuple[tuple[str, int, int], ...]:
    """Files that a scene names, as `_Shared` has them; the buffers that a glTF names are not among them."""
    known = ((path, path.stat()) for path in _paths(scene))
    return tuple((str(path), status.st_size, status.st_mtime_ns) for path, status in known)


def _paths(part: Any) -> Iterator[Path]:
    """Paths in a part of a scene: of a section, which hands out its keys with their values, or of a tuple."""
    if isinstance(part, Path):
        yield part
    elif isinstance(part, Section | tuple):
        for inner in part:
            yield from _paths(inner)


def _columns(made: Simulated, *, noiseless: bool) -> dict[str, NDArray[Any]]:
    columns: dict[str, NDArray[Any]] = {
        "samples": made.samples,
        "time": made.time,
        "first": made.first,
        "last": made.last,
        "truth": made.truth,
    }
    return columns | ({"noiseless": made.noiseless} if noiseless else {})


def _description(job: Simulation, shared: _Shared) -> dict[str, Any]:
    """Everything that the blocks depend on; key by key, so that one line says what differs."""
    settings = {"fidelity": job.fidelity, "rays": job.rays, "noiseless": job.noiseless}
    return {"version": __version__, **settings, **job.scene.model_dump(mode="json"), "files": shared.files}


def _content(job: Simulation, ready: Simulator, store: Store, count: int, text: str) -> Content:
    """The blocks as columns of a file."""
    n, m = job.scene.shots * job.scene.beams, job.scene.digitiser.samples
    surfaces = sum(len(store.get(number, "truth")) for number in range(count))
    columns: dict[str, tuple[np.dtype[Any], tuple[int, ...]]] = {
        "samples": (np.dtype(np.uint16), (n, m)),
        "time": (np.dtype(np.float64), (n,)),
        "first": (np.dtype(np.float64), (n, 3)),
        "last": (np.dtype(np.float64), (n, 3)),
        "truth": (TRUTH, (surfaces,)),
    }
    if job.noiseless:
        columns["noiseless"] = np.dtype(np.float32), (n, m)

    def pieces(name: str) -> Iterator[NDArray[Any]]:
        return (store.get(number, name) for number in range(count))

    pulse = ready.instrument.pulse[0]
    return Content(columns, pieces, 1e9 / job.scene.digitiser.rate, pulse / pulse.max(), text)
