"""The environment and the base test of every module."""

from __future__ import annotations

import importlib
import os
import random
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer
from numpy.typing import NDArray
from pyuvm import uvm_env, uvm_test

from openecho.golden import Beats, Config
from openecho.hardware import MODULES, Stream, settings
from tb.env.coverage import Coverage, Samples, beats_of
from tb.env.run import RUN_VARIABLE, Run
from tb.env.scoreboard import Scoreboard
from tb.env.stream import Pauses, SinkAgent, SourceAgent, WaveformItem, WaveformSequence, ports

PERIOD = 10
"""Clock period in nanoseconds. No result depends on it."""
RESET_CYCLES = 4
DRAIN_CYCLES = 200
"""How long a module must stay silent after the last beat that was expected of it."""
PATIENCE_CYCLES = 5000
"""How long nothing may move before a run counts as hung."""

PausesBy = Pauses | dict[str, Pauses] | None
"""Pauses of all sources or sinks, or of some by the prefix of their stream."""


class Bench(uvm_env):
    """An agent for each stream of the module, the scoreboard and the coverage."""

    def __init__(self, name: str, parent: Any, run: Run) -> None:
        super().__init__(name, parent)
        self.module = MODULES[run.module]

    def build_phase(self) -> None:
        """Create the parts."""
        module, dut = self.module, cocotb.top
        self.sources = {s.prefix: SourceAgent(f"source_{s.prefix}", self, dut, s) for s in module.inputs}
        self.sinks = {s.prefix: SinkAgent(f"sink_{s.prefix}", self, dut, s) for s in module.outputs}
        self.scoreboard = Scoreboard("scoreboard", self, module)
        self.coverage = Coverage("coverage", self, module.streams, module.inputs)

    def connect_phase(self) -> None:
        """Join each monitor to the scoreboard and the coverage."""
        for prefix, agent in self.agents.items():
            agent.monitor.ap.connect(self.scoreboard.channels[prefix].analysis_export)
            agent.monitor.ap.connect(self.coverage.watches[prefix].analysis_export)

    @property
    def agents(self) -> dict[str, SourceAgent | SinkAgent]:
        """Every agent by the prefix of its stream."""
        return {**self.sources, **self.sinks}


class ModuleTest(uvm_test):
    """Base of every test: subclasses state their `goals` and what they `play`."""

    goals: frozenset[str] = frozenset()
    """Bins of the functional coverage that the test must reach by itself."""

    def build_phase(self) -> None:
        """Create the environment."""
        self.run = Run.load(Path(os.environ[RUN_VARIABLE]))
        self.config = self.run.config
        self.dut: Any = cocotb.top
        self.bench = Bench("bench", self, self.run)
        # Each test has random numbers of its own, so that it can be repeated alone.
        seeds = np.random.SeedSequence([self.run.seed, *type(self).__name__.encode()])
        self.rng = np.random.default_rng(seeds)
        self.random = random.Random(int(seeds.generate_state(1)[0]))

    def end_of_elaboration_phase(self) -> None:
        """Hand over the goals."""
        self.bench.coverage.goals = self.goals

    async def run_phase(self) -> None:
        """Run the test's scenario on a running clock."""
        self.raise_objection()
        self._falling = FallingEdge(self.dut.clk)
        self.dut.rst.value = 1
        for source in self.bench.sources.values():
            source.driver.bus.clear_pins()
        for sink in self.bench.sinks.values():
            sink.pause(None)
        Clock(self.dut.clk, PERIOD, "ns", impl="gpi").start(start_high=False)
        await self.scenario()
        self.drop_objection()

    async def scenario(self) -> None:
        """Do what the test is about."""
        raise NotImplementedError

    def inputs(self, waveforms: Sequence[Samples], config: Config) -> dict[str, Beats]:
        """Beats on each input of the module that these waveforms cause."""
        module = importlib.import_module(f"tb.modules.{self.run.module}")
        return module.inputs(beats_of(waveforms), config)  # type: ignore[no-any-return]

    def beats(self, waveforms: Sequence[Samples], config: Config) -> int:
        """Beats that these waveforms make on the module's first input."""
        return _count(self.inputs(waveforms, config)[self.bench.module.inputs[0].prefix])

    def check_latency(self) -> None:
        """Fail if an output of the last run, which must have been without pauses, was faster or slower than stated."""
        for prefix, measured in self.bench.scoreboard.latency.items():
            self.logger.info("%s: latency %d to %d cycles", prefix, measured.min(), measured.max())
        for prefix, stated in (self.bench.module.latency or {}).items():
            fastest = self.bench.scoreboard.latency[prefix].min()
            assert fastest == stated(self.config), f"{prefix}: latency {fastest}, expected {stated(self.config)} cycles"

    def check_rate(self) -> None:
        """Fail if the first input waited in the last run, which must have been without pauses, more than it may."""
        module, source = self.bench.module, self.bench.scoreboard.source
        if not module.waits:
            assert source.stalls == 0, f"the input waited {source.stalls} cycles, expected none"
            return
        # What its first samples wait for shows when they have come through the module.
        index, waits = self.waits()
        passed = sum(stated(self.config) for stated in (module.latency or {}).values()) + module.waits
        late, allowed = int(waits[index > passed].sum()), module.waits * source.waveforms
        assert late == 0, f"the input waited {late} cycles behind sample {passed} of a waveform, expected none"
        assert source.stalls <= allowed, f"the input waited {source.stalls} cycles, expected at most {allowed}"

    def waits(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Index in its waveform of each beat of the first input in the last run, and cycles since the one before."""
        source = self.bench.scoreboard.source
        last = source.values("last")[0][:, 0] == 1
        starts = np.append(0, np.flatnonzero(last)[:-1] + 1)
        index = np.arange(last.size) - starts[np.cumsum(last) - last]
        return index, np.diff(source.cycles(), prepend=source.cycles()[0] - 1) - 1

    async def play(
        self,
        title: str,
        waveforms: Sequence[Samples],
        *,
        config: Config | None = None,
        gaps: PausesBy = None,
        stalls: PausesBy = None,
        fresh: bool = True,
        reset_after: int | None = None,
    ) -> None:
        """Send waveforms through the module and compare; see `play_beats`."""
        config = config or self.config
        waveforms = [samples.astype(np.int64) for samples in waveforms]
        inputs = self.inputs(waveforms, config)
        await self.play_beats(
            title, inputs, config=config, gaps=gaps, stalls=stalls, fresh=fresh, reset_after=reset_after
        )
        if self.goals:
            self.bench.coverage.sample_waveforms(waveforms[: self.bench.scoreboard.source.waveforms], config)

    async def play_beats(
        self,
        title: str,
        inputs: dict[str, Beats],
        *,
        config: Config | None = None,
        gaps: PausesBy = None,
        stalls: PausesBy = None,
        fresh: bool = True,
        reset_after: int | None = None,
    ) -> None:
        """Reset the module, send beats on its inputs, wait for what the model expects, and compare.

        Parameters
        ----------
        title : str
            Names the run in messages.
        inputs : dict of str to Beats
            What to send on each input.
        config : Config, optional
            The settings to use.
        gaps, stalls : iterator of (cycles on, cycles off), or a dict of them by stream, optional
            When sources offer and sinks take beats; in every cycle if left out.
        fresh : bool
            Whether to reset the module; if not, it goes on from the last run with other settings.
        reset_after : int, optional
            Reset after so many cycles instead of waiting for the end.
        """
        config = config or self.config
        await self.begin(inputs, config, gaps, stalls, fresh)
        if reset_after is None:
            expected = inputs | self.bench.module.expected(inputs, config)
            await self.settle(title, {prefix: _count(beats) for prefix, beats in expected.items()})
        else:
            await Timer(reset_after * PERIOD, "ns")
            await self._begin_reset()
        self.bench.scoreboard.close_run(title, inputs, config, cut=reset_after is not None)

    async def begin(
        self,
        inputs: dict[str, Beats],
        config: Config,
        gaps: PausesBy = None,
        stalls: PausesBy = None,
        fresh: bool = True,
    ) -> None:
        """Reset the module and start to send beats on its inputs; see `play_beats`."""
        if fresh:
            await self._begin_reset()
        await self._go_on(config)
        self.bench.scoreboard.open_run()
        for prefix, source in self.bench.sources.items():
            source.pause(gaps.get(prefix) if isinstance(gaps, dict) else gaps)
        for prefix, sink in self.bench.sinks.items():
            sink.pause(stalls.get(prefix) if isinstance(stalls, dict) else stalls)
        for prefix, source in self.bench.sources.items():
            sequence = WaveformSequence(prefix, _items(source.stream, inputs[prefix]))
            cocotb.start_soon(sequence.start(source.sequencer))

    async def _begin_reset(self) -> None:
        """Assert the reset in whatever the streams are doing, and drop what was still to be sent."""
        await self._falling
        self.dut.rst.value = 1
        for source in self.bench.sources.values():
            source.driver.bus.aborted = True
        for agent in self.bench.agents.values():
            agent.monitor.bus.reset(active=True)
        await Timer(RESET_CYCLES * PERIOD, "ns")

    async def _go_on(self, config: Config) -> None:
        """Set the module's run-time inputs and end its reset."""
        await self._falling
        for name in self.bench.module.settings:
            getattr(self.dut, name).value = settings(config)[name]
        self.dut.rst.value = 0
        for source in self.bench.sources.values():
            source.driver.bus.aborted = False
        for agent in self.bench.agents.values():
            agent.monitor.bus.reset(active=False)

    async def settle(self, title: str, expected: dict[str, int]) -> None:
        """Wait until every stream has carried what is expected of it, and then some, to see what should not come."""
        begun = {prefix: agent.monitor.bus.transfers for prefix, agent in self.bench.agents.items()}
        seen, quiet = dict.fromkeys(begun, 0), 0
        while any(seen[prefix] < expected[prefix] for prefix in seen):
            await Timer(DRAIN_CYCLES * PERIOD, "ns")
            before = seen
            seen = {prefix: agent.monitor.bus.transfers - begun[prefix] for prefix, agent in self.bench.agents.items()}
            quiet = 0 if seen != before else quiet + DRAIN_CYCLES
            if quiet > PATIENCE_CYCLES:
                streams = ", ".join(f"{prefix} {seen[prefix]} of {expected[prefix]}" for prefix in seen)
                self.logger.error("%s: hung, beats so far: %s", title, streams)
                return
        await Timer(DRAIN_CYCLES * PERIOD, "ns")


def _count(beats: Beats) -> int:
    """Beats of a stream."""
    return len(next(iter(beats.values())))


def _items(stream: Stream, beats: Beats) -> list[WaveformItem]:
    """Beats of a stream, cut into waveforms. What the model leaves undefined is driven with ones."""
    ends = np.flatnonzero(beats["last"]) + 1 if stream.last else np.arange(1, _count(beats) + 1)
    columns = {port: np.split(np.ma.filled(beats[port], -1), ends[:-1]) for port in ports(stream)}
    return [
        WaveformItem(f"{stream.prefix}{k}", {port: column[k] for port, column in columns.items()})
        for k in range(ends.size)
    ]


def random_pauses(rng: random.Random, longest_on: int, longest_off: int) -> Iterator[tuple[int, int]]:
    """Endless random numbers of cycles on and off; now and then a pause ten times as long."""
    while True:
        scale = 10 if rng.random() < 0.02 else 1
        yield rng.randint(1, longest_on), rng.randint(0, scale * longest_off)
