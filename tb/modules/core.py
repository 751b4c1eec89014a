"""Module `core`: the six modules in a row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyuvm
from numpy.typing import NDArray

from openecho import golden
from openecho.golden import Beats, Config
from openecho.golden.beats import waveform_of
from tb.env.bench import ModuleTest
from tb.env.coverage import beats_of
from tb.env.waveforms import SETTLE, clocks_per_echo, every_length, with_many_echoes

NO_ECHO_LATENCY = 50
"""Cycles from the last sample of a waveform to its trailer, at most, without an echo: until its noise is known."""
CLOCKS_PER_DROPPED = 5
"""Of a component that does not stand out of the noise."""
CLOCKS_PER_TRAILER = SETTLE
"""Until the threshold of the next waveform is set, if that has no noise figures."""
CLOCKS_PER_FIGURES = 44
"""The same if it has, as these are worked out only when those before have been taken."""


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    del config
    return {"s": beats}


@pyuvm.test()
class TrailerSoonAfterTheLastSample(ModuleTest):
    """The trailer comes soon after its waveform's last sample, or after all before it can have been worked off."""

    async def scenario(self) -> None:
        """Play what keeps the divider busy."""
        waveforms = [*with_many_echoes(self.config, self.rng), *every_length(self.config, self.rng)]
        await self.play("trailers", waveforms)
        board = self.bench.scoreboard
        cause, work, is_trailer = _work(beats_of(waveforms), self.config)
        # Components and trailers are worked off one after the other, each as soon as it has come.
        came, done = board.source.cycles()[cause], np.cumsum(work)
        worked_off = done + np.maximum.accumulate(came - done + work)
        last, _, _ = board.channels["m"].values("last")
        slowest = (board.channels["m"].cycles()[last[:, 0] == 1] - worked_off[is_trailer]).max()
        # The last echo still goes through `parameters`.
        limit = NO_ECHO_LATENCY + clocks_per_echo(self.config)
        assert slowest <= limit, f"a trailer took {slowest} cycles, expected at most {limit}"


def _work(beats: Beats, config: Config) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Sample that each component, kept or not, or trailer waits for, its clocks, and whether it is a trailer."""
    samples, noise = golden.reader(beats, config)
    differences = golden.second_difference(golden.filter(samples, config), config)
    silence = {name: np.zeros_like(values) for name, values in noise.items()}
    everything = golden.inflection(differences, silence, replace(config, min_amplitude=0, k=0.0))
    echoes = golden.inflection(differences, noise, config)
    is_echo = np.isin(everything["cause"], echoes["cause"][~echoes["last"]])
    work = np.where(is_echo, clocks_per_echo(config), CLOCKS_PER_DROPPED)
    has_figures_next = np.append(noise["none"][1:] == 0, False)
    work[everything["last"]] = np.where(has_figures_next, CLOCKS_PER_FIGURES, CLOCKS_PER_TRAILER)
    cause = np.maximum(samples["cause"][everything["cause"]], noise["cause"][waveform_of(everything["last"])])
    return cause, work, everything["last"]
