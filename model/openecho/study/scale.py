"""What a large file costs: speed, memory, and that neither interrupts nor processes change a byte of the result.

Run as ``python -m openecho.study.scale``; the report is ``build/reports/scale.json``. Speeds are of this machine and
this run; what carries over is their ratio.
"""

from __future__ import annotations

import argparse
import hashlib
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import psutil
from rich.console import Console
from rich.progress import track

from openecho import golden, report, stimulus

LENGTH = 1024
"""Samples in a waveform, as in granules of LVIS since 2015."""

BLOCK = 2000
"""Waveforms that are made at a time."""

MOST_ECHOES = 5
"""In a waveform: ground and layers above it."""

POLL = 0.05
"""Seconds between looks at the memory."""

SPEED_WAVEFORMS = 20_000
"""Waveforms that the golden model alone is timed on."""


@dataclass(frozen=True)
class Run:
    """One run of the command.

    Attributes
    ----------
    status : int
        Of its exit.
    seconds : float
        Wall time from start to end.
    peak_mb : float
        Most resident memory at any look, of the process and all that it started, in 10^6 bytes.
    """

    status: int
    seconds: float
    peak_mb: float


def granule(path: Path, shots: int, seed: int) -> None:
    """Write an LVIS L1B granule of today's layout, not compressed: 2 kB a shot.

    Parameters
    ----------
    path : Path
        HDF5 file to write.
    shots : int
        Waveforms of `LENGTH` samples: 1 to `MOST_ECHOES` echoes of σ 5 to 12 bins on a baseline with noise.
    seed : int
        Seed of everything in it.
    """
    rng = np.random.default_rng(seed)
    with h5py.File(path, "w") as file:
        rxwave = file.create_dataset("RXWAVE", (shots, LENGTH), np.uint16)
        for first in track(range(0, shots, BLOCK), "granule", transient=True):
            rows = slice(first, min(first + BLOCK, shots))
            rxwave[rows] = waveforms(rows.stop - rows.start, rng)
        file["SHOTNUMBER"] = np.arange(shots, dtype=np.uint32)
        file["TIME"] = 43200 + np.arange(shots) / 4000
        # Along a line, each beam down and a little aside.
        for number, height, shift in ((0, 450.0, 0.0), (1023, 300.0, 1e-5)):
            file[f"LON{number}"] = 260 + shift + 1e-6 * np.arange(shots)
            file[f"LAT{number}"] = 42 + shift + 1e-6 * np.arange(shots)
            file[f"Z{number}"] = np.full(shots, height, np.float32)


def waveforms(count: int, rng: np.random.Generator) -> stimulus.Samples:
    """Waveforms (count, `LENGTH`) of a few echoes each."""
    signal_ = rng.normal(20, 1.0, (count, LENGTH)).astype(np.float32)
    echoes = rng.integers(1, MOST_ECHOES, count, endpoint=True)
    x = np.arange(LENGTH, dtype=np.float32)
    for number in range(MOST_ECHOES):
        rows = np.flatnonzero(echoes > number)
        centre, width = rng.uniform(300, 800, (2, len(rows), 1))[0], rng.uniform(5, 12, (len(rows), 1))
        amplitude = np.exp(rng.uniform(np.log(20), np.log(500), (len(rows), 1)))
        signal_[rows] += (amplitude * np.exp(-0.5 * ((x - centre) / width) ** 2)).astype(np.float32)
    return np.clip(np.rint(signal_), 0, 1023).astype(np.uint16)


def decompose(source: Path, output: Path, jobs: int, interrupt_at: float | None = None) -> Run:
    """Run ``openecho decompose`` and watch its memory.

    Parameters
    ----------
    source, output : Path
    jobs : int
        Processes.
    interrupt_at : float, optional
        Seconds after which it is interrupted as with Ctrl-C.

    Returns
    -------
    Run
    """
    program = Path(sys.executable).with_name("openecho")
    command: list[str | Path] = [program, "decompose", source, "-o", output, "--jobs", str(jobs)]
    start, peak, interrupted = time.perf_counter(), 0, interrupt_at is None
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        while process.poll() is None:
            peak = max(peak, resident(process.pid))
            if not interrupted and time.perf_counter() - start > (interrupt_at or 0):
                process.send_signal(signal.SIGINT)
                interrupted = True
            time.sleep(POLL)
    return Run(process.returncode, time.perf_counter() - start, peak / 1e6)


def resident(pid: int) -> int:
    """Resident bytes of a process and its descendants now."""
    total = 0
    try:
        mine = psutil.Process(pid)
        for process in (mine, *mine.children(recursive=True)):
            total += process.memory_info().rss
    except psutil.NoSuchProcess:
        pass  # it ended between two looks
    return total


def golden_speed(seed: int) -> float:
    """Waveforms of `LENGTH` samples that the golden model decomposes in a second, in blocks, on one core."""
    samples = waveforms(SPEED_WAVEFORMS, np.random.default_rng(seed))
    length = np.full(len(samples), LENGTH)
    config = golden.Config()
    start = time.perf_counter()
    for first in range(0, len(samples), 512):
        rows = slice(first, first + 512)
        golden.core(golden.stream(samples[rows], length[rows], config), config)
    return len(samples) / (time.perf_counter() - start)


def study(folder: Path, shots: int, seed: int) -> dict[str, Any]:
    """Make a granule, decompose it in one process, in two, and with an interrupt in between.

    Parameters
    ----------
    folder : Path
        Where there is room for the granule and three tables.
    shots, seed : int
        As of `granule`.

    Returns
    -------
    dict
        JSON types.

    Raises
    ------
    RuntimeError
        If a run ends otherwise than it should, or two results differ.
    """
    source = folder / "granule.h5"
    granule(source, shots, seed)
    one = decompose(source, folder / "one.csv", 1)
    two = decompose(source, folder / "two.csv", 2)
    broken = decompose(source, folder / "resumed.csv", 1, one.seconds / 2)
    left = sorted(path.name for path in folder.glob("resumed*"))
    resumed = decompose(source, folder / "resumed.csv", 1)
    statuses = [run.status for run in (one, two, broken, resumed)]
    if statuses != [0, 0, 130, 0] or left != ["resumed.csv.partial"]:
        raise RuntimeError(f"exit statuses {statuses} and {left} left, expected 0, 0, 130, 0 and resumed.csv.partial")
    digests = {name: digest(folder / f"{name}.csv") for name in ("one", "two", "resumed")}
    if len(set(digests.values())) > 1:
        raise RuntimeError(f"found results that differ: {digests}, expected the same bytes")
    return {
        "shots": shots,
        "bytes": source.stat().st_size,
        "sha256": digests["one"],
        "golden_waveforms_per_s": golden_speed(seed),
        "one_process": {"waveforms_per_s": shots / one.seconds, "peak_mb": one.peak_mb},
        "two_processes": {"waveforms_per_s": shots / two.seconds, "peak_mb": two.peak_mb},
        "speedup": one.seconds / two.seconds,
        "resumed_share_of_time": resumed.seconds / one.seconds,
    }


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def main() -> None:
    """Run the study, print what it found and write its report."""
    parser = argparse.ArgumentParser(prog="openecho.study.scale", description=main.__doc__)
    parser.add_argument("--shots", type=int, default=400_000, help="waveforms of the granule (400000, 0.8 GB)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the granule (0)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="openecho-scale-", dir=report.FOLDER.parent) as folder:
        found = study(Path(folder), options.shots, options.seed)
    content = {"tools": report.tools("numpy", "distributed"), "seed": options.seed, **found}
    Console().print_json(data=content)
    print(report.write("scale", content))


if __name__ == "__main__":
    main()
