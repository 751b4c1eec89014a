"""Module `core`: the six modules in a row."""

from __future__ import annotations

import pyuvm

from openecho.golden import Beats, Config
from tb.env.bench import ModuleTest
from tb.env.waveforms import every_length, with_many_echoes

TRAILER_LATENCY = 128
"""Cycles from the last sample of a waveform to its trailer, at most."""


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    del config
    return {"s": beats}


@pyuvm.test()
class TrailerSoonAfterTheLastSample(ModuleTest):
    """With the default parameters the trailer comes within 128 cycles, however many echoes wait before it."""

    async def scenario(self) -> None:
        """Play what keeps the dividers busy."""
        waveforms = [*with_many_echoes(self.config, self.rng), *every_length(self.config, self.rng)]
        await self.play("trailers", waveforms)
        board = self.bench.scoreboard
        last, _, _ = board.channels["m"].values("last")
        slowest = board.latency["m"][last[:, 0] == 1].max()
        assert slowest <= TRAILER_LATENCY or self.config != Config(), (
            f"a trailer took {slowest} cycles, expected at most {TRAILER_LATENCY}"
        )
