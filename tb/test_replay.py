"""Whole files through the core, and the comparison that says whether its records are right."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from openecho import formats, golden, stimulus
from openecho.decompose import EngineError, decompose
from openecho.golden import ARITHMETICS, Config
from openecho.hardware import ROOT
from tb.env import runner
from tb.env.waveforms import RARELY
from tb.replay import bench

RECORDED = ("gedi_cerrado.npz", "lvis_arctic.npz", "neon_harvard.npz")
SLICE = 200
"""Waveforms of each recorded file, evenly spread over it; `make replay DATA=` takes them all."""
SETTINGS = Config(n=1.5, min_interval=3, min_amplitude=20, k=4.5)
"""None of them as it is by default."""


@pytest.fixture
def made() -> stimulus.Stimulus:
    return stimulus.reference_set(0)


@pytest.fixture
def records(made: stimulus.Stimulus) -> np.ndarray:
    return golden.core(golden.stream(made.samples, made.length), Config())["record"]


def replay(*arguments: str, path: str | None = None) -> subprocess.CompletedProcess[str]:
    environment = os.environ | ({} if path is None else {"PATH": path})
    command = [sys.executable, str(ROOT / "scripts" / "replay.py"), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def assert_refused(run: subprocess.CompletedProcess[str], *said: str) -> None:
    assert run.returncode == 2, run.stderr
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("error: ")
    assert all(word in run.stderr for word in said), run.stderr


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.arithmetic(name)) for name in ARITHMETICS])
def test_reference_waveforms_give_the_records_of_the_golden_model_without_a_stall(
    name: str, made: stimulus.Stimulus
) -> None:
    config = Config().in_arithmetic(name)
    replayed = bench.replay(made.samples, made.length, config)
    expected = golden.core(golden.stream(made.samples, made.length), config)["record"]
    np.testing.assert_array_equal(replayed.records, expected)
    assert replayed.records.dtype == expected.dtype
    assert replayed.stalls == 0
    assert made.length.sum() < replayed.cycles < made.length.sum() + 2000


def test_engine_rtl_gives_the_echoes_of_the_model(made: stimulus.Stimulus) -> None:
    modelled, simulated = (decompose(made.samples, made.length, engine=engine, k=5) for engine in ("model", "rtl"))
    assert len(simulated.echoes)
    np.testing.assert_array_equal(simulated.echoes, modelled.echoes)
    np.testing.assert_array_equal(simulated.waveforms, modelled.waveforms)


def test_engine_rtl_without_a_compiler_says_so(made: stimulus.Stimulus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(EngineError, match=r"^engine rtl: verilator: g\+\+ not found, expected it on PATH"):
        decompose(made.samples, made.length, engine="rtl")


@pytest.mark.parametrize("simulator", runner.find_simulators())
def test_settings_reach_the_core(simulator: str, made: stimulus.Stimulus) -> None:
    samples, length = made.samples[-3:], made.length[-3:]
    replayed = bench.replay(samples, length, SETTINGS, simulator)
    assert bench.compare(replayed.records, samples, length, SETTINGS) == bench.Comparison(0, ())
    assert bench.compare(replayed.records, samples, length, Config()).mismatches > 0


def test_waveforms_too_short_and_too_long_are_replayed() -> None:
    config = Config(max_samples=64)
    length = np.array([1, 65, 64, 200, 22])
    samples = np.random.default_rng(0).integers(0, 2048, (length.size, 200))
    replayed = bench.replay(samples, length, config)
    assert bench.compare(replayed.records, samples, length, config) == bench.Comparison(0, ())


def test_comparison_in_several_blocks_finds_no_difference_where_there_is_none(
    made: stimulus.Stimulus, records: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "BLOCK", 3 * made.samples.shape[1])
    rows: list[int] = []
    assert bench.compare(records, made.samples, made.length, Config(), rows.append) == bench.Comparison(0, ())
    assert rows == [*range(3, 40, 3), 40]


@pytest.mark.parametrize("block", [1, bench.BLOCK])
@pytest.mark.parametrize("word", range(8))
def test_comparison_names_a_single_wrong_bit(
    word: int, block: int, made: stimulus.Stimulus, records: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "BLOCK", block)
    at = int(np.flatnonzero(records[:, 1] == 30)[1])
    wrong = records.copy()
    wrong[at, word] ^= 1
    assert bench.compare(wrong, made.samples, made.length, Config()) == bench.Comparison(
        1,
        (f"waveform 30 record 1 word {word}: found {records[at, word] ^ 1:#x}, expected {records[at, word]:#x}",),
    )


def test_comparison_counts_a_lost_echo_once_in_its_own_waveform(made: stimulus.Stimulus, records: np.ndarray) -> None:
    trailers = np.flatnonzero(records[:, 0] >> 31)
    lost = np.delete(records, trailers[7] - 1, axis=0)
    compared = bench.compare(lost, made.samples, made.length, Config())
    held = trailers[7] - trailers[6]
    assert compared.differences[0] == f"waveform 7: found {held - 1} records, expected {held}"
    assert compared.mismatches == 2  # the echo is missing, and the trailer is where it should be
    assert all(text.startswith("waveform 7") for text in compared.differences)


@pytest.mark.parametrize("kept", [0, 1, 100])
def test_comparison_counts_all_records_that_never_came(kept: int, made: stimulus.Stimulus, records: np.ndarray) -> None:
    compared = bench.compare(records[:kept], made.samples, made.length, Config())
    assert compared.mismatches >= len(records) - kept
    assert len(compared.differences) == bench.SHOWN


def test_comparison_counts_records_after_the_last_waveform(made: stimulus.Stimulus, records: np.ndarray) -> None:
    for more in (records[:1], records[:50]):
        assert bench.compare(np.concatenate((records, more)), made.samples, made.length, Config()) == bench.Comparison(
            len(more), (f"after the last waveform: found {len(more)} records, expected 0",)
        )


def test_simulation_that_breaks_off_says_so_and_leaves_nothing(
    made: stimulus.Stimulus, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(bench, "RUNS", tmp_path)
    monkeypatch.setattr(bench, "settings", lambda config: {"n": config.n_raw})
    with pytest.raises(runner.SimulationError, match=r"broke off(.|\n)*found no \+min_interval="):
        bench.replay(made.samples, made.length, Config())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", RECORDED)
def test_recorded_waveforms_give_the_records_of_the_golden_model(name: str, recorded: Path) -> None:
    config = Config()
    waveforms = formats.load(recorded / name, config.sample_w)
    rows = np.linspace(0, len(waveforms.length) - 1, SLICE).astype(int)
    samples, length = waveforms.samples[rows], waveforms.length[rows]
    replayed = bench.replay(samples, length, config)
    assert np.count_nonzero(replayed.records[:, 0] >> 31) == SLICE
    assert bench.compare(replayed.records, samples, length, config) == bench.Comparison(0, ())
    assert replayed.stalls <= RARELY * length.sum()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), ("DATA", "none")),
        (("--data", "x.npz", "--arith", "float128"), ("float128", "fixed, float16")),
        (("--data", "x.npz", "--taps", "wide"), ("wide", "paper, gedi")),
        (("--data", "x.npz", "--sim", "vcs"), ("vcs", "verilator, icarus")),
        (("--data", "nowhere.npz"), ("nowhere.npz", "no such file")),
    ],
)
def test_argument_that_is_not_known_is_refused(arguments: tuple[str, ...], said: tuple[str, ...]) -> None:
    assert_refused(replay(*arguments), *said)


def test_counts_wider_than_a_sample_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "bright.npy", np.full((1, 100), 1 << 11, np.uint16))
    assert_refused(replay("--data", str(tmp_path / "bright.npy")), "2048", "0 to 2047")


def test_missing_compiler_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "dark.npy", np.zeros((1, 100), np.uint16))
    assert_refused(replay("--data", str(tmp_path / "dark.npy"), path=str(tmp_path)), "g++ not found")
