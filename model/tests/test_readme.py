"""`make readme` replaces what stands between its markers and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from openecho import report
from scripts import readme


def test_only_the_lines_between_the_markers_are_replaced() -> None:
    text = "above\n<!-- begin one -->\nold\n<!-- end one -->\nbelow\n"
    assert readme.replaced(text, "one", ["a", "b"]) == text.replace("old", "a\nb")


@pytest.mark.parametrize("text", ["", "<!-- begin one -->\n", "<!-- begin one -->\n<!-- end one -->\n" * 2])
def test_missing_or_repeated_markers_are_an_error(text: str) -> None:
    with pytest.raises(ValueError, match="expected one part"):
        readme.replaced(text, "one", [])


def test_every_part_has_its_markers_in_the_readme() -> None:
    text = readme.README.read_text()
    for name in (*readme.PARTS, *readme.LONG_PARTS):
        readme.replaced(text, name, [])


def test_parts_of_long_studies_stay_without_a_full_report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(report, "FOLDER", tmp_path)
    assert readme.with_long_studies("whatever") == "whatever"
    for name in ("trade", "extremes", "synth", "bench"):
        report.write(name, {"quick": True})
    assert readme.with_long_studies("whatever") == "whatever"
