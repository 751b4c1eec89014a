"""Commands on scenes, and their simulation."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from openecho.cli.common import PICTURE, optional, progress
from openecho.study import figure


@click.group()
def scene() -> None:
    """Scenes that a lidar flies over, each a YAML file, and those that are bundled."""


@scene.command("list")
def list_scenes() -> None:
    """Name the bundled scenes, which are taken by name wherever a file is."""
    for name, description in optional("openecho.scene.schema").bundled().items():
        click.echo(f"{name:12}{description}")


SCENE = click.argument("scene", callback=lambda _, __, name: named(name))
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
    with naming(scene):
        planning = optional("openecho.study.planning")
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
    with naming(scene):
        drawn = optional("openecho.study.scene_view").draw(scene.scene, waveforms)
    if output is None:
        figure.show(drawn)
    else:
        figure.save(drawn, output)
        click.echo(f"{output}: {scene.name}")


@click.command()
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
    with naming(scene):
        world = optional("openecho.scene.schema").changed(scene.scene, **chosen)
    simulation = optional("openecho.batch.simulate")
    job = simulation.Simulation(world, output, fidelity, rays, noiseless, jobs or 1, scheduler)
    try:
        with naming(scene), progress("waveforms") as advance:
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
    scenes = optional("openecho.scene.schema")
    click.echo(json.dumps(scenes.json_schema(), indent=2) if as_json else scenes.described())


@dataclass(frozen=True)
class Named:
    """A scene, and what the user called it."""

    name: str
    scene: Any


def named(name: str) -> Named:
    """A scene by its name or its file; a wrong one is a matter of usage."""
    schema = optional("openecho.scene.schema")
    try:
        return Named(name, schema.load(name))
    except schema.SceneError as error:
        raise click.UsageError(str(error)) from error


@contextmanager
def naming(scene: Named) -> Iterator[None]:
    """Name the scene in an error of what it needs."""
    try:
        yield
    except optional("openecho.scene.schema").SceneError as error:
        raise click.UsageError(f"{scene.name}: {error}") from error
    except ModuleNotFoundError as error:
        raise click.UsageError(str(error)) from error


def _power_of_two(count: int | None) -> int | None:
    if count is not None and not (1 <= count <= 2**16 and count & (count - 1) == 0):
        raise click.BadParameter(f"found {count}, expected a power of two from 1 to 65536")
    return count
