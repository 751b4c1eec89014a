"""The table of proofs stays in step with the RTL, and the quickest of them runs: it passes, and fails with a fault."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from openecho.hardware import RTL, bench_names
from scripts import formal


def need_tools() -> None:
    """Skip where the solver is missing; fail in CI, where nothing may be left out."""
    missing = formal.missing_package()
    if missing is not None:
        assert "CI" not in os.environ, f"CI: {missing} is not installed"
        pytest.skip(f"{missing} is not installed")


def fifo() -> formal.Row:
    return next(row for row in formal.ROWS if row.module == "fifo")


def test_every_module_with_a_bench_and_its_parts_have_a_proof_and_a_planted_fault() -> None:
    expected = {*bench_names(), "fifo", "noise", "detect", "threshold", "interpolate", "axi_lite", "axi"}
    assert expected <= {row.module for row in formal.ROWS}
    assert expected <= {row.module for row in formal.ROWS if row.faults}
    assert expected <= {row.module for row in formal.ROWS if row.cover_depth}


def test_names_of_proofs_are_unique() -> None:
    assert len({row.name for row in formal.ROWS}) == len(formal.ROWS)


@pytest.mark.parametrize("row", formal.ROWS, ids=lambda row: row.name)
def test_every_change_is_of_one_line_that_the_module_has(row: formal.Row) -> None:
    for made in (*row.faults, *row.reduced):
        assert RTL / made.file in row.sources
        assert formal.change((RTL / made.file).read_text(), made) != (RTL / made.file).read_text()


def test_proof_passes_and_reaches_its_covers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    need_tools()
    monkeypatch.setattr(formal, "KEPT", tmp_path)
    proof, cover = (formal.solve(run) for run in formal.runs([fifo()], faults=False))
    assert (proof.status, proof.failed) == ("PASS", ())
    assert (cover.status, cover.covers) == ("PASS", 4)


def test_proof_fails_with_a_fault_and_names_the_property(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    need_tools()
    monkeypatch.setattr(formal, "KEPT", tmp_path)
    outcome = formal.solve(formal.Run(fifo(), "fault", fifo().faults[0]))
    assert outcome.status == "FAIL"
    assert "accepts_unless_full" in outcome.failed
    assert outcome.trace.is_file()
