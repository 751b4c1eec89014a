"""Module `inflection`: behind the second difference, with the reader's noise beside it."""

from __future__ import annotations

from dataclasses import replace
from itertools import repeat
from math import floor

import numpy as np
import pyuvm

from openecho import golden
from openecho.golden import AMP_FRAC, TAP_FRAC, Beats, Config
from tb.env.bench import ModuleTest, random_pauses
from tb.env.coverage import Samples, beats_of
from tb.env.numbers import any_value, decoded, encoded
from tb.env.waveforms import sensitive, with_many_echoes
from tb.modules import second_difference


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    _, noise = golden.reader(beats, config)
    return {"s": golden.second_difference(second_difference.inputs(beats, config)["s"], config), "noise": noise}


def any_noise(config: Config, rng: np.random.Generator, waveforms: int) -> Beats:
    """Noise of any mean and deviation, the extremes often, low enough that about half of the components stand out."""
    greatest = ((1 << config.sample_w) - 1) << AMP_FRAC
    none = rng.integers(0, 1, waveforms, endpoint=True)
    mean, deviation = any_value(greatest, waveforms, rng), any_value(greatest, waveforms, rng) >> 5
    return {"mean": np.where(none, 0, mean), "deviation": np.where(none, 0, deviation), "none": none}


@pyuvm.test()
class WorkedExampleOfThePaper(ModuleTest):
    """Zhou 2022, section 3.2.2: inflections at 536.99613 and 570.49862, on the axis of the second difference."""

    async def scenario(self) -> None:
        """Play the four values of the example, scaled to integers, and read the interval that comes out."""
        config = replace(self.config, min_amplitude=0, k=0.0)
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
        noise = {name: np.zeros(1, np.int64) for name in ("mean", "deviation", "none")}
        await self.play_beats("worked example", {"s": beats, "noise": noise}, config=config)
        for port, bin_before, crossing in (("left", 536, 0.1464 / 0.1469684), ("right", 570, 0.05633 / 0.11297)):
            values, _, _ = self.bench.scoreboard.channels["m"].values(port)
            # The module takes out the group delay of the filter and the difference; the example does not.
            found = float(decoded(values, config)[0, 0]) + (config.tap_count + 1) / 2
            assert abs(found - bin_before - crossing) <= 2 * last_place + 20 / scale, f"{port} is {found}"
            if last_place <= 2**-20 and config.second_w >= 24:
                assert floor(found * 1e5) / 1e5 == {"left": 536.99613, "right": 570.49862}[port]


class _NoiseOfItsOwn(ModuleTest):
    """Waveforms beside noise that is not theirs: of any size, so that components stand out or do not by chance."""

    def with_any_noise(self, waveforms: list[Samples], config: Config) -> dict[str, Beats]:
        """Beats on each input."""
        return inputs(beats_of(waveforms), config) | {"noise": any_noise(config, self.rng, len(waveforms))}


@pyuvm.test()
class AnyNoiseWithAnySetting(_NoiseOfItsOwn):
    """Random and extreme noise and settings, thresholds of 0 and the highest."""

    async def scenario(self) -> None:
        """Play with one setting after the other."""
        full, rng = (1 << self.config.sample_w) - 1, self.rng
        settings = [(0, 0.0), (1, 0.0625), (full, 0.0), (0, 15.9375)]
        settings += [(int(rng.integers(0, full // 2)), int(rng.integers(0, 256)) / 16) for _ in range(6)]
        for min_amplitude, k in settings:
            config = replace(sensitive(self.config), min_amplitude=min_amplitude, k=k)
            waveforms = [rng.integers(0, full, length, endpoint=True) for length in rng.integers(1, 150, 20)]
            waveforms += with_many_echoes(config, rng)[-6:]
            beats = self.with_any_noise(waveforms, config)
            await self.play_beats(f"min_amplitude {min_amplitude}, k {k}", beats, config=config)


@pyuvm.test()
class NoiseMayComeLateOrEarly(_NoiseOfItsOwn):
    """The two inputs are joined waveform by waveform, whichever waits for the other."""

    async def scenario(self) -> None:
        """Play with gaps on one input, then on the other."""
        config, full = sensitive(self.config), (1 << self.config.sample_w) - 1
        waveforms = [self.rng.integers(0, full, length, endpoint=True) for length in self.rng.integers(1, 100, 40)]
        for late, longest_on in (("noise", 1), ("s", 20)):
            gaps = {late: random_pauses(self.random, longest_on, 200)}
            await self.play_beats(f"late {late}", self.with_any_noise(waveforms, config), config=config, gaps=gaps)


@pyuvm.test()
class FullQueueStopsTheInput(ModuleTest):
    """Components that come much faster than they are taken: the input waits, and not one is lost."""

    async def scenario(self) -> None:
        """Play square waves of a few periods with an output that is taken once in a hundred cycles."""
        config, full = sensitive(self.config), (1 << self.config.sample_w) - 1
        waveforms = [np.where(np.arange(500) % period < period // 2, full, 0) for period in (6, 14)]
        await self.play("slow sink", waveforms, config=config, stalls={"m": repeat((1, 100))})
        source = self.bench.scoreboard.source
        assert source.stalls > 0, "the input never waited: the queue was not full"
