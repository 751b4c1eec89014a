"""What a scene requires: effects are left out only as long as nobody could tell."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from openecho.scene.geometry.world import build
from openecho.scene.instrument import EFFECTS, instrument
from openecho.scene.plan import MOST_RAYS, plan
from openecho.scene.schema import Scene, bundled, bundled_files, load, loads
from openecho.scene.simulate import simulate, simulator


def ice(**changed: Any) -> Scene:
    """The flat ice with some keys of its sections changed."""
    data = yaml.safe_load(bundled_files()["ice"].read_text())
    for section, keys in changed.items():
        data[section] = data[section] | keys if isinstance(keys, dict) else keys
    return loads(yaml.safe_dump(data), Path("scene.yaml"))


def kept(scene: Scene) -> frozenset[str]:
    return plan(scene, build(scene)).kept


@pytest.mark.parametrize("name", list(bundled()))
def test_all_that_is_left_out_stays_below_the_tolerance(name: str) -> None:
    scene = load(name)
    found = plan(scene, build(scene))
    assert sorted(effect.name for effect in found.effects) == sorted(EFFECTS)
    assert [effect.share for effect in found.effects] == sorted((e.share for e in found.effects), reverse=True)
    assert found.tolerance == max(0.5, 0.1 * found.noise)
    left_out = [effect for effect in found.effects if not effect.kept]
    assert sum(effect.share for effect in left_out) <= 1
    # The least of those that are modelled would have been one too many.
    assert sum(e.share for e in left_out) + min(e.share for e in found.effects if e.kept) > 1
    # Dark noise counts where there is no light; what grows with the light, at the peak of the brightest echo.
    dark = next(effect for effect in found.effects if effect.name == "bulk dark current")
    assert dark.share == pytest.approx(dark.counts / found.tolerance)
    view = next(effect for effect in found.effects if effect.name == "field of view")
    chain = instrument(scene)
    allowed = max(0.5, 0.1 * (chain.dark + chain.shot * found.peak) ** 0.5)
    assert view.share == pytest.approx(view.counts / allowed)


def test_a_calm_flight_at_300_m_needs_no_turbulence_and_a_long_way_through_strong_does() -> None:
    calm = ice(
        platform={"altitude": "300 m"},
        receiver={"field_of_view": "1.5 mrad"},
        atmosphere={"visibility": "23 km", "cn2": "1e-17 m^(-2/3)"},
    )
    assert not {"turbulence spread", "scintillation"} & kept(calm)
    strong = ice(
        platform={"altitude": "5 km"},
        receiver={"aperture": "1 m"},
        atmosphere={"visibility": "23 km", "cn2": "1e-13 m^(-2/3)"},
    )
    assert {"turbulence spread", "scintillation"} <= kept(strong)


def test_clear_air_is_not_modelled_and_haze_is() -> None:
    assert "extinction" not in kept(ice(atmosphere={"visibility": "10000 km"}))
    assert "extinction" in kept(ice(atmosphere={"visibility": "2 km"}))


def test_speckle_is_modelled_where_the_scene_has_it() -> None:
    assert "speckle" not in kept(ice())
    assert "speckle" in kept(ice(speckle=4))


def test_full_fidelity_forces_every_effect_and_all_rays() -> None:
    scene = load("sea")
    found = plan(scene, build(scene), "full")
    assert found.kept == set(EFFECTS)
    assert (found.rays.most, found.rays.adaptive) == (MOST_RAYS, False)


def test_rays_may_be_given() -> None:
    scene = load("forest")
    ready = simulator(scene, rays=256)
    assert (ready.plan.rays.most, ready.plan.rays.adaptive) == (256, False)


def test_what_is_left_out_moves_no_waveform_by_more_than_the_tolerance() -> None:
    scene = load("woodland")
    planned, full = simulator(scene, rays=256), simulator(scene, "full", rays=256)
    assert planned.plan.kept < full.plan.kept
    one, other = (simulate(ready, 0, 200) for ready in (planned, full))
    chain = full.instrument
    light = other.noiseless.astype(np.float64) - scene.digitiser.offset
    allowed = scene.tolerance.allowed(chain.dark + chain.shot * np.maximum(light, 0))
    assert (abs(one.noiseless - other.noiseless) <= allowed).all()
    # The same random numbers in both: what is left is the noise that is left out, and rounding.
    assert (abs(one.samples.astype(int) - other.samples) <= allowed + 1).all()
