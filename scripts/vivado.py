"""Run Vivado: synthesise, place and route the core, package it as IP, and make the Zynq design that boards start from.

The steps are the scripts in scripts/vivado/, in batch mode. What they share with the rest of the project they read from
build/vivado/sources.tcl, which is written here: the sources in the order of compilation, and the parameters of the
arithmetic and the tap set asked for. Each step leaves its log beside. Synthesis and implementation leave their figures
in a summary, and so in build/reports/vivado.json; nothing is reported that was not run.
"""

from __future__ import annotations

import argparse
import json
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import openecho
from openecho import hardware, report
from openecho.golden import ARITHMETICS, TAP_SETS, Config

SCRIPTS = hardware.ROOT / "scripts" / "vivado"
OUTPUT = hardware.ROOT / "build" / "vivado"
AXI = hardware.RTL / "axi"
STEPS = {"synth": "synth.tcl", "impl": "impl.tcl", "package": "package_ip.tcl", "bd": "zynq_bd.tcl"}
"""Steps in their order, and their scripts; the last two need the AXI wrapper."""
MEASURING = ("synth", "impl")
"""Steps that leave a summary."""


class UsageError(ValueError):
    """An argument that can't be used, or a file that is missing: what was found and what was expected."""


@dataclass(frozen=True)
class Job:
    """What was asked for."""

    arithmetic: str
    taps: str
    steps: tuple[str, ...]

    @property
    def parameters(self) -> dict[str, str]:
        """Values of the core's parameters as SystemVerilog literals."""
        values = hardware.parameters(Config(taps=TAP_SETS[self.taps]).in_arithmetic(self.arithmetic))
        return {name: values[name] for name in hardware.MODULES["core"].parameters}


def parse(arguments: list[str]) -> Job:
    """Check the arguments before anything is run; raise UsageError."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--arith", default="fixed", help=f"one of {', '.join(ARITHMETICS)}; fixed if left out")
    parser.add_argument("--taps", default="paper", help=f"one of {', '.join(TAP_SETS)}; the paper's if left out")
    parser.add_argument("--step", default="all", help=f"one of {', '.join(STEPS)}, all; all if left out")
    options = parser.parse_args(arguments)
    if options.arith not in ARITHMETICS:
        raise UsageError(f"ARITH: found {options.arith!r}, expected one of {', '.join(ARITHMETICS)}")
    if options.taps not in TAP_SETS:
        raise UsageError(f"TAPS: found {options.taps!r}, expected one of {', '.join(TAP_SETS)}")
    if options.step not in (*STEPS, "all"):
        raise UsageError(f"STEP: found {options.step!r}, expected one of {', '.join(STEPS)}, all")
    steps = tuple(STEPS) if options.step == "all" else (options.step,)
    return Job(options.arith, options.taps, steps)


def core_sources() -> tuple[Path, ...]:
    """Files of the core in the order of compilation; raise UsageError if a module has none."""
    try:
        return hardware.MODULES["core"].sources
    except (StopIteration, RuntimeError) as error:
        raise UsageError("rtl: found no file for a module that openecho_core uses, expected <module>.sv") from error


def axi_sources() -> tuple[Path, ...]:
    """Files of the AXI shell, if it is there, in the order of compilation: packages, SystemVerilog, Verilog on top."""

    def place(path: Path) -> tuple[bool, bool, str]:
        return path.suffix == ".v", not path.stem.endswith("_pkg"), path.name

    return tuple(sorted((*AXI.glob("*.sv"), *AXI.glob("*.v")), key=place))


def tcl_list(words: Iterable[object]) -> str:
    """Words as a Tcl list, whatever characters are in them."""
    return "[list " + " ".join(re.sub(r"([^\w./:'-])", r"\\\1", str(word)) for word in words) + "]"


def write_sources(job: Job) -> Path:
    """Write what the Tcl scripts read, complete or not at all; raise UsageError."""
    values: dict[str, str] = {
        "version": tcl_list([openecho.__version__]),
        "sources": tcl_list(core_sources()),
        "axi_sources": tcl_list(axi_sources()),
        "parameters": tcl_list(word for item in job.parameters.items() for word in item),
    }
    lines = ["# Written by scripts/vivado.py: an edit is lost.", "namespace eval openecho {"]
    lines += [f"  variable {name} {value}" for name, value in values.items()]
    OUTPUT.mkdir(parents=True, exist_ok=True)
    path = OUTPUT / "sources.tcl"
    partial = path.with_name(f"{path.name}.partial")
    partial.write_text("\n".join([*lines, "}"]) + "\n")
    partial.replace(path)
    return path


def oldest() -> str:
    """Version of Vivado that the Tcl scripts ask for at least."""
    found = re.search(r"variable oldest (\S+)", (SCRIPTS / "common.tcl").read_text())
    assert found is not None
    return found[1]


def run(step: str, vivado: str) -> int:
    """Run a step, its output passed on, and return its exit status. A summary of an earlier run is gone before."""
    (OUTPUT / f"{step}.summary").unlink(missing_ok=True)
    files = ("-log", OUTPUT / f"{step}.log", "-journal", OUTPUT / f"{step}.jou")
    command = (vivado, "-mode", "batch", "-source", SCRIPTS / STEPS[step], "-notrace", *files)
    return subprocess.run(command, cwd=OUTPUT, check=False).returncode


def summary(step: str) -> dict[str, str]:
    """What a step has measured, by name; empty if it was not run to that point."""
    path = OUTPUT / f"{step}.summary"
    if not path.exists():
        return {}
    pairs = (line.split(" ", 1) for line in path.read_text().splitlines())
    return {name: value for name, value in pairs if not name.startswith("parameter.")}


def content(job: Job, measured: Mapping[str, Mapping[str, str]]) -> dict[str, Any]:
    """Report of what steps have measured."""
    first = next(iter(measured.values()))
    shared = ("vivado", "part", "period_ns")
    return {
        "tools": {"python": platform.python_version(), "vivado": first["vivado"]},
        "part": first["part"],
        "period_ns": float(first["period_ns"]),
        "arithmetic": job.arithmetic,
        "taps": job.taps,
        "parameters": job.parameters,
        "rows": [
            {"step": step} | {name: json.loads(value) for name, value in figures.items() if name not in shared}
            for step, figures in measured.items()
        ],
    }


def main() -> int:
    """Return 0 if all steps succeed, 2 if none could be tried, 130 if interrupted, or the status of the failing one."""
    try:
        job = parse(sys.argv[1:])
        write_sources(job)
    except UsageError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    vivado = shutil.which("vivado")
    if vivado is None:
        print(f"error: vivado not found on PATH, expected Vivado {oldest()} or newer (settings64.sh)", file=sys.stderr)
        return 2
    measured = {}
    status = 0
    for step in job.steps:
        try:
            status = run(step, vivado)
        except KeyboardInterrupt:
            print("error: interrupted", file=sys.stderr)
            return 130
        if step in MEASURING and (figures := summary(step)):
            measured[step] = figures
        if status != 0:
            print(f"error: step {step} fails with status {status} ({OUTPUT / f'{step}.log'})", file=sys.stderr)
            break
    if measured:
        print(report.write("vivado", content(job, measured)))
    return status


if __name__ == "__main__":
    sys.exit(main())
