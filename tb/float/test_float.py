"""Every float unit in every format, bit for bit, with its flags, its latency and its throughput.

OPENECHO_FLOAT_VECTORS sets how many vectors a unit gets on Verilator: 20,000, or a million in the nightly run.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from tb.env.runner import find_simulators
from tb.float import bench, vectors
from tb.float.lanes import FORMATS, LANES, SMALL, Lane, stimulus

COUNT = {"verilator": int(os.environ.get("OPENECHO_FLOAT_VECTORS", "20000")), "icarus": 5_000}
FASTEST = find_simulators()[:1]
EXHAUSTIVE = 1 << 19  # as many as from_int has integers; the small format has 65,536 pairs
NAMES = [pytest.param(name, marks=pytest.mark.arithmetic(lane.arithmetic)) for name, lane in LANES.items()]
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


def first_latency(lane: Lane, vector: tuple[int, int, int], simulator: str, directory: Path) -> int:
    """Cycles that one vector takes."""
    return bench.stream(lane, np.array([vector], vectors.VECTOR), simulator, directory).least


@pytest.mark.parametrize("name", NAMES)
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


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("simulator", find_simulators())
def test_latency_and_throughput_are_as_stated(simulator: str, name: str, tmp_path: Path) -> None:
    lane = LANES[name]
    for control, latency in lane.latencies.items():
        same = np.zeros(bench.MEASURED, vectors.VECTOR)
        same["control"], same["a"], same["b"] = control, lane.operand, lane.operand
        seen = bench.stream(lane, same, simulator, tmp_path)
        assert (seen.least, seen.greatest) == (latency, latency)
        assert seen.span == (bench.MEASURED - 1) * lane.interval(latency)


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
        (0x00800000, 0x7F000000, -23 - 2),
        (0x7FC00000, 0x3F800000, -23 - 3),
        (0x00000000, 0x3F800000, -23 - 3),
    ],
)
@pytest.mark.parametrize("name", ["float32_div_iterative", "float32_serial"])
@pytest.mark.parametrize("simulator", FASTEST)
def test_an_iterative_division_takes_a_cycle_for_each_place_it_needs(
    simulator: str, name: str, a: int, b: int, extra: int, tmp_path: Path
) -> None:
    lane = LANES[name]
    assert first_latency(lane, (vectors.DIVIDE, a, b), simulator, tmp_path) == max(lane.latencies.values()) + extra


@pytest.mark.parametrize(
    ("a", "b", "shifts"),
    [
        (0x3F800000, 0x3FFFFFFF, 0),
        (0x40000000, 0x3F800000, 1 + 1),
        (0x3F800000, 0x40000000, 1 + 1),
        (0x40000000, 0x3FFFFFFF, 1 + 1),
        (0x4B800000, 0x3F800000, 24 + 1),
        (0x7F000000, 0x3F800000, 31 + 1),
        (0x3F800000, 0x7F000000, 32 + 1),
        (0x3F800000, 0xBF800001, 1 + 23),
        (0xBF800001, 0x3F800000, 1 + 23),
        (0x3F800000, 0xBF000000, 1 + 1 + 1),
        (0x3F800000, 0xBF800000, 1),
        (0x00000001, 0x00000001, 1),
        (0x00800000, 0x80800001, 1),
        (0x00000000, 0x80000000, 1),
        (0x7F800000, 0x3F800000, -1),
        (0x7FC00000, 0x3F800000, -1),
    ],
)
@pytest.mark.parametrize("name", ["float32_add_iterative", "float32_serial"])
@pytest.mark.parametrize("simulator", FASTEST)
def test_an_iterative_addition_takes_a_cycle_for_each_place_it_shifts(
    simulator: str, name: str, a: int, b: int, shifts: int, tmp_path: Path
) -> None:
    lane = LANES[name]
    assert first_latency(lane, (0, a, b), simulator, tmp_path) == min(lane.latencies.values()) + shifts


@pytest.mark.parametrize("unit", ["add", "div"])
@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("simulator", FASTEST)
def test_both_forms_of_a_unit_give_the_same_bits(simulator: str, name: str, unit: str, tmp_path: Path) -> None:
    lanes = [LANES[f"{name}_{unit}_{kind}"] for kind in ("iterative", "pipelined")]
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
