"""The lossless codec in Python: records, payloads, and the choice of what suits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from openecho import codec
from openecho.codec import CodecError, Form
from openecho.codec.kernels import SLACK

FRAME_BITS = 8 * 16
"""Head and tail of a record."""


@st.composite
def coded(draw: st.DrawFn, longest: int = 300) -> tuple[NDArray[np.int64], Form]:
    """A waveform of any width and shape, and any form that holds it."""
    bits = draw(st.integers(1, 16))
    largest = (1 << bits) - 1
    count = draw(st.integers(0, longest))
    kind = draw(st.sampled_from(["any", "noise", "steps", "spikes", "ramp"]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    level = draw(st.integers(0, largest))
    shapes = {
        "any": rng.integers(0, largest, count, endpoint=True),
        "noise": level + np.rint(rng.normal(0, draw(st.floats(0, 20)), count)).astype(np.int64),
        "steps": np.repeat(rng.integers(0, largest, count // 7 + 1, endpoint=True), 7)[:count],
        "spikes": np.where(rng.random(count) < 0.05, largest, level),
        "ramp": level + draw(st.integers(-9, 9)) * np.arange(count),
    }
    waveform = np.clip(shapes[kind], 0, largest)
    mode = draw(st.sampled_from([codec.THRESHOLD, codec.PREDICTION]))
    threshold = draw(st.integers(0, largest)) if mode == codec.THRESHOLD else 0
    return waveform, Form(mode, bits, threshold, (draw(st.integers(0, largest)), draw(st.integers(0, largest))))


@settings(max_examples=400, deadline=None)
@given(coded())
def test_a_record_gives_its_waveform_back_and_is_hardly_longer(case: tuple[NDArray[np.int64], Form]) -> None:
    waveform, form = case
    record = codec.encode(waveform, form)
    np.testing.assert_array_equal(codec.decode(record), waveform)
    payload = -(-(form.bits * waveform.size + SLACK) // 32) * 32
    assert len(record) % 4 == 0
    assert 8 * len(record) <= FRAME_BITS + payload


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_payloads_of_many_waveforms_are_those_of_each(data: st.DataObject) -> None:
    waveform, form = data.draw(coded())
    cuts = sorted(data.draw(st.lists(st.integers(0, waveform.size), max_size=5)))
    parts = np.split(waveform, cuts)
    length = np.array([part.size for part in parts], np.int32)
    samples = np.full((length.size, max(1, length.max())), 0xFFFF, np.uint16)
    for row, part in zip(samples, parts, strict=True):
        row[: part.size] = part
    payload, ends = codec.pack(samples, length, form)
    np.testing.assert_array_equal(
        codec.unpack(payload, length, form),
        np.where(np.arange(length.max()) < length[:, None], samples[:, : length.max()], 0),
    )
    starts = [0, *ends[:-1]]
    for part, start, end in zip(parts, starts, ends, strict=True):
        record = codec.encode(part, form)
        assert payload[start:end].ljust(len(record) - 16, b"\0") == record[8:-8]


def test_worked_example_of_the_threshold() -> None:
    record = bytes.fromhex("10700005 00000000 3e428000 00000003 c3f43ae8")
    assert codec.encode(np.array([3, 200, 5]), Form(codec.THRESHOLD, 8, 5)) == record


def test_worked_example_of_the_prediction() -> None:
    record = bytes.fromhex("11700000 0010000f a6200000 00000005 155488f0")
    assert codec.encode(np.array([16, 15, 17, 15, 18]), Form(codec.PREDICTION, 8, 0, (16, 15))) == record


def test_published_example_five_is_three_bits() -> None:
    """The paper's: a threshold of 00000101 has l = 3, so 7 takes four bits and 8 takes nine."""
    form = Form(codec.THRESHOLD, 8, 0b101)
    assert codec.encode(np.array([7]), form)[8:12] == bytes.fromhex("70000000")
    assert codec.encode(np.array([8]), form)[8:12] == bytes.fromhex("84000000")


@pytest.mark.parametrize("form", [Form(codec.THRESHOLD, 8, 7, (14, 13)), Form(codec.PREDICTION, 8, 0, (16, 15))])
def test_every_bit_of_a_record_counts(form: Form) -> None:
    waveform = np.array([16, 15, 15, 17, 40, 90, 60, 30, 22, 17, 16, 15, 255, 0, 16], np.uint16)
    record = codec.encode(waveform, form)
    for bit in range(8 * len(record)):
        changed = bytearray(record)
        changed[bit // 8] ^= 0x80 >> bit % 8
        if form.mode == codec.THRESHOLD and bit in (30, 31):  # T of 5 and 6 has three bits as 7 has
            np.testing.assert_array_equal(codec.decode(bytes(changed)), waveform)
            continue
        with pytest.raises(CodecError, match=r"^byte \d+: .+, expected "):
            codec.decode(bytes(changed))


@pytest.mark.parametrize("mode", [codec.THRESHOLD, codec.PREDICTION])
def test_damage_is_one_line_and_never_other_samples(mode: int) -> None:
    rng = np.random.default_rng(8)
    waveform = np.clip(np.rint(20 + rng.normal(0, 2, 80) + 90 * np.exp(-((np.arange(80) - 40) ** 2) / 50)), 0, 255)
    record = codec.encode(
        waveform.astype(np.uint16), codec.choose(waveform[None].astype(np.uint16), np.array([80]), 8, mode)
    )
    for _ in range(20_000):
        damaged = bytearray(record)
        kind = rng.integers(4)
        at, size = int(rng.integers(len(record))), int(rng.integers(1, 9))
        if kind == 0:
            damaged[at : at + size] = rng.bytes(len(damaged[at : at + size]))
        elif kind == 1:
            del damaged[at : at + size]
        elif kind == 2:
            damaged[at:at] = rng.bytes(size)
        else:
            del damaged[at:]
        if damaged != record:
            with pytest.raises(CodecError, match=r"^byte \d+: .+$"):
                codec.decode(bytes(damaged))


def test_a_count_is_not_believed_before_there_are_as_many_bits() -> None:
    record = bytearray(codec.encode(np.zeros(40, np.uint16), Form(codec.PREDICTION, 8)))
    record[-8:-4] = (65_535).to_bytes(4)
    with pytest.raises(CodecError, match=r"byte 16: 65535 samples, expected 0 to 64"):
        codec.decode(bytes(record))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((2, 8, 0, (0, 0)), "mode 2, expected 0 to 1"),
        ((0, 0, 0, (0, 0)), "bits a sample 0, expected 1 to 16"),
        ((0, 17, 0, (0, 0)), "bits a sample 17, expected 1 to 16"),
        ((0, 8, 256, (0, 0)), "threshold 256, expected 0 to 255"),
        ((1, 8, 1, (0, 0)), "threshold 1, expected 0 to 0"),
        ((0, 8, 0, (0, 256)), "baseline 256, expected 0 to 255"),
    ],
)
def test_a_form_out_of_range_is_one_line(values: tuple[int, int, int, tuple[int, int]], message: str) -> None:
    with pytest.raises(CodecError, match=message):
        Form(*values)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((0, 0x21), "byte 0: version 2, expected 1"),
        ((0, 0x12), "byte 0: mode 2, expected 0 to 1"),
        ((1, 0x71), "byte 1: 1 in bits that are not used, expected 0"),
        ((4, 0x01), "byte 2: baseline 256, expected 0 to 255"),
    ],
)
def test_an_unknown_head_is_one_line(change: tuple[int, int], message: str) -> None:
    record = bytearray(codec.encode(np.arange(9), Form(codec.PREDICTION, 8)))
    record[change[0]] = change[1]
    with pytest.raises(CodecError, match=message):
        codec.decode(bytes(record))


def test_what_does_not_fit_is_one_line() -> None:
    form = Form(codec.PREDICTION, 8)
    with pytest.raises(CodecError, match="sample 1 is 256, expected 0 to 255, as 8 bits hold"):
        codec.encode(np.array([255, 256]), form)
    with pytest.raises(CodecError, match="sample 0 is -1, expected 0 to 255"):
        codec.encode(np.array([-1]), form)
    with pytest.raises(CodecError, match=r"samples of shape \(65536,\), expected one waveform of 0 to 65535"):
        codec.encode(np.zeros(65_536, np.uint16), form)
    with pytest.raises(CodecError, match="waveform 1 sample 2 is 300, expected 0 to 255"):
        codec.pack(np.array([[1, 2, 999], [1, 2, 300]], np.uint16), np.array([2, 3], np.int32), form)
    with pytest.raises(CodecError, match="lengths of -1 to 3 samples, expected 0 to 8"):
        codec.unpack(b"\0", np.array([-1, 3], np.int32), form)


def test_payload_that_is_too_short_or_too_long_tells_where() -> None:
    form = Form(codec.THRESHOLD, 8, 15)
    length = np.array([6, 6], np.int32)
    payload, ends = codec.pack(np.full((2, 6), 3, np.uint16), length, form)
    with pytest.raises(CodecError, match=f"^byte {len(payload) - 1}: "):
        codec.unpack(payload[:-1], length, form)
    with pytest.raises(CodecError, match=f"^byte {len(payload)}: 1 bytes behind the last waveform, expected none"):
        codec.unpack(payload + b"\0", length, form)
    padded = bytearray(payload)
    padded[ends[0] - 1] |= 1
    with pytest.raises(CodecError, match=f"^byte {ends[0] - 1}: "):
        codec.unpack(bytes(padded), length, form)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_best_threshold_is_the_best_of_all(bits: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = 1 << bits
    samples = np.minimum(rng.geometric(0.3, (3, 40)) + rng.integers(size), size - 1).astype(np.uint16)
    length = rng.integers(1, 40, 3, endpoint=True).astype(np.int32)

    def cost(threshold: int, even: int, odd: int) -> int:
        small = (1 << threshold.bit_length()) - 1
        total = 0
        for row, count in zip(samples, length, strict=True):
            value = (row[:count].astype(np.int64) - np.where(np.arange(count) % 2, odd, even)) % size
            total += int(np.where(value <= small, threshold.bit_length() + 1, bits + 1).sum())
        return total

    thresholds = [(1 << small) - 1 for small in range(bits + 1)]
    best = codec.best_threshold(samples, length, bits)
    places = range(size) if bits <= 3 else rng.integers(0, size, 8)
    assert cost(best.threshold, *best.baseline) <= min(
        cost(threshold, int(even), int(odd)) for threshold in thresholds for even in places for odd in places
    )
    literal = codec.best_threshold(samples, length, bits, (0, 0))
    assert literal.baseline == (0, 0)
    assert cost(literal.threshold, 0, 0) == min(cost(threshold, 0, 0) for threshold in thresholds)


def test_published_threshold_is_twice_the_rms_of_the_noise() -> None:
    rng = np.random.default_rng(1)
    samples = np.rint(100 + rng.normal(0, 3, (200, 60))).astype(np.uint16)
    samples[:, 50:] = 1000  # an echo behind the noise
    form = codec.published_threshold(samples, np.full(200, 60, np.int32), 10)
    rms = np.sqrt(np.mean(samples[:, :50].var(axis=1)))
    assert form == Form(codec.THRESHOLD, 10, int(np.ceil(2 * rms)))
    assert 2.9 < rms < 3.1


def test_nothing_to_compress_is_no_error() -> None:
    for mode in (codec.THRESHOLD, codec.PREDICTION):
        empty = np.zeros((3, 0), np.uint16), np.zeros(3, np.int32)
        form = codec.choose(*empty, 8, mode)
        payload, ends = codec.pack(*empty, form)
        assert payload == b""
        assert list(ends) == [0, 0, 0]
        assert codec.unpack(payload, empty[1], form).shape == (3, 0)
