"""What a core is built with and set to, and every width that follows from it."""

from dataclasses import dataclass

import numpy as np

NOISE_SAMPLES = 50
"""Samples at the start of a waveform that measure the noise (Zhou 2022, section 2.1)."""
AMP_FRAC = 8
"""Fractional bits of amplitude, noise mean and noise deviation: 2⁻⁸ count."""
ROOT_FRAC = 4
"""Fractional bits of the square root inside the noise deviation."""
RATIO_FRAC = 4
"""Fractional bits of the settings n and k: UQ4.4."""

SATURATED, TRUNCATED, NO_PEAK = 1, 2, 4
"""Flags of an echo."""
TOO_SHORT, TOO_LONG, NO_NOISE = 1, 2, 4
"""Flags of a trailer."""

PAPER_TAPS = (43, 55, 69, 84, 99, 114, 127, 138, 146, 150, 150, 146, 138, 127, 114, 99, 84, 69, 55, 43)
"""The Gaussian of Zhou 2022, Eq (11), as the integers in front of 2⁻¹¹."""


@dataclass(frozen=True)
class Config:
    """Parameters and settings of the core.

    Parameters
    ----------
    sample_w : int
        Bits of an unsigned sample, 8 to 16.
    frac : int
        Fractional bits of a position, 4 to 24.
    max_samples : int
        Longest waveform, T + 2 to 65536 samples.
    taps : tuple of int
        All T filter taps, 4 to 48, symmetric, 16-bit signed.
    n : float
        Width divisor of Eq (7), a multiple of 1/16 below 16; the core takes less than 1 as 1.
    min_interval : int
        An interval between inflections is kept if it is longer than this, in bins.
    min_amplitude : int
        Least amplitude of an echo, in counts.
    k : float
        Least amplitude of an echo in noise deviations, a multiple of 1/16 below 16.

    Raises
    ------
    ValueError
        If a value is outside the range given here.
    """

    sample_w: int = 11
    frac: int = 16
    max_samples: int = 4096
    taps: tuple[int, ...] = PAPER_TAPS
    n: float = 2.0
    min_interval: int = 5
    min_amplitude: int = 5
    k: float = 3.0

    def __post_init__(self) -> None:
        _check_integer("sample_w", self.sample_w, 8, 16)
        _check_integer("frac", self.frac, 4, 24)
        _check_integer("number of taps", len(self.taps), 4, 48)
        for tap in self.taps:
            _check_integer("tap", tap, -(1 << 15), (1 << 15) - 1)
        if self.taps != self.taps[::-1]:
            raise ValueError(f"taps: found {self.taps}, expected a symmetric set")
        _check_integer("max_samples", self.max_samples, self.tap_count + 2, 1 << 16)
        _check_integer("min_interval", self.min_interval, 0, (1 << self.idx_w) - 1)
        _check_integer("min_amplitude", self.min_amplitude, 0, (1 << self.sample_w) - 1)
        _check_ratio("n", self.n)
        _check_ratio("k", self.k)

    @property
    def tap_count(self) -> int:
        """Number of taps T."""
        return len(self.taps)

    @property
    def delay(self) -> int:
        """Beats from a raw sample to the second difference at or just after it: its group delay (T+1)/2, rounded up."""
        return (self.tap_count + 2) // 2

    @property
    def first_valid(self) -> int:
        """Index of the first beat whose second difference saw no sample from before the waveform."""
        return self.tap_count + 1

    @property
    def idx_w(self) -> int:
        """Bits of a sample's index."""
        return (self.max_samples - 1).bit_length()

    @property
    def len_w(self) -> int:
        """Bits of a waveform's length."""
        return self.idx_w + 1

    @property
    def pos_w(self) -> int:
        """Bits of a position."""
        return self.idx_w + self.frac

    @property
    def amp_w(self) -> int:
        """Bits of an amplitude."""
        return self.sample_w + AMP_FRAC

    @property
    def sum_w(self) -> int:
        """Bits of the filter's signed sum."""
        return self._signed_width(0)

    @property
    def first_w(self) -> int:
        """Bits of the signed first difference."""
        return self._signed_width(1)

    @property
    def second_w(self) -> int:
        """Bits of the signed second difference."""
        return self._signed_width(2)

    @property
    def word_w(self) -> int:
        """Bits of a record's word: the narrower of 32 and 64 that holds the signed echo time and the amplitude."""
        return 32 if max(self.pos_w + 1, self.amp_w) <= 32 else 64

    @property
    def n_raw(self) -> int:
        """Setting n as the core gets it, UQ4.4."""
        return int(self.n * (1 << RATIO_FRAC))

    @property
    def k_raw(self) -> int:
        """Setting k as the core gets it, UQ4.4."""
        return int(self.k * (1 << RATIO_FRAC))

    def _signed_width(self, differences: int) -> int:
        """Bits that hold the filter's output, differenced so many times, for any samples."""
        taps = np.array(self.taps)
        for _ in range(differences):
            taps = np.diff(taps, prepend=0, append=0)
        gain = max(int(taps[taps > 0].sum()), -int(taps[taps < 0].sum()))
        return self.sample_w + gain.bit_length() + 1


def _check_integer(name: str, value: int, low: int, high: int) -> None:
    if not isinstance(value, int | np.integer) or not low <= value <= high:
        raise ValueError(f"{name}: found {value!r}, expected an integer from {low} to {high}")


def _check_ratio(name: str, value: float) -> None:
    raw = value * (1 << RATIO_FRAC)
    if not 0 <= raw < 1 << (4 + RATIO_FRAC) or raw != int(raw):
        raise ValueError(f"{name}: found {value!r}, expected a multiple of 1/16 from 0 to 15.9375")
