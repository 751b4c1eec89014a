"""The command ``openecho``: recorded waveforms in, echoes and what they are worth out."""

from __future__ import annotations

import importlib
import json
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from click.core import ParameterSource
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from openecho import __version__, batch, formats, report, tables
from openecho.decompose import CRITERIA, ENGINES, METHODS, STARTS, WIDTHS, EngineError, Method, prepare
from openecho.decompose.inflection import Inflection
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


PICTURE = click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    callback=in_folder,
    help="Picture to write: .png, .svg, .pdf.  [default: a window]",
)


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="openecho")
def openecho() -> None:
    """Echoes out of full-waveform lidar, bit for bit as the OpenEcho core finds them.

    FILE is an LVIS or GEDI L1B granule (HDF5), LAS 1.3 or 1.4 with waveform packets, PulseWaves, .oec, .npz or .npy.
    """


def numbers(_: click.Context, __: click.Parameter, text: str | None) -> tuple[float, ...] | None:
    """Numbers with commas between them."""
    try:
        return None if text is None else tuple(float(number) for number in text.split(","))
    except ValueError as error:
        raise click.BadParameter(f"found {text!r}, expected numbers with commas between them") from error


def recorded_pulse(_: click.Context, __: click.Parameter, path: Path | None) -> tuple[float, ...] | None:
    """Transmitted pulse, the mean if there are several, out of an .npy file."""
    if path is None:
        return None
    try:
        pulse = np.load(path, allow_pickle=False)
    except ValueError as error:
        raise click.BadParameter(f"{path}: found no .npy file, expected one") from error
    if not isinstance(pulse, np.ndarray) or pulse.ndim not in (1, 2) or pulse.dtype.kind not in "iuf":
        raise click.BadParameter(f"{path}: found no array of one or two dimensions, expected a pulse, or one a row")
    return tuple(np.atleast_2d(pulse).mean(axis=0).tolist())


CORE = {
    "engine": click.option(
        "--engine",
        type=click.Choice(list(ENGINES)),
        default="model",
        show_default=True,
        help="The golden model, or the RTL in simulation (in a checkout): the same bits.",
    ),
    "taps": click.option(
        "--taps", type=click.Choice(list(TAP_SETS)), default="paper", show_default=True, help="Filter of the core."
    ),
    "arithmetic": click.option(
        "--arith", "arithmetic", type=click.Choice(list(ARITHMETICS)), default="fixed", show_default=True
    ),
    "sample_w": click.option(
        "--sample-w", type=int, default=Config.sample_w, show_default=True, help="Bits of the digitiser."
    ),
    "n": click.option("--n", type=float, default=Config.n, show_default=True, help="Divisor of the width, Eq (7)."),
    "min_interval": click.option(
        "--min-interval",
        type=int,
        default=Config.min_interval,
        show_default=True,
        help="Bins that the inflections of an echo are further apart than.",
    ),
    "min_amplitude": click.option(
        "--min-amplitude",
        type=int,
        default=Config.min_amplitude,
        show_default=True,
        help="Least amplitude of an echo, counts.",
    ),
    "k": click.option(
        "--k",
        type=float,
        default=Config.k,
        show_default=True,
        help="Least amplitude of an echo, deviations of the noise.",
    ),
}
"""Settings of the method inflection: what the core is built with and set to, as `configure` takes it."""

FIT = {
    "width": click.option(
        "--width", type=float, default=5.0, show_default=True, help="σ of a usual echo, bins; √2 τ of a laser's."
    ),
    "widths": click.option("--widths", type=click.Choice(WIDTHS), default="free", show_default=True),
    "most": click.option("--most", type=click.IntRange(0), default=16, show_default=True, help="Echoes of a waveform."),
    "least": click.option(
        "--least",
        type=float,
        default=4.0,
        show_default=True,
        help="Height that is worth an echo's trial, deviations of the noise behind a matched filter.",
    ),
    "criterion": click.option(
        "--criterion",
        type=click.Choice(list(CRITERIA)),
        default="ebic",
        show_default=True,
        help="By which an echo has to pay.",
    ),
    "start": click.option(
        "--start", type=click.Choice(STARTS), default="inflection", show_default=True, help="First guess of the echoes."
    ),
    "noise": click.option("--noise", type=float, help="Deviation of the noise, counts.  [default: measured]"),
    "correlation": click.option(
        "--correlation",
        metavar="1,R1,R2,…",
        callback=numbers,
        help="Autocorrelation of the noise from lag 0 on.  [default: white]",
    ),
    "misfit": click.option(
        "--misfit",
        type=float,
        default=0.0,
        show_default=True,
        help="Share of its height that a waveform may differ by from a sum of such shapes; 0.01 for most recordings.",
    ),
    "saturation": click.option(
        "--saturation", type=float, help="Counts from which on the digitiser clips: such samples have no say."
    ),
    "epsilon": click.option("--epsilon", type=float, help="Of Vondrák's smoothing, method vl.  [default: by --width]"),
    "rough": click.option(
        "--rough", is_flag=True, help="Convolve the laser template, of this --width, with the height of rough targets."
    ),
    "transmitted": click.option(
        "--pulse",
        "transmitted",
        type=click.Path(exists=True, dir_okay=False, path_type=Path),
        callback=recorded_pulse,
        help="Take this transmitted pulse for the laser template: .npy, counts, one sample a bin.",
    ),
}
"""Settings of the methods that fit, as `openecho.decompose.fitting.Fitting` takes them."""


def settings(*without: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Options of all methods, but for some."""
    options = [option for name, option in {**CORE, **FIT}.items() if name not in without]

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorated


METHOD = click.option(
    "--method",
    type=click.Choice(METHODS),
    default="inflection",
    show_default=True,
    help="As the core does it; or by least squares, with Gaussians, with the laser template, or with that and first "
    "guesses behind Vondrák's smoothing.",
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
    given = _given(method, chosen)
    _prepare(method, 0, given)
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


@openecho.command()
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
        ready = _prepare(method, recording.longest, _given(method, chosen))
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
    given = {method: _given(method, chosen, *methods) for method in methods}
    trials = [(name, method, chosen) for method, chosen in given.items() if method != "inflection" for name in [method]]
    if "inflection" in given:
        trials = [(taps, "inflection", {"taps": taps, **given["inflection"]}) for taps in tap_sets] + trials
    results = {}
    with formats.open(file) as recording, progress("waveforms") as advance:
        references = formats.references(recording, reference)
        for name, method, own in trials:
            ready = _prepare(method, recording.longest, own)
            told = partial(_tell, advance, name, recording.waveforms)
            results[name] = judge.score(recording, references, ready, told)
    console = Console(highlight=False)
    for table in judge.tables(results):
        console.print(table)
    if output is not None:
        content = {"tools": report.tools("numpy"), "source": file.name, "settings": given, "methods": results}
        report.save(output, content)


@openecho.command()
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
        job = batch.Compression(file, made, _optional("openecho.codec").MODES.index(mode), bits, verify)
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


@openecho.command()
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
    _optional("openecho.codec")
    with progress("waveforms") as advance:
        waveforms, left_out = batch.decompress_file(file, made, advance)
    for name in left_out:
        click.echo(f"{name} left out: there is no place for them in an .npz")
    click.echo(f"{made}: {waveforms} waveforms")


def _a_file(meaning: str, *names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Option of another file to write."""
    return click.option(*names, type=click.Path(path_type=Path), callback=in_folder, help=meaning)


def _of_filter(meaning: str, usual: float, name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Option of a setting of the ground filter."""
    return click.option(name, type=float, help=f"{meaning}  [default: {usual:g}; more where points are sparse]")


@openecho.command()
@click.argument("echoes", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), required=True, callback=in_folder, help="Elevation model, .tif."
)
@_a_file("Heights of the highest points, .tif.", "--dsm")
@_a_file("Heights over the ground, .tif.", "--canopy")
@_a_file("Light on the ground, .tif.", "--hillshade")
@_a_file("All points with their classes, .las or .laz.", "--points")
@_a_file("Triangles of the ground, .ply.", "--mesh")
@click.option("--cell", type=float, default=1.0, show_default=True, help="Side of a grid's squares, m.")
@click.option("--smoothing", type=click.FloatRange(0), default=0.0, show_default=True, help="σ over the heights, m.")
@click.option("--reach", type=click.FloatRange(0, min_open=True), help="How far from points heights go, m.")
@_of_filter("Longer than any building, m.", 25, "--building")
@_of_filter("Under which ground is seen, degrees.", 8, "--angle")
@_of_filter("Of new ground from what is known, m.", 1.4, "--distance")
@_of_filter("Of the corners of the network, m.", 1.5, "--spacing")
@_of_filter("Of ground about the network, m.", 0.3, "--tolerance")
@click.option("--lowest", type=float, help="Height that is believed, m.  [default: -11000]")
@click.option("--highest", type=float, help="Height that is believed, m.  [default: 10000]")
@click.option("--system", metavar="EPSG:NUMBER", help="Coordinate system, or what to project degrees into.")
@click.option("--jobs", type=click.IntRange(1), help="Processes on this machine.  [default: 1]")
@click.option("--scheduler", metavar="ADDRESS", help="Hand the tiles to this Dask cluster, as tcp://host:8786.")
def surface(echoes: Path, output: Path, **chosen: Any) -> None:
    """Make terrain of ECHOES, a table as decompose writes it or any LAS: what is ground, and heights on a grid.

    Points that are none, alone in the air or below the ground, are marked and kept. The ground is found by a network of
    triangles that grows from the lowest points.
    """
    job = _optional("openecho.batch.surface")
    if chosen["jobs"] is not None and chosen["scheduler"] is not None:
        raise click.UsageError("found --jobs and --scheduler, expected one of them: a cluster has its own workers")
    given = {name: value for name, value in chosen.items() if value is not None}
    names = {"building": "cell", **{name: name for name in ("angle", "distance", "spacing", "tolerance")}}
    settings = {own: given.pop(name) for name, own in names.items() if name in given}
    try:
        _optional("openecho.surface.ground").Filter(**settings)
    except ValueError as error:
        raise click.UsageError(f"--{str(error).replace('cell', 'building', 1)}") from error
    with progress("points") as advance:
        made = job.surface_file(job.Surfacing(echoes, output, settings=settings, **given), advance)
    rows, columns = made.grid.shape
    told = f"{made.points} points, {made.ground} of them ground, {made.unknown} none"
    click.echo(f"{output}: {rows} × {columns} cells of {told}")


@openecho.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    callback=in_folder,
    help="Page to write, .html.  [default: a browser's window]",
)
@_a_file("Heights that it should have, .tif, to colour it by what it is off.", "--truth")
@click.option("--most", type=click.IntRange(4), help="Points or heights to draw at most.  [default: 200000]")
def view(file: Path, output: Path | None, truth: Path | None, most: int | None) -> None:
    """Show FILE in space, as a page of its own to turn and zoom: echoes with places, points, a grid or triangles.

    .csv, .npz, .parquet, .las, .laz; .tif; .ply. Coloured by class, height, intensity, or error.
    """
    shown = _optional("openecho.study.surface_view")
    page = Path(tempfile.mkdtemp(prefix="openecho-")) / f"{file.stem}.html" if output is None else output
    told = shown.write(file, page, truth=truth, most=shown.MOST if most is None else most)
    click.echo(f"{page}: {told}")
    if output is None:
        click.launch(str(page))


@openecho.group()
def scene() -> None:
    """Scenes that a lidar flies over, each a YAML file, and those that are bundled."""


@scene.command("list")
def list_scenes() -> None:
    """Name the bundled scenes, which are taken by name wherever a file is."""
    for name, description in _optional("openecho.scene.schema").bundled().items():
        click.echo(f"{name:12}{description}")


SCENE = click.argument("scene", callback=lambda _, __, name: _scene(name))
FIDELITY = click.option(
    "--fidelity",
    type=click.Choice(["plan", "full"]),
    default="plan",
    show_default=True,
    help="What the scene requires; or every effect and all rays, however little they change.",
)
RAYS = click.option(
    "--rays", type=int, callback=lambda _, __, count: _power_of_two(count), help="Rays of every beam: a power of two."
)


@scene.command("plan")
@SCENE
@FIDELITY
@RAYS
def plan_scene(scene: Any, fidelity: str, rays: int | None) -> None:
    """Say what simulating SCENE requires: effects, rays, targets in reach, and time; and why.

    Effects are left out from those that matter least on, as long as all that are left out together move no count by
    more than the scene's tolerance.
    """
    with _naming(scene):
        planning = _optional("openecho.study.planning")
        found = planning.compare(scene.scene, fidelity, rays)
    console = Console(highlight=False)
    for part in planning.tables(found):
        console.print(part)


@scene.command("view")
@SCENE
@PICTURE
@click.option("--waveforms", type=click.IntRange(1, 12), default=4, show_default=True, help="How many to draw.")
def view_scene(scene: Any, output: Path | None, waveforms: int) -> None:
    """Draw SCENE: heights with the beams on them, one scan from the side, and a few waveforms with their truth."""
    with _naming(scene):
        drawn = _optional("openecho.study.scene_view").draw(scene.scene, waveforms)
    if output is None:
        figure.show(drawn)
    else:
        figure.save(drawn, output)
        click.echo(f"{output}: {scene.name}")


@openecho.command()
@SCENE
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), required=True, help="Waveforms to write: .npz, or .h5 as LVIS."
)
@click.option("--shots", type=click.IntRange(1), help="Pulses.  [default: the scene's]")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), help="Of all that is random.  [default: the scene's]")
@FIDELITY
@RAYS
@click.option("--noiseless", is_flag=True, help="Keep the waveforms without noise, too.")
@click.option("--jobs", type=click.IntRange(1), help="Processes on this machine, each on all processors.  [default: 1]")
@click.option("--scheduler", metavar="ADDRESS", help="Hand the blocks to this Dask cluster, as tcp://host:8786.")
def simulate(
    scene: Any,
    output: Path,
    shots: int | None,
    seed: int | None,
    fidelity: str,
    rays: int | None,
    noiseless: bool,
    jobs: int | None,
    scheduler: str | None,
) -> None:
    """Record the waveforms of SCENE, a YAML file or a bundled scene, with the truth about each.

    Memory stays bounded for any number of shots. An interrupted run goes on where it was when the same command is given
    again; the result appears when it is complete, and is the same for any number of processes.
    """
    if jobs is not None and scheduler is not None:
        raise click.UsageError("found --jobs and --scheduler, expected one of them: a cluster has its own workers")
    chosen = {name: value for name, value in (("shots", shots), ("seed", seed)) if value is not None}
    with _naming(scene):
        world = _optional("openecho.scene.schema").changed(scene.scene, **chosen)
    simulation = _optional("openecho.batch.simulate")
    job = simulation.Simulation(world, output, fidelity, rays, noiseless, jobs or 1, scheduler)
    try:
        with _naming(scene), progress("waveforms") as advance:
            result = simulation.simulate_file(job, advance)
    except KeyboardInterrupt:
        click.echo("the same command goes on where this one was", err=True)
        raise
    if result.resumed:
        click.echo(f"{result.resumed} waveforms were simulated by an earlier run")
    click.echo(f"{output}: {result.waveforms} waveforms, {result.surfaces} surfaces met, seed {world.seed}")


@scene.command("schema")
@click.option("--json", "as_json", is_flag=True, help="As JSON Schema, for editors.")
def scene_schema(as_json: bool) -> None:
    """Say what a scene is made of: every key, its unit, what is assumed where it is left out, and what it means."""
    scenes = _optional("openecho.scene.schema")
    click.echo(json.dumps(scenes.json_schema(), indent=2) if as_json else scenes.described())


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


def _optional(module: str) -> Any:
    """A module of this package that needs packages which nothing else does."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise click.UsageError(str(error)) from error


@dataclass(frozen=True)
class _Named:
    """A scene, and what the user called it."""

    name: str
    scene: Any


def _scene(name: str) -> _Named:
    schema = _optional("openecho.scene.schema")
    try:
        return _Named(name, schema.load(name))
    except schema.SceneError as error:
        raise click.UsageError(str(error)) from error


@contextmanager
def _naming(scene: _Named) -> Iterator[None]:
    """Name the scene in an error of what it needs."""
    try:
        yield
    except _optional("openecho.scene.schema").SceneError as error:
        raise click.UsageError(f"{scene.name}: {error}") from error
    except ModuleNotFoundError as error:
        raise click.UsageError(str(error)) from error


def _power_of_two(count: int | None) -> int | None:
    if count is not None and not (1 <= count <= 2**16 and count & (count - 1) == 0):
        raise click.BadParameter(f"found {count}, expected a power of two from 1 to 65536")
    return count


def _given(method: str, chosen: Mapping[str, Any], *others: str) -> dict[str, Any]:
    """What was chosen for a method; whatever belongs to none of those that run is a matter of usage."""
    context = click.get_current_context()
    own = CORE if method == "inflection" else FIT
    wanted = {name for other in (method, *others) for name in (CORE if other == "inflection" else FIT)}
    for name, value in chosen.items():
        if name not in wanted and context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"found {name} {value}, expected only options of method {method}")
    return {name: value for name, value in chosen.items() if name in own and value is not None}


def _prepare(method: str, longest: int, given: Mapping[str, Any]) -> Method:
    """Take a method with its settings; a wrong one is a matter of usage."""
    try:
        return prepare(method, longest, given)
    except (ValueError, ModuleNotFoundError) as error:
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
