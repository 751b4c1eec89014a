"""One waveform as a record of 32-bit words."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openecho.codec.batch import pack, unpack_into
from openecho.codec.checksum import checksum
from openecho.codec.form import HEADER_BYTES, CodecError, Form
from openecho.codec.kernels import SPARE

LARGEST_LENGTH = (1 << 16) - 1
"""Samples of a record."""
WORD = 4
TAIL_BYTES = 2 * WORD


def encode(samples: NDArray[Any], form: Form) -> bytes:
    """Code one waveform.

    Parameters
    ----------
    samples : integers (m,)
        Counts, 0 to 2^N - 1; m of 0 to 65535.
    form : Form
        See `choose` for one that suits.

    Returns
    -------
    bytes
        The record, a whole number of words.

    Raises
    ------
    CodecError
        For more samples than a record has, or a sample of more bits than the form.
    """
    waveform = np.asarray(samples)
    if waveform.ndim != 1 or waveform.size > LARGEST_LENGTH:
        raise CodecError(f"samples of shape {waveform.shape}, expected one waveform of 0 to {LARGEST_LENGTH}")
    outside = np.flatnonzero((waveform < 0) | (waveform > form.largest))
    if outside.size:
        at = outside[0]
        raise CodecError(f"sample {at} is {waveform[at]}, expected 0 to {form.largest}, as {form.bits} bits hold")
    row = waveform.astype(np.uint16)
    payload, _ = pack(row[None], np.array([row.size], np.int32), form)
    padding = bytes(-len(payload) % WORD)
    return form.header() + payload + padding + row.size.to_bytes(WORD) + checksum(row, form.bits).to_bytes(WORD)


def decode(record: bytes) -> NDArray[np.uint16]:
    """The waveform of a record.

    Parameters
    ----------
    record : bytes
        As `encode` or the RTL's encoder gives it.

    Returns
    -------
    uint16 (m,)

    Raises
    ------
    CodecError
        With the byte at which the record is not what an encoder writes.
    """
    smallest = HEADER_BYTES + TAIL_BYTES
    if len(record) < smallest or len(record) % WORD:
        raise CodecError(f"byte {len(record)}: the record ends, expected {smallest} bytes or more, in words of {WORD}")
    form = Form.parse(record[:HEADER_BYTES])
    end = len(record) - TAIL_BYTES
    count = int.from_bytes(record[end : end + WORD])
    largest = min(LARGEST_LENGTH, 8 * (end - HEADER_BYTES))
    if count > largest:
        raise CodecError(f"byte {end}: {count} samples, expected 0 to {largest}")
    samples = np.zeros(count, np.uint16)
    data = np.frombuffer(record + bytes(SPARE), np.uint8)
    behind = unpack_into(samples[None], data, HEADER_BYTES, end, np.array([count], np.int32), form)
    if end - behind >= WORD or any(record[behind:end]):
        raise CodecError(
            f"byte {behind}: {end - behind} bytes behind the last code, expected less than {WORD}, all zero"
        )
    found, expected = int.from_bytes(record[end + WORD :]), checksum(samples, form.bits)
    if found != expected:
        raise CodecError(f"byte {end + WORD}: checksum {found:#010x}, expected {expected:#010x} of the decoded samples")
    return samples
