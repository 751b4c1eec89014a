"""What calculates the core's records: its golden model, or the RTL itself."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import NDArray

from openecho import golden
from openecho.golden import Config
from openecho.hardware import ROOT

Engine = Callable[[NDArray[Any], NDArray[Any], Config], NDArray[Any]]
"""(samples (n, m), length (n,), config) to records (k, 8), whose sequence starts at 0."""


class EngineError(RuntimeError):
    """An engine that can't be used here: what was found and what was expected."""


def model(samples: NDArray[Any], length: NDArray[Any], config: Config) -> NDArray[Any]:
    """Records of the golden model."""
    return golden.core(golden.stream(samples, length, config), config)["record"]


def rtl(samples: NDArray[Any], length: NDArray[Any], config: Config) -> NDArray[Any]:
    """Records of the RTL, simulated by Verilator: those of the model, or one of the two is wrong.

    Raises
    ------
    EngineError
        If there is no checkout with the bench, no Verilator, or the simulation fails.
    """
    if not (ROOT / "tb" / "replay").is_dir():
        raise EngineError(f"engine rtl: no {ROOT / 'tb'}, expected a checkout of the project, installed by make sim")
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    try:
        # The bench imports this package, so this package can't name it: whoever asks for the RTL gets it here.
        runner = importlib.import_module("tb.env.runner")
        bench = importlib.import_module("tb.replay.bench")
    except ModuleNotFoundError as error:
        raise EngineError(f"engine rtl: no module {error.name}, expected what make sim installs") from error
    try:
        runner.require("verilator")
        records: NDArray[Any] = bench.replay(samples, length, config).records
    except (runner.MissingToolError, runner.SimulationError) as error:
        raise EngineError(f"engine rtl: {error}") from error
    return records


ENGINES: Mapping[str, Engine] = {"model": model, "rtl": rtl}
"""Engines by name."""
