"""Commands from echoes to terrain."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from openecho.cli.common import in_folder, optional, progress


def _a_file(meaning: str, *names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Option of another file to write."""
    return click.option(*names, type=click.Path(path_type=Path), callback=in_folder, help=meaning)


def _of_filter(meaning: str, usual: float, name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Option of a setting of the ground filter."""
    return click.option(name, type=float, help=f"{meaning}  [default: {usual:g}; more where points are sparse]")


@click.command()
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
    job = optional("openecho.batch.surface")
    if chosen["jobs"] is not None and chosen["scheduler"] is not None:
        raise click.UsageError("found --jobs and --scheduler, expected one of them: a cluster has its own workers")
    given = {name: value for name, value in chosen.items() if value is not None}
    names = {"building": "cell", **{name: name for name in ("angle", "distance", "spacing", "tolerance")}}
    settings = {own: given.pop(name) for name, own in names.items() if name in given}
    try:
        optional("openecho.surface.ground").Filter(**settings)
    except ValueError as error:
        raise click.UsageError(f"--{str(error).replace('cell', 'building', 1)}") from error
    with progress("points") as advance:
        made = job.surface_file(job.Surfacing(echoes, output, settings=settings, **given), advance)
    rows, columns = made.grid.shape
    told = f"{made.points} points, {made.ground} of them ground, {made.unknown} none"
    click.echo(f"{output}: {rows} × {columns} cells of {told}")


@click.command()
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
    shown = optional("openecho.study.surface_view")
    page = Path(tempfile.mkdtemp(prefix="openecho-")) / f"{file.stem}.html" if output is None else output
    told = shown.write(file, page, truth=truth, most=shown.MOST if most is None else most)
    click.echo(f"{page}: {told}")
    if output is None:
        click.launch(str(page))
