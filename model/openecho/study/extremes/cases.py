"""All cases."""

from openecho.study.extremes import codec, core, fits, floats, smoothing, sums

CASES = (*core.CASES, *floats.CASES, *fits.CASES, *smoothing.CASES, *sums.CASES, *codec.CASES)
"""In the order in which they are shown."""
