"""Recorded waveforms from files: ``.npz`` with the keys `samples` and `length`, or a plain two-dimensional ``.npy``."""

from openecho.formats.waveforms import DataError, Waveforms, load

__all__ = ["DataError", "Waveforms", "load"]
