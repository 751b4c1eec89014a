"""Damaged copies of small files, and what every reader owes them: the data, or one line."""

from __future__ import annotations

import resource
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
from hypothesis import strategies as st

from openecho import formats

MEMORY_KIB = 300 * 1024
"""What reading damaged files of a few kilobytes may add to the resident memory, most of it the parsers themselves."""

fuzzed = hypothesis.settings(
    max_examples=250,
    derandomize=True,
    database=None,
    deadline=None,
    phases=[hypothesis.Phase.explicit, hypothesis.Phase.generate, hypothesis.Phase.shrink],
    suppress_health_check=list(hypothesis.HealthCheck),
)

_NUMBERS = [
    struct.pack(code, value)
    for code, values in (
        ("<B", (0, 1, 0x7F, 0x80, 0xFF)),
        ("<H", (0, 1, 0x7FFF, 0x8000, 0xFFFF)),
        ("<I", (0, 1, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)),
        ("<Q", (0, 1, 2**31, 2**32, 2**40, 2**63 - 1, 2**63, 2**64 - 1)),
        ("<d", (float("nan"), float("inf"), -1.0, 1e300)),
    )
    for value in values
]


@st.composite
def damage(draw: st.DrawFn, content: bytes) -> bytes:
    """Bytes overwritten by others or by the numbers that break readers, cut out, put in, or the end cut off."""
    damaged = bytearray(content)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, max(len(damaged) - 1, 0)))
        match draw(st.sampled_from(["number", "number", "bytes", "flip", "cut", "insert", "truncate"])):
            case "number":
                number = draw(st.sampled_from(_NUMBERS))
                damaged[at : at + len(number)] = number
            case "bytes":
                other = draw(st.binary(min_size=1, max_size=8))
                damaged[at : at + len(other)] = other
            case "flip":
                damaged[at : at + 1] = bytes(byte ^ 1 << draw(st.integers(0, 7)) for byte in damaged[at : at + 1])
            case "cut":
                del damaged[at : at + draw(st.integers(1, 64))]
            case "insert":
                damaged[at:at] = draw(st.binary(min_size=1, max_size=16))
            case "truncate":
                del damaged[at:]
    return bytes(damaged)


def read_all(path: Path) -> list[formats.Block]:
    """Blocks of three of a whole file, each checked for what `Block` promises."""
    with formats.open(path) as recording:
        blocks = list(recording.blocks(3))
        assert sum(len(block.length) for block in blocks) == recording.waveforms
        assert max(int(block.length.max()) for block in blocks) == recording.longest
        for block in blocks:
            n, m = block.samples.shape
            assert block.samples.dtype == np.uint16
            assert block.length.shape == (n,)
            assert 1 <= block.length.min() <= block.length.max() == m
            assert not block.samples[np.arange(m) >= block.length[:, None]].any()
            columns: list[tuple[Any, tuple[int, ...]]] = [(block.time, (n,)), (block.shot, (n,))]
            if block.geolocation is not None:
                columns += [(block.geolocation.first, (n, 3)), (block.geolocation.last, (n, 3))]
            assert all(column is None or column.shape == shape for column, shape in columns)
    return blocks


def give_data_or_one_line(path: Path, read: Callable[[Path], object] = read_all) -> None:
    """Read a damaged file: what `read` promises or one line, in bounded memory."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    line = ""
    try:
        read(path)
    except formats.DataError as error:
        line = str(error)
    assert not line or line.startswith(str(path.parent))
    assert "\n" not in line
    assert len(line) < 1000
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MEMORY_KIB
