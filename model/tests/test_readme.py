"""`make readme` replaces what stands between its markers and nothing else."""

from __future__ import annotations

import pytest

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
    for name in readme.PARTS:
        readme.replaced(text, name, [])
