"""Module `output`: one record of eight words for each echo and each trailer."""

import numpy as np

from .beats import Beats, waveform_of
from .config import Config

TRAILER_BIT = 31
"""Bit of the header word that marks a trailer."""
FLAGS_MASK = 0b111
"""Bits of the header word that hold the flags."""


def output(beats: Beats, config: Config) -> Beats:
    """Number the echoes and pack them into records, word 0 first.

    ==== ============================ ============================
    word echo                         trailer
    ==== ============================ ============================
    0    flags                        bit 31, flags
    1    sequence number of waveform  sequence number of waveform
    2    number of echo, from 0       number of echoes
    3    centre                       length
    4    peak                         noise mean
    5    width                        0
    6    time                         0
    7    amplitude                    noise deviation
    ==== ============================ ============================

    The time, and every float, is sign-extended to a word.

    Parameters
    ----------
    beats : Beats
        `centre`, `peak`, `width`, `time`, `amplitude`, `flags`, `last`, as `parameters` returns them.
    config : Config

    Returns
    -------
    Beats
        `record`: (beats, 8) uint32 or uint64 array, by `config.word_w`.
    """
    last = beats["last"]
    sequence = waveform_of(last)
    starts = np.append(0, np.flatnonzero(last)[:-1] + 1)
    number = np.arange(last.size) - starts[sequence]
    header = last.astype(np.int64) << TRAILER_BIT | beats["flags"]
    words = [header, sequence, number, *(beats[name] for name in ("centre", "peak", "width", "time", "amplitude"))]
    record = np.stack(words, axis=-1).astype(f"u{config.word_w // 8}")
    return {"record": record, "last": last, "cause": np.arange(last.size)}
