"""What a core is built with and set to, and every width that follows from it."""

from dataclasses import dataclass, replace

import numpy as np

from .floating import BINARY16, BINARY32, BINARY64, Format
from .taps import MAX_TAPS, PAPER_TAPS

NOISE_SAMPLES = 50
"""Samples at the start of a waveform that measure the noise (Zhou 2022, section 2.1)."""
AMP_FRAC = 8
"""Fractional bits of amplitude, noise mean and noise deviation: 2⁻⁸ count."""
ROOT_FRAC = 4
"""Fractional bits of the square root inside the noise deviation."""
RATIO_FRAC = 4
"""Fractional bits of the settings n and k: UQ4.4."""
TAP_FRAC = 11
"""Fractional bits of a tap in Zhou 2022, Eq (11): the 2⁻¹¹ that scales the differences where they become floats."""

SATURATED, TRUNCATED, NO_PEAK = 1, 2, 4
"""Flags of an echo."""
TOO_SHORT, TOO_LONG, NO_NOISE = 1, 2, 4
"""Flags of a trailer."""
BAD_FORM, BAD_LENGTH, BAD_CHECK = 1, 2, 4
"""Flags of a record that the decoder found out of order: its head, its payload and their lengths, its checksum."""

ARITHMETICS = {
    "fixed": (0, 16),
    "float16": (BINARY16.exp_w, BINARY16.frac_w),
    "float32": (BINARY32.exp_w, BINARY32.frac_w),
    "float64": (BINARY64.exp_w, BINARY64.frac_w),
}
"""`exp_w` and `frac` of each arithmetic that command lines and reports know by name."""


@dataclass(frozen=True)
class Config:
    """Parameters and settings of the core and of the codec.

    Parameters
    ----------
    sample_w : int
        Bits of an unsigned sample, 8 to 16.
    exp_w : int
        Bits of the exponent. 0: positions are fixed point with `frac` fractional bits. 5 to 11: positions, widths,
        times, amplitudes and the differences of the filtered waveform are IEEE-754 numbers with `exp_w` exponent and
        `frac` fraction bits.
    frac : int
        Fractional bits of a position, 4 to 24; fraction bits of an IEEE-754 number, 2 to 52.
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
    codec_mode : int
        How the encoder compresses: 0 threshold, 1 prediction.
    codec_threshold : int
        The encoder's threshold, in counts; 0 if it predicts.
    codec_baseline_even, codec_baseline_odd : int
        What the encoder takes the samples with even and with odd indices to lie on, in counts.

    Raises
    ------
    ValueError
        If a value is outside the range given here, or a result could be beyond the largest number of the format.
    """

    sample_w: int = 11
    exp_w: int = 0
    frac: int = 16
    max_samples: int = 4096
    taps: tuple[int, ...] = PAPER_TAPS
    n: float = 2.0
    min_interval: int = 5
    min_amplitude: int = 5
    k: float = 3.0
    codec_mode: int = 1
    codec_threshold: int = 0
    codec_baseline_even: int = 0
    codec_baseline_odd: int = 0

    def __post_init__(self) -> None:
        _check_integer("sample_w", self.sample_w, 8, 16)
        if self.exp_w == 0:
            _check_integer("frac", self.frac, 4, 24)
        else:
            _check_integer("exp_w", self.exp_w, 5, 11, "0 or ")
            _check_integer("frac", self.frac, 2, 52)
        _check_integer("number of taps", len(self.taps), 4, MAX_TAPS)
        for tap in self.taps:
            _check_integer("tap", tap, -(1 << 15), (1 << 15) - 1)
        if self.taps != self.taps[::-1]:
            raise ValueError(f"taps: found {self.taps}, expected a symmetric set")
        _check_integer("max_samples", self.max_samples, self.tap_count + 2, 1 << 16)
        _check_integer("min_interval", self.min_interval, 0, (1 << self.idx_w) - 1)
        _check_integer("min_amplitude", self.min_amplitude, 0, (1 << self.sample_w) - 1)
        _check_ratio("n", self.n)
        _check_ratio("k", self.k)
        _check_integer("codec_mode", self.codec_mode, 0, 1)
        full_scale = (1 << self.sample_w) - 1
        _check_integer("codec_threshold", self.codec_threshold, 0, 0 if self.codec_mode else full_scale)
        _check_integer("codec_baseline_even", self.codec_baseline_even, 0, full_scale)
        _check_integer("codec_baseline_odd", self.codec_baseline_odd, 0, full_scale)
        if self.form is not None:
            self._check_range(self.form)

    def in_arithmetic(self, name: str) -> "Config":
        """Return the same core in one of `ARITHMETICS`."""
        exp_w, frac = ARITHMETICS[name]
        return replace(self, exp_w=exp_w, frac=frac)

    @property
    def form(self) -> Format | None:
        """Format of the IEEE-754 numbers; None if positions are fixed point."""
        return Format(self.exp_w, self.frac) if self.exp_w else None

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
        """Bits of a position, or of any IEEE-754 number."""
        return self.idx_w + self.frac if self.form is None else self.form.word_w

    @property
    def amp_w(self) -> int:
        """Bits of an amplitude, a noise mean or a noise deviation in fixed point."""
        return self.sample_w + AMP_FRAC

    @property
    def sum_w(self) -> int:
        """Bits of the filter's signed sum."""
        return self._signed_width(0)

    @property
    def first_w(self) -> int:
        """Bits of the signed first difference as an integer."""
        return self._signed_width(1)

    @property
    def second_w(self) -> int:
        """Bits of the signed second difference as an integer."""
        return self._signed_width(2)

    @property
    def difference_w(self) -> int:
        """Bits of either signed difference as an integer."""
        return max(self.first_w, self.second_w)

    @property
    def value_w(self) -> int:
        """Bits of a record's widest field: a position, the echo time with its sign, an amplitude or a length."""
        return max(self.pos_w + (self.form is None), self.amp_w, self.len_w)

    @property
    def word_w(self) -> int:
        """Bits of a record's word: the narrower of 32 and 64 that holds every field."""
        return 32 if self.value_w <= 32 else 64

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

    def _check_range(self, form: Format) -> None:
        """Refuse a format in which a result could overflow: 2^bias is a number, twice as much is not."""
        greatest = {
            "the sum of two positions": self.idx_w + 1,
            "an amplitude": self.sample_w,
            "the sum of two differences": self.difference_w - TAP_FRAC,
        }
        for what, power in greatest.items():
            if power > form.bias:
                raise ValueError(
                    f"exp_w: found {self.exp_w}, whose numbers end at 2^{form.bias + 1}, "
                    f"expected more bits for {what} of up to 2^{power}"
                )


def _check_integer(name: str, value: int, low: int, high: int, other: str = "") -> None:
    if not isinstance(value, int | np.integer) or not low <= value <= high:
        raise ValueError(f"{name}: found {value!r}, expected {other}an integer from {low} to {high}")


def _check_ratio(name: str, value: float) -> None:
    raw = value * (1 << RATIO_FRAC)
    if not 0 <= raw < 1 << (4 + RATIO_FRAC) or raw != int(raw):
        raise ValueError(f"{name}: found {value!r}, expected a multiple of 1/16 from 0 to 15.9375")
