"""The AXI shell against a bus model that others wrote, around records of the golden model."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from openecho import formats
from openecho.golden import Config
from openecho.hardware import RTL, parameters
from tb.env import runner
from tb.env.run import Run
from tb.test_replay import RECORDED
from tb.test_rtl import CONFIGS, need

CASES = {
    ("axi", "verilator", "default"): ("tests", "streams", "counters"),
    ("axi", "verilator", "narrow"): ("tests", "streams"),
    ("axi", "verilator", "wide"): ("tests", "streams"),
    ("axi", "verilator", "float32"): ("tests", "streams"),
    ("axi_top", "verilator", "default"): ("tests", "streams"),
    ("axi_top", "verilator", "wide"): ("tests",),
    # The slower simulator leaves out the 40 reference waveforms.
    ("axi", "icarus", "narrow"): ("tests", "counters"),
}
"""Module, simulator and parameters, and what of tb/axi to run."""
COUNTED = ("axi", "verilator", "narrow")
"""What coverage is counted with."""
STEP = 40
"""Every so many waveforms of a recorded file are sent."""
MOST = 50
"""And no more than these."""


def simulate(run: Run, simulator: str, directory: Path, tests: list[str]) -> None:
    need(simulator)
    try:
        runner.simulate(run, simulator, directory, tests)
    except runner.SimulationError as error:
        pytest.fail(str(error), pytrace=False)


def marked(case: tuple[str, str, str]) -> object:
    """A case as a pytest parameter."""
    marks = [pytest.mark.arithmetic(case[2] if CONFIGS[case[2]].form else "fixed")]
    return pytest.param(case, id="-".join(case), marks=[*marks, *[pytest.mark.counted] * (case == COUNTED)])


@pytest.mark.parametrize("case", [marked(case) for case in CASES])
def test_shell_keeps_its_promises(case: tuple[str, str, str], tmp_path: Path) -> None:
    module, simulator, name = case
    run = Run(module, CONFIGS[name], int(os.environ.get("SEED", "0")))
    simulate(run, simulator, tmp_path, [f"tb.axi.{tests}" for tests in CASES[case]])


@pytest.mark.parametrize("name", RECORDED)
def test_recorded_waveforms_give_the_records_of_the_golden_model(name: str, recorded: Path, tmp_path: Path) -> None:
    config = Config()
    waveforms = formats.load(recorded / name, config.sample_w)
    stored = tmp_path / "waveforms.npz"
    np.savez(stored, samples=waveforms.samples[::STEP][:MOST], length=waveforms.length[::STEP][:MOST])
    simulate(Run("axi", config, samples=str(stored)), "verilator", tmp_path, ["tb.axi.recorded"])


@pytest.mark.parametrize("simulator", runner.SIMULATORS)
@pytest.mark.parametrize(("word_w", "changes"), [("64", {}), ("32", {"MAX_SAMPLES": "65536"}), ("32", {"FRAC": "24"})])
def test_width_of_a_word_that_is_not_the_records_stops_elaboration_with_a_sentence(
    word_w: str, changes: dict[str, str], simulator: str, tmp_path: Path
) -> None:
    need(simulator)
    values = parameters(Config()) | changes | {"WORD_W": word_w}
    assert f"WORD_W is {word_w};" in runner.refusal("axi_top", values, simulator, tmp_path)


def test_verilog_top_has_the_ports_and_defaults_of_the_shell() -> None:
    shell, top = (
        (RTL / "axi" / name).read_text().split("\n);")[0] for name in ("openecho_axi.sv", "openecho_axi_top.v")
    )
    port = re.compile(r"\b(input|output)\s+(?:logic|wire)\b.*?(\w+)\s*(?:,|\)|\n)")
    assert port.findall(top) == port.findall(shell)
    given = dict(re.findall(r"parameter (?:integer )?(?:\[383:0\] )?(\w+) = ([\w']+),", top))
    expected = parameters(Config())
    assert int(given.pop("TAPS").split("h")[1].replace("_", ""), 16) == int(expected.pop("TAPS").split("h")[1], 16)
    assert given.pop("DSP") == "1"
    assert given == expected


def test_verilog_top_is_plain_verilog() -> None:
    need("icarus")
    command = ["iverilog", "-g2001", "-i", "-t", "null", str(RTL / "axi" / "openecho_axi_top.v")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
