"""`make sim` says in one line what is wrong with its arguments, with exit status 2."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from openecho.golden import Config
from openecho.hardware import ROOT
from tb.env import runner
from tb.env.run import Run

FST_HEADER = b"\x00"
"""Kind of the first block of an FST file."""


def sim(*arguments: str, path: str | None = None) -> subprocess.CompletedProcess[str]:
    environment = os.environ | ({} if path is None else {"PATH": path})
    command = [sys.executable, str(ROOT / "scripts" / "sim.py"), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def assert_refused(run: subprocess.CompletedProcess[str], *said: str) -> None:
    assert run.returncode == 2, run.stderr
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("error: ")
    assert all(word in run.stderr for word in said), run.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--module", "filtre"), ("filtre", "reader, filter")),
        (("--sim", "vcs"), ("vcs", "verilator, icarus")),
        (("--taps", "wide"), ("wide", "paper, gedi, lvis, nasa3.5, nasa6.5")),
        (("--arith", "float8"), ("float8", "fixed, float16, float32, float64")),
        (("--module", "float_add", "--arith", "fixed"), ("fixed", "float16, float32, float64 for float_add")),
        (("--seed", "-1"), ("-1", "whole number")),
        (("--data", "nowhere.npz"), ("nowhere.npz: no such file", "expected LVIS or GEDI L1B (HDF5)")),
    ],
)
def test_argument_that_is_not_known_is_refused(arguments: tuple[str, ...], said: tuple[str, ...]) -> None:
    assert_refused(sim(*arguments), *said)


def test_tests_of_an_arithmetic_that_is_not_known_are_refused() -> None:
    run = subprocess.run([sys.executable, "-m", "pytest", "--arith=float8"], cwd=ROOT, capture_output=True, check=False)
    assert run.returncode == 2
    assert b"error: ARITH: found 'float8', expected one of fixed, float16, float32, float64" in run.stdout + run.stderr


def test_counts_wider_than_a_sample_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "bright.npy", np.full((1, 100), 1 << 11, np.uint16))
    assert_refused(sim("--data", str(tmp_path / "bright.npy")), "2048", "0 to 2047")


def test_missing_compiler_is_refused(tmp_path: Path) -> None:
    assert_refused(sim("--sim", "verilator", path=str(tmp_path)), "g++ not found", "expected it on PATH")


@pytest.mark.parametrize("simulator", runner.find_simulators())
def test_waves_are_left_where_the_runner_says(simulator: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "waveforms.npz", samples=np.arange(100)[np.newaxis], length=[100])
    stored, result, progress = (str(tmp_path / name) for name in ("waveforms.npz", "result", "progress"))
    run = Run("output", Config(), samples=stored, result=result, progress=progress)
    runner.simulate(run, simulator, tmp_path, ["tb.env.reference"], waves=True)
    assert (tmp_path / runner.WAVES).read_bytes()[:1] == FST_HEADER
