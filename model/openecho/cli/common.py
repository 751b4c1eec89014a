"""What commands share: arguments, options of the methods, progress, rooms that need packages of their own."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np
from click.core import ParameterSource
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from openecho import batch
from openecho.decompose import CRITERIA, ENGINES, METHODS, STARTS, WIDTHS, Method, prepare
from openecho.golden import ARITHMETICS, TAP_SETS, Config

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


def optional(module: str) -> Any:
    """A module of this package that needs packages which nothing else does."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise click.UsageError(str(error)) from error


def options_of(method: str, chosen: Mapping[str, Any], *others: str) -> dict[str, Any]:
    """What was chosen for a method; whatever belongs to none of those that run is a matter of usage."""
    context = click.get_current_context()
    own = CORE if method == "inflection" else FIT
    wanted = {name for other in (method, *others) for name in (CORE if other == "inflection" else FIT)}
    for name, value in chosen.items():
        if name not in wanted and context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"found {name} {value}, expected only options of method {method}")
    return {name: value for name, value in chosen.items() if name in own and value is not None}


def prepared(method: str, longest: int, given: Mapping[str, Any]) -> Method:
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


def tell(advance: batch.Advance, doing: str, total: int, done: int) -> None:
    """Tell of progress where only `done` changes."""
    advance(doing, done, total)
