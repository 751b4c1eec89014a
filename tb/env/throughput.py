"""The test of modules that take a sample in each clock, whatever the waveform."""

from __future__ import annotations

import pyuvm

from tb.env.bench import ModuleTest
from tb.env.waveforms import dense


@pyuvm.test()
class OneSampleAClockWhateverTheEchoes(ModuleTest):
    """No stall of the input while the sink is ready, with as many components as fit, in long and short waveforms.

    But for what the module table allows each waveform at its start.
    """

    async def scenario(self) -> None:
        """Play waveforms that cross zero as often as they can."""
        await self.play("dense", dense(self.config, self.rng, (1 << self.config.sample_w) - 1))
        self.check_rate()
