"""The core on recorded waveforms, against floating point, and against the limit of what noise lets one know."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from openecho import formats, golden, stimulus
from openecho.golden import ARITHMETICS, Config
from openecho.study import comparison, precision
from tb.env import runner
from tb.env.run import Run
from tb.env.waveforms import RARELY

RECORDED = ("gedi_cerrado.npz", "lvis_arctic.npz", "neon_harvard.npz")
SLICE = 50
"""Waveforms of each recorded file, evenly spread over it; `make sim MODULE=core DATA=` takes them all."""

LIMITS = {"centre": 2**-15, "peak": 2**-15, "width": 2**-15, "time": 2**-14, "amplitude": 2**-6}
"""Largest difference from float64 at FRAC 16, in bins and counts."""

FLOATS = tuple(name for name in ARITHMETICS if name != "fixed")
PLACES = {"centre": 1.5, "peak": 1, "width": 1.1, "time": 2.7}
"""Largest difference of floats from float64 on the reference waveforms, in last places of a position from 512 to 1023.

The base and the position are rounded to half a place each, the centre once more; the width is half the difference of
two positions, and 0.59 times that is taken off the centre for the time.
"""

RTL_POINTS = tuple(
    point for point in precision.POINTS if point.matched and (point.width, point.amplitude) in ((3, 200), (8, 20))
)
RTL_COUNT = 1000


def decomposed(
    samples: NDArray[Any], length: NDArray[Any], config: Config, directory: Path
) -> tuple[np.ndarray, dict[str, Any]]:
    """Run waveforms through the RTL, which must equal its model; return the decoded records and what was measured."""
    stored, result = directory / "waveforms.npz", directory / "result.json"
    np.savez(stored, samples=samples, length=length)
    run = Run("core", config, samples=str(stored), result=str(result), progress=str(directory / "progress"))
    runner.simulate(run, "verilator", directory, ["tb.env.reference"])
    records = golden.decode_records(np.load(result.with_suffix(".npy")), config)
    return records, json.loads(result.read_text())


@pytest.mark.parametrize("name", RECORDED)
def test_core_equals_its_model_on_recorded_waveforms_and_rarely_stalls(
    name: str, recorded: Path, tmp_path: Path
) -> None:
    config = Config()
    waveforms = formats.load(recorded / name, config.sample_w)
    rows = np.linspace(0, len(waveforms.length) - 1, SLICE).astype(int)
    records, measured = decomposed(waveforms.samples[rows], waveforms.length[rows], config, tmp_path)
    assert measured["mismatches"] == 0
    assert measured["waveforms"] == records["trailer"].sum() == SLICE
    assert measured["cycles_per_waveform"] <= (1 + RARELY) * measured["samples_per_waveform"]


def test_core_agrees_with_float64_on_the_reference_waveforms(tmp_path: Path) -> None:
    made, config = stimulus.reference_set(0), Config()
    records, measured = decomposed(made.samples, made.length, config, tmp_path)
    assert measured["cycles_per_waveform"] == measured["samples_per_waveform"]
    assert measured["latency_cycles"]["max"] <= 128
    compared = comparison.compare(records, made.samples, made.length, config)
    assert compared["differing_waveforms"] == 0
    over = {name: compared["largest_difference"][name] for name in LIMITS}
    assert all(over[name] <= limit for name, limit in LIMITS.items()), over


@pytest.mark.arithmetic("float64")
def test_float64_core_finds_the_echoes_of_the_fixed_point_core(tmp_path: Path) -> None:
    made = stimulus.reference_set(0)
    echoes = []
    for name in ("fixed", "float64"):
        (tmp_path / name).mkdir()
        config = Config().in_arithmetic(name)
        records, _ = decomposed(made.samples, made.length, config, tmp_path / name)
        echoes.append(records[~records["trailer"]])
    for field in ("sequence", "number", "flags"):
        np.testing.assert_array_equal(echoes[0][field], echoes[1][field])
    assert np.abs(echoes[0]["centre"] - echoes[1]["centre"]).max() <= 2**-15


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.arithmetic(name)) for name in FLOATS])
def test_float_core_takes_the_reference_waveforms_without_a_stall_and_is_as_exact_as_its_format(
    name: str, tmp_path: Path
) -> None:
    made, config = stimulus.reference_set(0), Config().in_arithmetic(name)
    records, measured = decomposed(made.samples, made.length, config, tmp_path)
    assert measured["cycles_per_waveform"] == measured["samples_per_waveform"]
    compared = comparison.compare(records, made.samples, made.length, config)
    assert compared["differing_waveforms"] == 0
    place = 2.0 ** (9 - config.frac)
    # The noise mean is rounded to 2^-8 count, and the amplitude, below 256 counts, to half its last place.
    limits = {field: places * place for field, places in PLACES.items()}
    limits["amplitude"] = 2**-9 + 2.0 ** (7 - config.frac - 1)
    over = {field: compared["largest_difference"][field] for field in limits}
    assert all(over[field] <= limit for field, limit in limits.items()), over


@pytest.mark.parametrize("point", RTL_POINTS, ids=lambda point: f"sigma{point.width}-amplitude{point.amplitude}")
def test_matched_taps_come_close_to_the_cramer_rao_bound(point: precision.Point, tmp_path: Path) -> None:
    made = precision.waveforms(point, RTL_COUNT, seed=0)
    records, _ = decomposed(made.samples, made.length, point.config, tmp_path)
    score = precision.score(point, records, made.truth)
    assert score["found"] == RTL_COUNT
    assert score["peak"] <= 1.1
    assert score["centre"] <= 1.6
