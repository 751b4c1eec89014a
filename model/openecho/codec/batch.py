"""Payloads of many waveforms at once, without their heads and tails."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openecho.codec import kernels
from openecho.codec.form import CodecError, Form

SPARE_OUT = 8
"""Bytes: the kernels write words of four."""


def pack(samples: NDArray[np.uint16], length: NDArray[np.int32], form: Form) -> tuple[bytes, NDArray[np.int64]]:
    """Code waveforms one behind the other, each with zeros to the end of its last byte.

    Parameters
    ----------
    samples : uint16 (n, m)
        Counts; what is past `length` is not looked at.
    length : int32 (n,)
        Samples in each row, 0 to m.
    form : Form

    Returns
    -------
    payload : bytes
    ends : int64 (n,)
        Byte behind each waveform.

    Raises
    ------
    CodecError
        If a sample has more bits than the form.
    """
    _check(samples, length, form.bits)
    longest = int(length.sum(dtype=np.int64)) * form.bits + (kernels.SLACK + 8) * length.size
    out = np.empty(longest // 8 + SPARE_OUT, np.uint8)
    ends = np.empty(length.size, np.int64)
    size = kernels.pack(samples, length, *_parameters(form), out, ends)
    return out[:size].tobytes(), ends


def unpack(payload: bytes, length: NDArray[np.int32], form: Form) -> NDArray[np.uint16]:
    """The waveforms of a payload.

    Parameters
    ----------
    payload : bytes
        As `pack` gives it.
    length : int32 (n,)
        Samples of each waveform.
    form : Form

    Returns
    -------
    uint16 (n, longest)
        Zero past `length`.

    Raises
    ------
    CodecError
        If the payload is not what waveforms of these lengths take.
    """
    if length.size and not 0 <= length.min() <= length.max() <= 8 * len(payload):
        raise CodecError(f"lengths of {length.min()} to {length.max()} samples, expected 0 to {8 * len(payload)}")
    samples = np.zeros((length.size, length.max(initial=0)), np.uint16)
    behind = unpack_into(
        samples, np.frombuffer(payload + bytes(2 * kernels.SPARE), np.uint8), 0, len(payload), length, form
    )
    if behind < len(payload):
        raise CodecError(f"byte {behind}: {len(payload) - behind} bytes behind the last waveform, expected none")
    return samples


def unpack_into(
    samples: NDArray[np.uint16], data: NDArray[np.uint8], start: int, end: int, length: NDArray[np.int32], form: Form
) -> int:
    """Decode what stands from `start` to `end` of `data`, which has spare bytes behind; the byte behind the last code.

    Raises
    ------
    CodecError
        With the byte of `data` where a waveform ran out of codes, or where its padding is not zero.
    """
    behind = kernels.unpack(data, start, end, length, *_parameters(form), samples)
    if behind < 0:
        raise CodecError(f"byte {-1 - behind}: codes end or do not end here, expected those of all samples, then zeros")
    return int(behind)


def _parameters(form: Form) -> tuple[int, int, int, int, int]:
    """What the kernels take of a form: mode, N, l, baselines."""
    return form.mode, form.bits, form.threshold.bit_length(), *form.baseline


def _check(samples: NDArray[np.uint16], length: NDArray[np.int32], bits: int) -> None:
    """Raise a CodecError for the first recorded sample that is too wide."""
    if samples.size == 0 or samples.max() >> bits == 0:
        return
    wide = np.argwhere((samples >> bits != 0) & (np.arange(samples.shape[1]) < length[:, None]))
    if len(wide):
        row, at = (int(i) for i in wide[0])
        raise CodecError(
            f"waveform {row} sample {at} is {samples[row, at]}, expected 0 to {(1 << bits) - 1}, as {bits} bits hold"
        )
