"""What one simulation is to do: written by the process that starts it, read by the tests inside it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from openecho.golden import Config

RUN_VARIABLE = "OPENECHO_RUN"
"""Environment variable with the path of the saved `Run`."""


@dataclass(frozen=True)
class Run:
    """What one simulation does.

    Attributes
    ----------
    module : str
        Row of the module table.
    config : Config
        What the module is built with, and the settings that tests start from.
    seed : int
        Of all that is random.
    samples : str
        File with the waveforms of the reference run (`samples`, `length`), or empty.
    result : str
        File for what the reference run measures, or empty.
    progress : str
        File that grows by a byte for each waveform, or empty.
    """

    module: str
    config: Config
    seed: int = 0
    samples: str = ""
    result: str = ""
    progress: str = ""

    def save(self, path: Path) -> None:
        """Write as JSON."""
        path.write_text(json.dumps(asdict(self)))

    @classmethod
    def load(cls, path: Path) -> Run:
        """Read what `save` wrote."""
        content = json.loads(path.read_text())
        content["config"]["taps"] = tuple(content["config"]["taps"])
        return cls(**content | {"config": Config(**content["config"])})
