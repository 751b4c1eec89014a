"""What a recording is told to be, on recordings that are known sample by sample."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from openecho import formats
from openecho.formats.survey import lines
from tests.test_formats_hdf5 import gedi, lvis


def surveyed(path: Path, samples: Any, length: Any = None, **arrays: Any) -> tuple[formats.Survey, dict[str, str]]:
    """Survey and what is printed of it, of an ``.npz`` with these arrays."""
    rows: NDArray[Any] = np.asarray(samples)
    lengths = np.full(len(rows), rows.shape[1]) if length is None else np.array(length)
    np.savez(path / "a.npz", samples=rows, length=lengths, **arrays)
    with formats.open(path / "a.npz") as recording:
        found = formats.survey(recording)
        return found, dict(lines(recording, found))


def test_lengths_and_counts_are_those_of_recorded_samples(tmp_path: Path) -> None:
    found, told = surveyed(tmp_path, [[7, 9, 5, 0], [6, 300, 8, 9], [8, 8, 0, 0]], [3, 4, 2])
    assert found.length.tolist() == [3, 4, 2]
    assert (found.least, found.greatest) == (5, 300)
    assert told["samples a waveform"] == "2 3 4"
    assert told["samples"] == "9"
    assert told["counts"] == "5 to 300, 9 bits"
    assert told["sample interval"] == "not in the file"
    assert "length" not in told
    assert "shot numbers" not in told
    assert told["no noise"] == "3 waveforms of fewer than 50 samples"


def test_clipped_are_neighbours_at_the_greatest_count_of_the_whole_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clipped, once, lower = [1, 9, 9, 1], [9, 1, 9, 1], [8, 8, 8, 1]
    for size in (1, 2, 100):
        monkeypatch.setattr(formats.recording, "BLOCK", 4 * size)
        found, told = surveyed(tmp_path, [lower, once, clipped, lower, clipped])
        assert (found.greatest, found.clipped) == (9, 2)
        assert told["clipped"] == "2 waveforms, 40.00%"
    # What is past the end of a waveform is no sample.
    found, _ = surveyed(tmp_path, [[0, 0, 0, 0]], [1])
    assert (found.greatest, found.clipped) == (0, 0)


def test_noise_is_that_of_the_first_50_samples(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    samples = rng.integers(10, 20, (3, 60))
    samples[:, 50:] = 200
    samples[1] = 7
    found, told = surveyed(tmp_path, samples, [60, 50, 49])
    first = samples[0, :50].astype(float)
    assert found.noise_mean.tolist() == [first.mean(), 7]
    assert found.noise_deviation == pytest.approx([first.std(), 0], rel=1e-12)
    off = first - first.mean()
    assert found.noise_correlation[0] == pytest.approx((off[:-1] * off[1:]).mean() / first.var(), rel=1e-12)
    assert np.isnan(found.noise_correlation[1])
    assert told["no noise"] == "1 waveforms of fewer than 50 samples"
    assert told["noise lag 1"] == f"{found.noise_correlation[0]:.2f}"


def test_noise_that_never_varies_has_no_correlation(tmp_path: Path) -> None:
    _, told = surveyed(tmp_path, np.full((2, 60), 7), bin_ns=2.0)
    assert told["noise lag 1"] == "constant"
    assert told["noise mean"] == "7.00 7.00 7.00 counts"
    assert told["sample interval"] == "2 ns"
    assert told["length"] == "120.0 120.0 120.0 ns"


def test_extent_is_that_of_both_ends_where_they_are_numbers(tmp_path: Path) -> None:
    written = lvis(tmp_path / "a", 432, 431, lon0=np.array([1, np.nan, 3, 4, 5.0]), z431=np.full(5, np.nan, "f4"))
    with formats.open(tmp_path / "a") as recording:
        found = formats.survey(recording)
        told = dict(lines(recording, found))
    assert found.extent is not None
    assert found.extent[0, 0] == min(1, written["lon431"].min())
    assert found.extent[1, 0] == max(5, written["lon431"].max())
    assert found.extent[:, 2].tolist() == [written["z0"].min(), written["z0"].max()]
    assert found.time == (written["time"].min(), written["time"].max())
    assert told["time"].endswith(" seconds of the UTC day")
    assert told["x"] == f"{found.extent[0, 0]:.9g} to {found.extent[1, 0]:.9g}"


def test_beams_shots_and_progress_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = [np.array([2**64 - 1, 8], "u8"), np.array([3, 5, 2**53 + 1], "u8")]
    gedi(tmp_path / "a", {"BEAM0000": [60, 50], "BEAM0110": [40] * 3})
    with h5py.File(tmp_path / "a", "r+") as file:
        for beam, number in zip(("BEAM0000", "BEAM0110"), numbers, strict=True):
            file[beam]["shot_number"][...] = number
    monkeypatch.setattr(formats.recording, "BLOCK", 120)
    done: list[int] = []
    with formats.open(tmp_path / "a") as recording:
        found = formats.survey(recording, done.append)
        told = lines(recording, found)
    assert done == [2, 4, 5]
    assert told[3:5] == [("BEAM0000", "2 waveforms"), ("BEAM0110", "3 waveforms")]
    assert found.shot == (2**64 - 1, 2**53 + 1)
    assert told[-1] == ("shot numbers", f"{2**64 - 1} to {2**53 + 1}")


def test_recorded_waveforms_are_what_their_description_says(recorded: Path) -> None:
    with formats.open(recorded / "gedi_cerrado.npz") as recording:
        found = formats.survey(recording)
        told = dict(lines(recording, found))
    assert (len(found.length), found.length.min(), found.length.max(), found.greatest) == (946, 746, 1420, 1382)
    assert told["sample interval"] == "1 ns"
    assert 0.8 < np.median(found.noise_correlation) < 0.95
