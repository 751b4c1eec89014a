"""The tests that every module passes."""

from __future__ import annotations

import pyuvm

from tb.env import coverage
from tb.env.bench import ModuleTest, random_pauses
from tb.env.waveforms import every_length, every_shape, sensitive, with_many_echoes


@pyuvm.test()
class EveryWaveformBackToBack(ModuleTest):
    """Every shape and length with no cycle in between and a sink that is always ready; latencies as the table says."""

    goals = coverage.WAVEFORMS | {coverage.BACK_TO_BACK}

    async def scenario(self) -> None:
        """Play with the default settings and with those that keep every component."""
        await self.play("back to back", every_shape(self.config, self.rng))
        self.check_latency()
        await self.play("sensitive", with_many_echoes(self.config, self.rng), config=sensitive(self.config))


@pyuvm.test()
class GapsAndStallsChangeNothing(ModuleTest):
    """Waveforms through pauses on one side, the other, and both."""

    goals = frozenset({coverage.GAP, coverage.INPUT_STALL, coverage.OUTPUT_STALL})

    async def scenario(self) -> None:
        """Play with pauses of many lengths."""
        config = sensitive(self.config)
        waveforms = [*with_many_echoes(config, self.rng), *every_length(config, self.rng)]
        pauses = self.random
        await self.play("stalls", waveforms, stalls=random_pauses(pauses, 20, 4))
        await self.play("gaps", waveforms, config=config, gaps=random_pauses(pauses, 20, 4))
        both = random_pauses(pauses, 3, 3), random_pauses(pauses, 3, 3)
        await self.play("gaps and stalls", waveforms, config=config, gaps=both[0], stalls=both[1])
        busiest = with_many_echoes(config, self.rng)[-2:]
        await self.play("long stalls", busiest, config=config, stalls=random_pauses(pauses, 2, 100))


@pyuvm.test()
class ResetInMidWaveformStartsAfresh(ModuleTest):
    """Resets at random times; what follows each must be as after power-up."""

    goals = frozenset({coverage.RESET})

    async def scenario(self) -> None:
        """Play and reset in turn."""
        config = sensitive(self.config)
        waveforms = with_many_echoes(config, self.rng)
        cycles = max(self.beats(waveforms, config) // 2, 20)
        for attempt in range(10):
            stalls = random_pauses(self.random, 5, 5) if attempt % 2 else None
            after = int(self.rng.integers(4, cycles))
            await self.play("reset", waveforms, config=config, stalls=stalls, reset_after=after)
        await self.play("after resets", waveforms, config=config)
