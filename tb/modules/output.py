"""Module `output`: behind the parameters."""

from __future__ import annotations

import numpy as np
import pyuvm

from openecho import golden
from openecho.golden import Beats, Config
from tb.env.bench import ModuleTest, random_pauses
from tb.modules import parameters


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    return {"s": golden.parameters(parameters.inputs(beats, config)["s"], config)}


@pyuvm.test()
class AnyFieldInItsPlace(ModuleTest):
    """Random and extreme values in every field, negative times too; every bit must land in its word."""

    async def scenario(self) -> None:
        """Play without and with stalls."""
        config, rng = self.config, self.rng
        count = 400
        last = rng.random(count) < 0.2
        last[-1] = True

        def values(low: int, high: int) -> np.ndarray:
            anything = rng.integers(low, high, count, endpoint=True)
            return np.where(rng.random(count) < 0.2, rng.choice([low, low + 1, high - 1, high], count), anything)

        largest = (1 << config.value_w - 1) - 1
        beats = {
            "centre": values(0, largest),
            "peak": values(0, largest),
            "width": np.where(last, 0, values(0, largest)),
            "time": np.where(last, 0, values(-largest - 1, largest)),
            "amplitude": values(0, largest),
            "flags": values(0, 7),
            "last": last,
        }
        await self.play_beats("random", {"s": beats})
        await self.play_beats("random, stalls", {"s": beats}, stalls=random_pauses(self.random, 3, 3))
