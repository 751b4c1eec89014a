"""Reports: JSON files under ``build/reports/`` with everything that a figure in the README is copied from."""

from __future__ import annotations

import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[2] / "build" / "reports"
"""Where every command that measures writes to."""


def tools(*packages: str) -> dict[str, str]:
    """Versions of Python and of installed packages, for a report's ``tools``.

    Parameters
    ----------
    *packages : str
        Names of distributions.

    Returns
    -------
    dict
        Name to version.
    """
    return {"python": platform.python_version()} | {name: version(name) for name in packages}


def write(name: str, content: dict[str, Any]) -> Path:
    """Write a report, complete or not at all.

    Parameters
    ----------
    name : str
        File name without suffix.
    content : dict
        JSON types and numpy scalars.

    Returns
    -------
    Path
        The file, for the line that tells the user.
    """
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.json"
    save(path, content)
    return path


def save(path: Path, content: dict[str, Any]) -> None:
    """Write JSON types and numpy scalars to a file, complete or not at all."""
    partial = path.with_name(f"{path.name}.partial")
    partial.write_text(json.dumps(content, indent=1, default=lambda value: value.item()) + "\n")
    partial.replace(path)
