"""The core's divider."""

from .beats import IntArray

_BITS = 13
"""Of a quotient at a time: what the remainder may be shifted by without leaving int64."""


def divide(numerator: IntArray, denominator: IntArray | int, frac: int) -> IntArray:
    """Divide to `frac` fractional bits, rounded half up: (⌊numerator·2^(frac+1)/denominator⌋ + 1) >> 1.

    Long division, a few bits at a time: a numerator of 38 bits (16-bit samples and taps) shifted by 25 would overflow
    int64.

    Parameters
    ----------
    numerator : (...) int64 array
        Not negative, below 2^49.
    denominator : (...) int64 array or int
        Positive, below 2^50.
    frac : int
        Fractional bits of the result; the result is below 2^62.

    Returns
    -------
    (...) int64 array
    """
    doubled, remainder = divmod(numerator, denominator)
    for start in range(0, frac + 1, _BITS):
        bits = min(_BITS, frac + 1 - start)
        quotient, remainder = divmod(remainder << bits, denominator)
        doubled = (doubled << bits) + quotient
    return (doubled + 1) >> 1
