"""What every method makes of waveforms: a table of echoes, and a line about each waveform."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openecho.decompose import criteria
from openecho.golden import NO_NOISE, TOO_LONG, TOO_SHORT

if TYPE_CHECKING:  # needs numba to be imported, which the core's own method does without
    from openecho.decompose.pulses import Pulse

WAVEFORM = np.dtype(
    [("length", "i4"), ("echoes", "i4"), ("noise_mean", "f8"), ("noise_deviation", "f8"), ("flags", "u1")]
)
"""What is said of each waveform: samples, number of echoes, baseline and noise in counts, flags."""

NOT_CONVERGED = 8
"""Flag of a waveform whose fit could have gone on: its echoes overlap so far that many sums of them fit as well."""

TROUBLES = {
    TOO_SHORT: "too short for the filter",
    TOO_LONG: "too long and cut",
    NO_NOISE: "too short for noise",
    NOT_CONVERGED: "with echoes that are not well determined",
}
"""What each flag of a waveform means."""


@dataclass(frozen=True)
class Decomposition:
    """Echoes of some waveforms.

    Attributes
    ----------
    echoes : structured (echoes,)
        Columns of `columns.COLUMNS`, in the order of waveforms and of bins.
    waveforms : structured (n,) of `WAVEFORM`
        One entry for each waveform, also for one without echoes. Its flags: 1 too short, 2 too long and cut,
        4 fewer than the 50 samples that measure the core's noise, 8 fit not converged.
    pulse : Pulse, optional
        Shape of the echoes; that of a Gaussian if None.
    """

    echoes: np.ndarray
    waveforms: np.ndarray
    pulse: Pulse | None = None

    def fitted(self, m: int) -> NDArray[np.float64]:
        """Baseline and echoes of each waveform added up.

        Parameters
        ----------
        m : int
            Samples.

        Returns
        -------
        float64 (n, m)
            Counts.
        """
        if self.pulse is None:
            return criteria.fitted(self.echoes, self.waveforms["noise_mean"], m)
        from openecho.decompose.fit import echo_sum

        return echo_sum(
            m,
            self.waveforms["noise_mean"],
            self.echoes["waveform"],
            self.echoes["amplitude"],
            self.echoes["peak"],
            self.echoes["width"],
            self.pulse,
        )

    def alone(self, waveform: int, echo: int | None = None) -> Decomposition:
        """One waveform, with all its echoes or one of them.

        Parameters
        ----------
        waveform : int
            From 0.
        echo : int, optional
            Of that waveform, from 0.

        Returns
        -------
        Decomposition
        """
        echoes = self.echoes[self.echoes["waveform"] == waveform].copy()
        echoes["waveform"] = 0
        picked = echoes if echo is None else echoes[echo : echo + 1]
        return Decomposition(picked, self.waveforms[waveform : waveform + 1], self.pulse)


def troubles(waveforms: np.ndarray) -> dict[str, int]:
    """How many waveforms could not be treated as any other, by what was the matter with them."""
    counts = {name: int(np.count_nonzero(waveforms["flags"] & flag)) for flag, name in TROUBLES.items()}
    return {name: count for name, count in counts.items() if count}
