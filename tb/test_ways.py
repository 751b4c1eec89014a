"""What the trade-off measures of cores in simulation."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from openecho import golden, report
from openecho.golden import TRUNCATED, Config
from openecho.study.trade.ways import USUAL, WAYS
from scripts import ways
from tb.env import runner
from tb.replay import bench


def test_the_last_sample_decides_the_lone_echo() -> None:
    config = Config()
    last = ways.decided(ways.LONE, config)
    flags = {}
    for samples in (last - 1, last):
        beats = golden.stream(ways.LONE, np.array([samples]), config)
        records = golden.decode_records(golden.core(beats, config)["record"], config)
        flags[samples] = records["flags"][~records["trailer"]].tolist()
    assert flags == {last - 1: [TRUNCATED], last: [0]}


def test_a_core_that_is_not_its_model_is_no_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(replay: Callable[..., bench.Replay]) -> Callable[..., bench.Replay]:
        def replayed(*arguments: Any) -> bench.Replay:
            found = replay(*arguments)
            found.records[0, 2] ^= 1
            return found

        return replayed

    try:
        runner.require("verilator")
    except runner.MissingToolError as error:
        pytest.skip(str(error))
    found = ways.simulated(Config())
    assert found["cycles_per_waveform"] == 1024
    assert found["latency_cycles"] > 100  # two divisions, a bit a clock, and a crossing before them
    monkeypatch.setattr(bench, "replay", wrong(bench.replay))
    with pytest.raises(runner.SimulationError, match=r"^1 records differ\nwaveform 0 record 0 word 2"):
        ways.simulated(Config())


def test_quick_measures_the_usual_core_and_keeps_what_is_known(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    monkeypatch.setattr(ways, "simulated", lambda config: {"latency_cycles": config.frac})
    monkeypatch.setattr(sys, "argv", ["ways.py", "--extent", "quick"])
    report.write("ways", {"rows": [{"name": USUAL, "lut": 7}, {"name": "core FRAC 4", "lut": 5}]})
    assert ways.main() == 0
    rows = {row["name"]: row for row in ways.known()}
    assert list(rows) == [way.name for way in WAYS if way.in_hardware]
    assert rows[USUAL] == {"name": USUAL, "lut": 7, "latency_cycles": 16}
    assert rows["core FRAC 4"] == {"name": "core FRAC 4", "lut": 5}


def test_an_unknown_extent_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["ways.py", "--extent", "half"])
    assert ways.main() == 2
    assert capsys.readouterr().err == "error: TRADE: found 'half', expected one of full, quick\n"
