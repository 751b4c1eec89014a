"""Whole files: the same bytes however the work was cut, shared out, or interrupted."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import distributed
import numpy as np
import pytest

from openecho import batch, formats, stimulus, tables
from openecho.batch.store import open_store
from openecho.decompose import COLUMNS, decompose
from tests.test_formats_hdf5 import gedi

SMALL = 8000
"""Samples in a block here, so that a small file has several."""


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formats.recording, "BLOCK", SMALL)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers, each a process of its own."""
    local = cast("Any", distributed.LocalCluster)  # comes without types
    with local(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as running:
        yield running


@pytest.fixture
def source(tmp_path: Path) -> Path:
    made = stimulus.reference_set()
    path = tmp_path / "waveforms.npz"
    np.savez(path, samples=made.samples, length=made.length, bin_ns=2.0)
    return path


def job(source: Path, name: str, **changed: Any) -> batch.Job:
    arguments: dict[str, Any] = {"method": "inflection", "bin_ns": None, "settings": {}, "jobs": 1} | changed
    return batch.Job(source, source.with_name(name), **arguments)


def test_a_file_has_the_echoes_of_its_waveforms(source: Path) -> None:
    made = stimulus.reference_set()
    expected = decompose(made.samples, made.length, bin_ns=2.0, taps="lvis", k=4)
    result = batch.decompose_file(job(source, "echoes.npz", settings={"taps": "lvis", "k": 4}))
    with np.load(source.with_name("echoes.npz")) as found:
        for name in expected.echoes.dtype.names or ():
            np.testing.assert_array_equal(found[name], expected.echoes[name], err_msg=name)
    assert result == batch.Result(40, len(expected.echoes), len(expected.echoes), 0, {})
    assert sorted(path.name for path in source.parent.iterdir()) == ["echoes.npz", "waveforms.npz"]


def test_progress_counts_every_waveform(source: Path) -> None:
    told: list[tuple[str, int, int | None]] = []
    batch.decompose_file(job(source, "echoes.csv"), lambda *news: told.append(news))
    assert told == [*(("decomposing", done, 40) for done in (0, 7, 14, 21, 28, 35, 40)), ("writing", 0, None)]


@pytest.mark.parametrize("suffix", list(tables.WRITERS))
def test_neither_interrupts_nor_workers_change_a_byte(suffix: str, tmp_path: Path, cluster: Any) -> None:
    source = tmp_path / "granule.h5"
    gedi(source, {"BEAM0000": [1200, 900, 1000] * 5, "BEAM0110": [800] * 20})
    settings = {"k": 0, "sample_w": 11}
    batch.decompose_file(job(source, f"one{suffix}", settings=settings))

    def interrupt(doing: str, done: int, total: int | None) -> None:
        if done > 15:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch.decompose_file(job(source, f"broken{suffix}", settings=settings), interrupt)
    assert not source.with_name(f"broken{suffix}").exists()
    resumed = batch.decompose_file(job(source, f"broken{suffix}", settings=settings))
    assert 15 < resumed.resumed < resumed.waveforms == 35
    address = cluster.scheduler_address
    batch.decompose_file(job(source, f"shared{suffix}", settings=settings, jobs=None, scheduler=address))
    one, broken, shared = (source.with_name(f"{name}{suffix}").read_bytes() for name in ("one", "broken", "shared"))
    assert one == broken
    assert one == shared


def test_processes_of_a_local_cluster_give_the_same_bytes(source: Path) -> None:
    batch.decompose_file(job(source, "one.csv"))
    batch.decompose_file(job(source, "two.csv", jobs=2))
    assert source.with_name("one.csv").read_bytes() == source.with_name("two.csv").read_bytes()


def test_what_a_recording_tells_becomes_columns(tmp_path: Path) -> None:
    source = tmp_path / "granule.h5"
    written = gedi(source, {"BEAM0000": [1200] * 9, "BEAM0110": [800] * 9})
    batch.decompose_file(job(source, "echoes.npz", settings={"k": 0}))
    with np.load(source.with_name("echoes.npz")) as found:
        echoes = {name: found[name] for name in found}
    assert [name for name in echoes if name != "bin_ns"] == [column.name for column in COLUMNS if column.needs != "fit"]
    shots = np.concatenate([beam["shot_number"] for beam in written.values()])
    times = np.concatenate([beam["delta_time"] for beam in written.values()])
    np.testing.assert_array_equal(echoes["shot"], shots[echoes["waveform"]])
    np.testing.assert_array_equal(echoes["shot_time"], times[echoes["waveform"]])
    np.testing.assert_array_equal(echoes["beam"], np.where(echoes["waveform"] < 9, "BEAM0000", "BEAM0110"))


def test_blocks_of_other_settings_are_refused_and_kept(source: Path) -> None:
    def interrupt(doing: str, done: int, total: int | None) -> None:
        if done > 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch.decompose_file(job(source, "echoes.csv"), interrupt)
    kept = sorted(source.with_name("echoes.csv.partial").iterdir())
    assert [path.name for path in kept] == ["000000.npz", "000001.npz", "job.json"]
    with pytest.raises(batch.StoreError, match=r"found blocks of a job with k 3\.0, expected 4: ") as caught:
        batch.decompose_file(job(source, "echoes.csv", settings={"k": 4}))
    assert "\n" not in str(caught.value)
    assert sorted(source.with_name("echoes.csv.partial").iterdir()) == kept


def test_a_recording_that_has_changed_is_not_resumed(source: Path) -> None:
    def interrupt(doing: str, done: int, total: int | None) -> None:
        if done > 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch.decompose_file(job(source, "echoes.csv"), interrupt)
    made = stimulus.reference_set(1)
    np.savez(source, samples=made.samples, length=made.length, bin_ns=2.0)
    with pytest.raises(batch.StoreError, match="found blocks of a job with modified "):
        batch.decompose_file(job(source, "echoes.csv"))


def test_two_processes_do_not_work_on_one_result(tmp_path: Path) -> None:
    output = tmp_path / "echoes.csv"
    with (
        open_store(output, {}),
        pytest.raises(batch.StoreError, match="found another process at work on it"),
        open_store(output, {}),
    ):
        pass


def test_a_damaged_block_or_description_is_told_in_one_line(tmp_path: Path) -> None:
    output = tmp_path / "echoes.csv"
    with open_store(output, {"k": 3}) as store:
        store.put(0, echoes=np.zeros(3))
        (store.folder / "000000.npz").write_bytes(b"PK")
        with pytest.raises(batch.StoreError, match=r"000000\.npz: .*expected a block; without this file") as caught:
            store.get(0, "echoes")
        assert "\n" not in str(caught.value)
    (tmp_path / "echoes.csv.partial" / "job.json").write_text("{")
    with pytest.raises(batch.StoreError, match=r"job\.json: not readable"), open_store(output, {"k": 3}):
        pass


def test_a_block_that_was_being_written_does_not_count(tmp_path: Path) -> None:
    with open_store(tmp_path / "echoes.csv", {}) as store:
        store.put(3, echoes=np.zeros(3))
        (store.folder / "000004.new").write_bytes(b"half")
        assert store.finished() == {3}
        assert json.loads((store.folder / "job.json").read_text()) == {}


def test_a_job_that_fails_at_once_leaves_nothing(source: Path) -> None:
    with pytest.raises(formats.DataError, match=r"samples of waveform .*, expected 0 to 255"):
        batch.decompose_file(job(source, "echoes.csv", settings={"sample_w": 8}))
    assert sorted(path.name for path in source.parent.iterdir()) == ["waveforms.npz"]


def test_no_scheduler_is_told_in_one_line(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch.distribute, "TIMEOUT", 1)
    with pytest.raises(batch.DistributionError, match=r"^tcp://127\.0\.0\.1:9: no answer within 1 s, expected"):
        batch.decompose_file(job(source, "echoes.csv", jobs=None, scheduler="tcp://127.0.0.1:9"))


def test_an_error_on_a_worker_is_the_same_error(source: Path, cluster: Any) -> None:
    elsewhere = job(source, "echoes.csv", settings={"sample_w": 8}, jobs=None, scheduler=cluster.scheduler_address)
    with pytest.raises(formats.DataError, match="samples of waveform"):
        batch.decompose_file(elsewhere)
