"""What the methods that fit can be told by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

PARAMETERS = 3
"""Of an echo."""

CRITERIA: Mapping[str, Callable[[FloatArray], FloatArray]] = {
    "ebic": lambda m: (PARAMETERS + 2) * np.log(m),
    "bic": lambda m: PARAMETERS * np.log(m),
    "aic": lambda m: np.full(len(m), 2.0 * PARAMETERS),
}
"""What an echo must take off the sum of squares, in variances of the noise, in a waveform of m samples.

Akaike 1974; Schwarz 1978; extended by Chen & Chen 2008 (Biometrika 95, 759; their γ is 1) for having been looked for at
m places, without which one in a few waveforms of plain noise has an echo.
"""
STARTS = ("inflection", "maxima", "none")
"""First guesses: intervals of negative curvature, maxima, or one by one from none at all."""

WIDTHS = ("free", "shared", "fixed")
"""Of the echoes of a waveform: each its own, all the same, all as given."""
