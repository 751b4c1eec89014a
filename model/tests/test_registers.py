"""The table of registers, and all that is made from it."""

from __future__ import annotations

import re
import subprocess
import tomllib
from itertools import combinations
from pathlib import Path

import pytest

from openecho import registers
from openecho.golden import Config
from openecho.hardware import MODULES, ROOT, package_constants, settings
from openecho.registers import ADDRESS_W, BY_NAME, READ_WRITE, REGISTERS, SETTINGS, reset_values
from scripts import registers as script


def test_registers_are_words_in_order_that_fit_the_address() -> None:
    offsets = [register.offset for register in REGISTERS]
    assert offsets == sorted(set(offsets))
    assert all(offset % 4 == 0 and 0 <= offset < 1 << ADDRESS_W for offset in offsets)
    assert len(BY_NAME) == len(REGISTERS)
    assert all(register.width <= 32 for register in REGISTERS)


def test_fields_of_a_register_do_not_overlap() -> None:
    for register in REGISTERS:
        assert not any(one.mask & other.mask for one, other in combinations(register.fields, 2)), register.name


def test_defaults_are_those_of_the_model() -> None:
    stated = {name.lower(): BY_NAME[name].reset for name in SETTINGS}
    modelled = settings(Config())
    assert stated == {name: modelled[name] for name in MODULES["core"].settings}
    assert all(BY_NAME[name].access == READ_WRITE for name in SETTINGS)
    assert BY_NAME["N"].width == BY_NAME["K"].width == package_constants()["RATIO_W"]


def test_build_registers_say_how_the_core_is_built() -> None:
    values = reset_values(Config(sample_w=12, max_samples=65536).in_arithmetic("float64"))
    assert values["BUILD0"] == 12 | 11 << 8 | 52 << 16 | 64 << 24
    assert values["BUILD1"] == 65536
    assert values["BUILD2"] == 20


def test_version_is_that_of_the_package() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert BY_NAME["VERSION"].reset == registers.version_word(version)
    assert registers.version_word("1.20.255") == 0x0114FF


@pytest.mark.parametrize("version", ["1.2", "1.2.3.4", "1.2.256", "1.2.dev3", "1.2.-3"])
def test_version_that_does_not_fit_is_refused(version: str) -> None:
    with pytest.raises(ValueError, match=f"version: found '{version}', expected major.minor.patch, each below 256"):
        registers.version_word(version)


def test_systemverilog_states_every_register() -> None:
    text = registers.systemverilog()
    stated = dict(re.findall(r"ADDRESS_(\w+) = 12'h(\w+);", text))
    assert {name: int(digits, 16) for name, digits in stated.items()} == {row.name: row.offset for row in REGISTERS}
    resets = dict(re.findall(r"RESET_(\w+) = 32'h(\w+);", text))
    assert {name: int(digits, 16) for name, digits in resets.items()} == {
        row.name: row.reset for row in REGISTERS if row.reset is not None
    }
    for row in REGISTERS:
        for field in row.fields:
            if field.name:
                assert f"localparam int {row.name}_{field.name} = {field.low};" in text


def test_c_header_compiles_and_states_every_register(tmp_path: Path) -> None:
    (tmp_path / "header.h").write_text(registers.c_header())
    lines = ['#include "header.h"', '#include "header.h"']
    for row in REGISTERS:
        lines.append(f'_Static_assert(OPENECHO_{row.name}_OFFSET == {row.offset}, "");')
        if row.reset is not None:
            lines.append(f'_Static_assert(OPENECHO_{row.name}_RESET == {row.reset}u, "");')
        for field in row.fields:
            if field.name:
                name = f"OPENECHO_{row.name}_{field.name}"
                lines.append(f'_Static_assert({name}_MASK == {field.mask}u, "");')
                lines.append(f'_Static_assert({name}_MASK >> {name}_SHIFT == {field.mask >> field.low}u, "");')
    source = tmp_path / "check.c"
    source.write_text("\n".join(lines) + "\n")
    command = ["g++", "-x", "c", "-std=c11", "-Wall", "-Werror", "-fsyntax-only", str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_files_are_what_the_table_makes() -> None:
    assert script.main(["--check"]) == 0


@pytest.mark.parametrize("name", ["PACKAGE", "HEADER", "README"])
@pytest.mark.parametrize("missing", [False, True])
def test_file_that_differs_is_named_in_one_line_and_written_anew(
    name: str, missing: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for each in ("PACKAGE", "HEADER", "README"):
        original: Path = getattr(script, each)
        copy = tmp_path / original.name
        copy.write_text(original.read_text())
        monkeypatch.setattr(script, each, copy)
    monkeypatch.setattr(script, "ROOT", tmp_path)
    assert script.main(["--check"]) == 0
    path: Path = getattr(script, name)
    text = path.read_text()
    if missing:
        path.unlink()
    else:
        path.write_text(text.replace(f"{BY_NAME['K'].offset:02x}", "ee"))
    assert script.main(["--check"]) != 0
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    assert path.name in said
    if not (missing and name == "README"):
        assert script.main([]) == 0
        assert path.read_text() == text
        assert script.main(["--check"]) == 0
