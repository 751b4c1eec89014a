"""Functional coverage: the situations that a bench must have put its module in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyuvm import uvm_component, uvm_subscriber

from openecho import golden
from openecho.golden import Config
from openecho.hardware import Stream
from tb.env.stream import Observed

Samples = NDArray[np.integer[Any]]

SHAPES: dict[str, Callable[[Samples, int], bool]] = {
    "all zero": lambda s, full: not s.any(),
    "full-scale flat": lambda s, full: bool((s == full).all()),
    "alternating 0 and full scale": lambda s, full: bool(s.min() == 0 and (np.abs(np.diff(s)) == full).all()),
    "single impulse": lambda s, full: np.count_nonzero(s) == 1,
    "step": lambda s, full: np.count_nonzero(np.diff(s)) == 1 and 0 < np.flatnonzero(np.diff(s))[0] < s.size - 2,
    "ramp": lambda s, full: bool(s[-1] - s[0] == full and np.diff(s).min() >= 0 and np.ptp(np.diff(s)) <= 1),
    "saturated flat-topped echo": lambda s, full: _flat_top(s, full) >= 3 and s[0] < full > s[-1],
    "noise alone": lambda s, full: 0 < s.std() <= max(full / 500, 2) and np.ptp(s) < 12 * s.std(),
}
"""Shapes of a waveform as predicates of its samples (int64) and of full scale."""

LENGTHS: dict[str, Callable[[int, Config], bool]] = {
    "shortest": lambda length, config: length == config.tap_count + 2,
    "528 samples": lambda length, config: length == 528,
    "1024 samples": lambda length, config: length == 1024,
    "longest": lambda length, config: length == config.max_samples,
    "too short": lambda length, config: length < config.tap_count + 2,
    "too long": lambda length, config: length > config.max_samples,
}
ECHO_COUNTS = {"no echo": (0, 0), "1 echo": (1, 1), "2 to 16 echoes": (2, 16), "more than 16 echoes": (17, 1 << 16)}
"""Least and greatest number of echoes."""
EDGES = ("echo cut by the start", "echo cut by the end")

WAVEFORMS = frozenset((*SHAPES, *LENGTHS, *ECHO_COUNTS, *EDGES))
"""Bins of what the waveforms are."""
BACK_TO_BACK = "waveforms back to back"
GAP = "gap in a waveform"
INPUT_STALL = "stall of the input"
OUTPUT_STALL = "stall of the output"
RESET = "reset in mid-waveform"
EVERY_BIN = WAVEFORMS | {BACK_TO_BACK, GAP, INPUT_STALL, OUTPUT_STALL, RESET}
"""What every module's bench must reach, all its tests together."""


class Watch(uvm_subscriber):
    """Feeds the coverage with what one monitor publishes."""

    def __init__(self, name: str, parent: Coverage, is_input: bool) -> None:
        super().__init__(name, parent)
        self.coverage, self.is_input = parent, is_input

    def write(self, tt: Observed) -> None:
        """Sample a waveform."""
        self.coverage.sample(tt, self.is_input)


class Coverage(uvm_component):
    """Counts the bins that a test reached, from what its monitors saw, and fails if one of its goals is missing."""

    def __init__(self, name: str, parent: Any, streams: Sequence[Stream], inputs: Sequence[Stream]) -> None:
        super().__init__(name, parent)
        self._streams, self._inputs = streams, inputs
        self.goals: frozenset[str] = frozenset()
        self.hit: set[str] = set()

    def build_phase(self) -> None:
        """Create a watch for each stream."""
        self.watches = {stream.prefix: Watch(stream.prefix, self, stream in self._inputs) for stream in self._streams}

    def sample(self, observed: Observed, is_input: bool) -> None:
        """Take what the pins showed of one waveform."""
        if is_input:
            self._note(RESET, not observed.complete)
            self._note(BACK_TO_BACK, not observed.idle and not observed.gaps)
            self._note(GAP, observed.gaps > 0)
            self._note(INPUT_STALL, observed.stalls > 0)
        else:
            self._note(OUTPUT_STALL, observed.stalls > 0)

    def sample_waveforms(self, waveforms: Sequence[Samples], config: Config) -> None:
        """Take the waveforms that went through the module completely."""
        if not waveforms:
            return
        full = (1 << config.sample_w) - 1
        for samples in waveforms:
            for name, matches in LENGTHS.items():
                self._note(name, matches(samples.size, config))
            if samples.size >= config.tap_count + 2:
                for name, shows in SHAPES.items():
                    self._note(name, shows(samples, full))
        records = golden.decode_records(golden.core(beats_of(waveforms), config)["record"], config)
        echoes, trailers = records[~records["trailer"]], records[records["trailer"]]
        for name, (least, most) in ECHO_COUNTS.items():
            self._note(name, bool(((least <= trailers["number"]) & (trailers["number"] <= most)).any()))
        truncated = echoes[echoes["flags"] & golden.TRUNCATED != 0]
        centre = truncated["centre"] / trailers["length"][truncated["sequence"]]
        self._note("echo cut by the start", bool((centre < 0.5).any()))
        self._note("echo cut by the end", bool((centre > 0.5).any()))

    def check_phase(self) -> None:
        """Fail on a goal that was not reached."""
        missing = sorted(self.goals - self.hit)
        assert not missing, f"not covered: {', '.join(missing)}"

    def _note(self, name: str, reached: bool) -> None:
        if reached:
            self.hit.add(name)


def beats_of(waveforms: Sequence[Samples]) -> golden.Beats:
    """Waveforms of any lengths as one sample stream."""
    last = np.zeros(sum(samples.size for samples in waveforms), bool)
    last[np.cumsum([samples.size for samples in waveforms]) - 1] = True
    return {"sample": np.concatenate(waveforms).astype(np.int64), "last": last}


def _flat_top(samples: Samples, full: int) -> int:
    """Length of the longest stretch at full scale."""
    edges = np.flatnonzero(np.diff(samples == full, prepend=False, append=False))
    return int((edges[1::2] - edges[0::2]).max(initial=0))
