"""The extremes: every guarantee holds, and every one notices the fault that is planted for it."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from openecho import report
from openecho.study.extremes import __main__ as extremes
from openecho.study.extremes.case import Case, Outcome, Trial, planted
from openecho.study.extremes.cases import CASES
from tests import browser


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.area}-{case.name}")
def test_the_guarantee_holds_and_notices_its_fault(case: Case) -> None:
    outcome = case.run(0, full=False)
    assert outcome.held, outcome.found
    faulty = case.broken(0)
    assert not faulty.held, faulty.found


def test_a_fault_is_gone_with_its_context() -> None:
    with planted(sys, "version", "wrong")():
        assert sys.version == "wrong"
    assert sys.version != "wrong"


def test_no_case_is_without_a_guarantee() -> None:
    assert len({(case.area, case.name) for case in CASES}) == len(CASES)
    for case in CASES:
        assert all((case.tried, case.guarantee, case.fault)), case.name


def failing(trial: Trial) -> Outcome:
    raise ValueError("found <nothing>")


def test_what_fails_is_told_and_red_and_the_status_is_1(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = replace(next(case for case in CASES if case.name == "noise sums"), name="good")
    bad = replace(good, name="bad", check=failing)
    deaf = replace(good, name="deaf", planted=planted(sys, "version", ""))
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    monkeypatch.setattr(sys, "argv", ["extremes", "--quick", "--seed", "3"])
    monkeypatch.setattr(extremes, "CASES", (good,))
    assert extremes.main() == 0
    monkeypatch.setattr(extremes, "CASES", (good, bad, deaf))
    assert extremes.main() == 1
    assert "seed 3" in capsys.readouterr().out
    rows = json.loads((tmp_path / "extremes.json").read_text())["rows"]
    assert [(row["held"], row["caught"]) for row in rows] == [(True, True), (False, True), (True, False)]
    assert rows[1]["found"] == "ValueError: found <nothing>"
    with browser.opened(tmp_path / "extremes.html") as visit:
        assert visit.page.locator("tr.failed td:first-child").all_inner_texts() == ["bad", "deaf"]
        assert visit.page.locator("tbody tr").count() == 3
        assert visit.complaints == []
