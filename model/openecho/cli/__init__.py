"""The command ``openecho``: waveforms in, echoes, terrain and what they are worth out."""

from __future__ import annotations

import signal
import sys

import click

from openecho import __version__, batch, formats, tables
from openecho.cli import scenes, terrain, waveforms
from openecho.decompose import EngineError
from openecho.study import figure

ERRORS = (
    formats.DataError,
    tables.TableError,
    batch.StoreError,
    batch.DistributionError,
    EngineError,
    figure.FigureError,
)
"""What can be wrong with what a user gives, each in one line; anything else is our mistake, and shows its traceback."""


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="openecho")
def openecho() -> None:
    """Echoes out of full-waveform lidar, bit for bit as the OpenEcho core finds them.

    FILE is an LVIS or GEDI L1B granule (HDF5), LAS 1.3 or 1.4 with waveform packets, PulseWaves, .oec, .npz or .npy.
    """


for _command in (
    waveforms.info,
    waveforms.decompose,
    waveforms.plot,
    waveforms.score,
    waveforms.compress,
    waveforms.decompress,
    terrain.surface,
    terrain.view,
    scenes.scene,
    scenes.simulate,
):
    openecho.add_command(_command)


def main() -> None:
    """Run the command: exit status 0; 2 for what can't be used, in one line; 130 if it was interrupted."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        openecho.main(standalone_mode=False)
    except click.ClickException as error:
        _fail(error.format_message())
    except ERRORS as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror or error}" if error.filename else str(error))
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted", err=True)
        sys.exit(130)


def _fail(line: str) -> None:
    click.echo(f"error: {line}", err=True)
    sys.exit(2)
