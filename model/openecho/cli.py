"""The command ``openecho``: recorded waveforms in, echoes and what they are worth out."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from openecho import __version__, batch, formats, report, tables
from openecho.decompose import ENGINES, EngineError, configure, tabulate
from openecho.formats.recording import check_bits
from openecho.formats.survey import lines
from openecho.golden import ARITHMETICS, TAP_SETS, Config
from openecho.study import figure
from openecho.study import score as judge

ERRORS = (
    formats.DataError,
    tables.TableError,
    batch.StoreError,
    batch.DistributionError,
    EngineError,
    figure.FigureError,
)
"""What can be wrong with what a user gives, each in one line; anything else is our mistake, and shows its traceback."""

RECORDING = click.argument("file", type=click.Path(path_type=Path))


def in_folder(_: click.Context, __: click.Parameter, output: Path | None) -> Path | None:
    """Refuse an output that can't be written before any work is done for it."""
    if output is not None and not output.parent.is_dir():
        raise click.UsageError(f"{output}: no folder {output.parent}, expected one")
    return output


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="openecho")
def openecho() -> None:
    """Echoes out of full-waveform lidar, bit for bit as the OpenEcho core finds them.

    FILE is an LVIS or GEDI L1B granule (HDF5), LAS 1.3 or 1.4 with waveform packets, PulseWaves, .npz or .npy.
    """


def settings(command: Callable[..., None]) -> Callable[..., None]:
    """Options of whatever decomposes: what the core is built with and set to, as `configure` takes it."""
    options = [
        click.option("--arith", "arithmetic", type=click.Choice(list(ARITHMETICS)), default="fixed", show_default=True),
        click.option("--sample-w", type=int, default=Config.sample_w, show_default=True, help="Bits of the digitiser."),
        click.option("--n", type=float, default=Config.n, show_default=True, help="Divisor of the width, Eq (7)."),
        click.option(
            "--min-interval",
            type=int,
            default=Config.min_interval,
            show_default=True,
            help="Bins that the inflections of an echo are further apart than.",
        ),
        click.option(
            "--min-amplitude",
            type=int,
            default=Config.min_amplitude,
            show_default=True,
            help="Least amplitude of an echo, counts.",
        ),
        click.option(
            "--k",
            type=float,
            default=Config.k,
            show_default=True,
            help="Least amplitude of an echo, deviations of the noise.",
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


TAPS = click.option(
    "--taps", type=click.Choice(list(TAP_SETS)), default="paper", show_default=True, help="Filter of the core."
)
ENGINE = click.option(
    "--engine",
    type=click.Choice(list(ENGINES)),
    default="model",
    show_default=True,
    help="The golden model, or the RTL in simulation (in a checkout): the same bits.",
)


@openecho.command()
@RECORDING
def info(file: Path) -> None:
    """Tell what is in FILE: waveforms, sample interval, lengths, noise, saturation, extent.

    Of lengths least, median and greatest; of the noise the 5th, 50th and 95th percentile over the waveforms, taken
    from their first 50 samples as the core does. A waveform is clipped if two neighbouring samples have the file's
    greatest count.
    """
    with formats.open(file) as recording:
        with progress("waveforms") as advance:
            found = formats.survey(recording, partial(_tell, advance, "reading", recording.waveforms))
        for name, text in lines(recording, found):
            click.echo(f"{name:20}{text}")


@openecho.command()
@RECORDING
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    help=f"Table of echoes to write: {', '.join(tables.WRITERS)}.",
)
@ENGINE
@TAPS
@settings
@click.option("--bin-ns", type=click.FloatRange(0, min_open=True), help="Sample interval where FILE doesn't tell it.")
@click.option("--jobs", type=click.IntRange(1), help="Processes on this machine.  [default: all that pay]")
@click.option("--scheduler", metavar="ADDRESS", help="Hand the blocks to this Dask cluster, as tcp://host:8786.")
def decompose(
    file: Path,
    output: Path,
    engine: str,
    bin_ns: float | None,
    jobs: int | None,
    scheduler: str | None,
    **chosen: Any,
) -> None:
    """Find the echoes of all waveforms in FILE.

    Memory stays bounded for files of any size. An interrupted run goes on where it was when the same command is given
    again; the result appears when it is complete.
    """
    _check(**chosen)
    if jobs is not None and scheduler is not None:
        raise click.UsageError("found --jobs and --scheduler, expected one of them: a cluster has its own workers")
    job = batch.Job(file, output, engine, bin_ns, chosen, jobs, scheduler)
    try:
        with progress("waveforms") as advance:
            result = batch.decompose_file(job, advance)
    except KeyboardInterrupt:
        click.echo("the same command goes on where this one was", err=True)
        raise
    if result.resumed:
        click.echo(f"{result.resumed} waveforms were decomposed by an earlier run")
    for trouble, count in result.troubles.items():
        click.echo(f"{count} waveforms {trouble}")
    if result.written < result.echoes:
        click.echo(f"{result.echoes - result.written} echoes without a position left out")
    click.echo(f"{output}: {result.written} echoes of {result.waveforms} waveforms")


@openecho.command()
@RECORDING
@click.option("--waveform", type=click.IntRange(0), required=True, help="Which, from 0.")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    callback=in_folder,
    help="Picture to write: .png, .svg, .pdf.  [default: a window]",
)
@ENGINE
@TAPS
@settings
def plot(file: Path, waveform: int, output: Path | None, engine: str, **chosen: Any) -> None:
    """Draw one waveform of FILE: raw, filtered, echoes, their sum, and what they leave."""
    with formats.open(file) as recording:
        if waveform >= recording.waveforms:
            raise click.UsageError(f"--waveform {waveform}: expected 0 to {recording.waveforms - 1}, those of {file}")
        block = recording.read(waveform, 1)
        config = _check(longest=recording.longest, **chosen)
        check_bits(recording.path, block, config.sample_w)
        found = tabulate(ENGINES[engine](block.samples, block.length, config), config, recording.bin_ns)
        title = f"{file.name}, waveform {waveform}"
        drawn = figure.draw(found, block.samples, block.length, config, {title: 0}, recording.bin_ns)
    if output is None:
        figure.show(drawn)
    else:
        figure.save(drawn, output)
        click.echo(f"{output}: {len(found.echoes)} echoes")


@openecho.command()
@RECORDING
@click.option("--reference", type=click.Path(path_type=Path), help="GEDI L2A granule of the same orbit as FILE.")
@click.option(
    "--taps",
    "tap_sets",
    type=click.Choice(list(TAP_SETS)),
    multiple=True,
    default=list(TAP_SETS),
    help="Filter of the core; may be given again.  [default: all]",
)
@ENGINE
@settings
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), callback=in_folder, help="Also write the figures as JSON."
)
def score(
    file: Path, reference: Path | None, tap_sets: tuple[str, ...], engine: str, output: Path | None, **chosen: Any
) -> None:
    """Judge the echoes of FILE by what others found in it, and by the waveforms themselves.

    References are the keys ref_* of an .npz, or a GEDI L2A granule beside an L1B one: the share of their modes that
    an echo's peak is within 1 and 3 bins of, echoes that they have nothing near, and the ground. Without any, and
    beside them: RMSE and R² of the sum of echoes, and what it leaves.
    """
    results = {}
    with formats.open(file) as recording, progress("waveforms") as advance:
        references = formats.references(recording, reference)
        for taps in tap_sets:
            config = _check(longest=recording.longest, taps=taps, **chosen)
            told = partial(_tell, advance, f"taps {taps}", recording.waveforms)
            results[taps] = judge.score(recording, references, config, engine, told)
    console = Console(highlight=False)
    for table in judge.tables(results):
        console.print(table)
    if output is not None:
        content = {"tools": report.tools("numpy"), "source": file.name, "engine": engine, **chosen, "taps": results}
        report.save(output, content)


def _check(**chosen: Any) -> Config:
    """Core with these settings; a wrong one is a matter of usage."""
    try:
        return configure(**chosen)
    except ValueError as error:
        raise click.UsageError(str(error)) from error


class Rate(ProgressColumn):
    """Things a second."""

    def render(self, task: Task) -> Text:
        """Show the rate of a task."""
        return Text(f"{task.speed:,.0f}/s" if task.speed else "", style="progress.data.speed")


@contextmanager
def progress(unit: str) -> Iterator[batch.Advance]:
    """Bar with rate and time left on standard error; gives what is to be told of the progress."""
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit), Rate()
    console = Console(stderr=True)
    hidden = not console.is_terminal
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True, disable=hidden) as bars:
        tasks: dict[str, Any] = {}

        def advance(doing: str, done: int, total: int | None) -> None:
            if doing not in tasks:
                tasks[doing] = bars.add_task(doing, total=total, completed=done)
            bars.update(tasks[doing], completed=done)

        yield advance


def _tell(advance: batch.Advance, doing: str, total: int, done: int) -> None:
    """Tell of progress where only `done` changes."""
    advance(doing, done, total)


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
