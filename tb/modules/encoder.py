"""Module `encoder`: its input is the core's; what it is set to, and samples that are the worst for a codec."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import cocotb
import numpy as np
import pyuvm
from numpy.typing import NDArray

from openecho import golden, stimulus
from openecho.golden import NOISE_SAMPLES, Beats, Config
from tb.env.bench import ModuleTest, random_pauses
from tb.env.coverage import Samples, beats_of
from tb.env.run import RUN_VARIABLE, Run
from tb.env.waveforms import dense, every_shape

LENGTHS = (1, 2, 3, 22, 130)
"""Of waveforms of each extreme shape: in the shorter ones codes never get away from where they start."""
MOST_SAMPLES = 65535
"""Of a waveform whose record can be decoded."""


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    del config
    return {"s": beats}


def every_setting(config: Config, rng: np.random.Generator) -> list[Config]:
    """Both modes, with thresholds and baselines at both ends and between, for even and odd indices alike and not."""
    full = (1 << config.sample_w) - 1
    baselines = [(0, 0), (full, full), (0, full), (full // 8, full // 8 + 3), tuple(rng.integers(0, full, 2).tolist())]
    thresholds = [0, 1, full, full // 2, full // 2 + 1, 7, int(rng.integers(2, full))]
    codes = [(1, 0, pair) for pair in baselines]
    codes += [(0, threshold, baselines[k % len(baselines)]) for k, threshold in enumerate(thresholds)]
    return [
        replace(config, codec_mode=mode, codec_threshold=threshold, codec_baseline_even=even, codec_baseline_odd=odd)
        for mode, threshold, (even, odd) in codes
    ]


def extremes(config: Config, rng: np.random.Generator) -> list[Samples]:
    """What costs a code most and least, near the baselines and far from them, in short and long waveforms, mixed."""
    waveforms = [samples for length in LENGTHS for samples in _shapes(config, length, rng)]
    return [waveforms[k] for k in rng.permutation(len(waveforms))]


def _shapes(config: Config, length: int, rng: np.random.Generator) -> Iterator[Samples]:
    """Each shape, so long."""
    full, x = (1 << config.sample_w) - 1, np.arange(length)
    base = np.where(x % 2, config.codec_baseline_odd, config.codec_baseline_even)
    yield np.zeros(length, np.int64)
    yield np.full(length, full)
    yield np.where(x % 2, full, 0)
    yield rng.integers(0, full, length, endpoint=True)
    yield np.where(x < length // 2, 0, full)
    yield x * full // length
    yield full - x * full // length
    yield np.where(x == length // 2, full, base)
    yield np.where(x == length // 2, 0, base)
    # Quiet for so long that all credit is there, then as bad as can be; and the other way round.
    noise = rng.integers(-2, 2, length, endpoint=True)
    anything = rng.integers(0, full, length, endpoint=True)
    yield np.where(x < length // 2, base + noise, anything) & full
    yield np.where(x > length // 4, base + noise, anything) & full
    # As large as the threshold and just beyond, over the baseline.
    yield base + config.codec_threshold + noise & full


def recorded_like(config: Config) -> list[Samples]:
    """Land and ocean waveforms with noise of about a count, of at most 11 bits."""
    reference = stimulus.reference_set(0)
    rows = zip(reference.samples[::10], reference.length[::10], strict=True)
    return [row[:length].astype(np.int64) >> max(0, Config().sample_w - config.sample_w) for row, length in rows]


@pyuvm.test()
class AnySettingWithAnySamples(ModuleTest):
    """Both modes, every threshold and baseline; extreme and random samples, with and without pauses."""

    async def scenario(self) -> None:
        """Play with one setting after the other."""
        for config in every_setting(self.config, self.rng):
            title = f"mode {config.codec_mode}, threshold {config.codec_threshold}"
            await self.play(title, extremes(config, self.rng), config=config)
            pauses = random_pauses(self.random, 3, 3), random_pauses(self.random, 3, 3)
            few = extremes(config, self.rng)[:20]
            await self.play(f"{title}, pauses", few, config=config, gaps=pauses[0], stalls=pauses[1])


@pyuvm.test()
class EveryWaveformByThreshold(ModuleTest):
    """Every shape and length of the other benches in the mode that they do not run."""

    async def scenario(self) -> None:
        """Play with a threshold of about the noise."""
        config = replace(self.config, codec_mode=0, codec_threshold=15)
        await self.play("threshold", every_shape(config, self.rng), config=config)


@pyuvm.test()
class SettingsMayChangeBetweenWaveforms(ModuleTest):
    """Nothing is left of the setting before when a waveform has gone."""

    async def scenario(self) -> None:
        """Play waveforms one by one, each with another setting, without a reset."""
        for turn in range(3):
            for config in every_setting(self.config, self.rng):
                shapes = extremes(config, self.rng)[:2]
                await self.play(f"turn {turn}", shapes, config=config, fresh=False)


@pyuvm.test()
class QuietWaveformsAreTakenAtOneSampleAClock(ModuleTest):
    """Waveforms like recorded ones, back to back, take as many clocks as they have samples if they are predicted."""

    async def scenario(self) -> None:
        """Play with the baseline in the middle of the noise."""
        waveforms = recorded_like(self.config)
        base = int(np.median(np.concatenate([samples[:NOISE_SAMPLES] for samples in waveforms])))
        config = replace(self.config, codec_baseline_even=base, codec_baseline_odd=base)
        await self.play("recorded", waveforms, config=config)
        waited = self.bench.scoreboard.source.stalls
        assert waited == 0, f"the input waited {waited} cycles, expected none"


@pyuvm.test()
class AnyWaveformWaitsOnlyUntilItsHeadIsOut(ModuleTest):
    """Where the first codes fill a word before the last record's tail and the head are out, the input waits for those.

    A clock less for each code: as long as the module table says if the first code is a word, which needs 16 + 16 bits.
    """

    async def scenario(self) -> None:
        """Play waveforms that are long enough to be told from each other, then short ones as well."""
        full = (1 << self.config.sample_w) - 1
        loud = [self.rng.integers(0, full, 100, endpoint=True) for _ in range(10)]
        for config in every_setting(self.config, self.rng):
            for title, waveforms in (("loud", loud), ("quiet", recorded_like(config))):
                await self.play(title, waveforms, config=config)
                self.check_rate()
                index, waits = self.waits()
                # Nothing is before the first waveform.
                waited = np.bincount(np.cumsum(index == 0) - 1, waits)[1:].astype(np.int64)
                codes = _codes_in_the_first_word(waveforms, config)[1:]
                expected = np.maximum(self.bench.module.waits + 1 - codes, 0)
                wrong = f"{title}: the input waited {waited}, expected {expected} cycles"
                assert (waited == expected).all(), wrong
        for config in (self.config, replace(self.config, codec_mode=0, codec_threshold=full)):
            await self.play("dense", dense(config, self.rng, full), config=config)
            self.check_rate()


def _codes_in_the_first_word(waveforms: Sequence[Samples], config: Config) -> NDArray[np.int64]:
    """Codes of each waveform up to that which fills the first word of the payload."""
    beats = beats_of(waveforms)
    starts = np.append(0, np.flatnonzero(beats["last"])[:-1] + 1)
    encoded = golden.encoder(beats, config)
    heads = np.append(0, np.flatnonzero(encoded["last"])[:-1] + 1)
    return encoded["cause"][heads + 2] - starts + 1  # type: ignore[no-any-return]


def is_long_affordable() -> bool:
    """Whether hundreds of thousands of samples are: on Verilator, and once, with the default parameters."""
    path = os.environ.get(RUN_VARIABLE)
    if path is None or cocotb.SIM_NAME != "Verilator":
        return False
    return Run.load(Path(path)).config == Config()


@pyuvm.test(skip=not is_long_affordable())
class TooManySamplesSpoilNoOtherRecord(ModuleTest):
    """65535 samples are counted; of one more bit 16 of the count is set; the next record is sound."""

    async def scenario(self) -> None:
        """Play long waveforms of small samples, with a short one behind each."""
        lengths = (MOST_SAMPLES, 22, MOST_SAMPLES + 1, 22)
        await self.play("long", [self.rng.integers(0, 3, length) for length in lengths])
