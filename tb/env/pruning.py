"""The test of modules that take a sample in each clock, whatever the waveform, as long as it has no echo."""

from __future__ import annotations

from dataclasses import replace

import pyuvm

from tb.env.bench import ModuleTest
from tb.env.waveforms import dense


@pyuvm.test()
class OneSampleAClockWhateverDoesNotStandOut(ModuleTest):
    """No stall of the input while the sink is ready, with as many components as fit, none of which is an echo."""

    async def scenario(self) -> None:
        """Play waveforms that cross zero as often as they can, and stay below the least amplitude of an echo."""
        height = 1 << self.config.sample_w - 1
        config = replace(self.config, min_amplitude=height + 1)
        await self.play("low", dense(config, self.rng, height), config=config)
        self.check_rate()
