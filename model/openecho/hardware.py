"""The RTL modules: the one table that simulation, tests, lint and synthesis read. A new module is one row."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from openecho import golden
from openecho.golden import TAP_FRAC, Beats, Config
from openecho.golden.floating import Format

ROOT = Path(__file__).resolve().parents[2]
"""The repository."""
RTL = ROOT / "rtl"
PACKAGE = RTL / "openecho_pkg.sv"


@dataclass(frozen=True)
class Stream:
    """A valid/ready stream of a module.

    Attributes
    ----------
    prefix : str
        Ports are named `prefix_valid`, `prefix_ready`, and so on.
    fields : tuple of str
        Payload ports besides `last`; the keys of the golden model's `Beats`.
    last : bool
        Whether a port `last` ends a waveform. Without one each beat stands for a waveform.
    words : int
        Numbers in each field: 1, or more for a field that packs several, the first in its lowest bits.
    """

    prefix: str
    fields: tuple[str, ...]
    last: bool = True
    words: int = 1


@dataclass(frozen=True)
class Budget:
    """What a module may take of an xc7, synthesised by itself with default parameters.

    Attributes
    ----------
    lut : int
        LUTs, those in memories and shift registers among them.
    ff, dsp : int
        Flip-flops, multipliers.
    bram36 : float
        Block RAMs of 36 kbit.
    path_ns : float
        Longest path between registers, ns, of the cells alone.
    """

    lut: int
    ff: int
    dsp: int = 0
    bram36: float = 0
    path_ns: float = 3.3  # of the 5 ns at 200 MHz: the rest is for the wires


@dataclass(frozen=True)
class Module:
    """One RTL module.

    Attributes
    ----------
    name : str
        As in the golden model; file and module are `openecho_<name>`.
    parameters : tuple of str
        Parameters that follow from a `Config`, keys of `parameters`.
    inputs, outputs : tuple of Stream
        In the order of the golden function's arguments and results.
    settings : tuple of str
        Run-time input ports, keys of `settings`.
    golden : callable or None
        The bit-exact model: Beats of each input and a `Config` to the Beats of each output. None for a part that is
        verified inside the modules that use it.
    latency : dict of str to callable
        For an output's prefix, the cycles from the transfer of the beat that determines an output beat to the transfer
        of that beat, in an idle module whose sink is ready: a function of the `Config`, or of the `FloatUnit`. Where an
        echo takes longer than a trailer, by what its interpolations and divisions take, that of a trailer.
    waits : int
        Clocks for which the first input may wait in each waveform, with a ready sink, while its first samples pass.
    budget : Budget or None
        What it may take: what it took when this was last looked at, so that a change that makes it grow is noticed.
    """

    name: str
    parameters: tuple[str, ...] = ()
    inputs: tuple[Stream, ...] = ()
    outputs: tuple[Stream, ...] = ()
    settings: tuple[str, ...] = ()
    golden: Callable[..., Beats | tuple[Beats, ...]] | None = None
    latency: dict[str, Callable[[Any], int]] | None = None
    waits: int = 0
    budget: Budget | None = None

    @property
    def top(self) -> str:
        """Name in SystemVerilog."""
        return f"openecho_{self.name}"

    @property
    def streams(self) -> tuple[Stream, ...]:
        """Inputs, then outputs."""
        return self.inputs + self.outputs

    @property
    def sources(self) -> tuple[Path, ...]:
        """Files in the order of compilation: the package, what the module uses, the module."""
        return tuple(dict.fromkeys((PACKAGE, *_sources(_file(self.top)))))

    @property
    def takes_samples(self) -> bool:
        """Whether a beat of the first input is a sample, of which the module must take one a clock."""
        return bool(self.inputs) and not {"sample", "raw"}.isdisjoint(self.inputs[0].fields)

    def expected(self, inputs: dict[str, Beats], config: Config) -> dict[str, Beats]:
        """Beats that the golden model puts on each output, by prefix, for the beats on each input."""
        if self.golden is None:
            raise ValueError(f"{self.name}: no golden model, expected one of {', '.join(bench_names())}")
        results = self.golden(*(inputs[stream.prefix] for stream in self.inputs), config)
        by_output = results if isinstance(results, tuple) else (results,)
        return {stream.prefix: beats for stream, beats in zip(self.outputs, by_output, strict=True)}


@dataclass(frozen=True)
class FloatUnit:
    """A float unit as it is built.

    Attributes
    ----------
    form : Format
        Its parameters EXP_W and FRAC_W.
    parameters : mapping of str to int
        The others.
    """

    form: Format
    parameters: Mapping[str, int] = field(default_factory=dict)


_SAMPLES = ("sample", "index", "overlong")
_BESIDE = ("raw", "index", "overlong")
_DIFFERENCES = ("second", "first", "raw", "overlong")
_COMPONENTS = ("left", "right", "peak", "amplitude", "length", "mean", "flags")
_ECHOES = ("centre", "peak", "width", "time", "amplitude", "flags")
_NOISE = Stream("noise", ("mean", "deviation", "none"), last=False)
_RECORDS = Stream("m", ("record",), words=8)
_FILTER = ("SAMPLE_W", "MAX_SAMPLES", "TAP_COUNT", "TAPS")
_POSITIONS = ("SAMPLE_W", "EXP_W", "FRAC", "MAX_SAMPLES")
_FLOAT = ("EXP_W", "FRAC_W")
_ALL = ("SAMPLE_W", "EXP_W", "FRAC", "MAX_SAMPLES", "TAP_COUNT", "TAPS")


def _second_difference_latency(config: Config) -> int:
    """Cycles of `second_difference`: 1, and those of a conversion in floating point."""
    if config.form is None:
        return 1
    built = FloatUnit(config.form, {"INT_W": config.difference_w, "SCALE": -TAP_FRAC})
    return 1 + _from_int_latency(built)


def _core_latency(config: Config) -> int:
    """Cycles of the core's modules in a row; those of `output` are none."""
    names = ("reader", "filter", "second_difference", "inflection", "parameters")
    return sum((MODULES[name].latency or {})["m"](config) for name in names)


def _levels(width: int) -> int:
    """Stages of a shifter that has so many places, four to choose from in each: ceil(log4(width))."""
    return ((width - 1).bit_length() + 1) // 2


def _add_latency(unit: FloatUnit) -> int:
    """If iterative, of a sum with a carry and nothing to align; the header of the RTL says what others take."""
    if unit.parameters.get("ITERATIVE"):
        return 4
    return 6 + _levels(unit.form.frac_w + 5)


def _mul_latency(unit: FloatUnit) -> int:
    significand = unit.form.frac_w + 1
    return 5 + _levels(significand) + math.ceil(significand / 17)


def _div_latency(unit: FloatUnit) -> int:
    """If iterative, of normal numbers with a quotient of at least 1; the header of the RTL says what others take."""
    if unit.parameters["ITERATIVE"]:
        return _serial_latency(unit)
    return unit.form.frac_w + 9 + _levels(unit.form.frac_w + 1)


def _serial_latency(unit: FloatUnit) -> int:
    """Of a division, as above; sums take as long as in an iterative adder."""
    return unit.form.frac_w + 6


def _from_int_latency(unit: FloatUnit) -> int:
    """If iterative, of the most negative integer; the header of the RTL says what others take."""
    if unit.parameters.get("ITERATIVE"):
        return 3
    int_w, scale = unit.parameters["INT_W"], unit.parameters["SCALE"]
    return 3 + _levels(int_w + max(0, 1 - (int_w - 1 + scale + unit.form.bias)))


MODULES: dict[str, Module] = {
    row.name: row
    for row in (
        Module(
            name="reader",
            parameters=("SAMPLE_W", "MAX_SAMPLES"),
            inputs=(Stream("s", ("sample",)),),
            outputs=(Stream("m", _SAMPLES), _NOISE),
            golden=golden.reader,
            latency={"m": lambda _: 1},
            budget=Budget(lut=147, ff=243, dsp=2),
        ),
        Module(
            name="filter",
            parameters=_FILTER,
            inputs=(Stream("s", _SAMPLES),),
            outputs=(Stream("m", ("sum", "first", *_BESIDE)),),
            golden=golden.filter,
            latency={"m": lambda _: 5},
            budget=Budget(lut=268, ff=544),
        ),
        Module(
            name="second_difference",
            parameters=_ALL,
            inputs=(Stream("s", ("first", *_BESIDE)),),
            outputs=(Stream("m", (*_DIFFERENCES, "index")),),
            golden=golden.second_difference,
            latency={"m": _second_difference_latency},
            budget=Budget(lut=22, ff=66),
        ),
        Module(
            name="inflection",
            parameters=_ALL,
            inputs=(Stream("s", _DIFFERENCES), _NOISE),
            outputs=(Stream("m", _COMPONENTS),),
            settings=("min_interval", "min_amplitude", "k"),
            golden=golden.inflection,
            latency={"m": lambda _: 6},
            budget=Budget(lut=433, ff=448),
        ),
        Module(
            name="parameters",
            parameters=_POSITIONS,
            inputs=(Stream("s", _COMPONENTS),),
            outputs=(Stream("m", _ECHOES),),
            settings=("n",),
            golden=golden.parameters,
            latency={"m": lambda _: 1},
            budget=Budget(lut=168, ff=188),
        ),
        Module(
            name="output",
            parameters=_POSITIONS,
            inputs=(Stream("s", _ECHOES),),
            outputs=(_RECORDS,),
            golden=golden.output,
            latency={"m": lambda _: 0},
            budget=Budget(lut=5, ff=48),
        ),
        Module(
            name="core",
            parameters=_ALL,
            inputs=(Stream("s", ("sample",)),),
            outputs=(_RECORDS,),
            settings=("n", "min_interval", "min_amplitude", "k"),
            golden=golden.core,
            latency={"m": _core_latency},
            budget=Budget(lut=999, ff=1486, dsp=2),
        ),
        # The lossless codec
        Module(
            name="encoder",
            parameters=("SAMPLE_W",),
            inputs=(Stream("s", ("sample",)),),
            outputs=(Stream("m", ("word",)),),
            settings=("mode", "threshold", "baseline_even", "baseline_odd"),
            golden=golden.encoder,
            latency={"m": lambda _: 9},
            waits=5,
            budget=Budget(lut=467, ff=570),
        ),
        Module(
            name="decoder",
            parameters=("SAMPLE_W",),
            inputs=(Stream("s", ("word",)),),
            outputs=(Stream("m", ("sample", "flags")),),
            golden=golden.decoder,
            latency={"m": lambda _: 2},
            # One loop by nature: where a code begins, and what it means, hangs on the sample before.
            budget=Budget(lut=880, ff=309, path_ns=9.0),
        ),
        # The core on AXI buses, verified by tb/axi
        Module(name="axi", parameters=_ALL),
        Module(name="axi_top", parameters=_ALL),
        Module(name="axi_lite"),
        Module(name="check", parameters=("SAMPLE_W", "EXP_W", "FRAC", "MAX_SAMPLES", "TAP_COUNT")),
        Module(name="interpolate", parameters=("EXP_W", "FRAC", "MAX_SAMPLES", "TAP_COUNT")),
        Module(name="detect", parameters=_ALL),
        Module(name="threshold", parameters=("SAMPLE_W",)),
        Module(name="noise", parameters=("SAMPLE_W", "MAX_SAMPLES")),
        Module(name="predictor", parameters=("SAMPLE_W",)),
        Module(name="coder", parameters=("SAMPLE_W",)),
        Module(name="packer", parameters=("SAMPLE_W",)),
        Module(name="restorer", parameters=("SAMPLE_W",)),
        Module(name="crc", parameters=("SAMPLE_W",)),
        Module(name="fifo"),
        Module(name="multiply"),
        Module(name="square_root"),
        # IEEE-754 units, verified by tb/float, and their parts
        Module(name="float_add", parameters=_FLOAT, latency={"m": _add_latency}),
        Module(name="float_mul", parameters=_FLOAT, latency={"m": _mul_latency}),
        Module(name="float_div", parameters=_FLOAT, latency={"m": _div_latency}),
        Module(name="float_serial", parameters=_FLOAT, latency={"m": _serial_latency}),
        Module(name="float_compare", parameters=_FLOAT, latency={"m": lambda _: 1}),
        Module(name="float_from_int", parameters=_FLOAT, latency={"m": _from_int_latency}),
        Module(name="float_to_fixed", parameters=_FLOAT, latency={"m": lambda _: 4}),
        Module(name="float_check", parameters=_FLOAT),
        Module(name="float_unpack", parameters=_FLOAT),
        Module(name="float_operand", parameters=_FLOAT),
        Module(name="float_align"),
        Module(name="float_normalize"),
        Module(name="float_range", parameters=_FLOAT),
        Module(name="float_round", parameters=_FLOAT),
    )
}


def bench_names() -> tuple[str, ...]:
    """Modules that have a golden model and so a bench of their own."""
    return tuple(name for name, row in MODULES.items() if row.golden is not None)


def parameters(config: Config) -> dict[str, str]:
    """Values of all RTL parameters as SystemVerilog literals that Icarus and Verilator both take on the command line.

    The taps are the first half of the symmetric set, 16 bits each, tap 0 in the lowest.
    """
    half = config.taps[: (config.tap_count + 1) // 2]
    word, total = package_constants()["TAP_W"], package_constants()["TAPS_W"]
    flat = sum((tap & (1 << word) - 1) << word * k for k, tap in enumerate(half))
    return {
        "SAMPLE_W": str(config.sample_w),
        "EXP_W": str(config.exp_w),
        "FRAC": str(config.frac),
        "MAX_SAMPLES": str(config.max_samples),
        "TAP_COUNT": str(config.tap_count),
        "TAPS": f"{total}'h{flat:0{total // 4}x}",
    }


def settings(config: Config) -> dict[str, int]:
    """Values of the run-time inputs."""
    return {
        "n": config.n_raw,
        "min_interval": config.min_interval,
        "min_amplitude": config.min_amplitude,
        "k": config.k_raw,
        "mode": config.codec_mode,
        "threshold": config.codec_threshold,
        "baseline_even": config.codec_baseline_even,
        "baseline_odd": config.codec_baseline_odd,
    }


@cache
def package_constants() -> dict[str, int]:
    """Integer constants of the SystemVerilog package by name.

    Raises
    ------
    ValueError
        If a constant is not an expression of integers and constants before it.
    """
    values: dict[str, int] = {}
    for name, expression in re.findall(r"^\s*localparam int (\w+) = ([^;]+);", PACKAGE.read_text(), re.MULTILINE):
        value = None
        for operator, term in re.findall(r"([*/+-]?)\s*(\w+)\s*", expression):
            number = int(term) if term.isdecimal() else values[term]
            if value is None:
                value = number
            elif operator == "*":
                value *= number
            elif operator == "/":
                value //= number
            else:
                raise ValueError(f"{PACKAGE}: {name} is {expression}, expected products and quotients of integers")
        assert value is not None
        values[name] = value
    return values


def _file(name: str) -> Path:
    """File of a module, wherever it is in the RTL."""
    return next(path for suffix in (".sv", ".v") for path in RTL.rglob(name + suffix))


def _sources(path: Path) -> tuple[Path, ...]:
    """Files of the packages and modules that a file uses, each after what it uses itself, then the file."""
    pattern = r"^\s*(?:import\s+(openecho_\w+)::|(openecho_\w+)\s*(?:#\s*\(|u_\w+))"
    used = [package or module for package, module in re.findall(pattern, path.read_text(), re.MULTILINE)]
    below = (source for name in used for source in _sources(_file(name)))
    return tuple(dict.fromkeys((*below, path)))
