"""Module `decoder`: the samples of each record that the encoder made."""

import numpy as np

from .beats import Array, Beats, BoolArray, IntArray
from .codec import (
    CREDIT_LEAST,
    CREDIT_START,
    HEAD,
    LIMITS,
    PREDICTION,
    TAIL,
    THRESHOLD,
    VERSION,
    WORD_W,
    Predictions,
    actives,
    bit_length,
    bounds,
    checksum,
    spent,
    unfold,
)
from .config import BAD_CHECK, BAD_FORM, BAD_LENGTH, Config


def decoder(beats: Beats, config: Config) -> Beats:
    """Restore the waveform of each record, as `openecho.codec` specifies it, and say which are not in order.

    Parameters
    ----------
    beats : Beats
        `word` (32 bits) and `last`.
    config : Config
        Its `sample_w` is what records must have.

    Returns
    -------
    Beats
        `sample` (counts) and `flags`, which are 0 except with the `last` of a record that is not in order:
        `BAD_FORM`, `BAD_LENGTH` or `BAD_CHECK`. Such a record is one beat here; the RTL may give others before, and
        have other flags than these, but some. `cause` is the word two behind that with the code's last bit: only then
        is it known to be followed by more of the payload, or the number of samples to be the number. Of a record that
        is not in order it is its last word.
    """
    word = beats["word"].astype(np.int64)
    starts, words = bounds(beats["last"])
    flags = np.where(_ill_formed(word, starts, words, config), BAD_FORM, 0)
    sound = np.flatnonzero(flags == 0)
    starts_in, payload = starts[sound], words[sound] - HEAD - TAIL
    number = word[starts_in + HEAD + payload]
    # A sample has one bit at least.
    possible = (number > 0) & (number >> 16 == 0) & (number <= WORD_W * payload)
    flags[sound[~possible]] = BAD_LENGTH

    rows = sound[possible]
    rows = rows[np.argsort(-word[starts[rows] + words[rows] - TAIL], kind="stable")]
    length, first = word[starts[rows] + words[rows] - TAIL], starts[rows] + HEAD
    at = np.cumsum(length) - length
    sample, end = _samples(word, starts[rows], at, length, config)
    left = WORD_W * (words[rows] - HEAD - TAIL) - end[at + length - 1]
    padding = word[first + words[rows] - HEAD - TAIL - 1] & (1 << np.clip(left, 0, WORD_W)) - 1
    flags[rows[(left < 0) | (left >= WORD_W) | (padding != 0)]] = BAD_LENGTH
    wrong = checksum(sample, at, length, config.sample_w) != word[starts[rows] + words[rows] - 1]
    flags[rows[(flags[rows] == 0) & wrong]] = BAD_CHECK
    return _in_order(
        flags, rows, at, length, sample, np.repeat(first, length) + (end - 1) // WORD_W + 2, starts + words
    )


def _ill_formed(word: IntArray, starts: IntArray, words: IntArray, config: Config) -> BoolArray:
    """Whether each record has too few words or a head that no encoder of this width makes."""
    head, baselines = word[starts], np.append(word, 0)[starts + 1]
    mode, threshold, full = head >> 24 & 15, head & 0xFFFF, (1 << config.sample_w) - 1
    wrong: BoolArray = (
        (words < HEAD + TAIL)
        | (head >> 28 != VERSION)
        | ((mode != THRESHOLD) & (mode != PREDICTION))
        | (head >> 20 & 15 != config.sample_w - 1)
        | (head >> 16 & 15 != 0)
        | (threshold > full)
        | ((mode == PREDICTION) & (threshold != 0))
        | (baselines >> 16 > full)
        | (baselines & 0xFFFF > full)
    )
    return wrong


def _samples(
    word: IntArray, starts: IntArray, at: IntArray, length: IntArray, config: Config
) -> tuple[IntArray, IntArray]:
    """Samples of records with a sound head, longest first, and the bit of the payload that each one's code ends before.

    Parameters
    ----------
    word : (words,) array
        All records.
    starts : (n,) array
        First word of each record.
    at, length : (n,) arrays
        Where to put the samples, and how many they are.
    config : Config

    Returns
    -------
    sample, end : (samples,) arrays
        Beyond the end of a payload anything.
    """
    width = config.sample_w
    sample, end = np.zeros((2, length.sum()), np.int64)
    ahead = np.append(word, [0, 0])
    mode, k_threshold = word[starts] >> 24 & 15, bit_length(word[starts] & 0xFFFF)
    even, odd = word[starts + 1] >> 16, word[starts + 1] & 0xFFFF
    limit = np.where(mode == PREDICTION, LIMITS[PREDICTION], LIMITS[THRESHOLD])
    predictions = Predictions(even, odd, width)
    credit = np.full(starts.size, CREDIT_START)
    position = np.zeros(starts.size, np.int64)
    for index, active in enumerate(actives(length)):
        is_prediction, most, place = mode[:active] == PREDICTION, limit[:active], position[:active]
        half, k = predictions.take(index, active)
        k = np.where(is_prediction, k, k_threshold[:active])
        base = (odd if index % 2 else even)[:active]

        # The 64 bits from the word on in which the code begins; a code has no more than 32.
        here = np.minimum(starts[:active] + HEAD + place // WORD_W, word.size)
        window = (ahead[here] << WORD_W | ahead[here + 1]).astype(np.uint64) << (place % WORD_W).astype(np.uint64)
        upper = (window >> np.uint64(WORD_W)).astype(np.int64)
        zeros = WORD_W - bit_length(np.where(is_prediction, upper, upper ^ 1 << WORD_W - 1))

        plain = credit[:active] < CREDIT_LEAST
        escape = zeros >= most
        quotient = np.minimum(zeros, most)
        bits = np.where(escape, most + width, quotient + 1 + k)
        raw = plain | escape
        taken = np.where(plain, width, bits)
        low = upper >> WORD_W - taken & (1 << np.where(raw, width, k)) - 1
        value = quotient << k | low
        coded = np.where(is_prediction, unfold(value, half, width), value + base & (1 << width) - 1)
        x = np.where(raw, low, coded)

        predictions.renew(index, x)
        credit[:active] = spent(credit[:active], bits, width)
        position[:active] += taken
        sample[at[:active] + index], end[at[:active] + index] = x, position[:active]
    return sample, end


def _in_order(
    flags: IntArray,
    rows: IntArray,
    at: IntArray,
    length: IntArray,
    sample: IntArray,
    cause: IntArray,
    behind: IntArray,
) -> Beats:
    """Samples of the records in order and one beat for each other record, in the order of the records.

    Parameters
    ----------
    flags, behind : (records,) arrays
        Of all records; the word behind each.
    rows : (n,) array
        Records that were decoded, whose `length` samples are at `at`, with `cause`.
    """
    count, source = np.ones((2, flags.size), np.int64)
    good = flags[rows] == 0
    count[rows[good]], source[rows[good]] = length[good], at[good]
    ends = np.cumsum(count)
    is_good = np.repeat(flags == 0, count)
    pick = np.repeat(source - ends + count, count) + np.arange(ends[-1])
    last = np.zeros(ends[-1], np.bool_)
    last[ends - 1] = True

    def filled(values: Array, bad: Array) -> IntArray:
        field = np.repeat(bad, count)
        field[is_good] = values[pick[is_good]]
        return field

    return {
        "sample": filled(sample, np.zeros_like(flags)),
        "flags": np.repeat(flags, count),
        "last": last,
        "cause": filled(cause, behind - 1),
    }
