"""What each way takes: of hardware as `scripts/ways.py` measured it, and of time on this machine."""

from __future__ import annotations

import json
import os
import platform
import statistics
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from openecho import report, stimulus
from openecho.study.trade.sets import Set, synthetic
from openecho.study.trade.ways import USUAL, WAYS, Way

SLICE = 0.15
"""Seconds that one timing is to take, so that the clock's grain and a call's overhead don't matter."""

TURNS, QUICK_TURNS = 7, 3
"""Timings of each way, all in turn, so that what else the machine does falls on all."""

PAPER = {"software": 12.0, "core": 0.041}
"""Zhou 2022, section 4.4: milliseconds a waveform of MATLAB on a PC and of their core."""

HARDWARE = ("lut", "ff", "dsp", "bram36", "path_ns", "fmax_mhz", "cycles_per_waveform", "latency_cycles")


def costs(quick: bool, seed: int) -> list[dict[str, Any]]:
    """Row of the report for each way.

    Returns
    -------
    list of dict
        ``name``, ``group``, what `scripts/ways.py` measured, None where it did not; ``software_per_s``, waveforms a
        second of the bit-exact model or of the method itself, on one core; ``waveforms_per_s`` of hardware at its
        clock, else the same.
    """
    measured = {row["name"]: row for row in hardware()["rows"]}
    speed = software(synthetic("land", stimulus.WAVEFORMS, seed), QUICK_TURNS if quick else TURNS)
    rows = []
    for way in WAYS:
        found = measured.get(way.name, {})
        row = {"name": way.name, "group": way.group} | {
            name: found.get(name) for name in (*HARDWARE, "simulated_per_s")
        }
        row["software_per_s"] = speed[way.name]
        row["waveforms_per_s"] = at_its_clock(row) if way.in_hardware else speed[way.name]
        rows.append(row)
    return rows


def hardware() -> dict[str, Any]:
    """Report of `scripts/ways.py`.

    Raises
    ------
    FileNotFoundError
        If it has not been run.
    """
    content: dict[str, Any] = json.loads((report.FOLDER / "ways.json").read_text())
    return content


def at_its_clock(row: dict[str, Any]) -> float | None:
    """Waveforms a second of a core, None if its clock or its cycles are not known."""
    if row["fmax_mhz"] is None or row["cycles_per_waveform"] is None:
        return None
    return float(row["fmax_mhz"] * 1e6 / row["cycles_per_waveform"])


def software(given: Set, turns: int) -> dict[str, float]:
    """Waveforms a second of every way in software: the median of some turns, in each of which all are timed."""
    runs = {way.name: (way, repeated(given, way)) for way in WAYS}
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(turns):
        for name, run in runs.items():
            seconds[name].append(timed(*run))
    return {name: len(many.samples) / statistics.median(seconds[name]) for name, (_, many) in runs.items()}


def repeated(given: Set, way: Way) -> Set:
    """So many copies of a set's waveforms that a way is busy for `SLICE`."""
    timed(way, given)  # the first time the compiler has its part
    times = max(1, round(SLICE / timed(way, given)))
    return replace(given, samples=np.tile(given.samples, (times, 1)), length=np.tile(given.length, times))


def timed(way: Way, given: Set) -> float:
    """Seconds that a way takes for a set."""
    method = way.prepare(given.longest, given.told)
    begun = time.perf_counter()
    method(given.samples, given.length, None)
    return time.perf_counter() - begun


def machine() -> dict[str, Any]:
    """Name of the processor, and how many of its cores there are."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = (line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    return {"processor": next(names, platform.machine()), "cores": len(os.sched_getaffinity(0))}


def comparison(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The paper's comparison beside ours: milliseconds a waveform, in software and in hardware, and their ratios."""
    named = {row["name"]: row for row in rows}
    fast, slow = named[USUAL]["waveforms_per_s"], named["inflections, float64"]["software_per_s"]
    pairs = {
        "the paper": (PAPER["software"], PAPER["core"]),
        "ours": (1e3 / slow, None if fast is None else 1e3 / fast),
    }
    labels = {
        "the paper": ("the paper, MATLAB on a PC", "the paper, FPGA"),
        "ours": ("ours, the method in float64 software", "ours, the core at its estimated clock"),
    }
    return {
        "rows": [row for name, pair in pairs.items() for row in zip(labels[name], pair, strict=True)],
        "ratios": {name: None if core is None else software / core for name, (software, core) in pairs.items()},
    }
