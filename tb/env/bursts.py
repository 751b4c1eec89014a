"""The test of modules that take a sample in each clock through bursts of echoes, which wait in a queue."""

from __future__ import annotations

from dataclasses import replace

import pyuvm

from tb.env.bench import ModuleTest
from tb.env.waveforms import bursts


@pyuvm.test()
class OneSampleAClockInBurstsOfEchoes(ModuleTest):
    """No stall of the input while the sink is ready, with up to 10 echoes as close as can be and quiet behind them."""

    async def scenario(self) -> None:
        """Play bursts, each with the quiet that it needs to be worked off and short waveforms behind that."""
        await self.play("bursts", bursts(self.config), config=replace(self.config, k=0.0))
        self.check_rate()
