"""Module `core`: the six modules in a row."""

from __future__ import annotations

import numpy as np
import pyuvm

from openecho.golden import Beats, Config
from tb.env.bench import ModuleTest
from tb.env.waveforms import clocks_per_echo, every_length, with_many_echoes

NO_ECHO_LATENCY = 50
"""Cycles from the last sample of a waveform to its trailer, at most, without an echo: until its noise is known."""
CLOCKS_PER_DROPPED = 3
SLOTS = 16
"""Components that may be in the core."""


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    del config
    return {"s": beats}


@pyuvm.test()
class TrailerSoonAfterTheLastSample(ModuleTest):
    """The trailer comes soon after its waveform's last sample, or after all echoes can have been solved."""

    async def scenario(self) -> None:
        """Play what keeps the divider busy."""
        waveforms = [*with_many_echoes(self.config, self.rng), *every_length(self.config, self.rng)]
        await self.play("trailers", waveforms)
        board = self.bench.scoreboard
        last, _, _ = board.channels["m"].values("last")
        is_trailer, sent = last[:, 0] == 1, board.channels["m"].cycles()
        # Echoes are solved one after the other, each as soon as it has come and the one before is done.
        work = np.where(is_trailer, 0, clocks_per_echo(self.config))
        done = np.cumsum(work)
        solved = done + np.maximum.accumulate(sent - board.latency["m"] - done + work)
        slowest = (sent - solved)[is_trailer].max()
        # The last echo goes through `inflection`, then through `parameters`; what is dropped may wait before it.
        limit = NO_ECHO_LATENCY + 2 * clocks_per_echo(self.config) + CLOCKS_PER_DROPPED * SLOTS
        assert slowest <= limit, f"a trailer took {slowest} cycles, expected at most {limit}"
