"""The test of modules that take a sample in each clock."""

from __future__ import annotations

import numpy as np
import pyuvm

from openecho.golden import NOISE_SAMPLES
from tb.env.bench import ModuleTest
from tb.env.coverage import Samples

PERIODS = (4, 6, 7, 9, 12, 14, 17, 24)
"""Of full-scale square waves, in samples: with many of them a component comes as soon as one can after another."""
SETTLE = 13
"""Samples from which on waveforms may follow each other for ever: `parameters` sets its threshold once in each."""


@pyuvm.test()
class OneSampleAClockWhateverTheEchoes(ModuleTest):
    """No stall of the input while the sink is ready, with as many components as fit, in long and short waveforms."""

    async def scenario(self) -> None:
        """Play waveforms that cross zero as often as they can."""
        full = (1 << self.config.sample_w) - 1
        shortest = max(self.config.tap_count + 2, SETTLE)
        lengths = [1024, 300, 528, *[shortest] * 30, *[NOISE_SAMPLES] * 8, 51, 200, *[57] * 4, 1000]
        waveforms: list[Samples] = [self.rng.integers(0, full, length, endpoint=True) for length in lengths]
        square = {period: np.where(np.arange(400) % period < period // 2, full, 0) for period in PERIODS}
        waveforms += square.values()
        # Every distance from the end of a run to the end of its waveform.
        waveforms += [square[period][: 400 - cut] for period in PERIODS for cut in range(period)]
        await self.play("dense", waveforms)
        stalls = self.bench.scoreboard.source.stalls
        assert stalls == 0, f"the input waited {stalls} cycles, expected none"
