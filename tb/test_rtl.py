"""Every RTL module against its golden model, on every simulator, with several sets of parameters."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest

from openecho import golden
from openecho.golden import Config
from openecho.hardware import MODULES, ROOT, bench_names, package_constants, parameters
from tb.env import coverage, runner, tests
from tb.env.run import Run

NEGATIVE = (-90, -61, -17, 40, 99, 131, 140, 133, 118, 101, 86, 75, 66, 60, 55, 52, 49, 47, 46, 46, 45, 45, 45)
"""Half of a set of 47 taps with negative ones; its centre is stated below."""
STEEP = (25000, *range(1400, 1400 * 24, 1400))
"""Half of a set of 48 taps with steep edges, whose sums need more than 32 bits."""

CONFIGS = {
    "default": Config(),
    "short": Config(max_samples=1100),
    "narrow": Config(sample_w=8, frac=4, max_samples=1100, taps=(3, 11, 16, 11, 3)),
    "wide": Config(sample_w=16, frac=24, max_samples=1100, taps=STEEP + STEEP[::-1]),
    # Taps with strong edges: the second difference is wider than the first.
    "four taps": Config(sample_w=12, frac=10, max_samples=1025, taps=(-5, 9, 9, -5)),
    "negative taps": Config(sample_w=10, max_samples=1300, taps=(*NEGATIVE, 44, *NEGATIVE[::-1]), n=1.0, k=2.5),
    "float64": Config(exp_w=11, frac=52, max_samples=1100),
    "float32": Config(exp_w=8, frac=23, max_samples=1100),
    "float16": Config(exp_w=5, frac=10, max_samples=1100),
    "bfloat16": Config(sample_w=8, exp_w=8, frac=7, max_samples=1100, taps=(3, 11, 16, 11, 3)),
    # Quotients of so few bits that they come before their base has been converted.
    "coarse": Config(exp_w=5, frac=2, max_samples=16384),
    # A format of its own, with as wide integers as there are to convert.
    "float24": Config(sample_w=16, exp_w=7, frac=16, max_samples=1100, taps=STEEP + STEEP[::-1]),
}
"""Parameters to test with. Other than the default they have a small MAX_SAMPLES, so that long waveforms cost little."""

ON_ICARUS = ("short", "narrow", "float16")
"""What Icarus, the slower simulator, runs: the first in place of the default."""

COUNTED = ("default", "float16")
"""What coverage is counted with, on Verilator: either arithmetic."""

CODEC = {"verilator": ("default", "narrow", "wide"), "icarus": ("short",)}
"""What encoder and decoder, which know of no taps, run."""

ILLEGAL = {
    "SAMPLE_W": (("7", "17"), "samples of 8 to 16 bits"),
    "FRAC": (("3", "25"), "4 to 24 fraction bits"),
    "TAP_COUNT": (("3", "49"), "4 to 48 taps"),
    "MAX_SAMPLES": (("21", "65537"), "TAP_COUNT + 2 up to 65536 samples"),
}
"""Values just outside each parameter's range, and what the sentence that stops elaboration must say."""

WIDE = parameters(CONFIGS["wide"])
ILLEGAL_FLOATS: list[tuple[dict[str, int | str], str]] = [
    ({"EXP_W": 1}, "EXP_W is 1; 0, for fixed point, or exponents of 5 to 11 bits"),
    ({"EXP_W": 4}, "EXP_W is 4; 0, for fixed point, or exponents of 5 to 11 bits"),
    ({"EXP_W": 12}, "EXP_W is 12; 0, for fixed point, or exponents of 5 to 11 bits"),
    ({"FRAC": 1}, "FRAC is 1; floating-point fractions of 2 to 52 bits"),
    ({"FRAC": 53}, "FRAC is 53; floating-point fractions of 2 to 52 bits"),
    ({"MAX_SAMPLES": 16385}, "EXP_W 5 ends at 2^15; sums of positions below MAX_SAMPLES 16385 do not fit"),
    ({"SAMPLE_W": 16}, "EXP_W 5 ends at 2^15; amplitudes of SAMPLE_W 16 do not fit"),
    ({"TAP_COUNT": 48, "TAPS": WIDE["TAPS"]}, "EXP_W 5 ends at 2^15; sums of differences of 29 bits times 2^-11"),
]
"""Formats that the core refuses, as changes of a binary16 core, and what the sentence must say."""


def cases() -> Iterator[object]:
    """Every module, simulator and set of parameters that is worth its time, as pytest parameters."""
    for simulator in runner.SIMULATORS:
        for module in bench_names():
            for name, config in CONFIGS.items():
                if name not in _worth_it(module, simulator):
                    continue
                if config.form is not None and "EXP_W" not in MODULES[module].parameters:
                    continue  # the same in either arithmetic
                marks = [pytest.mark.arithmetic("fixed" if config.form is None else name)]
                if simulator == "verilator" and name in COUNTED:
                    marks.append(pytest.mark.counted)
                case = f"{module}-{simulator}-{name.replace(' ', '_')}"
                yield pytest.param(module, simulator, name, id=case, marks=marks)


def _worth_it(module: str, simulator: str) -> Collection[str]:
    """Sets of parameters that a module is run with on a simulator."""
    if module in ("encoder", "decoder"):
        return CODEC[simulator]
    return ON_ICARUS if simulator == "icarus" else CONFIGS.keys() - {"short"}


def benches(module: str, config: Config) -> list[str]:
    """Python modules with the tests of an RTL module."""
    return ["tb.env.tests", *rates(module, config), f"tb.modules.{module}"]


def rates(module: str, config: Config) -> list[str]:
    """Python modules with the tests of what an RTL module takes without a stall.

    Echoes wait in a queue to be interpolated, which takes no endless train of them; in floating point, where more of it
    is kept free for what is on its way, only as many at once as come in recorded data.
    """
    row = MODULES[module]
    if not row.takes_samples:
        return []
    if "min_interval" not in row.settings:
        return ["tb.env.throughput"]
    return ["tb.env.pruning", *["tb.env.bursts"] * (config.form is None)]


def need(simulator: str) -> None:
    """Skip where a simulator is missing; fail in CI, where nothing may be left out."""
    try:
        runner.require(simulator)
    except runner.MissingToolError as error:
        if os.environ.get("CI"):
            pytest.fail(str(error))
        pytest.skip(str(error))


@pytest.mark.parametrize(("module", "simulator", "name"), list(cases()))
def test_module_equals_its_model(module: str, simulator: str, name: str, tmp_path: Path) -> None:
    need(simulator)
    run = Run(module, CONFIGS[name], int(os.environ.get("SEED", "0")))
    try:
        runner.simulate(run, simulator, tmp_path, benches(module, run.config))
    except runner.SimulationError as error:
        pytest.fail(str(error), pytrace=False)


@pytest.mark.parametrize("simulator", runner.SIMULATORS)
@pytest.mark.parametrize("parameter", ILLEGAL)
def test_illegal_parameter_stops_elaboration_with_a_sentence(parameter: str, simulator: str, tmp_path: Path) -> None:
    need(simulator)
    values, sentence = ILLEGAL[parameter]
    for value in values:
        assert sentence in runner.refusal("core", parameters(Config()) | {parameter: value}, simulator, tmp_path)


@pytest.mark.parametrize("simulator", runner.SIMULATORS)
@pytest.mark.parametrize(("changes", "sentence"), ILLEGAL_FLOATS)
def test_format_that_cannot_work_stops_elaboration_with_a_sentence(
    changes: dict[str, int | str], sentence: str, simulator: str, tmp_path: Path
) -> None:
    need(simulator)
    given = parameters(Config().in_arithmetic("float16")) | {name: str(value) for name, value in changes.items()}
    assert sentence in runner.refusal("core", given, simulator, tmp_path)


def test_package_and_model_state_the_same_constants() -> None:
    rtl = package_constants()
    assert {name: rtl[name] for name in ("NOISE_SAMPLES", "AMP_FRAC", "ROOT_FRAC", "RATIO_FRAC")} == {
        "NOISE_SAMPLES": golden.NOISE_SAMPLES,
        "AMP_FRAC": golden.AMP_FRAC,
        "ROOT_FRAC": golden.ROOT_FRAC,
        "RATIO_FRAC": golden.RATIO_FRAC,
    }
    for name in ("SATURATED", "TRUNCATED", "NO_PEAK", "TOO_SHORT", "TOO_LONG", "NO_NOISE"):
        assert 1 << rtl[f"FLAG_{name}"] == getattr(golden, name)
    assert rtl["PAPER_TAP_COUNT"] == len(golden.PAPER_TAPS)
    assert rtl["MAX_TAPS"] == golden.MAX_TAPS


def test_every_file_of_rtl_is_in_the_module_table() -> None:
    in_table = {path for row in MODULES.values() for path in row.sources}
    assert in_table == {*(ROOT / "rtl").rglob("*.sv"), *(ROOT / "rtl").rglob("*.v")}


def test_goals_of_the_tests_are_every_bin() -> None:
    every_test = (tests.EveryWaveformBackToBack, tests.GapsAndStallsChangeNothing, tests.ResetInMidWaveformStartsAfresh)
    assert frozenset().union(*(test.goals for test in every_test)) == coverage.EVERY_BIN
