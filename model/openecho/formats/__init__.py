"""Recorded waveforms from files: `open` hands out blocks of any supported format, `load` reads a whole file."""

from openecho.formats.detect import open
from openecho.formats.recording import Block, DataError, Geolocation, Recording
from openecho.formats.references import Reference, references
from openecho.formats.survey import Survey, survey
from openecho.formats.waveforms import Waveforms, load

__all__ = [
    "Block",
    "DataError",
    "Geolocation",
    "Recording",
    "Reference",
    "Survey",
    "Waveforms",
    "load",
    "open",
    "references",
    "survey",
]
