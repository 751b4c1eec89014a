"""Module `inflection`: behind the second difference."""

from __future__ import annotations

from itertools import repeat
from math import floor

import numpy as np
import pyuvm

from openecho import golden
from openecho.golden import TAP_FRAC, Beats, Config
from tb.env.bench import ModuleTest
from tb.env.numbers import decoded, encoded
from tb.env.waveforms import sensitive
from tb.modules import second_difference


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    return {"s": golden.second_difference(second_difference.inputs(beats, config)["s"], config)}


@pyuvm.test()
class WorkedExampleOfThePaper(ModuleTest):
    """Zhou 2022, section 3.2.2: inflections at 536.99613 and 570.49862, on the axis of the second difference."""

    async def scenario(self) -> None:
        """Play the four values of the example, scaled to integers, and read the interval that comes out."""
        config = self.config
        scale = ((1 << min(config.first_w, config.second_w) - 2) - 1) / 0.1464
        # Of a fixed-point position, or of a float between 512 and 1023.
        last_place = 2.0**-config.frac if config.form is None else 2.0 ** (9 - config.frac)
        second = np.where((np.arange(600) < 537) | (np.arange(600) > 570), 0.01, -0.0001)
        second[[536, 537, 570, 571]] = 0.1464, -0.0005684, -0.05633, 0.05664
        scaled = np.rint(second * scale).astype(np.int64)
        scaled[:530] = 1
        scaled[580:] = 1
        index = np.arange(600)
        beats = {
            "second": encoded(scaled, TAP_FRAC, config),
            "first": encoded(np.cumsum(scaled) - scaled[:537].sum(), TAP_FRAC, config),
            "raw": np.zeros_like(index),
            "index": index,
            "overlong": np.zeros_like(index),
            "last": index == 599,
        }
        await self.play_beats("worked example", {"s": beats})
        for port, bin_before, crossing in (("left", 536, 0.1464 / 0.1469684), ("right", 570, 0.05633 / 0.11297)):
            values, _, _ = self.bench.scoreboard.channels["m"].values(port)
            # The module takes out the group delay of the filter and the difference; the example does not.
            found = float(decoded(values, config)[0, 0]) + (config.tap_count + 1) / 2
            assert abs(found - bin_before - crossing) <= 2 * last_place + 20 / scale, f"{port} is {found}"
            if last_place <= 2**-20 and config.second_w >= 24:
                assert floor(found * 1e5) / 1e5 == {"left": 536.99613, "right": 570.49862}[port]


@pyuvm.test()
class FullQueueStopsTheInput(ModuleTest):
    """Components that come much faster than they are taken: the input waits, and not one is lost."""

    async def scenario(self) -> None:
        """Play square waves of a few periods with an output that is taken once in a hundred cycles."""
        config, full = sensitive(self.config), (1 << self.config.sample_w) - 1
        waveforms = [np.where(np.arange(500) % period < period // 2, full, 0) for period in (8, 14)]
        await self.play("slow sink", waveforms, config=config, stalls={"m": repeat((1, 100))})
        source = self.bench.scoreboard.source
        assert source.stalls > 0, "the input never waited: the queue was not full"
