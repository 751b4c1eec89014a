"""Scenes into files: the same bytes however the work was cut, shared out or interrupted; and what is in them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import distributed
import h5py
import numpy as np
import psutil
import pytest
import yaml

from openecho import formats
from openecho.batch import StoreError
from openecho.batch.simulate import Simulation, simulate_file
from openecho.formats import writers
from openecho.formats.references import references
from openecho.scene import simulate
from openecho.scene.geometry.flight import beams
from openecho.scene.geometry.world import build
from openecho.scene.instrument import instrument
from openecho.scene.returns import Rays, returns
from openecho.scene.schema import Scene, bundled, bundled_files, load, loads
from tests.test_cli import Run, refused, run

__all__ = ["run"]

SHOTS = 300


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulate, "BLOCK", 128)
    monkeypatch.setattr(writers, "AT_ONCE", 128)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers, each a process of its own."""
    local = cast("Any", distributed.LocalCluster)  # comes without types
    with local(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as running:
        yield running


def woodland(**changed: Any) -> Scene:
    return load("woodland").model_copy(update={"shots": SHOTS} | changed)


def changed_scene(**changed: Any) -> Scene:
    """The flat ice with some of its sections changed."""
    data = yaml.safe_load(bundled_files()["ice"].read_text())
    for key, value in changed.items():
        data[key] = data[key] | value if isinstance(value, dict) else value
    return loads(yaml.safe_dump(data), Path("scene.yaml"))


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_neither_interrupts_nor_workers_change_a_byte(suffix: str, tmp_path: Path, cluster: Any) -> None:
    whole, broken, shared = (tmp_path / f"{name}{suffix}" for name in ("whole", "broken", "shared"))
    told: list[tuple[str, int, int | None]] = []
    simulate_file(Simulation(woodland(), whole), lambda *progress: told.append(progress))
    assert told[:4] == [("simulating", done, SHOTS) for done in (0, 128, 256, 300)]

    def interrupt(doing: str, done: int, _: int | None) -> None:
        if (doing, done) == ("simulating", 256):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_file(Simulation(woodland(), broken), interrupt)
    assert not broken.exists()
    result = simulate_file(Simulation(woodland(), broken))
    assert (result.waveforms, result.resumed) == (SHOTS, 256)
    simulate_file(Simulation(woodland(), shared, scheduler=cluster.scheduler_address))
    assert whole.read_bytes() == broken.read_bytes() == shared.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in (whole, broken, shared))


def interrupted(job: Simulation) -> None:
    """Break a job off when its first block is made."""

    def interrupt(doing: str, done: int, _: int | None) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_file(job, interrupt)


def test_blocks_of_another_scene_are_refused_with_the_key_that_differs(tmp_path: Path) -> None:
    interrupted(Simulation(woodland(seed=1), tmp_path / "waves.npz"))
    with pytest.raises(StoreError, match="found blocks of a job with seed 1, expected 2: ") as caught:
        simulate_file(Simulation(woodland(seed=2), tmp_path / "waves.npz"))
    assert "\n" not in str(caught.value)


def test_a_scene_with_a_file_that_has_changed_is_not_resumed_and_its_targets_are_made_anew(tmp_path: Path) -> None:
    def sheet(height: float) -> None:
        corners = [(x, y, height) for x, y in ((-100, -100), (100, -100), (100, 100), (-100, 100))]
        vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
        (tmp_path / "sheet.obj").write_text(f"{vertices}f 1 2 3\nf 1 3 4\n")

    sheet(10)
    file = {"kind": "mesh", "file": str(tmp_path / "sheet.obj"), "sheet": True, "reflectance": {"albedo": 0.3}}
    scene = changed_scene(targets=[file], shots=SHOTS, platform={"speed": "0 m/s", "scan": None})
    job = Simulation(scene, tmp_path / "waves.npz")
    simulate_file(job)
    interrupted(job)
    sheet(20)
    with pytest.raises(StoreError, match=r"found blocks of a job with files \[\['.*sheet\.obj', ") as caught:
        simulate_file(job)
    assert "\n" not in str(caught.value)
    higher = Simulation(scene, tmp_path / "higher.npz")
    assert simulate_file(higher).resumed == 0
    with np.load(job.output) as before, np.load(higher.output) as after:
        np.testing.assert_allclose(before["truth"]["range"] - after["truth"]["range"], 10, atol=1e-3)


def test_another_seed_gives_other_waveforms(tmp_path: Path) -> None:
    for seed in (1, 2):
        simulate_file(Simulation(woodland(seed=seed), tmp_path / f"{seed}.npz"))
    one, other = (np.load(tmp_path / f"{seed}.npz")["samples"] for seed in (1, 2))
    assert (one != other).any(axis=1).all()


def test_an_npz_is_a_recording_with_positions_truth_and_scene(tmp_path: Path) -> None:
    path = tmp_path / "waves.npz"
    result = simulate_file(Simulation(woodland(), path, noiseless=True))
    with np.load(path) as file:
        truth, noiseless, text = file["truth"], file["noiseless"], str(file["scene"])
        assert loads(text, Path("scene.yaml")) == woodland()
    with formats.open(path) as recording:
        assert (recording.waveforms, recording.longest, recording.bin_ns) == (SHOTS, 384, 1.0)
        assert recording.coordinates == "x, y, z (metres)"
        block = recording.read(0, SHOTS)
        (reference,) = references(recording)
    assert len(truth) == result.surfaces
    assert (reference.name, len(reference.waveform)) == ("truth", len(truth))
    # Noise is all that parts both: its deviation of 3 counts, and that of the light's own.
    assert abs(block.samples - noiseless.astype(np.float64)).max() < 120
    assert abs((block.samples - noiseless).mean()) < 0.1
    assert block.geolocation is not None
    solid = truth[~np.isnan(truth["incidence"])]
    row, share = solid["waveform"], solid["bin"] / 383
    first, last = block.geolocation.first[row], block.geolocation.last[row]
    height = (first + share[:, None] * (last - first))[:, 2]
    # Ground within four deviations of the relief, 2 m.
    assert abs(height).max() < 8
    assert np.array_equal(reference.ground[row], solid["bin"])


def test_hdf5_is_an_lvis_granule(tmp_path: Path) -> None:
    flat, granule = tmp_path / "waves.npz", tmp_path / "waves.h5"
    for path in (flat, granule):
        simulate_file(Simulation(woodland(), path, noiseless=True))
    with formats.open(flat) as one, formats.open(granule) as other:
        here, there = one.read(0, SHOTS), other.read(0, SHOTS)
        assert (other.format, other.bin_ns) == ("LVIS L1B", 1.0)
    assert np.array_equal(here.samples, there.samples)
    assert np.array_equal(there.shot if there.shot is not None else [], np.arange(SHOTS))
    assert here.geolocation is not None
    assert there.geolocation is not None
    assert np.array_equal(here.geolocation.last[:, 2], there.geolocation.last[:, 2])
    # A degree on the equator is 111.32 km, one of a meridian there 110.57 km: NGA.STND.0036, WGS 84.
    metres = there.geolocation.first[:, :2] * [111319.49, 110574.28]
    assert abs(metres - here.geolocation.first[:, :2]).max() < 1e-4
    with h5py.File(granule) as file, np.load(flat) as archive:
        assert file["TRUTH"][:].tobytes() == archive["truth"].tobytes()  # nan is the incidence of leaves
        assert np.array_equal(file["NOISELESS"][:], archive["noiseless"])
        assert file["SHOTNUMBER"][:].tolist() == list(range(SHOTS))
        assert file["TXWAVE"][0].max() == 512
        assert (file["TXWAVE"][:] == file["TXWAVE"][0]).all()


@pytest.mark.parametrize("name", list(bundled()))
def test_a_plan_changes_no_waveform_beyond_the_tolerance(name: str) -> None:
    scene = load(name)
    built, chain = build(scene), instrument(scene)
    aimed = beams(scene, np.linspace(0, scene.shots - 1, max(2, 200 // scene.beams)).astype(np.int64))
    full = returns(built, chain, aimed, Rays(2**12, False, scene.tolerance))
    planned = returns(built, chain, aimed, Rays(2**12, True, scene.tolerance))
    allowed = scene.tolerance.allowed(chain.dark + chain.shot * full.waveform)
    assert np.array_equal(planned.start, full.start)
    assert (abs(planned.waveform - full.waveform) <= allowed).all()


def test_a_beam_that_meets_nothing_records_noise() -> None:
    scene = changed_scene(targets=[], shots=200)
    made = simulate.simulate(simulate.simulator(scene), 0, 200)
    assert len(made.truth) == 0
    assert (made.noiseless == 200).all()
    assert made.samples.std() == pytest.approx(0.95, abs=0.05)


def test_the_command_says_what_it_made_and_from_which_seed(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "waves.npz"
    status, out, err = run("simulate", "ice", "-o", path, "--shots", 50, "--seed", 7)
    assert (status, out, err) == (0, f"{path}: 50 waveforms, 50 surfaces met, seed 7\n", "")


def test_a_plan_is_printed_with_every_effect_and_its_cost(run: Run) -> None:
    status, out, _ = run("scene", "plan", "ice")
    assert status == 0
    assert re.search(r"extinction +\d+ +[\d.]+ +yes +an exponential", out)
    assert re.search(r"speckle +0 +0 +no ", out)
    assert re.search(r"smooth, of closed form +100\.0% +0\.0%", out)


def test_what_cannot_be_simulated_is_one_line(run: Run, tmp_path: Path) -> None:
    refused(
        run("simulate", "ice", "-o", tmp_path / "waves.txt"), "waves.txt: found the suffix .txt, expected .npz, .h5"
    )
    refused(run("simulate", "ice", "-o", tmp_path / "no" / "waves.npz"), "no folder", "expected one")
    refused(run("simulate", "nowhere", "-o", tmp_path / "waves.npz"), "nowhere: no such scene, expected a YAML file")
    refused(run("simulate", "ice", "-o", tmp_path / "waves.npz", "--rays", 100), "found 100, expected a power of two")
    refused(run("simulate", "ice", "-o", tmp_path / "waves.npz", "--shots", 4 * 10**9), "ice: shots: found 4000000000")
    both = ("--jobs", 2, "--scheduler", "tcp://127.0.0.1:1")
    refused(run("simulate", "ice", "-o", tmp_path / "waves.npz", *both), "expected one of them")
    assert not list(tmp_path.iterdir())


def test_a_file_of_the_scene_that_is_of_no_use_is_named_with_its_key(run: Run, tmp_path: Path) -> None:
    data = yaml.safe_load(bundled_files()["ice"].read_text())
    (tmp_path / "bare.npy").write_bytes(b"nothing")
    mesh = {"kind": "mesh", "file": "bare.stl", "reflectance": {"albedo": 0.3}}
    (tmp_path / "bare.stl").write_bytes(b"solid bare\nendsolid bare\n")
    pulse = {"laser": data["laser"] | {"pulse": {"shape": "measured", "file": "bare.npy", "interval": "1 ns"}}}
    for changed, key in (({"targets": [mesh]}, "targets[0].file"), (pulse, "laser.pulse.file")):
        path = tmp_path / "scene.yaml"
        path.write_text(yaml.safe_dump(data | changed))
        refused(run("simulate", path, "-o", tmp_path / "waves.npz"), f"{path}: {key}: ", "expected")
        refused(run("scene", "plan", path), f"{path}: {key}: ", "expected")
    assert not (tmp_path / "waves.npz.partial").exists()


def test_more_memory_than_there_is_is_one_line(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = psutil.virtual_memory()._replace(available=1000)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: there)
    for name, key in (("woodland", "targets[0].relief.cell"), ("roofs", "targets[1].size")):
        refused(run("simulate", name, "-o", tmp_path / "waves.npz"), f"{name}: {key}: ", "GB, expected at most")
