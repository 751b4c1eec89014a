"""Module `filter`: behind the reader."""

from openecho import golden
from openecho.golden import Beats, Config


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    samples, _ = golden.reader(beats, config)
    return {"s": samples}
