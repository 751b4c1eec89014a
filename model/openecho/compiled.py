"""The compiler that loops over samples need, and what to do where it is missing."""

try:
    from numba import njit, prange
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("numba is not installed, expected it: pip install 'openecho[fit]'") from error

__all__ = ["njit", "prange"]
