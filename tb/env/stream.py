"""The agent of a valid/ready stream: cocotb-bus on the pins, pyuvm above them.

Stimulus changes on the falling edge of the clock and everything is observed on the rising edge, so that the result
doesn't depend on the order in which a simulator runs what happens at an edge.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from cocotb.triggers import FallingEdge, RisingEdge
from cocotb.utils import get_sim_time
from cocotb_bus.drivers import BitDriver, ValidatedBusDriver
from cocotb_bus.monitors import BusMonitor
from pyuvm import uvm_agent, uvm_analysis_port, uvm_driver, uvm_monitor, uvm_sequence, uvm_sequence_item, uvm_sequencer

from openecho.golden import Beats
from openecho.hardware import Stream
from tb.env import pins

Pauses = Iterator[tuple[int, int]]
"""Cycles on, cycles off, and so on: when a source offers a beat, or a sink takes one."""


def ports(stream: Stream) -> list[str]:
    """Payload ports of a stream in the order of a beat; `last`, where there is one, comes first."""
    return ["last"] * stream.last + list(stream.fields)


class WaveformItem(uvm_sequence_item):
    """One waveform on one stream: an array for each field, an entry a beat."""

    def __init__(self, name: str, beats: Beats) -> None:
        super().__init__(name)
        self.beats = beats


class WaveformSequence(uvm_sequence):
    """Waveforms, one after the other."""

    def __init__(self, name: str, items: list[WaveformItem]) -> None:
        super().__init__(name)
        self.items = items

    async def body(self) -> None:
        """Send every item."""
        for item in self.items:
            await self.start_item(item)
            await self.finish_item(item)


@dataclass
class Observed:
    """One waveform as a monitor saw it.

    Attributes
    ----------
    beats : list of list of str
        Binary digits of each port, in the order of `ports`, for each transfer.
    cycles : list of int
        When each transfer happened.
    complete : bool
        False if a reset cut it.
    stalls : int
        Cycles in which a beat was offered and not taken.
    gaps : int
        Cycles after its first beat in which none was offered.
    idle : int
        Cycles before its first beat in which none was offered.
    """

    beats: list[list[str]] = field(default_factory=list)
    cycles: list[int] = field(default_factory=list)
    complete: bool = True
    stalls: int = 0
    gaps: int = 0
    idle: int = 0


class StreamDriver(ValidatedBusDriver):
    """Drives `valid` and the payload; `valid_generator` makes gaps. The stream's monitor tells it what was taken."""

    def __init__(self, dut: Any, stream: Stream, clock: Any, monitor: StreamMonitor) -> None:
        self._signals = ["valid", "ready", *ports(stream)]
        super().__init__(dut, stream.prefix, clock, case_insensitive=False)
        payload = [getattr(self.bus, port) for port in ports(stream)]
        self._ports = list(zip(ports(stream), map(pins.width, payload), strict=True))
        self._writers = [pins.writer(handle) for handle in payload]
        self._valid, self._monitor, self._falling = pins.writer(self.bus.valid), monitor, FallingEdge(clock)
        # What stands on the payload while `valid` is low: a module that looks at it then ends a waveform.
        self._rubbish = [pins.encode(np.array([-1]), bits)[0] for _, bits in self._ports]
        self.aborted = False
        """Set to give up the waveform in hand, and all that follow until it is cleared."""

    def clear_pins(self) -> None:
        """Offer nothing."""
        self._valid(0)
        for write, value in zip(self._writers, self._rubbish, strict=True):
            write(value)

    async def _driver_send(self, transaction: Beats, sync: bool = True) -> None:
        """Offer each beat until it is taken. Begins and ends on a falling edge, so that no gap is between waveforms."""
        valid, monitor, falling = self._valid, self._monitor, self._falling
        columns = [pins.encode(transaction[port], bits) for port, bits in self._ports]
        old: tuple[pins.Pin | None, ...] = (None,) * len(columns)
        if sync:
            await falling
        for beat in zip(*columns, strict=True):
            if self.aborted:
                break
            if self.on is not True:
                if self.on == 0:
                    self.clear_pins()
                    old = (None,) * len(columns)
                    for _ in range(self.off):
                        await falling
                    self._next_valids()
                self.on -= 1
            for write, value, before in zip(self._writers, beat, old, strict=True):
                if value != before:
                    write(value)
            old = beat
            valid(1)
            await falling
            while not (monitor.taken or self.aborted):
                await falling
        self.clear_pins()


class StreamMonitor(BusMonitor):
    """Collects the waveforms of a stream and checks its contract in every cycle.

    A beat that is offered stays, unchanged, until it is taken; `valid` is 0 or 1, and 0 from a reset's second cycle.
    """

    def __init__(self, dut: Any, stream: Stream, clock: Any, callback: Any) -> None:
        self._signals = ["valid", "ready", *ports(stream)]
        self.stream = stream
        self.cycle = 0
        self.transfers = 0
        self.taken = False
        """Whether the last rising edge took a beat."""
        self.violations: list[str] = []
        self._resetting = True  # nothing is known of a module that was never reset
        self._current = Observed()
        super().__init__(dut, stream.prefix, clock, callback=callback, case_insensitive=False)

    def reset(self, active: bool) -> None:
        """Follow the reset: what has been seen of a waveform counts as cut."""
        self._resetting = active
        if active and self._current.beats:
            self._current.complete = False
            self._recv(self._current)
        self._current = Observed()

    async def _monitor_recv(self) -> None:
        valid, ready = pins.reader(self.bus.valid), pins.reader(self.bus.ready)
        payload = [pins.reader(getattr(self.bus, port)) for port in ports(self.stream)]
        ends_by_last = self.stream.last
        rising = RisingEdge(self.clock)
        offered: list[str] | None = None
        reset_cycles = 0
        while True:
            await rising
            self.cycle += 1
            self.taken = False
            offers = valid()
            if self._resetting:
                reset_cycles += 1
                if reset_cycles > 1 and offers != "0":
                    self._violated(f"valid is {offers} during reset")
                offered = None
                continue
            reset_cycles = 0
            current = self._current
            if offers == "1":
                beat = [read() for read in payload]
                if offered is not None and beat != offered:
                    self._violated(f"payload changed from {offered} to {beat} while stalled")
                if ready() == "1":
                    offered = None
                    self.transfers += 1
                    self.taken = True
                    current.beats.append(beat)
                    current.cycles.append(self.cycle)
                    if beat[0] == "1" or not ends_by_last:
                        self._current = Observed()
                        self._recv(current)
                else:
                    offered = beat
                    current.stalls += 1
            else:
                if offered is not None:
                    self._violated("valid fell before the beat was taken")
                    offered = None
                if offers != "0":
                    self._violated(f"valid is {offers}")
                if current.beats:
                    current.gaps += 1
                else:
                    current.idle += 1

    def _violated(self, what: str) -> None:
        self.violations.append(f"stream {self.stream.prefix}, cycle {self.cycle}: {what}")


class Monitor(uvm_monitor):
    """Publishes every waveform of a stream."""

    def __init__(self, name: str, parent: Any, dut: Any, stream: Stream) -> None:
        super().__init__(name, parent)
        self.ap = uvm_analysis_port("ap", self)
        self.bus = StreamMonitor(dut, stream, dut.clk, callback=self.ap.write)

    def check_phase(self) -> None:
        """Fail on a broken contract."""
        assert not self.bus.violations, "\n".join(self.bus.violations[:5])


class Driver(uvm_driver):
    """Hands waveforms from the sequencer to the pins."""

    def __init__(self, name: str, parent: Any, dut: Any, stream: Stream, monitor: StreamMonitor) -> None:
        super().__init__(name, parent)
        self.bus = StreamDriver(dut, stream, dut.clk, monitor)
        self.sent = 0

    async def run_phase(self) -> None:
        """Send whatever comes."""
        free_since = None
        while True:
            item = await self.seq_item_port.get_next_item()
            if not self.bus.aborted:
                await self.bus.send(item.beats, sync=get_sim_time() != free_since)
                free_since = get_sim_time()
                self.sent += 1
            self.seq_item_port.item_done()


class SourceAgent(uvm_agent):
    """Drives and monitors a stream into the module."""

    def __init__(self, name: str, parent: Any, dut: Any, stream: Stream) -> None:
        super().__init__(name, parent)
        self.dut, self.stream = dut, stream

    def build_phase(self) -> None:
        """Create the parts."""
        super().build_phase()
        self.sequencer = uvm_sequencer("sequencer", self)
        self.monitor = Monitor("monitor", self, self.dut, self.stream)
        self.driver = Driver("driver", self, self.dut, self.stream, self.monitor.bus)

    def connect_phase(self) -> None:
        """Join sequencer and driver."""
        self.driver.seq_item_port.connect(self.sequencer.seq_item_export)

    def pause(self, gaps: Pauses | None) -> None:
        """Offer beats at these times; always if None."""
        self.driver.bus.set_valid_generator(gaps)


class SinkAgent(uvm_agent):
    """Takes and monitors a stream from the module."""

    def __init__(self, name: str, parent: Any, dut: Any, stream: Stream) -> None:
        super().__init__(name, parent)
        self.dut, self.stream = dut, stream
        self._stalling: BitDriver | None = None

    def build_phase(self) -> None:
        """Create the monitor."""
        super().build_phase()
        self.monitor = Monitor("monitor", self, self.dut, self.stream)

    def pause(self, stalls: Pauses | None) -> None:
        """Take beats at these times; always if None."""
        ready = getattr(self.dut, f"{self.stream.prefix}_ready")
        if self._stalling is not None:
            self._stalling.stop()
            self._stalling = None
        if stalls is None:
            ready.value = 1
        else:
            self._stalling = BitDriver(ready, self.dut.clk)
            self._stalling.start(stalls)
