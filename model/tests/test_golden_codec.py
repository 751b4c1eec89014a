"""The codec's golden encoder and decoder: examples by hand, both ways, and records that are not in order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openecho import codec, golden, stimulus
from openecho.golden import BAD_CHECK, BAD_FORM, BAD_LENGTH, Beats, Config

POLYNOMIAL = 1 << 32 | 1 << 22 | 1 << 2 | 1 << 1 | 1


def config_of(sample_w: int, mode: int, threshold: int = 0, even: int = 0, odd: int = 0) -> Config:
    return Config(
        sample_w=sample_w,
        codec_mode=mode,
        codec_threshold=threshold,
        codec_baseline_even=even,
        codec_baseline_odd=odd,
    )


def beats(waveforms: Sequence[Sequence[int]]) -> Beats:
    last = [index == len(samples) - 1 for samples in waveforms for index in range(len(samples))]
    return {"sample": np.concatenate([np.asarray(samples, np.int64) for samples in waveforms]), "last": np.array(last)}


def encoded(waveforms: Sequence[Sequence[int]], config: Config) -> list[list[int]]:
    words = golden.encoder(beats(waveforms), config)
    return [part.tolist() for part in np.split(words["word"], np.flatnonzero(words["last"])[:-1] + 1)]


def decoded(records: Sequence[Sequence[int]], config: Config) -> tuple[list[list[int]], list[int]]:
    last = [index == len(words) - 1 for words in records for index in range(len(words))]
    stream = {"word": np.concatenate([np.asarray(words, np.uint32) for words in records]), "last": np.array(last)}
    out = golden.decoder(stream, config)
    ends = np.flatnonzero(out["last"])
    assert not out["flags"][~out["last"]].any()
    return [part.tolist() for part in np.split(out["sample"], ends[:-1] + 1)], out["flags"][ends].tolist()


def remainder(samples: Sequence[int], sample_w: int) -> int:
    """Checksum by long division: what starts from all ones is the message with its first 32 bits turned round."""
    bits = sample_w * len(samples)
    message = int("".join(f"{sample:0{sample_w}b}" for sample in samples), 2)
    left = message << 32 ^ 0xFFFFFFFF << bits
    for place in range(bits + 31, 31, -1):
        if left >> place & 1:
            left ^= POLYNOMIAL << place - 32
    return left


def payload(digits: str) -> list[int]:
    digits = digits.replace(" ", "")
    padded = digits + "0" * (-len(digits) % 32)
    return [int(padded[k : k + 32], 2) for k in range(0, len(padded), 32)]


@st.composite
def cases(draw: st.DrawFn) -> tuple[Config, list[list[int]]]:
    """Any setting, and waveforms of anything, of steps about a walk, and about the baselines."""
    sample_w, mode = draw(st.integers(8, 16)), draw(st.integers(0, 1))
    full = (1 << sample_w) - 1
    count = st.integers(0, full)
    threshold = 0 if mode else draw(count | st.sampled_from([0, 1, 7, full]))
    even = draw(count)
    odd = draw(count | st.just(even))
    waveforms = []
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["any", "walk", "base"]))
        if kind == "any":
            samples = draw(st.lists(count | st.sampled_from([0, full]), min_size=1, max_size=60))
        else:
            steps = draw(st.lists(st.integers(-3, 3) | st.integers(-60, 60), min_size=1, max_size=60))
            path = np.cumsum(steps) if kind == "walk" else np.array(steps) // 8
            base = np.where(np.arange(len(steps)) % 2, odd, even) if kind == "base" else even
            samples = (base + path & full).tolist()
        waveforms.append(samples)
    return config_of(sample_w, mode, threshold, even, odd), waveforms


@pytest.mark.parametrize(
    ("config", "samples", "record"),
    [
        (config_of(8, 0, threshold=5), [3, 200, 5], "10700005 00000000 3e428000 00000003 c3f43ae8"),
        (config_of(8, 1, even=16, odd=15), [16, 15, 17, 15, 18], "11700000 0010000f a6200000 00000005 155488f0"),
    ],
)
def test_examples_of_the_specification(config: Config, samples: list[int], record: str) -> None:
    words = [int(word, 16) for word in record.split()]
    assert encoded([samples], config) == [words]
    assert decoded([words], config) == ([samples], [0])


def test_threshold_example_by_hand() -> None:
    # T = 5 has 3 bits, so 7 is still small; 9 lies below its baseline, which makes it as large as can be.
    samples = [17, 15, 9, 20, 200]
    codes = "0 111   0 011   1 00001001   1 00010100   1 11001000"
    config = config_of(8, 0, threshold=5, even=10, odd=12)
    record = [0x10700005, 0x000A000C, *payload(codes), 5, remainder(samples, 8)]
    assert encoded([samples], config) == [record]
    assert decoded([record], config) == ([samples], [0])


def test_a_threshold_of_zero_costs_a_bit_for_each_sample_on_the_baseline() -> None:
    samples = [3] * 32
    config = config_of(11, 0, even=3, odd=3)
    assert encoded([samples], config) == [[0x10A00000, 0x00030003, 0, 32, remainder(samples, 11)]]


def test_prediction_example_by_hand_with_an_escape() -> None:
    # sample        100    53           103       90
    # floor(b/16)   201    101          200       101
    # w0, u         -1, 0  5, 5         6, 6      79, 79
    # G, order 0    3      1            3         4
    # G, order 2           3            48        121
    # k, q          1, 0   0, 5         1, 3      2, 19
    samples = [100, 53, 103, 90]
    codes = "1 0    000001    0001 0    0000000000000000 01011010"
    config = config_of(8, 1, even=100, odd=50)
    record = [0x11700000, 0x00640032, *payload(codes), 4, remainder(samples, 8)]
    assert encoded([samples], config) == [record]
    assert decoded([record], config) == ([samples], [0])


def test_prediction_example_by_hand_that_turns_to_the_line() -> None:
    # sample        100    110       120      130    139
    # u, order 0    0      19        40       59
    # u, order 2           20        0        0      1
    # G, order 0    3      1         10       25     42
    # G, order 2           3         11       5      2
    # order, k, q   0,1,0  0,0,19    0,3,5    2,2,0  2,0,1
    samples = [100, 110, 120, 130, 139]
    codes = "1 0    0000000000000000 01101110    000001 000    1 00    01"
    config = config_of(8, 1, even=100, odd=100)
    record = [0x11700000, 0x00640064, *payload(codes), 5, remainder(samples, 8)]
    assert encoded([samples], config) == [record]
    assert decoded([record], config) == ([samples], [0])


def test_samples_that_find_too_little_credit_have_no_code() -> None:
    # 32 - 16 for an escape leaves 16; 12 bits for the second sample leave 12; from then on all are as they are.
    samples = [100, 110, 121, 0, 0]
    codes = "0000000000000000 01100100    00000000001 0    01111001 00000000 00000000"
    config = config_of(8, 1)
    record = [0x11700000, 0, *payload(codes), 5, remainder(samples, 8)]
    assert encoded([samples], config) == [record]
    assert decoded([record], config) == ([samples], [0])


def test_credit_grows_no_further_than_the_first_that_is_128() -> None:
    # From 32, 14 flags of N = 8 bits leave 32 + 14 * 7 = 130; then 115 large samples leave 15.
    samples = [0] * 40 + [255] * 120
    [record] = encoded([samples], config_of(8, 0))
    bits = "".join(f"{word:032b}" for word in record[2:-2])
    assert bits[:40] == "0" * 40
    assert bits[40 : 40 + 115 * 9] == "111111111" * 115
    assert bits[40 + 115 * 9 :].rstrip("0") == "11111111" * 5


@given(cases())
@settings(max_examples=300, deadline=None)
def test_decoder_restores_every_waveform(case: tuple[Config, list[list[int]]]) -> None:
    config, waveforms = case
    assert decoded(encoded(waveforms, config), config) == (waveforms, [0] * len(waveforms))


@given(cases())
@settings(max_examples=100, deadline=None)
def test_waveforms_have_the_records_that_they_have_alone(case: tuple[Config, list[list[int]]]) -> None:
    config, waveforms = case
    assert encoded(waveforms, config) == [encoded([samples], config)[0] for samples in waveforms]


@given(cases())
@settings(max_examples=200, deadline=None)
def test_records_are_those_of_the_other_implementation(case: tuple[Config, list[list[int]]]) -> None:
    config, waveforms = case
    form = codec.Form(
        config.codec_mode,
        config.sample_w,
        config.codec_threshold,
        (config.codec_baseline_even, config.codec_baseline_odd),
    )
    for samples, record in zip(waveforms, encoded(waveforms, config), strict=True):
        assert np.array(record, ">u4").tobytes() == codec.encode(np.array(samples, np.uint16), form)


@given(cases())
@settings(max_examples=100, deadline=None)
def test_checksum_is_the_remainder_of_a_long_division(case: tuple[Config, list[list[int]]]) -> None:
    config, waveforms = case
    found = [record[-1] for record in encoded(waveforms, config)]
    assert found == [remainder(samples, config.sample_w) for samples in waveforms]


@given(cases())
@settings(max_examples=100, deadline=None)
def test_a_payload_has_at_most_a_word_more_than_its_samples(case: tuple[Config, list[list[int]]]) -> None:
    config, waveforms = case
    for samples, record in zip(waveforms, encoded(waveforms, config), strict=True):
        assert 32 * (len(record) - 4) < config.sample_w * len(samples) + 32 + 32


@pytest.mark.parametrize("mode", [0, 1])
@pytest.mark.parametrize("sample_w", range(8, 17))
def test_the_worst_samples_spend_all_credit(sample_w: int, mode: int) -> None:
    rng = np.random.default_rng(sample_w)
    samples = rng.integers(1 << sample_w - 1, 1 << sample_w, 1000)
    [record] = encoded([samples.tolist()], config_of(sample_w, mode))
    assert 32 * (len(record) - 4) - 1000 * sample_w in range(1, 64)


@given(cases())
@settings(max_examples=100, deadline=None)
def test_a_word_waits_for_the_sample_that_completes_it(case: tuple[Config, list[list[int]]]) -> None:
    # What comes behind a sample changes no word but those that it does not determine, and the padded ones.
    config, waveforms = case
    samples = waveforms[0]
    full = golden.encoder(beats([samples]), config)
    assert full["cause"][[0, 1, -2, -1]].tolist() == [0, 0, len(samples) - 1, len(samples) - 1]
    for known in range(1, len(samples)):
        cut = golden.encoder(beats([samples[:known]]), config)["word"]
        sure = int((full["cause"][2:-2] < known).sum())
        assert full["word"][2 : 2 + sure].tolist() == cut[2 : 2 + sure].tolist()
        assert sure >= cut.size - 4 - 1


def test_a_sample_waits_for_the_word_two_behind_the_one_in_which_its_code_ends() -> None:
    samples = [[3] * 33, [4], [3] * 32]
    out = golden.decoder(golden.encoder(beats(samples), config_of(11, 0, even=3, odd=3)), config_of(11, 0))
    # Records of 6, 5 and 5 words: samples of the first word of payload with the fourth word of the record.
    assert out["cause"].tolist() == [4] * 32 + [5] + [10] + [15] * 32


def test_more_samples_than_can_be_counted_set_a_bit_that_stays() -> None:
    config = config_of(8, 0)
    for number, counted in ((65535, 65535), (65536, 1 << 16), (65537, 1 << 16 | 1), (131073, 1 << 16 | 1)):
        record, following = encoded([[0] * number, [0, 1]], config)
        assert record[-2] == counted
        assert following == encoded([[0, 1]], config)[0]
        assert decoded([record, following], config)[1] == [0 if number < 65536 else BAD_LENGTH, 0]


@pytest.mark.parametrize("sample_w", [8, 11, 16])
@pytest.mark.parametrize(("mode", "threshold"), [(1, 0), (0, 1)])
def test_every_flipped_bit_is_flagged(mode: int, threshold: int, sample_w: int) -> None:
    even, odd = 85, 51
    samples = [even, odd + 1, even, odd - 1, even + 9, odd, even + 1, odd + 1, even]
    config = config_of(sample_w, mode, threshold, even, odd)
    [record] = encoded([samples], config)
    flipped = []
    for bit in range(32 * len(record)):
        words = list(record)
        words[bit // 32] ^= 1 << bit % 32
        flipped.append(words)
    found, flags = decoded([part for words in flipped for part in (words, record)], config)
    assert all(flags[::2])
    assert found[1::2] == [samples] * len(flipped)
    assert not any(flags[1::2])


@pytest.mark.parametrize(
    ("place", "bits", "flag"),
    [
        (0, 1 << 28, BAD_FORM),  # version 0
        (0, 3 << 28, BAD_FORM),
        (0, 2 << 24, BAD_FORM),
        (0, 1 << 24, BAD_FORM),  # mode 1 with a threshold
        (0, 1 << 20, BAD_FORM),
        (0, 1 << 16, BAD_FORM),
        (0, 1 << 11, BAD_FORM),  # a threshold of more than N bits
        (1, 1 << 11, BAD_FORM),
        (1, 1 << 27, BAD_FORM),
        (-3, 1, BAD_LENGTH),  # padding
        (-2, 15, BAD_LENGTH),  # M = 0
        (-2, 15 ^ 7, BAD_LENGTH),
        (-2, 15 ^ 17, BAD_LENGTH),
        (-2, 1 << 16, BAD_LENGTH),
        (-2, 15 ^ 14, BAD_CHECK),  # the last code might be padding
        (-2, 15 ^ 16, BAD_CHECK),  # the padding might be a code
        (-1, 1, BAD_CHECK),
        (1, 1, BAD_CHECK),
    ],
)
def test_each_kind_of_fault_has_its_flag(place: int, bits: int, flag: int) -> None:
    # 15 codes of a flag and 3 bits, the last of them zeros.
    config = config_of(11, 0, threshold=5, even=3, odd=4)
    samples = [9, 8, 7, 6, 5, 4, 5, 6, 7, 8, 9, 8, 7, 6, 3]
    [record] = encoded([samples], config)
    assert record[:2] == [0x10A00005, 0x00030004]
    changed = list(record)
    changed[place] ^= bits
    found, flags = decoded([record, changed, record], config)
    assert flags == [0, flag, 0]
    assert found == [samples, [0], samples]


def test_records_that_are_too_short_or_too_long_are_flagged() -> None:
    config = config_of(11, 1)
    [record] = encoded([list(range(0, 900, 30))], config)
    for words in range(1, 4):
        assert decoded([record[:words]], config)[1] == [BAD_FORM]
    for words in range(4, len(record)):
        assert decoded([record[:words]], config)[1][0]
        assert decoded([record[: words - 2] + record[-2:]], config)[1] == [BAD_LENGTH]
    assert decoded([[*record[:-2], 0, *record[-2:]]], config)[1] == [BAD_LENGTH]
    assert decoded([record[:2] + [0] * 50 + record[-2:]], config)[1][0]


def test_a_word_of_zeros_behind_codes_that_end_with_a_word_is_flagged() -> None:
    config = config_of(11, 0)
    [record] = encoded([[0] * 32], config)
    assert len(record) == 5
    assert decoded([[*record[:3], 0, *record[3:]]], config)[1] == [BAD_LENGTH]


def test_both_modes_and_any_setting_may_follow_each_other() -> None:
    waveforms = [[5, 6, 7, 900], [1], [0, 0, 1500]]
    configs = [config_of(11, 1, even=7, odd=9), config_of(11, 0, threshold=3), config_of(11, 1)]
    records = [encoded([samples], config)[0] for samples, config in zip(waveforms, configs, strict=True)]
    assert decoded(records, Config()) == (waveforms, [0, 0, 0])


@pytest.mark.parametrize(("mode", "threshold", "base", "part"), [(1, 0, 21, 0.4), (0, 15, 15, 0.7)])
def test_reference_waveforms_become_shorter(mode: int, threshold: int, base: int, part: float) -> None:
    reference = stimulus.reference_set(0)
    stream = golden.stream(reference.samples, reference.length)
    words = golden.encoder(stream, config_of(11, mode, threshold, base, base))["word"]
    assert words.dtype == np.uint32
    assert 32 * words.size < part * 11 * stream["sample"].size


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"codec_mode": 2}, "codec_mode: found 2, expected an integer from 0 to 1"),
        ({"codec_threshold": 1}, "codec_threshold: found 1, expected an integer from 0 to 0"),
        ({"codec_mode": 0, "codec_threshold": 2048}, "codec_threshold: found 2048, expected an integer from 0 to 2047"),
        ({"codec_baseline_even": -1}, "codec_baseline_even: found -1, expected an integer from 0 to 2047"),
        ({"codec_baseline_odd": 2048}, "codec_baseline_odd: found 2048, expected an integer from 0 to 2047"),
    ],
)
def test_illegal_settings_are_named_in_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        Config(**changes)
