"""Modules that are synthesised in seconds stay within their budgets; `make synth` looks at all."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from openecho import hardware, report
from scripts import formal, synth

QUICK = ("second_difference", "inflection", "parameters", "output", "encoder")


def synthesised(name: str) -> tuple[synth.Build, dict[str, Any]]:
    """A module's build and what it takes; skips where the tool is missing, but fails in CI."""
    missing = formal.missing_package()
    if missing is not None:
        assert "CI" not in os.environ, f"CI: {missing} is not installed"
        pytest.skip(f"{missing} is not installed")
    build = next(build for build in synth.BUILDS if build.name == name)
    return build, {"name": name, **synth.area(build, report.tools(synth.TOOLS[0]))}


@pytest.mark.parametrize("name", QUICK)
def test_module_stays_within_its_budget(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(synth, "KEPT", tmp_path)
    build, taken = synthesised(name)
    assert synth.overruns([build], [taken]) == []


def test_encoder_of_8_bits_takes_at_most_400_luts_and_neither_dsp_nor_block_ram(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(synth, "KEPT", tmp_path)
    _, taken = synthesised("encoder of 8 bits")
    assert taken["lut"] <= 400
    assert (taken["dsp"], taken["bram36"]) == (0, 0)


def test_module_that_grows_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(synth, "KEPT", tmp_path)
    build, taken = synthesised("output")
    module = hardware.MODULES["output"]
    assert module.budget is not None
    small = replace(module.budget, ff=taken["ff"] - 1, path_ns=1)
    monkeypatch.setitem(hardware.MODULES, "output", replace(module, budget=small))
    grown = synth.overruns([build], [taken])
    assert [line.split(" takes ")[1].split()[1] for line in grown] == ["ff,", "path_ns,"]
