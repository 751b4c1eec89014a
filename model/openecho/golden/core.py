"""Module `core`: the six modules in a row."""

from .beats import Beats
from .config import Config
from .filter import filter
from .inflection import inflection
from .output import output
from .parameters import parameters
from .reader import reader
from .second_difference import second_difference


def core(beats: Beats, config: Config) -> Beats:
    """Decompose waveforms into records of echoes: Zhou 2022 as corrected in the six modules.

    Parameters
    ----------
    beats : Beats
        `sample` (counts) and `last`, as `stream` returns them.
    config : Config

    Returns
    -------
    Beats
        `record`, as `output` returns it.
    """
    samples, noise = reader(beats, config)
    components = inflection(second_difference(filter(samples, config), config), noise, config)
    echoes = parameters(components, config)
    records = output(echoes, config)
    return records | {"cause": samples["cause"][components["cause"][echoes["cause"]]]}
