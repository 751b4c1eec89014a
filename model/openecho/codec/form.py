"""How a record is coded: what its first two words say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

VERSION = 1
MODES = ("threshold", "prediction")
"""Names of the modes, by their numbers."""
THRESHOLD, PREDICTION = range(2)
LARGEST_BITS = 16
HEADER_BYTES = 8


class CodecError(ValueError):
    """What can't be coded, or what no encoder wrote: one line with the place, what was found and what was expected."""


@dataclass(frozen=True)
class Form:
    """Mode and parameters of a record.

    Attributes
    ----------
    mode : int
        `THRESHOLD` or `PREDICTION`.
    bits : int
        N, of a sample, 1 to 16.
    threshold : int
        T of the threshold coding, 0 to 2^N - 1; 0 in the other mode.
    baseline : (int, int)
        Counts, of the samples with even and with odd index, 0 to 2^N - 1.

    Raises
    ------
    CodecError
        If a value is out of range.
    """

    mode: int
    bits: int
    threshold: int = 0
    baseline: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        _within("mode", self.mode, 0, len(MODES) - 1)
        _within("bits a sample", self.bits, 1, LARGEST_BITS)
        _within("threshold", self.threshold, 0, self.largest if self.mode == THRESHOLD else 0)
        for value in self.baseline:
            _within("baseline", value, 0, self.largest)

    @property
    def largest(self) -> int:
        """Counts that the bits can hold."""
        return (1 << self.bits) - 1

    def header(self) -> bytes:
        """Words 0 and 1 of a record."""
        word = VERSION << 28 | self.mode << 24 | self.bits - 1 << 20 | self.threshold
        return word.to_bytes(4) + b"".join(value.to_bytes(2) for value in self.baseline)

    @classmethod
    def parse(cls, header: bytes) -> Self:
        """Read words 0 and 1.

        Parameters
        ----------
        header : bytes
            `HEADER_BYTES` of them.

        Raises
        ------
        CodecError
            If they are not the header of a record that this version knows; bytes are counted from its start.
        """
        if len(header) != HEADER_BYTES:
            raise CodecError(f"byte 0: a header of {len(header)} bytes, expected {HEADER_BYTES}")
        if header[0] >> 4 != VERSION:
            raise CodecError(f"byte 0: version {header[0] >> 4}, expected {VERSION}")
        if header[0] & 15 >= len(MODES):
            raise CodecError(f"byte 0: mode {header[0] & 15}, expected 0 to {len(MODES) - 1}")
        if header[1] & 15:
            raise CodecError(f"byte 1: {header[1] & 15} in bits that are not used, expected 0")
        threshold, even, odd = (int.from_bytes(header[at : at + 2]) for at in (2, 4, 6))
        try:
            return cls(header[0] & 15, (header[1] >> 4) + 1, threshold, (even, odd))
        except CodecError as error:
            raise CodecError(f"byte 2: {error}") from None


def _within(name: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        raise CodecError(f"{name} {value}, expected {low} to {high}")
