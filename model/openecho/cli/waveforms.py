"""Commands on recorded waveforms: what is in them, their echoes, their worth, compression."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from openecho import batch, formats, report, tables
from openecho.cli.common import (
    METHOD,
    PICTURE,
    RECORDING,
    in_folder,
    optional,
    options_of,
    prepared,
    progress,
    settings,
    tell,
)
from openecho.decompose import METHODS
from openecho.decompose.inflection import Inflection
from openecho.formats.recording import check_bits
from openecho.formats.survey import lines
from openecho.golden import TAP_SETS
from openecho.study import figure
from openecho.study import score as judge


@click.command()
@RECORDING
def info(file: Path) -> None:
    """Tell what is in FILE: waveforms, sample interval, lengths, noise, saturation, extent.

    Of lengths least, median and greatest; of the noise the 5th, 50th and 95th percentile over the waveforms, taken
    from their first 50 samples as the core does. A waveform is clipped if two neighbouring samples have the file's
    greatest count.
    """
    with formats.open(file) as recording:
        with progress("waveforms") as advance:
            found = formats.survey(recording, partial(tell, advance, "reading", recording.waveforms))
        for name, text in lines(recording, found):
            click.echo(f"{name:20}{text}")


@click.command()
@RECORDING
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    help=f"Table of echoes to write: {', '.join(tables.WRITERS)}.",
)
@METHOD
@settings()
@click.option("--bin-ns", type=click.FloatRange(0, min_open=True), help="Sample interval where FILE doesn't tell it.")
@click.option("--jobs", type=click.IntRange(1), help="Processes on this machine.  [default: all that pay]")
@click.option("--scheduler", metavar="ADDRESS", help="Hand the blocks to this Dask cluster, as tcp://host:8786.")
def decompose(
    file: Path,
    output: Path,
    method: str,
    bin_ns: float | None,
    jobs: int | None,
    scheduler: str | None,
    **chosen: Any,
) -> None:
    """Find the echoes of all waveforms in FILE.

    Memory stays bounded for files of any size. An interrupted run goes on where it was when the same command is given
    again; the result appears when it is complete.
    """
    given = options_of(method, chosen)
    prepared(method, 0, given)
    if jobs is not None and scheduler is not None:
        raise click.UsageError("found --jobs and --scheduler, expected one of them: a cluster has its own workers")
    job = batch.Job(file, output, method, bin_ns, given, jobs, scheduler)
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


@click.command()
@RECORDING
@click.option("--waveform", type=click.IntRange(0), required=True, help="Which, from 0.")
@PICTURE
@METHOD
@settings()
def plot(file: Path, waveform: int, output: Path | None, method: str, **chosen: Any) -> None:
    """Draw one waveform of FILE: raw, echoes, their sum, what they leave, and how the core found them."""
    with formats.open(file) as recording:
        if waveform >= recording.waveforms:
            raise click.UsageError(f"--waveform {waveform}: expected 0 to {recording.waveforms - 1}, those of {file}")
        block = recording.read(waveform, 1)
        ready = prepared(method, recording.longest, options_of(method, chosen))
        check_bits(recording.path, block, ready.sample_w)
        found = ready(block.samples, block.length, recording.bin_ns)
        config = ready.config if isinstance(ready, Inflection) else None
        title = f"{file.name}, waveform {waveform}"
        drawn = figure.draw(found, block.samples, block.length, config, {title: 0}, recording.bin_ns)
    if output is None:
        figure.show(drawn)
    else:
        figure.save(drawn, output)
        click.echo(f"{output}: {len(found.echoes)} echoes")


@click.command()
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
@click.option(
    "--method",
    "methods",
    type=click.Choice(METHODS),
    multiple=True,
    default=["inflection"],
    show_default=True,
    help="May be given again.",
)
@settings("taps")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), callback=in_folder, help="Also write the figures as JSON."
)
def score(
    file: Path,
    reference: Path | None,
    tap_sets: tuple[str, ...],
    methods: tuple[str, ...],
    output: Path | None,
    **chosen: Any,
) -> None:
    """Judge the echoes of FILE by what others found in it, and by the waveforms themselves.

    References are the keys ref_* of an .npz, or a GEDI L2A granule beside an L1B one: the share of their modes that
    an echo's peak is within 1 and 3 bins of, echoes that they have nothing near, and the ground. Without any, and
    beside them: RMSE and R² of the sum of echoes, and what it leaves.
    """
    given = {method: options_of(method, chosen, *methods) for method in methods}
    trials = [(name, method, chosen) for method, chosen in given.items() if method != "inflection" for name in [method]]
    if "inflection" in given:
        trials = [(taps, "inflection", {"taps": taps, **given["inflection"]}) for taps in tap_sets] + trials
    results = {}
    with formats.open(file) as recording, progress("waveforms") as advance:
        references = formats.references(recording, reference)
        for name, method, own in trials:
            ready = prepared(method, recording.longest, own)
            told = partial(tell, advance, name, recording.waveforms)
            results[name] = judge.score(recording, references, ready, told)
    console = Console(highlight=False)
    for table in judge.tables(results):
        console.print(table)
    if output is not None:
        content = {"tools": report.tools("numpy"), "source": file.name, "settings": given, "methods": results}
        report.save(output, content)


@click.command()
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    callback=in_folder,
    help="File to write, or a folder for several.  [default: FILE with .oec]",
)
@click.option(
    "--mode",
    type=click.Choice(["prediction", "threshold"]),
    default="prediction",
    show_default=True,
    help="Adaptive Golomb-Rice codes of prediction errors, or the published threshold coding at its best threshold.",
)
@click.option("--bits", type=click.IntRange(1, 16), help="Of a sample.  [default: those of the greatest count]")
@click.option("--verify", is_flag=True, help="Decode everything and compare it with FILE before the result is kept.")
def compress(files: tuple[Path, ...], output: Path | None, mode: str, bits: int | None, verify: bool) -> None:
    """Compress the waveforms of each FILE without loss; every other command reads the result.

    Waveforms, positions, times and shot numbers are kept; what else a file has, as references or the transmitted pulse,
    is not. The ratio is to samples of as many bits as they need, end to end.
    """
    results = _compressed_names(files, output)
    for file, made in zip(files, results, strict=True):
        job = batch.Compression(file, made, optional("openecho.codec").MODES.index(mode), bits, verify)
        start = time.perf_counter()
        try:
            with progress("waveforms") as advance:
                result = batch.compress_file(job, advance)
        except KeyboardInterrupt:
            click.echo("the same command goes on where this one was", err=True)
            raise
        seconds = time.perf_counter() - start
        if result.resumed:
            click.echo(f"{result.resumed} waveforms were compressed by an earlier run")
        raw = result.samples * result.bits / 8
        click.echo(
            f"{made}: {result.waveforms} waveforms, {result.samples} samples of {result.bits} bits in "
            f"{8 * result.size / result.samples:.3f} each, ratio {raw / result.size:.3f}, "
            f"{result.size} bytes of {file.stat().st_size}, "
            f"{result.samples / seconds / 1e6:.1f} million samples/s" + (", verified" if verify else "")
        )


@click.command()
@RECORDING
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    callback=in_folder,
    help="Waveforms to write, .npz.  [default: FILE with .npz]",
)
def decompress(file: Path, output: Path | None) -> None:
    """Write the waveforms of FILE, compressed or not, as .npz."""
    made = file.with_suffix(".npz") if output is None else output
    if made.suffix.lower() != ".npz":
        raise click.UsageError(f"{made}: found the suffix {made.suffix or 'none'}, expected .npz")
    _not_itself(file, made)
    optional("openecho.codec")
    with progress("waveforms") as advance:
        waveforms, left_out = batch.decompress_file(file, made, advance)
    for name in left_out:
        click.echo(f"{name} left out: there is no place for them in an .npz")
    click.echo(f"{made}: {waveforms} waveforms")


def _compressed_names(files: tuple[Path, ...], output: Path | None) -> list[Path]:
    """What compressed files are called, each another than all others and than what is read."""
    if output is None:
        results = [file.with_suffix(".oec") for file in files]
    elif output.is_dir():
        results = [output / file.with_suffix(".oec").name for file in files]
    elif len(files) > 1:
        raise click.UsageError(f"{output}: found no folder, expected one for several files")
    elif output.suffix.lower() != ".oec":
        raise click.UsageError(f"{output}: found the suffix {output.suffix or 'none'}, expected .oec")
    else:
        results = [output]
    before: dict[Path, Path] = {}
    for file, made in zip(files, results, strict=True):
        for other in files:
            _not_itself(other, made)
        if (first := before.setdefault(made.resolve(), file)) is not file:
            raise click.UsageError(f"{made}: found it as the result of {first} and of {file}, expected one of each")
    return results


def _not_itself(file: Path, made: Path) -> None:
    if made.resolve() == file.resolve():
        raise click.UsageError(f"{made}: found the same file for input and output, expected another")
