"""What all tests share: recorded waveforms, and `pytest --arith=NAME` for those of one arithmetic."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from openecho.golden import ARITHMETICS


@pytest.fixture
def recorded() -> Path:
    """Folder of recorded waveforms, which are not part of the project; a test without it fails in CI, or is skipped."""
    folder = os.environ.get("OPENECHO_DATA")
    if folder is None:
        assert "CI" not in os.environ, "CI: OPENECHO_DATA is not set, expected the folder of recorded waveforms"
        pytest.skip("OPENECHO_DATA names no folder with recorded waveforms")
    return Path(folder)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption("--arith", help=f"one of {', '.join(ARITHMETICS)}; all if left out")


def pytest_configure(config: pytest.Config) -> None:
    """Refuse an arithmetic that there is not."""
    config.addinivalue_line("markers", "arithmetic(name): what the RTL under test is built for")
    config.addinivalue_line("markers", "counted: a bench that coverage is counted with")
    chosen = config.getoption("--arith")
    if chosen not in (None, *ARITHMETICS):
        pytest.exit(f"error: ARITH: found {chosen!r}, expected one of {', '.join(ARITHMETICS)}", returncode=2)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the tests of other arithmetics."""
    chosen = config.getoption("--arith")
    if chosen is None:
        return
    others = [item for item in items if any(mark.args[0] != chosen for mark in item.iter_markers("arithmetic"))]
    config.hook.pytest_deselected(items=others)
    items[:] = [item for item in items if item not in others]
