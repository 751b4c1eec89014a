"""Module `reader`: its input is the core's."""

from __future__ import annotations

from itertools import repeat

import pyuvm

from openecho.golden import NOISE_SAMPLES, Beats, Config
from tb.env.bench import ModuleTest, random_pauses
from tb.env.coverage import Samples


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    del config
    return {"s": beats}


class _ManyShortWaveforms(ModuleTest):
    """Waveforms about as long as the noise window, of every brightness and spread."""

    def waveforms(self, count: int) -> list[Samples]:
        """Random samples between random bounds; lengths on either side of the window."""
        full = (1 << self.config.sample_w) - 1
        lengths = self.rng.choice([1, 2, NOISE_SAMPLES - 1, NOISE_SAMPLES, NOISE_SAMPLES + 1, 130], count)
        bounds = self.rng.integers(0, full, (count, 2), endpoint=True)
        bounds[: count // 8] = 0, full
        bounds[count // 8 : count // 6] = full, full
        bounds.sort(axis=1)
        spread = [self.rng.integers(low, high, 130, endpoint=True) for low, high in bounds]
        half_full = [self.rng.permutation([0, full] * 65) for _ in range(count // 16)]
        return [samples[:length] for samples, length in zip([*half_full, *spread], lengths, strict=False)]


@pyuvm.test()
class NoiseOfEveryBrightnessAndSpread(_ManyShortWaveforms):
    """Mean and deviation to the last bit, up to the largest that there is: half zeros, half full scale."""

    async def scenario(self) -> None:
        """Play back to back."""
        await self.play("noise", self.waveforms(200))


@pyuvm.test()
class StalledNoiseLosesNothing(_ManyShortWaveforms):
    """The noise stream may wait for long, and so may the samples, without an entry lost or out of place."""

    async def scenario(self) -> None:
        """Stall one output, then the other."""
        for stalled in ("noise", "m"):
            stalls = {stalled: random_pauses(self.random, 1, 200 if stalled == "noise" else 20)}
            await self.play(f"{stalled} stalled", self.waveforms(40), stalls=stalls)


@pyuvm.test()
class ManyShortWaveformsWaitForTheirTurn(_ManyShortWaveforms):
    """Behind one waveform with statistics more short ones wait, without, than the reader can remember."""

    async def scenario(self) -> None:
        """Take the noise so rarely that all of them have come before the first is taken."""
        full = (1 << self.config.sample_w) - 1
        lengths = [NOISE_SAMPLES, *[5] * 40]
        waveforms = [self.rng.integers(0, full, length, endpoint=True) for length in lengths]
        await self.play("late noise", waveforms, stalls={"noise": repeat((1, sum(lengths)))})
