"""Module `parameters`: behind the inflections, with the reader's noise beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyuvm

from openecho import golden
from openecho.golden import AMP_FRAC, Beats, Config
from tb.env.bench import ModuleTest, random_pauses
from tb.env.numbers import encoded, position_frac
from tb.modules import inflection


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    _, noise = golden.reader(beats, config)
    return {"s": golden.inflection(inflection.inputs(beats, config)["s"], config), "noise": noise}


def random_inputs(config: Config, rng: np.random.Generator, waveforms: int) -> dict[str, Beats]:
    """Components with every value that their fields can have, the extremes often."""
    components = rng.integers(0, 6, waveforms)
    last = np.zeros((components + 1).sum(), bool)
    last[np.cumsum(components + 1) - 1] = True
    full, frac = (1 << config.sample_w) - 1, position_frac(config)
    end = (config.max_samples - 1) << frac

    def values(high: int, size: int) -> np.ndarray:
        anything = rng.integers(0, high, size, endpoint=True)
        return np.where(rng.random(size) < 0.2, rng.choice([0, 1, high - 1, high], size), anything)

    left, right = np.sort([values(end, last.size), values(end, last.size)], axis=0)
    close = rng.random(last.size) < 0.5
    right[close] = np.minimum(left[close] + values(60 << frac, int(close.sum())), end)
    if config.form is not None:
        # No inflection lies nearer to the start than half a tap set: there the sum of two is never subnormal.
        left, right = np.maximum(left, 1 << frac), np.maximum(right, 1 << frac)
    # Noise low enough that about half of the components stand out.
    mean, deviation = values(full << AMP_FRAC, waveforms) >> 1, values(full << AMP_FRAC, waveforms) >> 4
    none = rng.integers(0, 1, waveforms, endpoint=True)
    return {
        "s": {
            "left": np.ma.MaskedArray(encoded(left, frac, config), last),
            "right": np.ma.MaskedArray(encoded(right, frac, config), last),
            "peak": np.ma.MaskedArray(encoded(values(end, last.size), frac, config), last),
            "maximum": np.ma.MaskedArray(values(full, last.size), last),
            "length": np.ma.MaskedArray(rng.integers(1, config.max_samples, last.size, endpoint=True), ~last),
            "flags": np.where(last, rng.integers(0, 4, last.size), rng.integers(0, 8, last.size)),
            "last": last,
        },
        "noise": {"mean": np.where(none, 0, mean), "deviation": np.where(none, 0, deviation), "none": none},
    }


@pyuvm.test()
class AnyComponentWithAnySetting(ModuleTest):
    """Random and extreme components, noise and settings: n below 1, thresholds of 0 and the highest."""

    async def scenario(self) -> None:
        """Play with one setting after the other."""
        full = (1 << self.config.sample_w) - 1
        settings = [(0.0, 0, 0.0), (0.9375, 1, 0.0625), (1.0, full, 0.0), (15.9375, 0, 15.9375)]
        for _ in range(6):
            n, k = self.rng.integers(0, 256, 2)
            settings.append((int(n) / 16, int(self.rng.integers(0, full // 8)), int(k) // 4 / 16))
        for n, min_amplitude, k in settings:
            config = replace(self.config, n=n, min_amplitude=min_amplitude, k=k)
            title = f"n {n}, min_amplitude {min_amplitude}, k {k}"
            await self.play_beats(title, random_inputs(config, self.rng, 40), config=config)


@pyuvm.test()
class NoiseMayComeLateOrEarly(ModuleTest):
    """The two inputs are joined waveform by waveform, whichever waits for the other."""

    async def scenario(self) -> None:
        """Play with gaps on one input, then on the other."""
        for late in ("noise", "s"):
            gaps = {late: random_pauses(self.random, 1, 150)}
            await self.play_beats(f"late {late}", random_inputs(self.config, self.rng, 40), gaps=gaps)
