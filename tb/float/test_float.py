"""Every float unit in every format, bit for bit, with its flags, its latency and its throughput.

OPENECHO_FLOAT_VECTORS sets how many vectors a unit gets on Verilator: 50,000, or a million in the nightly run.
"""

from __future__ import annotations

import os
import zlib
from pathlib import Path

import numpy as np
import pytest

from tb.env.runner import find_simulators
from tb.float import bench, vectors
from tb.float.lanes import FORMATS, LANES, SMALL, Lane

COUNT = {"verilator": int(os.environ.get("OPENECHO_FLOAT_VECTORS", "50000")), "icarus": 10_000}
FASTEST = find_simulators()[:1]
EXHAUSTIVE = 1 << 19  # as many as from_int has integers; the small format has 65,536 pairs
ILLEGAL = [
    ("add", {"EXP_W": 2}, "EXP_W is 2; exponents of 3 to 15 bits are supported"),
    ("mul", {"EXP_W": 16}, "EXP_W is 16; exponents of 3 to 15 bits are supported"),
    ("div", {"FRAC_W": 1}, "FRAC_W is 1; fractions of at least 2 bits are supported"),
    ("compare", {"FRAC_W": 0}, "FRAC_W is 0; fractions of at least 2 bits are supported"),
    (
        "from_int",
        {"EXP_W": 5, "INT_W": 17, "SCALE": 0},
        "INT_W 17 and SCALE 0 reach 2^16; an exponent of 5 bits ends at 2^15",
    ),
    ("to_fixed", {"INT_W": 1}, "INT_W is 1; a signed integer has at least 2 bits"),
    ("to_fixed", {"FRAC": -1}, "FRAC is -1; a fixed-point number has no fewer than 0 fractional bits"),
]


def stimulus(lane: Lane, count: int) -> vectors.Vectors:
    rng = np.random.default_rng(zlib.crc32(lane.name.encode()))
    if lane.unit == "from_int":
        return vectors.integers(lane.parameters["INT_W"], count, rng)
    if lane.unit == "to_fixed":
        return vectors.words(lane.form, lane.parameters["INT_W"], lane.parameters["FRAC"], count, rng)
    if lane.form == SMALL and count >= EXHAUSTIVE:
        return vectors.all_pairs(lane.form)
    return vectors.pairs(lane.form, count, rng)


@pytest.mark.parametrize("name", LANES)
@pytest.mark.parametrize("simulator", find_simulators())
def test_every_result_and_flag_is_exact_under_gaps_and_stalls(simulator: str, name: str, tmp_path: Path) -> None:
    lane = LANES[name]
    count = EXHAUSTIVE if lane.form == SMALL and simulator == "verilator" else COUNT[simulator]
    sent = stimulus(lane, count)
    seen = bench.stream(lane, sent, simulator, tmp_path)
    results, flags = lane.expected(sent)

    assert seen.results.size == sent.size
    wrong = np.flatnonzero((seen.results != results) | (seen.flags != flags))
    rows = [
        f"{row['control']} {row['a']:x} {row['b']:x}: {seen.results[k]:x} {seen.flags[k]:05b}, "
        f"expected {results[k]:x} {flags[k]:05b}"
        for k, row in ((k, sent[k]) for k in wrong[:8])
    ]
    assert not rows, f"{wrong.size} of {sent.size} wrong:\n" + "\n".join(rows)
    assert seen.violations == 0


@pytest.mark.parametrize("name", LANES)
@pytest.mark.parametrize("simulator", find_simulators())
def test_latency_and_throughput_are_as_stated(simulator: str, name: str, tmp_path: Path) -> None:
    lane = LANES[name]
    ones = np.zeros(bench.MEASURED, vectors.VECTOR)
    ones["a"] = ones["b"] = lane.form.bias << lane.form.frac_w
    seen = bench.stream(lane, ones, simulator, tmp_path)
    assert seen.latency == lane.latency
    assert seen.span == (bench.MEASURED - 1) * lane.interval


@pytest.mark.parametrize(
    ("a", "b", "extra"),
    [
        (0x3F800000, 0x3F800000, 0),
        (0x3F800000, 0x3F800001, 1),
        (0x3F800001, 0x3F800000, 0),
        (0x00000001, 0x3F800000, 23 - 23),
        (0x00000001, 0x00000001, 23 + 23),
        (0x3F800000, 0x00400000, 1),
        (0x00800000, 0x40000000, -1),
        (0x00800000, 0x7F000000, -23 - 3),
        (0x7FC00000, 0x3F800000, -23 - 3),
        (0x00000000, 0x3F800000, -23 - 3),
    ],
)
@pytest.mark.parametrize("simulator", FASTEST)
def test_an_iterative_division_takes_a_cycle_for_each_place_it_needs(
    simulator: str, a: int, b: int, extra: int, tmp_path: Path
) -> None:
    lane = LANES["float32_div_iterative"]
    vector = np.zeros(1, vectors.VECTOR)
    vector["a"], vector["b"] = a, b
    assert bench.stream(lane, vector, simulator, tmp_path).latency == lane.latency + extra


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("simulator", FASTEST)
def test_both_forms_of_the_divider_give_the_same_bits(simulator: str, name: str, tmp_path: Path) -> None:
    lanes = [LANES[f"{name}_div_{kind}"] for kind in ("iterative", "pipelined")]
    sent = stimulus(lanes[0], COUNT[simulator])
    iterative, pipelined = (bench.stream(lane, sent, simulator, tmp_path) for lane in lanes)
    assert iterative.results.size == sent.size
    np.testing.assert_array_equal(iterative.results, pipelined.results)
    np.testing.assert_array_equal(iterative.flags, pipelined.flags)


@pytest.mark.parametrize("simulator", find_simulators())
@pytest.mark.parametrize(("unit", "values", "sentence"), ILLEGAL)
def test_what_cannot_work_stops_with_a_sentence(
    unit: str, values: dict[str, int], sentence: str, simulator: str, tmp_path: Path
) -> None:
    assert sentence in bench.refusal(unit, values, simulator, tmp_path)
