"""Module `second_difference`: the discrete second derivative."""

import numpy as np

from .arithmetic import from_int
from .beats import Beats
from .config import TAP_FRAC, Config


def second_difference(beats: Beats, config: Config) -> Beats:
    """Second backward difference of the filtered waveform, taken as 0 before its start, beside the first.

    Zhou 2022, Eq (2), with its newest sample y[x+2] as the current one. In fixed point both are exact and, as the sum,
    without the 2⁻¹¹ of Eq (11). As floats they have it, so that they stay in the range of binary16: integers,
    converted and scaled in one rounding, which leaves no difference but 0 without its sign.

    Parameters
    ----------
    beats : Beats
        `first`, `raw`, `index`, `overlong`, `last`.
    config : Config

    Returns
    -------
    Beats
        `second`, `first`, and `raw`, `index`, `overlong` as they came.
    """
    first = beats["first"]
    second = np.diff(first, prepend=0)
    starts = beats["index"] == 0
    second[starts] = first[starts]
    return {
        "second": second if config.form is None else from_int(second, config.form, -TAP_FRAC),
        "first": first if config.form is None else from_int(first, config.form, -TAP_FRAC),
        "raw": beats["raw"],
        "index": beats["index"],
        "overlong": beats["overlong"],
        "last": beats["last"],
        "cause": np.arange(first.size),
    }
