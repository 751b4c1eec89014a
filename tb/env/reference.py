"""The run of `make sim`: given waveforms, back to back into a sink that is always ready, compared and measured."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyuvm
from pyuvm import uvm_subscriber

from tb.env.bench import ModuleTest
from tb.env.stream import Observed


class Progress(uvm_subscriber):
    """Makes a file one byte longer for each waveform that went into the module."""

    def __init__(self, name: str, parent: Any, path: str) -> None:
        super().__init__(name, parent)
        self._file = Path(path).open("wb", buffering=0)  # noqa: SIM115  open as long as the simulation

    def write(self, tt: Observed) -> None:
        """Count a waveform."""
        self._file.write(b"." * tt.complete)


@pyuvm.test()
class ReferenceRun(ModuleTest):
    """The waveforms of `Run.samples`."""

    def build_phase(self) -> None:
        """Count progress."""
        super().build_phase()
        self.progress = Progress("progress", self, self.run.progress)

    def connect_phase(self) -> None:
        """Count at the module's first input."""
        source = self.bench.sources[self.bench.module.inputs[0].prefix]
        source.monitor.ap.connect(self.progress.analysis_export)

    async def scenario(self) -> None:
        """Play, and write what was measured before anything is judged."""
        with np.load(self.run.samples) as data:
            waveforms = [row[:length] for row, length in zip(data["samples"], data["length"], strict=True)]
        await self.play("reference", waveforms)
        board = self.bench.scoreboard
        latency = board.latency
        if self.run.module == "core":
            # Of the core, the time from the last sample to the trailer is what a user waits for.
            last, _, _ = board.channels["m"].values("last")
            latency = {"m": latency["m"][last[: latency["m"].size, 0] == 1]}
            records, _, _ = board.channels["m"].values("record")
            np.save(Path(self.run.result).with_suffix(".npy"), records)
        cycles, taken = np.concatenate(list(latency.values())), board.source.cycles()
        measured = {
            "waveforms": board.waveforms,
            "mismatches": board.mismatches,
            "latency_cycles": {"min": int(cycles.min()), "max": int(cycles.max())} if cycles.size else None,
            "cycles_per_waveform": float(taken[-1] - taken[0] + 1) / board.waveforms if board.waveforms else None,
            "samples_per_waveform": sum(map(len, waveforms)) / len(waveforms),
        }
        Path(self.run.result).write_text(json.dumps(measured))
