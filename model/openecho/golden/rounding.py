"""The core's divider."""

from .beats import IntArray


def divide(numerator: IntArray, denominator: IntArray | int, frac: int) -> IntArray:
    """Divide to `frac` fractional bits, rounded half up: (⌊numerator·2^(frac+1)/denominator⌋ + 1) >> 1.

    Long division in two halves: a numerator of 38 bits (16-bit samples and taps) shifted by 25 would overflow int64.

    Parameters
    ----------
    numerator : (...) int64 array
        Not negative, below 2^49.
    denominator : (...) int64 array or int
        Positive, below 2^50.
    frac : int
        Fractional bits of the result, 0 to 24.

    Returns
    -------
    (...) int64 array
    """
    upper = (frac + 1) // 2
    lower = frac + 1 - upper
    quotient, remainder = divmod(numerator << upper, denominator)
    doubled = (quotient << lower) + (remainder << lower) // denominator
    return (doubled + 1) >> 1
