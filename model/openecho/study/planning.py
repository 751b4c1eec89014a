"""What a scene requires, as tables for a terminal: effects, rays, reach, and the time against full fidelity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rich import box
from rich.table import Table

from openecho.scene.geometry.world import Built, build
from openecho.scene.plan import Pilot, Plan, pilot, plan
from openecho.scene.schema import Scene


@dataclass(frozen=True)
class Planned:
    """A plan, and what it takes beside full fidelity.

    Attributes
    ----------
    built : Built
    plan : Plan
    pilot, full : Pilot
        A few shots as planned, and with every effect and all rays.
    """

    built: Built
    plan: Plan
    pilot: Pilot
    full: Pilot


def compare(scene: Scene, fidelity: str = "plan", rays: int | None = None) -> Planned:
    """Plan a scene, and try it on a few shots; arguments as of `openecho.scene.plan.plan`."""
    built = build(scene)
    chosen = plan(scene, built, fidelity, rays)
    return Planned(built, chosen, pilot(scene, built, chosen), pilot(scene, built, plan(scene, built, "full")))


def tables(found: Planned) -> list[Table]:
    """Tables of effects, of rays, and of what was spared."""
    return [_effects(found.plan), _cost(found)]


def _effects(chosen: Plan) -> Table:
    title = f"an echo of up to {chosen.peak:.0f} counts, noise {chosen.noise:.2f}, tolerance {chosen.tolerance:.2f}"
    table = Table(box=box.SIMPLE, title=title, title_justify="left")
    for name in ("effect", "counts", "tolerances", "modelled", "cost"):
        table.add_column(name, justify="right" if name in ("counts", "tolerances") else "left")
    for effect in chosen.effects:
        amounts = f"{effect.counts:.3g}", f"{effect.share:.3g}"
        table.add_row(effect.name, *amounts, "yes" if effect.kept else "no", effect.cost)
    return table


def _cost(found: Planned) -> Table:
    table = Table(box=box.SIMPLE)
    table.add_column("required")
    table.add_column("planned", justify="right")
    table.add_column("full", justify="right")
    both = found.pilot, found.full
    table.add_row("rays a footprint, mean", *(f"{one.rays.mean():,.0f}" for one in both))
    for count in np.unique(np.concatenate([one.rays for one in both])):
        name = {0: "meeting nothing", 1: "smooth, of closed form"}.get(int(count), f"of {count} rays")
        table.add_row(f"  {name}", *(f"{(one.rays == count).mean():.1%}" for one in both))
    table.add_row("samples with light", *(f"{one.lit:.1%}" for one in both))
    table.add_row("ms a waveform", *(f"{one.milliseconds:.3f}" for one in both))
    for key, (there, kept) in found.built.spared.items():
        table.add_row(f"{key} in reach", f"{kept:,}", f"{there:,}")
    return table
