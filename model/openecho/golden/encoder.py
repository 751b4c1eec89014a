"""Module `encoder`: a lossless record of 32-bit words for each waveform."""

import numpy as np

from .beats import Beats, IntArray
from .codec import (
    CREDIT_LEAST,
    CREDIT_START,
    HEAD,
    LIMITS,
    MOST_SAMPLES,
    PREDICTION,
    TAIL,
    VERSION,
    WORD_W,
    Predictions,
    actives,
    bit_length,
    bounds,
    checksum,
    fold,
    signed,
    spent,
)
from .config import Config


def encoder(beats: Beats, config: Config) -> Beats:
    """Compress each waveform into a record, as `openecho.codec` specifies it.

    Parameters
    ----------
    beats : Beats
        `sample` (counts) and `last`.
    config : Config
        Mode, threshold and baselines are its `codec_mode`, `codec_threshold`, `codec_baseline_even`,
        `codec_baseline_odd`.

    Returns
    -------
    Beats
        `word` (32 bits): head, payload, tail. `cause` of the head is the first sample, of a word of payload the sample
        whose code completes it, of the tail the last. A waveform of more than 65535 samples, which cannot be decoded,
        has their number modulo 65536 in the word for it, with bit 16 set.
    """
    sample = beats["sample"].astype(np.int64)
    starts, length = bounds(beats["last"])
    code, bits = _codes(sample, starts, length, config)
    ends_bit = np.cumsum(bits)
    first_bit = np.append(0, ends_bit)[starts]
    payload_bits = ends_bit[starts + length - 1] - first_bit
    words = -(-payload_bits // WORD_W)

    # Where each record, and in it the payload, begins among all words.
    record = np.append(0, np.cumsum(HEAD + words + TAIL))
    total, record, behind = int(record[-1]), record[:-1], record[1:]
    within = np.arange(words.sum()) - np.repeat(np.cumsum(words) - words, words)
    payload = np.repeat(record + HEAD, words) + within

    word, cause = np.zeros((2, total), np.int64)
    word[record] = VERSION << 28 | config.codec_mode << 24 | config.sample_w - 1 << 20 | config.codec_threshold
    word[record + 1] = config.codec_baseline_even << 16 | config.codec_baseline_odd
    word[payload] = _packed(code, bits, payload_bits)
    word[behind - 2] = np.where(length > MOST_SAMPLES, 1 << 16, 0) | length & MOST_SAMPLES
    word[behind - 1] = checksum(sample, starts, length, config.sample_w)
    last = np.zeros(total, np.bool_)
    last[behind - 1] = True

    cause[record] = cause[record + 1] = starts
    full = np.minimum((within + 1) * WORD_W, np.repeat(payload_bits, words)) + np.repeat(first_bit, words)
    cause[payload] = np.searchsorted(ends_bit, full)
    cause[behind - 2] = cause[behind - 1] = starts + length - 1
    return {"word": word.astype(np.uint32), "last": last, "cause": cause}


def _codes(sample: IntArray, starts: IntArray, length: IntArray, config: Config) -> tuple[IntArray, IntArray]:
    """Each sample's code, as a number, and its bits."""
    width, mode = config.sample_w, config.codec_mode
    limit = LIMITS[mode]
    flag, escape_flag = (1, 0) if mode == PREDICTION else (0, 1)
    code, bits = np.zeros((2, sample.size), np.int64)
    order = np.argsort(-length, kind="stable")
    even, odd = (np.full(order.size, base) for base in (config.codec_baseline_even, config.codec_baseline_odd))
    predictions = Predictions(even, odd, width)
    credit = np.full(order.size, CREDIT_START)
    for index, active in enumerate(actives(length)):
        at = starts[order[:active]] + index
        x = sample[at]
        if mode == PREDICTION:
            half, k = predictions.take(index, active)
            value = fold(signed(2 * x - half, width))
            predictions.renew(index, x)
        else:
            value = x - (odd if index % 2 else even)[:active] & (1 << width) - 1
            k = bit_length(np.full(active, config.codec_threshold))
        quotient = value >> k
        escape = quotient >= limit
        inner = np.where(escape, escape_flag << width | x, flag << k | value & (1 << k) - 1)
        inner_bits = np.where(escape, limit + width, quotient + 1 + k)
        plain = credit[:active] < CREDIT_LEAST
        code[at] = np.where(plain, x, inner)
        bits[at] = np.where(plain, width, inner_bits)
        credit[:active] = spent(credit[:active], inner_bits, width)
    return code, bits


def _packed(code: IntArray, bits: IntArray, payload_bits: IntArray) -> IntArray:
    """Payloads as words, end to end: each waveform's codes, then zeros to the end of the word."""
    places = np.repeat(np.cumsum(bits), bits) - np.arange(bits.sum()) - 1
    digits = np.repeat(code, bits) >> places & 1
    padding = -payload_bits % WORD_W
    before = np.repeat(np.cumsum(padding) - padding, payload_bits)
    padded = np.zeros((payload_bits + padding).sum(), np.uint8)
    padded[np.arange(digits.size) + before] = digits
    return np.packbits(padded).view(">u4").astype(np.int64)
