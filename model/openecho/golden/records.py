"""The decoder of the core's records."""

import numpy as np

from .arithmetic import decode
from .beats import Array, FloatArray
from .config import AMP_FRAC, Config
from .output import FLAGS_MASK, TRAILER_BIT

RECORD = np.dtype(
    [
        ("trailer", bool),
        ("flags", np.int64),
        ("sequence", np.int64),
        ("number", np.int64),
        ("centre", np.float64),
        ("peak", np.float64),
        ("width", np.float64),
        ("time", np.float64),
        ("amplitude", np.float64),
        ("length", np.int64),
        ("noise_mean", np.float64),
        ("noise_deviation", np.float64),
    ]
)
"""Fields of a decoded record."""


def decode_records(records: Array, config: Config) -> Array:
    """Unpack records into numbers of bins and counts. Exact: every field fits float64.

    Parameters
    ----------
    records : (n, 8) integer array
        Words as `output` packs them.
    config : Config

    Returns
    -------
    (n,) array of `RECORD`
        `centre`, `peak`, `width`, `time` in bins and `amplitude` in counts are nan in a trailer; `length` in samples
        is 0, and `noise_mean` and `noise_deviation` in counts are nan, in an echo. `number` of a trailer is the number
        of echoes.
    """
    words = np.asarray(records).astype(f"u{config.word_w // 8}")
    decoded = np.zeros(len(words), RECORD)
    decoded["trailer"] = trailer = words[:, 0] >> TRAILER_BIT == 1
    decoded["flags"] = words[:, 0] & FLAGS_MASK
    decoded["sequence"] = words[:, 1]
    decoded["number"] = words[:, 2]
    for word, name in enumerate(("centre", "peak", "width", "time", "amplitude"), start=3):
        decoded[name] = np.where(trailer, np.nan, _number(words[:, word], name, config))
    counts = words / (1 << AMP_FRAC)
    decoded["length"] = np.where(trailer, words[:, 3], 0)
    decoded["noise_mean"] = np.where(trailer, counts[:, 4], np.nan)
    decoded["noise_deviation"] = np.where(trailer, counts[:, 7], np.nan)
    return decoded


def _number(words: Array, name: str, config: Config) -> FloatArray:
    """Bins or counts that a field of an echo stands for."""
    signed = words.astype(f"i{config.word_w // 8}").astype(np.int64)
    if config.form is None:
        return signed / (1 << (AMP_FRAC if name == "amplitude" else config.frac))
    return decode(signed, config.form)
