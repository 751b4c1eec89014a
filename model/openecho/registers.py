"""The registers of the AXI shell `openecho_axi`: the one table that its RTL, the C header and the README are made from.

Offsets are in bytes. Every register is a word of 32 bits; bits without a field read 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from openecho import __version__
from openecho.golden import RATIO_FRAC, Config

ADDRESS_W = 12
"""Bits of an address: 4 KiB, the least that an AXI interconnect maps, so that no register shows up twice."""

READ_ONLY: Final = "read"
READ_WRITE: Final = "read, write"
CLEARED: Final = "read, write 1 to clear"
COMMAND: Final = "read, write 1 to start"

MADE_BY = "made by scripts/registers.py from model/openecho/registers.py, not written by hand"


@dataclass(frozen=True)
class Field:
    """Bits of a register.

    Attributes
    ----------
    name : str
        Empty if the register is one number.
    low, width : int
        Lowest bit, and how many.
    meaning : str
        For the README and the C header.
    """

    name: str
    low: int
    width: int
    meaning: str

    @property
    def bits(self) -> str:
        """Highest and lowest bit, or the only one."""
        return str(self.low) if self.width == 1 else f"{self.low + self.width - 1}:{self.low}"

    @property
    def mask(self) -> int:
        """Ones where the field is."""
        return (1 << self.width) - 1 << self.low


@dataclass(frozen=True)
class Register:
    """One register.

    Attributes
    ----------
    name : str
        In capitals.
    offset : int
        Bytes.
    access : str
        One of the constants of this module.
    reset : int or None
        Value after `aresetn`; None if it says how the core was built.
    meaning : str
        Of the whole.
    fields : tuple of Field
        From the lowest bit up.
    """

    name: str
    offset: int
    access: str
    reset: int | None
    meaning: str
    fields: tuple[Field, ...]

    @property
    def width(self) -> int:
        """Bits up to the highest with a meaning."""
        return max(field.low + field.width for field in self.fields)


def version_word(version: str) -> int:
    """Register VERSION of a release: major, minor and patch, a byte each from bit 16 down.

    Raises
    ------
    ValueError
        If the version is anything but three numbers below 256.
    """
    parts = version.split(".")
    if len(parts) != 3 or not all(part.isdecimal() and int(part) < 256 for part in parts):
        raise ValueError(f"version: found {version!r}, expected major.minor.patch, each below 256")
    major, minor, patch = map(int, parts)
    return major << 16 | minor << 8 | patch


def _number(width: int, meaning: str = "") -> tuple[Field, ...]:
    return (Field("", 0, width, meaning),)


def _counter(name: str, offset: int, meaning: str) -> Register:
    return Register(name, offset, READ_ONLY, 0, f"{meaning}; stops at all ones", _number(32))


_DEFAULT = Config()
_INTERRUPTS = (
    Field("WAVEFORM", 0, 1, "a waveform's trailer was taken"),
    Field("ERROR", 1, 1, "an error was counted"),
)

REGISTERS: tuple[Register, ...] = (
    Register("ID", 0x00, READ_ONLY, int.from_bytes(b"OECH", "big"), "`OECH` in ASCII", _number(32)),
    Register(
        "VERSION",
        0x04,
        READ_ONLY,
        version_word(__version__),
        "of OpenEcho",
        (Field("PATCH", 0, 8, "patch"), Field("MINOR", 8, 8, "minor"), Field("MAJOR", 16, 8, "major")),
    ),
    Register(
        "BUILD0",
        0x08,
        READ_ONLY,
        None,
        "parameters",
        (
            Field("SAMPLE_W", 0, 8, "`SAMPLE_W`"),
            Field("EXP_W", 8, 8, "`EXP_W`"),
            Field("FRAC", 16, 8, "`FRAC`"),
            Field("WORD_W", 24, 8, "bits of a record's word, 32 or 64"),
        ),
    ),
    Register("BUILD1", 0x0C, READ_ONLY, None, "", (Field("MAX_SAMPLES", 0, 17, "`MAX_SAMPLES`"),)),
    Register("BUILD2", 0x10, READ_ONLY, None, "", (Field("TAP_COUNT", 0, 8, "`TAP_COUNT`"),)),
    Register(
        "CONTROL",
        0x14,
        COMMAND,
        0,
        "",
        (Field("SOFT_RESET", 0, 1, "soft reset: after the waveforms that were begun; 1 until it is done"),),
    ),
    Register(
        "STATUS",
        0x18,
        READ_ONLY,
        0,
        "",
        (
            Field("BUSY", 0, 1, "a waveform is in the core"),
            Field("CHANGE_WAITS", 1, 1, "a changed setting waits for the core to empty"),
            Field("RESET_WAITS", 2, 1, "a soft reset waits for it"),
        ),
    ),
    Register(
        "N", 0x20, READ_WRITE, _DEFAULT.n_raw, f"setting `n`, 4.4 bits, at least {1 << RATIO_FRAC:#x}", _number(8)
    ),
    Register(
        "MIN_INTERVAL",
        0x24,
        READ_WRITE,
        _DEFAULT.min_interval,
        "setting `min_interval`, as many bits as count `MAX_SAMPLES`",
        _number(16),
    ),
    Register(
        "MIN_AMPLITUDE",
        0x28,
        READ_WRITE,
        _DEFAULT.min_amplitude,
        "setting `min_amplitude`, `SAMPLE_W` bits",
        _number(16),
    ),
    Register("K", 0x2C, READ_WRITE, _DEFAULT.k_raw, "setting `k`, 4.4 bits", _number(8)),
    _counter("WAVEFORMS", 0x30, "trailers taken"),
    _counter("ECHOES", 0x34, "echoes taken"),
    _counter("STALLS", 0x38, "cycles in which a sample was offered and not taken"),
    _counter("ERRORS", 0x3C, "errors, of all causes"),
    Register("IRQ_STATUS", 0x40, CLEARED, 0, "", _INTERRUPTS),
    Register("IRQ_MASK", 0x44, READ_WRITE, 0, "bits of IRQ_STATUS that raise `irq`", _INTERRUPTS),
    Register(
        "ERROR_CAUSE",
        0x48,
        CLEARED,
        0,
        "",
        (
            Field("TOO_SHORT", 0, 1, "waveform too short"),
            Field("TOO_LONG", 1, 1, "waveform too long, or a missing tlast"),
            Field("SAMPLE", 2, 1, "sample beyond full scale"),
            Field("SETTING", 3, 1, "illegal setting written"),
        ),
    ),
)
"""All registers in the order of their offsets."""

BY_NAME: Mapping[str, Register] = {register.name: register for register in REGISTERS}
SETTINGS = ("N", "MIN_INTERVAL", "MIN_AMPLITUDE", "K")
"""Registers of the core's settings: in lower case, the keys of `hardware.settings`."""


def reset_values(config: Config) -> dict[str, int]:
    """Value of each register by name after reset, in a core that is built so."""
    built = {
        "SAMPLE_W": config.sample_w,
        "EXP_W": config.exp_w,
        "FRAC": config.frac,
        "WORD_W": config.word_w,
        "MAX_SAMPLES": config.max_samples,
        "TAP_COUNT": config.tap_count,
    }
    return {
        register.name: sum(built[field.name] << field.low for field in register.fields)
        if register.reset is None
        else register.reset
        for register in REGISTERS
    }


def systemverilog() -> str:
    """SystemVerilog package of addresses, reset values and bits."""
    lines = [
        f"// Registers of openecho_axi: {MADE_BY}.",
        "package openecho_registers_pkg;",
        f"  localparam int ADDRESS_W = {ADDRESS_W};  // of bytes",
    ]
    for register in REGISTERS:
        lines += ["", *([f"  // {register.meaning}"] if register.meaning else [])]
        digits = f"{register.offset:0{ADDRESS_W // 4}x}"
        lines.append(f"  localparam logic [ADDRESS_W-1:0] ADDRESS_{register.name} = {ADDRESS_W}'h{digits};")
        if register.reset is not None:
            lines.append(f"  localparam logic [31:0] RESET_{register.name} = 32'h{register.reset:08x};")
        named = [field for field in register.fields if field.name]
        if named:
            lines.append(f"  localparam int {register.name}_W = {register.width};")
        lines += [
            f"  localparam int {register.name}_{field.name} = {field.low};  // {field.meaning}" for field in named
        ]
    return "\n".join([*lines, "endpackage", ""])


def c_header() -> str:
    """C header of offsets, reset values, masks and shifts."""
    lines = [
        f"/* Registers of openecho_axi: {MADE_BY}. */",
        "#ifndef OPENECHO_REGISTERS_H",
        "#define OPENECHO_REGISTERS_H",
    ]
    for register in REGISTERS:
        name = f"OPENECHO_{register.name}"
        about = f"{register.access}; {register.meaning}" if register.meaning else register.access
        lines += ["", f"/* {about} */", f"#define {name}_OFFSET 0x{register.offset:02x}u"]
        if register.reset is not None:
            lines.append(f"#define {name}_RESET 0x{register.reset:08x}u")
        for field in register.fields:
            if field.name:
                lines.append(f"#define {name}_{field.name}_SHIFT {field.low}u /* {field.meaning} */")
                lines.append(f"#define {name}_{field.name}_MASK 0x{field.mask:08x}u")
    return "\n".join([*lines, "", "#endif", ""])


def markdown() -> list[str]:
    """Lines of the README's table."""
    return [
        "| offset | register | access | reset | bits |",
        "| --- | --- | --- | --- | --- |",
        *(
            f"| {register.offset:#04x} | `{register.name}` | {register.access} | {_reset_text(register)} "
            f"| {'; '.join(_bits_text(register))} |"
            for register in REGISTERS
        ),
    ]


def _reset_text(register: Register) -> str:
    return "as built" if register.reset is None else f"{register.reset:#x}"


def _bits_text(register: Register) -> Iterator[str]:
    """What the bits of a register mean, each field by itself."""
    if register.meaning:
        yield register.meaning
    for field in register.fields:
        if field.meaning:
            yield f"{field.bits} {field.meaning}"
