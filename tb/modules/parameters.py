"""Module `parameters`: behind the inflections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyuvm

from openecho import golden
from openecho.golden import AMP_FRAC, Beats, Config
from tb.env.bench import ModuleTest
from tb.env.numbers import any_value, encoded, position_frac
from tb.modules import inflection


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    before = inflection.inputs(beats, config)
    return {"s": golden.inflection(before["s"], before["noise"], config)}


def random_inputs(config: Config, rng: np.random.Generator, waveforms: int) -> dict[str, Beats]:
    """Components and trailers with every value that their fields can have, the extremes often."""
    components = rng.integers(0, 6, waveforms)
    last = np.zeros((components + 1).sum(), bool)
    last[np.cumsum(components + 1) - 1] = True
    frac, greatest = position_frac(config), ((1 << config.sample_w) - 1) << AMP_FRAC
    end = (config.max_samples - 1) << frac

    left, right = np.sort([any_value(end, last.size, rng), any_value(end, last.size, rng)], axis=0)
    close = rng.random(last.size) < 0.5
    right[close] = np.minimum(left[close] + any_value(60 << frac, int(close.sum()), rng), end)
    if config.form is not None:
        # No inflection lies nearer to the start than half a tap set: there the sum of two is never subnormal.
        left, right = np.maximum(left, 1 << frac), np.maximum(right, 1 << frac)
    beats = {
        "left": np.ma.MaskedArray(encoded(left, frac, config), last),
        "right": np.ma.MaskedArray(encoded(right, frac, config), last),
        "peak": np.ma.MaskedArray(encoded(any_value(end, last.size, rng), frac, config), last),
        "amplitude": any_value(greatest, last.size, rng),
        "length": np.ma.MaskedArray(rng.integers(1, config.max_samples, last.size, endpoint=True), ~last),
        "mean": np.ma.MaskedArray(any_value(greatest, last.size, rng), ~last),
        "flags": rng.integers(0, 8, last.size),
        "last": last,
    }
    return {"s": beats}


@pyuvm.test()
class AnyComponentWithAnySetting(ModuleTest):
    """Random and extreme components and trailers, and any divisor of the width: below 1, too."""

    async def scenario(self) -> None:
        """Play with one setting after the other."""
        for n in (0.0, 0.9375, 1.0, 15.9375, *(self.rng.integers(0, 256, 6) / 16)):
            config = replace(self.config, n=float(n))
            await self.play_beats(f"n {n}", random_inputs(config, self.rng, 40), config=config)
