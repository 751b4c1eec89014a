"""The shell under test with a bus model on each side, and what every test asks of it."""

from __future__ import annotations

import logging
import os
import random
from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge
from cocotbext.axi import AxiLiteBus, AxiStreamBus, AxiStreamFrame, AxiStreamSink, AxiStreamSource
from cocotbext.axi.axil_channels import AxiLiteARSource, AxiLiteAWSource, AxiLiteBSink, AxiLiteRSink, AxiLiteWSource
from numpy.typing import NDArray

from openecho import golden
from openecho.golden import Config
from openecho.golden.output import TRAILER_BIT
from openecho.registers import BY_NAME, READ_ONLY, REGISTERS, SETTINGS
from tb.env import pins
from tb.env.coverage import Samples, beats_of
from tb.env.run import RUN_VARIABLE, Run

PERIOD = 10
"""Clock period in nanoseconds. No result depends on it."""
RESET_CYCLES = 4
DRAIN_CYCLES = 200
"""How long nothing may come after the last record that was expected."""
PATIENCE_CYCLES = 20_000
"""How long any wait may take."""

OKAY, SLVERR = 0, 2
SEQUENCE_WORD = 1

WATCHED = {
    "s_axis_t": ("data", "last"),
    "m_axis_t": ("data", "keep", "last"),
    "s_axi_b": ("resp",),
    "s_axi_r": ("data", "resp"),
}
"""Prefixes of the channels whose contract is checked in every cycle, and their payloads."""


class Channel:
    """What was seen of one channel.

    Attributes
    ----------
    taken : list of int
        Cycle of each transfer.
    ends : list of int
        Cycle of each transfer with last.
    stalls : int
        Cycles in which a beat was offered and not taken.
    violations : list of str
        Broken promises.
    """

    def __init__(self, dut: Any, prefix: str, payload: tuple[str, ...]) -> None:
        self.prefix = prefix
        self.valid, self.ready = (pins.reader(getattr(dut, prefix + name)) for name in ("valid", "ready"))
        self.payload = [pins.reader(getattr(dut, prefix + name)) for name in payload]
        self.last = payload.index("last") if "last" in payload else None
        self.keep = payload.index("keep") if "keep" in payload else None
        self.offered: list[str] | None = None
        self.taken: list[int] = []
        self.ends: list[int] = []
        self.stalls = 0
        self.violations: list[str] = []

    def look(self, cycle: int, resetting: bool) -> None:
        """Look at one cycle."""
        valid, ready = self.valid(), self.ready()
        if resetting:
            self.offered = None
            return
        if valid not in ("0", "1") or ready not in ("0", "1"):
            self.violate(cycle, f"valid is {valid} and ready is {ready}")
        if valid != "1":
            if self.offered is not None:
                self.violate(cycle, "valid fell before the beat was taken")
            self.offered = None
            return
        beat = [read() for read in self.payload]
        if self.offered not in (None, beat):
            self.violate(cycle, f"payload changed from {self.offered} to {beat} while stalled")
        if any(set(digits) - {"0", "1"} for digits in beat):
            self.violate(cycle, f"payload is {beat}")
        if self.keep is not None and "0" in beat[self.keep]:
            self.violate(cycle, f"keep is {beat[self.keep]}")
        if ready == "1":
            self.offered = None
            self.taken.append(cycle)
            if self.last is not None and beat[self.last] == "1":
                self.ends.append(cycle)
        else:
            self.offered = beat
            self.stalls += 1

    def violate(self, cycle: int, what: str) -> None:
        """Note a broken promise."""
        self.violations.append(f"{self.prefix}, cycle {cycle}: {what}")


class Shell:
    """The shell, a source of samples, a sink of records and the five channels of its registers."""

    def __init__(self, test: str) -> None:
        self.dut: Any = cocotb.top
        self.run = Run.load(Path(os.environ[RUN_VARIABLE]))
        self.config = self.run.config
        logging.getLogger(f"cocotb.{self.dut._name}").setLevel(logging.ERROR)
        # Each test has random numbers of its own, so that it can be repeated alone.
        seeds = np.random.SeedSequence([self.run.seed, *test.encode()])
        self.rng = np.random.default_rng(seeds)
        self.random = random.Random(int(seeds.generate_state(1)[0]))
        dut: Any = self.dut
        ports = {"clock": dut.aclk, "reset": dut.aresetn, "reset_active_level": False}
        dut.aresetn.value = 0
        self.source = AxiStreamSource(AxiStreamBus.from_prefix(dut, "s_axis"), byte_lanes=1, **ports)
        self.sink = AxiStreamSink(AxiStreamBus.from_prefix(dut, "m_axis"), **ports)
        bus = AxiLiteBus.from_prefix(dut, "s_axi")
        self.aw = AxiLiteAWSource(bus.write.aw, **ports)
        self.w = AxiLiteWSource(bus.write.w, **ports)
        self.b = AxiLiteBSink(bus.write.b, **ports)
        self.ar = AxiLiteARSource(bus.read.ar, **ports)
        self.r = AxiLiteRSink(bus.read.r, **ports)
        self.polling = False
        self.cycle = 0
        self.irqs: list[int] = []
        self.channels: dict[str, Channel] = {}

    async def start(self) -> None:
        """Start the clock, reset, and watch every channel."""
        Clock(self.dut.aclk, PERIOD, "ns", impl="gpi").start(start_high=False)
        await self.reset()
        cocotb.start_soon(self._watch())

    async def reset(self) -> None:
        """Assert aresetn for some cycles, drop what was still to be sent, and begin to watch afresh."""
        await FallingEdge(self.dut.aclk)
        self.dut.aresetn.value = 0
        await ClockCycles(self.dut.aclk, RESET_CYCLES)
        await FallingEdge(self.dut.aclk)
        for end in (self.source, self.sink):
            end.clear()
        self.channels = {prefix: Channel(self.dut, prefix, payload) for prefix, payload in WATCHED.items()}
        self.dut.aresetn.value = 1
        await ClockCycles(self.dut.aclk, 2)

    async def _watch(self) -> None:
        rising = RisingEdge(self.dut.aclk)
        resetting, irq = pins.reader(self.dut.aresetn), pins.reader(self.dut.irq)
        while True:
            await rising
            self.cycle += 1
            for channel in self.channels.values():
                channel.look(self.cycle, resetting() != "1")
            if irq() == "1":
                self.irqs.append(self.cycle)

    @property
    def samples_in(self) -> Channel:
        """What was seen of the samples."""
        return self.channels["s_axis_t"]

    @property
    def records_out(self) -> Channel:
        """What was seen of the records."""
        return self.channels["m_axis_t"]

    @property
    def begun(self) -> int:
        """Waveforms whose first sample was taken."""
        taken, ends = self.samples_in.taken, self.samples_in.ends
        return len(ends) + bool(taken and (not ends or taken[-1] > ends[-1]))

    def pause(self, *, samples: bool = False, records: bool = False, registers: bool = False) -> None:
        """Have some of the channels pause at random from now on, and the others not at all."""
        chosen = [(self.source, samples), (self.sink, records)]
        chosen += [(channel, registers) for channel in (self.aw, self.w, self.b, self.ar, self.r)]
        for end, pauses in chosen:
            end.set_pause_generator(_pauses(self.random) if pauses else None)
            end.pause = False

    def send(self, waveforms: Sequence[Samples]) -> None:
        """Queue waveforms for the source, back to back."""
        for samples in waveforms:
            self.source.send_nowait(AxiStreamFrame([int(sample) for sample in samples]))

    async def wait_for(self, samples: int) -> None:
        """Wait until so many samples were taken since the reset."""
        await self.wait_until(lambda: len(self.samples_in.taken) >= samples, f"{samples} samples")

    async def wait_until(self, reached: Callable[[], bool], what: str) -> None:
        """Wait for a condition that is looked at in every cycle.

        Raises
        ------
        AssertionError
            If nothing is taken on any stream for a long time.
        """
        moved, since = 0, self.cycle
        while not reached():
            await RisingEdge(self.dut.aclk)
            now = len(self.samples_in.taken) + len(self.records_out.taken)
            if now != moved:
                moved, since = now, self.cycle
            assert self.cycle - since < PATIENCE_CYCLES, f"hung while waiting for {what}"

    async def take(self, waveforms: int) -> NDArray[Any]:
        """Wait for the records of so many waveforms, and then some, to see what should not come.

        Returns
        -------
        (n, 8) integer array
            As `golden.core` returns them.
        """
        await self.wait_until(lambda: self.sink.count() >= waveforms, f"the records of {waveforms} waveforms")
        await ClockCycles(self.dut.aclk, DRAIN_CYCLES)
        assert self.sink.count() == waveforms, f"found {self.sink.count()} trailers, expected {waveforms}"
        frames = [bytes(self.sink.recv_nowait(compact=False).tdata) for _ in range(waveforms)]
        word = self.config.word_w // 8
        records = np.frombuffer(b"".join(frames), f"<u{word}").reshape(-1, 8)
        return records.astype(f"u{word}")

    async def write(self, name: str | int, value: int, strobe: int = 0xF, order: int | None = None) -> int:
        """Write a register, given by name or offset, and return the answer's code.

        `order` is the number of cycles by which the address comes before the data, or after it if negative; random if
        left out.
        """
        lead = self.random.choice((-3, -1, 0, 0, 0, 1, 3)) if order is None else order
        address = self.aw._transaction_obj(awaddr=_offset(name))
        data = self.w._transaction_obj(wdata=value, wstrb=strobe)
        first, second = ((self.aw, address), (self.w, data))[:: 1 if lead >= 0 else -1]
        await first[0].send(first[1])
        if lead:
            await ClockCycles(self.dut.aclk, abs(lead))
        await second[0].send(second[1])
        await self.wait_until(lambda: not self.b.empty(), f"the answer to a write of {name}")
        return int(self.b.recv_nowait().bresp)

    async def ask(self, name: str | int) -> tuple[int, int]:
        """Read a register, given by name or offset, and return its value and the answer's code."""
        await self.ar.send(self.ar._transaction_obj(araddr=_offset(name)))
        await self.wait_until(lambda: not self.r.empty(), f"the answer to a read of {name}")
        answer = self.r.recv_nowait()
        return int(answer.rdata), int(answer.rresp)

    async def read(self, name: str) -> int:
        """Read a register that must answer."""
        value, code = await self.ask(name)
        assert code == OKAY, f"read of {name} answered {code}"
        return value

    async def set(self, name: str, value: int) -> None:
        """Write a register that must take it."""
        code = await self.write(name, value)
        assert code == OKAY, f"write of {value:#x} to {name} answered {code}"

    async def configure(self, config: Config) -> None:
        """Write all four settings."""
        for name, value in settings(config).items():
            await self.set(name, value)

    async def expect(self, **values: int) -> None:
        """Compare registers, by name, with what they should read."""
        found = {name: await self.read(name) for name in values}
        assert found == values, f"found {found}, expected {values}"

    def check(self) -> None:
        """Fail on a broken contract of any channel."""
        broken = [line for channel in self.channels.values() for line in channel.violations]
        assert not broken, "\n".join(broken[:5])


def shell_test(body: Callable[[Shell], Awaitable[None]]) -> Any:
    """Make a test of what is done with a started shell, in which every channel keeps its contract."""

    async def test(_: object) -> None:
        shell = Shell(body.__name__)
        await shell.start()
        await body(shell)
        shell.check()

    return cocotb.test(name=body.__name__)(test)


async def poll(shell: Shell) -> None:
    """Access registers for as long as `shell.polling`, in ways that must change nothing."""
    refused = [register.name for register in REGISTERS if register.access == READ_ONLY]
    while shell.polling:
        name = shell.random.choice([register.name for register in REGISTERS])
        match shell.random.randrange(4):
            case 0:
                assert await shell.write(shell.random.choice(refused), 0xFFFFFFFF) == SLVERR
            case 1:
                name = shell.random.choice(SETTINGS)
                await shell.set(name, settings(shell.config)[name])
            case 2:
                assert await shell.write(name, 0xFFFFFFFF, strobe=0) == (SLVERR if name in refused else OKAY)
            case _:
                await shell.read(name)


def settings(config: Config) -> dict[str, int]:
    """Values of the registers of the settings."""
    return {
        "N": config.n_raw,
        "MIN_INTERVAL": config.min_interval,
        "MIN_AMPLITUDE": config.min_amplitude,
        "K": config.k_raw,
    }


def expected(waveforms: Sequence[Samples], config: Config, sequence: int = 0) -> NDArray[Any]:
    """Records of the golden model, numbered from `sequence`; samples beyond full scale are taken as that."""
    if not waveforms:
        return np.zeros((0, 8), f"u{config.word_w // 8}")
    full = (1 << config.sample_w) - 1
    records = golden.core(beats_of([np.minimum(samples, full) for samples in waveforms]), config)["record"]
    records[:, SEQUENCE_WORD] += sequence
    return records


def counts(records: NDArray[Any]) -> dict[str, int]:
    """Registers that count what these records are, ERRORS of too short and too long waveforms among them."""
    trailers = records[records[:, 0] >> TRAILER_BIT == 1]
    errors = np.count_nonzero(trailers[:, 0] & (golden.TOO_SHORT | golden.TOO_LONG))
    return {"WAVEFORMS": len(trailers), "ECHOES": len(records) - len(trailers), "ERRORS": int(errors)}


def equal(found: NDArray[Any], wanted: NDArray[Any]) -> None:
    """Compare records bit by bit."""
    np.testing.assert_array_equal(found, wanted)


def waveforms_of(samples: NDArray[Any], length: NDArray[Any]) -> list[Samples]:
    """Rows, cut to their lengths."""
    return [row[:count] for row, count in zip(samples, length, strict=True)]


def busy(config: Config, rng: np.random.Generator, count: int = 5) -> list[Samples]:
    """Waveforms of different lengths with echoes of many heights and widths, so that every setting matters."""
    full, spacing = (1 << config.sample_w) - 1, max(40, 2 * config.tap_count)
    length = 80 + 6 * spacing
    x = np.arange(length)
    made: list[Samples] = []
    for k in range(count):
        signal = full / 32 + rng.normal(0, full / 250, length)
        centres = 80 + spacing * np.arange(5) + rng.uniform(0, 5, 5)
        heights = full * rng.permutation([0.03, 0.03, 0.1, 0.1, 0.4])
        for centre, height in zip(centres, heights, strict=True):
            signal += height * np.exp(-0.5 * ((x - centre) / rng.uniform(1.5, 7)) ** 2)
        made.append(np.clip(np.rint(signal), 0, full).astype(np.uint16)[: length - 7 * k])
    return made


def others(config: Config) -> list[dict[str, int]]:
    """Registers of settings to change to: each alone, then all."""
    single = [
        {"N": 0x1B},
        {"MIN_INTERVAL": max(9, config.tap_count * 6 // 10)},
        {"MIN_AMPLITUDE": (1 << config.sample_w) // 4},
        {"K": 0xFA},
    ]
    return [*single, {name: value for entry in single for name, value in entry.items()}]


def changed(config: Config, values: dict[str, int]) -> Config:
    """Return the configuration with other registers of settings."""
    fields: dict[str, Any] = {
        name.lower(): value / (1 << golden.RATIO_FRAC) if name in ("N", "K") else value
        for name, value in values.items()
    }
    return replace(config, **fields)


def increasing(cycles: Sequence[int]) -> bool:
    """Whether each is the one after the last."""
    return all(after == before + 1 for before, after in pairwise(cycles))


def _offset(name: str | int) -> int:
    return BY_NAME[name].offset if isinstance(name, str) else name


def _pauses(rng: random.Random) -> Iterator[bool]:
    """Endless pauses: now none for a while, now most of the time, now long ones."""
    while True:
        share = rng.choice((0.1, 0.5, 0.9))
        for _ in range(rng.randint(10, 200)):
            yield rng.random() < share
        for _ in range(rng.choice((0, 0, 0, 100))):
            yield True
