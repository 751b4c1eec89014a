"""One scoreboard for every module: what each stream carried, against the golden model, beat by beat and bit by bit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyuvm import uvm_scoreboard, uvm_subscriber

from openecho.golden import Beats, Config
from openecho.hardware import Module, Stream
from tb.env import pins
from tb.env.stream import Observed, ports

SHOWN = 5
"""Differences that a message spells out."""


class Channel(uvm_subscriber):
    """Keeps what one monitor publishes."""

    def __init__(self, name: str, parent: Any, stream: Stream) -> None:
        super().__init__(name, parent)
        self.stream = stream
        self.open_run()

    def open_run(self) -> None:
        """Forget what came before."""
        self.waveforms = 0
        self.stalls = 0
        self._cycles: list[int] = []
        self._digits: dict[str, list[str]] = {port: [] for port in ports(self.stream)}

    def write(self, tt: Observed) -> None:
        """Take a waveform; its digits are joined, because a list of them takes ten times the memory."""
        self.waveforms += tt.complete
        self.stalls += tt.stalls
        self._cycles += tt.cycles
        for kept, digits in zip(self._digits.values(), zip(*tt.beats, strict=True), strict=True):
            kept.append("".join(digits))

    def cycles(self) -> NDArray[np.int64]:
        """Cycle of each transfer."""
        return np.array(self._cycles, np.int64)

    def values(self, port: str) -> tuple[NDArray[np.uint64], NDArray[np.bool_], int]:
        """What a port carried in each transfer, where it was unknown, and its bits; see `pins.decode`."""
        words = self.stream.words if port != "last" else 1
        return pins.decode("".join(self._digits[port]), len(self._cycles), words)


class Scoreboard(uvm_scoreboard):
    """Compares run by run; a run is what lies between two resets."""

    def __init__(self, name: str, parent: Any, module: Module) -> None:
        super().__init__(name, parent)
        self.module = module
        self.mismatches = 0
        self.waveforms = 0
        self.differences: list[str] = []
        self.latency: dict[str, NDArray[np.int64]] = {}
        """Cycles from cause to each beat of each output in the last run."""

    def build_phase(self) -> None:
        """Create a channel for each stream."""
        self.channels = {stream.prefix: Channel(stream.prefix, self, stream) for stream in self.module.streams}

    @property
    def source(self) -> Channel:
        """Channel of the module's first input."""
        return self.channels[self.module.inputs[0].prefix]

    def open_run(self) -> None:
        """Forget what the last run carried."""
        for channel in self.channels.values():
            channel.open_run()

    def close_run(self, title: str, inputs: dict[str, Beats], config: Config, cut: bool) -> None:
        """Compare what a run carried.

        Parameters
        ----------
        title : str
            Names the run in messages.
        inputs : dict of str to Beats
            What was to be sent on each input.
        config : Config
            What the module was built with and set to.
        cut : bool
            Whether a reset ended the run, so that each stream may carry less than all.
        """
        expected = inputs | self.module.expected(inputs, config)
        for prefix, channel in self.channels.items():
            self._compare(f"{title}, {prefix}", channel, expected[prefix], cut)
        self.latency = {s.prefix: self._measure(s.prefix, expected[s.prefix]["cause"]) for s in self.module.outputs}
        for prefix, cycles in self.latency.items():
            early = int((cycles < 0).sum())
            self._differ(early, f"{title}, {prefix}: {early} beats left before the input that determines them came")
        self.waveforms += self.source.waveforms

    def check_phase(self) -> None:
        """Fail on a difference, and if nothing was compared."""
        assert not self.mismatches, f"{self.mismatches} beats differ from the model\n" + "\n".join(self.differences)
        assert self.waveforms > 0, "no waveform passed: nothing was compared"

    def _measure(self, prefix: str, cause: NDArray[np.int64]) -> NDArray[np.int64]:
        """Cycles to each transfer of an output from the one that determines it; -1 where that has not come."""
        source = self.source.cycles()
        seen = self.channels[prefix].cycles()
        cause = cause[: seen.size]
        come = cause < source.size
        return np.where(come, seen[: cause.size] - np.append(source, 0)[np.minimum(cause, source.size)], -1)

    def _compare(self, title: str, channel: Channel, expected: Beats, cut: bool) -> None:
        cycles = channel.cycles()
        wanted = len(next(iter(expected.values())))
        count = min(cycles.size, wanted)
        if cycles.size > wanted or (cycles.size < wanted and not cut):
            self._differ(abs(wanted - cycles.size), f"{title}: {cycles.size} beats came, expected {wanted}")
        if not count:
            return
        waveform = np.cumsum(expected["last"]) - expected["last"] if "last" in expected else np.arange(wanted)
        wrong = np.zeros(count, bool)
        for port in ports(channel.stream):
            values, unknown, bits = channel.values(port)
            model = np.ma.asarray(expected[port][:count]).reshape(count, -1)
            differs = ((values[:count] != _as_bits(model.data, bits)) | unknown[:count]) & ~np.ma.getmaskarray(model)
            rows = differs.any(axis=1)
            wrong |= rows
            for row in np.flatnonzero(rows)[:SHOWN]:
                found = ", ".join(map(str, values[row])) + " with unknown bits" * bool(unknown[row].any())
                model_bits = ", ".join(map(str, _as_bits(model.data[row], bits)))
                where = f"{title}: waveform {waveform[row]}, beat {row}, cycle {cycles[row]}"
                self.differences.append(f"{where}: {port} is {found}, expected {model_bits}")
        self._differ(int(wrong.sum()))

    def _differ(self, beats: int, what: str | None = None) -> None:
        self.mismatches += beats
        if beats and what is not None:
            self.differences.append(what)


def _as_bits(values: NDArray[Any], bits: int) -> NDArray[np.uint64]:
    """Two's complement of a port's width; the model's values must fit it."""
    low, high = int(values.min()), int(values.max())
    fits = low >= -(1 << bits - 1) and high < 1 << (bits - (low < 0))
    assert fits, f"the model has values from {low} to {high}, which a port of {bits} bits can't carry"
    return values.astype(np.uint64) & np.uint64((1 << bits) - 1)
