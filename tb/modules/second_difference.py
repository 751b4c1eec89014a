"""Module `second_difference`: behind the filter."""

from openecho import golden
from openecho.golden import Beats, Config
from tb.modules import filter


def inputs(beats: Beats, config: Config) -> dict[str, Beats]:
    """Beats on each input for these waveforms."""
    return {"s": golden.filter(filter.inputs(beats, config)["s"], config)}
