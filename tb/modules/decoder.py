"""Module `decoder`: behind the encoder; records that are not in order, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import pyuvm
from cocotb.triggers import Timer
from numpy.typing import NDArray

from openecho import golden
from openecho.golden import Beats, Config
from tb.env.bench import DRAIN_CYCLES, PERIOD, ModuleTest, PausesBy, random_pauses
from tb.env.coverage import Samples, beats_of
from tb.modules import encoder

Record: TypeAlias = NDArray[np.uint32]
"""Words of one record."""

HEAD, TAIL = 2, 2
"""Words before and behind the payload."""
SHOWN = 12
"""Words at either end of a record that a message spells out."""
BETWEEN = 6
"""Clocks without a sample between two waveforms, in which the head and the first words of the next one come."""


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    return {"s": golden.encoder(beats, config)}


def records(waveforms: Sequence[Samples], config: Config) -> list[Record]:
    """Record of each waveform."""
    beats = golden.encoder(beats_of(waveforms), config)
    return np.split(beats["word"], np.flatnonzero(beats["last"])[:-1] + 1)


def stream(parts: Sequence[Record]) -> Beats:
    """Records end to end."""
    last = np.zeros(sum(record.size for record in parts), bool)
    last[np.cumsum([record.size for record in parts]) - 1] = True
    return {"word": np.concatenate(parts), "last": last}


def sensitive_records(config: Config) -> list[Record]:
    """Short records in which every bit matters: no baseline or threshold that could as well be another."""
    full = (1 << config.sample_w) - 1
    even, odd = full // 3, full // 5
    near = np.array([0, 0, 1, -1, 0, 1, -1, 0, 1])
    base = np.where(np.arange(near.size) % 2, odd, even)
    config = replace(config, codec_baseline_even=even, codec_baseline_odd=odd)
    far = np.where(np.arange(near.size) == 6, full, base + near)
    predicted = records([base + near, far, base[:2]], config)
    by_threshold = [
        records([base + abs(near), base + 3 * near], replace(config, codec_mode=0, codec_threshold=threshold))
        for threshold in (0, 1)
    ]
    return [*predicted, *by_threshold[0], *by_threshold[1]]


def whole_word(config: Config) -> Record:
    """Record whose codes end with a word: in threshold mode, a bit for each sample on the baseline."""
    return records([np.zeros(32, np.int64)], replace(config, codec_mode=0))[0]


def with_bit_flipped(record: Record, bit: int) -> Record:
    """The same but for one bit, counted from the first."""
    flipped = record.copy()
    flipped[bit // 32] ^= np.uint32(1 << 31 - bit % 32)
    return flipped


def with_words(record: Record, changes: dict[int, int]) -> Record:
    """The same but for some words."""
    changed = record.copy()
    for place, word in changes.items():
        changed[place] = word
    return changed


def _shown(record: Record) -> str:
    """Words in a message, of a long record the first and the last."""
    words = [f"{word:08x}" for word in record]
    return " ".join(words if len(words) < 2 * SHOWN else [*words[:SHOWN], "...", *words[-SHOWN:]])


class _AnyRecord(ModuleTest):
    """Records in order and not: those must come out to the last bit, these must end with a flag."""

    async def play_records(
        self, title: str, parts: Sequence[Record], gaps: PausesBy = None, stalls: PausesBy = None
    ) -> None:
        """Send records and judge what comes out; the model says which are in order."""
        beats = stream(parts)
        expected = golden.decoder(beats, self.config)
        await self.begin({"s": beats}, self.config, gaps, stalls)
        # Records that are not in order may give more beats than the model's one.
        await self.settle(title, {"s": beats["word"].size, "m": expected["sample"].size})
        bus, seen = self.bench.sinks["m"].monitor.bus, -1
        while bus.transfers != seen:
            seen = bus.transfers
            await Timer(DRAIN_CYCLES * PERIOD, "ns")
        board = self.bench.scoreboard
        board.waveforms += board.source.waveforms
        columns = [board.channels["m"].values(port) for port in ("sample", "flags", "last")]
        assert not any(unknown.any() for _, unknown, _ in columns), f"{title}: unknown bits"
        sample, flags, last = (values[:, 0].astype(np.int64) for values, _, _ in columns)
        found, model = np.flatnonzero(last) + 1, np.flatnonzero(expected["last"]) + 1
        assert found.size == len(parts), f"{title}: {found.size} waveforms came of {len(parts)} records"
        assert found[-1] == last.size, f"{title}: beats behind the last waveform"
        pieces = zip(
            *(np.split(values, found[:-1]) for values in (sample, flags)),
            *(np.split(expected[port], model[:-1]) for port in ("sample", "flags")),
            strict=True,
        )
        wrong = [
            f"record {number}, {_shown(parts[number])}: samples {samples}, flags {flagged}"
            for number, (samples, flagged, model_samples, model_flags) in enumerate(pieces)
            if flagged[:-1].any()
            or (flagged[-1] == 0) != (model_flags[-1] == 0)
            or (model_flags[-1] == 0 and samples.tolist() != model_samples.tolist())
        ]
        assert not wrong, f"{title}: {len(wrong)} of {len(parts)} records are not as the model says\n" + "\n".join(
            wrong[:5]
        )

    def good(self) -> Record:
        """A record in order, of any setting."""
        choices = encoder.every_setting(self.config, self.rng)
        config = choices[int(self.rng.integers(len(choices)))]
        return records([encoder.extremes(config, self.rng)[0]], config)[0]

    def bad(self, parts: Sequence[Record]) -> list[Record]:
        """These records, which the model must find out of order, with one in order behind each."""
        beats = golden.decoder(stream(parts), self.config)
        sound = np.flatnonzero(beats["flags"][beats["last"]] == 0)
        assert not sound.size, f"records {sound[:5]} of {len(parts)} are in order, expected none"
        good = [self.good() for _ in range(8)]
        return [record for k, part in enumerate(parts) for record in (part, good[k % 8])]


@pyuvm.test()
class AnyRecordOfTheEncoder(ModuleTest):
    """Records of both modes and of any setting, one behind the other, with and without pauses."""

    async def scenario(self) -> None:
        """Play all settings in one stream, and each with pauses."""
        choices = encoder.every_setting(self.config, self.rng)
        parts = [part for config in choices for part in records(encoder.extremes(config, self.rng), config)]
        mixed = [parts[k] for k in self.rng.permutation(len(parts))]
        await self.play_beats("back to back", {"s": stream(mixed)})
        gaps, stalls = random_pauses(self.random, 3, 3), random_pauses(self.random, 3, 3)
        await self.play_beats("gaps and stalls", {"s": stream(mixed[:200])}, gaps=gaps, stalls=stalls)
        await self.play_beats("stalls", {"s": stream(mixed[:100])}, stalls=random_pauses(self.random, 2, 20))


@pyuvm.test()
class OneSampleAClockAndSixBetweenWaveforms(ModuleTest):
    """With words and a sink that never wait, a waveform of M samples takes M + 6 clocks, whatever its codes."""

    async def scenario(self) -> None:
        """Play each setting."""
        for config in encoder.every_setting(self.config, self.rng):
            waveforms = [*encoder.extremes(config, self.rng), *encoder.recorded_like(config)]
            await self.play_beats("back to back", {"s": stream(records(waveforms, config))})
            channel = self.bench.scoreboard.channels["m"]
            last = channel.values("last")[0][:-1, 0] == 1
            waits = np.diff(channel.cycles()) - 1
            assert (waits == np.where(last, BETWEEN, 0)).all(), f"waits of {np.unique(waits)} cycles"


@pyuvm.test()
class EveryFlippedBitIsFlagged(_AnyRecord):
    """Of short records in both modes, each bit in turn; the record behind comes out to the last bit."""

    async def scenario(self) -> None:
        """Play record by record."""
        for number, record in enumerate(sensitive_records(self.config)):
            flipped = [with_bit_flipped(record, bit) for bit in range(32 * record.size)]
            await self.play_records(f"sensitive record {number}", self.bad(flipped))


@pyuvm.test()
class WrongHeadsAndLengthsAreFlagged(_AnyRecord):
    """Heads that no encoder makes, too few and too many words, samples more or fewer than are there."""

    async def scenario(self) -> None:
        """Play all, without and with pauses."""
        kinds = [*sensitive_records(self.config), whole_word(self.config)]
        parts = [part for record in kinds for part in self._wrong(record)]
        await self.play_records("wrong", self.bad(parts))
        gaps, stalls = random_pauses(self.random, 3, 3), random_pauses(self.random, 3, 3)
        await self.play_records("wrong, pauses", self.bad(parts), gaps, stalls)

    def _wrong(self, record: Record) -> list[Record]:
        head, baselines, number = int(record[0]), int(record[1]), int(record[-TAIL])
        width, beyond = self.config.sample_w, (1 << self.config.sample_w) & 0xFFFF
        heads = [head ^ version << 28 for version in (1, 3, 15)]
        heads += [head & ~(15 << 24) | mode << 24 for mode in (2, 3, 9, 15)]
        heads += [head & ~(15 << 20) | other << 20 for other in range(16) if other != width - 1]
        heads += [head | 1 << bit for bit in range(16, 20)]
        heads += [head | beyond] * (beyond > 0) + [head | 1] * (head >> 24 & 1)
        pairs = [baselines | beyond, baselines | beyond << 16] * (beyond > 0)
        numbers = [0, number - 1, number + 1, number + 2, number + 33, 65535, number | 1 << 16, number << 16]
        cut = [record[:words] for words in range(1, record.size)]
        cut += [np.delete(record, place) for place in range(1, record.size)]
        longer = [np.insert(record, place, word) for place in range(1, record.size + 1) for word in (0, 0xFFFFFFFF)]
        return [
            *(with_words(record, {0: word}) for word in heads),
            *(with_words(record, {1: word}) for word in pairs),
            *(with_words(record, {record.size - TAIL: word}) for word in numbers),
            *(with_words(record, {record.size - 1: word}) for word in (0, 0xFFFFFFFF)),
            *cut,
            *longer,
            *(np.append(record, words) for words in ([0, 0], record[-TAIL:])),
        ]


@pyuvm.test()
class RandomWordsAreFlagged(_AnyRecord):
    """Words of any content, alone and between a head and a tail that are right."""

    async def scenario(self) -> None:
        """Play without and with pauses."""
        lengths = self.rng.integers(1, 40, 100)
        anything = [self.rng.integers(0, 1 << 32, length, dtype=np.uint32) for length in lengths]
        framed = [self._framed(part) for part in anything]
        cut = [record[: int(self.rng.integers(1, record.size))] for record in framed]
        for title, parts in (("anything", anything), ("framed", framed), ("cut", cut)):
            await self.play_records(title, self.bad(parts))
            gaps, stalls = random_pauses(self.random, 3, 3), random_pauses(self.random, 3, 3)
            await self.play_records(f"{title}, pauses", self.bad(parts), gaps, stalls)

    def _framed(self, payload: Record) -> Record:
        """Words between a right head and a tail with any number of samples that may be."""
        good = self.good()
        number = self.rng.integers(1, 32 * payload.size, endpoint=True, dtype=np.uint32)
        return np.concatenate([good[:HEAD], payload, [number], self.rng.integers(0, 1 << 32, 1, dtype=np.uint32)])


@pyuvm.test(skip=not encoder.is_long_affordable())
class AsManySamplesAsCanBeCounted(_AnyRecord):
    """65535 samples come out to the last; a record of one more is flagged, and the one behind it sound."""

    async def scenario(self) -> None:
        """Play samples of a bit and a few larger ones."""
        config = replace(self.config, codec_mode=0)
        anything = self.rng.integers(0, 1 << config.sample_w, encoder.MOST_SAMPLES + 1)
        samples = np.where(self.rng.random(anything.size) < 0.01, anything, 0)
        most, too_many = records([samples[:-1], samples], config)
        await self.play_records("long", [most, *self.bad([too_many])])
