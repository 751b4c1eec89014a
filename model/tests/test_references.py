"""What others found in the same waveforms: from the keys of an .npz, and from a GEDI L2A beside its L1B."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import h5py
import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from openecho import formats
from openecho.formats import DataError, Reference
from tests import fuzz
from tests.test_formats_hdf5 import gedi

NAN = np.nan


def npz(path: Path | io.BytesIO, n: int = 4, **arrays: Any) -> None:
    """Write n waveforms with `arrays` beside them."""
    np.savez(path, samples=np.full((n, 9), 3, np.uint16), length=np.full(n, 9), **arrays)


def references(path: Path, l2a: Path | None = None) -> dict[str, Reference]:
    """References by name, each checked for what `Reference` promises."""
    with formats.open(path) as recording:
        found = formats.references(recording, l2a)
        for one in found:
            assert one.waveform.dtype == np.int64
            assert one.waveform.shape == one.position.shape
            assert one.ground.shape == one.judged.shape == (recording.waveforms,)
            assert ((one.position >= -1) & (one.position <= 65536)).all()
            assert one.judged[one.waveform].all()
            assert np.isnan(one.ground[~one.judged]).all()
            order = np.lexsort((one.position, one.waveform))
            np.testing.assert_array_equal(order, np.arange(len(order)))
    return {one.name: one for one in found}


def modes(reference: Reference) -> list[list[float]]:
    """Positions of each waveform."""
    return [reference.position[reference.waveform == row].tolist() for row in range(len(reference.judged))]


A1: dict[str, Any] = {
    "ref_a1_modelocs": np.array([[5, 2.5, NAN], [1, 2, 3], [7, NAN, NAN], [NAN, NAN, NAN]], np.float32),
    "ref_a1_nummodes": np.array([2, 255, 1, 0], np.uint8),
}


def test_an_npz_without_references_has_none(tmp_path: Path) -> None:
    npz(tmp_path / "a.npz", ref_rh=np.zeros((4, 101)), ref_a1_modeamps=np.zeros((4, 3)))
    assert references(tmp_path / "a.npz") == {}


def test_other_recordings_have_none_of_their_own(tmp_path: Path) -> None:
    gedi(tmp_path / "a", {"BEAM0000": [5]})
    assert references(tmp_path / "a") == {}


def test_npz_modes_are_as_many_as_their_number_says_and_in_order(tmp_path: Path) -> None:
    npz(tmp_path / "a.npz", **A1)
    found = references(tmp_path / "a.npz")["a1"]
    assert modes(found) == [[2.5, 5], [], [7], []]
    assert found.judged.tolist() == [True, False, True, True]
    assert np.isnan(found.ground).all()


@pytest.mark.parametrize("number", [np.array([2, 4, 1, 0]), np.array([2, -1, 1, 0]), np.array([2, 255, 1, 0])])
def test_a_number_that_the_table_has_no_room_for_is_no_judgement(tmp_path: Path, number: Any) -> None:
    npz(tmp_path / "a.npz", **A1 | {"ref_a1_nummodes": number})
    assert references(tmp_path / "a.npz")["a1"].judged.tolist() == [True, False, True, True]


def test_npz_waveforms_without_modes_are_not_judged(tmp_path: Path) -> None:
    fit = np.array([4, 5, NAN, 7])
    npz(tmp_path / "a.npz", has_modes=np.array([True, True, True, False]), ref_g1_gloc=fit, **A1)
    found = references(tmp_path / "a.npz")
    assert found["a1"].judged.tolist() == [True, False, True, False]
    assert found["g1"].judged.tolist() == [True, True, False, False]
    assert modes(found["g1"]) == [[4], [5], [], []]


def test_ground_is_the_settings_own_and_the_common_one_for_the_others(tmp_path: Path) -> None:
    npz(
        tmp_path / "a.npz",
        ref_a1_zcross=np.array([5.5, 6, -9999, 8], np.float32),
        ref_g1_gloc=np.array([4, 5, NAN, 7]),
        ref_a2_modelocs=np.zeros((4, 1)),
        ref_a2_nummodes=np.array([0, 255, 1, 1]),
        ref_ground_bin=np.array([1.25, 2, 3, NAN]),
        **A1,
    )
    found = references(tmp_path / "a.npz")
    np.testing.assert_array_equal(found["a1"].ground, [5.5, NAN, NAN, NAN])
    np.testing.assert_array_equal(found["a2"].ground, [1.25, NAN, 3, NAN])
    np.testing.assert_array_equal(found["g1"].ground, [1.25, 2, NAN, NAN])


def test_decomposition_counts_rows_and_bins_from_one(tmp_path: Path) -> None:
    rows = np.array([[3, 90, 8.5, 2], [1, 80, 4, 2], [3, 70, 1, 2]], float)
    npz(tmp_path / "a.npz", ref_decomposition=rows, ref_ground_bin=np.arange(4))
    found = references(tmp_path / "a.npz")["decomposition"]
    assert modes(found) == [[3], [], [0, 7.5], []]
    assert found.judged.tolist() == [True, False, True, False]
    np.testing.assert_array_equal(found.ground, [0, NAN, 2, NAN])


def test_settings_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    table: dict[str, Any] = {
        f"ref_a{number}_{key}": value
        for number in (10, 2, 1)
        for key, value in (("modelocs", np.zeros((4, 1))), ("nummodes", np.ones(4, int)))
    }
    npz(tmp_path / "a.npz", ref_g1_gloc=np.zeros(4), ref_decomposition=np.ones((1, 3)), **table)
    assert list(references(tmp_path / "a.npz")) == ["a1", "a2", "a10", "g1", "decomposition"]


def test_tables_are_read_piece_by_piece_as_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    npz(tmp_path / "a.npz", **A1)
    monkeypatch.setattr(sys.modules[Reference.__module__], "SCANNED", 4)
    assert modes(references(tmp_path / "a.npz")["a1"]) == [[2.5, 5], [], [7], []]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"ref_a1_nummodes": None}, "no key ref_a1_nummodes, expected it beside ref_a1_modelocs"),
        ({"ref_a1_nummodes": np.zeros(4)}, "ref_a1_nummodes are of dtype float64, expected integers"),
        ({"ref_a1_nummodes": np.zeros(3, int)}, r"ref_a1_nummodes has shape \(3,\), expected \(4,\)"),
        ({"ref_a1_modelocs": np.zeros(4)}, r"ref_a1_modelocs has shape \(4,\), expected \(4, k\)"),
        ({"ref_a1_modelocs": np.zeros((5, 3))}, r"ref_a1_modelocs has shape \(5, 3\), expected \(4, k\)"),
        ({"ref_a1_modelocs": np.full((4, 3), "x")}, "ref_a1_modelocs are of dtype <U1, expected integers or floats"),
        ({"ref_a1_modelocs": np.full((4, 3), {})}, "ref_a1_modelocs are of dtype object, expected numbers: allow_pick"),
        ({"ref_a1_modelocs": np.full((4, 3), NAN)}, "ref_a1_modelocs of row 0 is at bin nan, expected -1 to 65536"),
        ({"ref_a1_modelocs": np.full((4, 3), -1.5)}, "ref_a1_modelocs of row 0 is at bin -1.5, expected -1 to 65536"),
        ({"ref_a1_modelocs": np.full((4, 3), np.inf)}, "ref_a1_modelocs of row 0 is at bin inf, expected"),
        ({"ref_a1_zcross": np.zeros((4, 1))}, r"ref_a1_zcross has shape \(4, 1\), expected \(4,\)"),
        ({"ref_ground_bin": np.zeros(2)}, r"ref_ground_bin has shape \(2,\), expected \(4,\)"),
        ({"has_modes": np.zeros(4)}, "has_modes are of dtype float64, expected booleans"),
        ({"ref_g1_gloc": np.array([1, 2, np.inf, 3])}, "ref_g1_gloc of row 2 is at bin inf, expected -1 to 65536"),
        ({"ref_decomposition": np.ones((2, 2))}, r"ref_decomposition has shape \(2, 2\), expected at least three"),
        ({"ref_decomposition": np.ones(3)}, r"ref_decomposition has shape \(3,\), expected \(m, k\)"),
        ({"ref_decomposition": np.full((1, 3), 5)}, "row 0 is waveform 5, expected a whole number from 1 to 4"),
        ({"ref_decomposition": np.full((1, 3), 1.5)}, "row 0 is waveform 1.5, expected a whole number from 1 to 4"),
        ({"ref_decomposition": np.full((1, 3), NAN)}, "row 0 is waveform nan, expected a whole number from 1 to 4"),
        ({"ref_decomposition": np.array([[1, 9, -9]])}, "ref_decomposition of row 0 is at bin -10.0, expected -1 to"),
    ],
)
def test_bad_keys_are_told_in_one_line(tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    npz(tmp_path / "a.npz", **{key: value for key, value in (A1 | changed).items() if value is not None})
    with pytest.raises(DataError, match=message) as error:
        references(tmp_path / "a.npz")
    assert str(error.value).startswith(str(tmp_path / "a.npz"))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("number", range(1, 7))
def test_ground_of_recorded_gedi_settings_is_one_of_their_modes(number: int, recorded: Path) -> None:
    found = references(recorded / "gedi_cerrado.npz")[f"a{number}"]
    with np.load(recorded / "gedi_cerrado.npz") as stored:
        count = np.where(stored["has_modes"], stored[f"ref_a{number}_nummodes"], 0)
        np.testing.assert_array_equal(found.judged, stored["has_modes"])
        np.testing.assert_array_equal(found.ground, stored[f"ref_a{number}_zcross"])
    np.testing.assert_array_equal(np.bincount(found.waveform, minlength=len(count)), count)
    at_ground = found.waveform[found.position == found.ground[found.waveform]]
    np.testing.assert_array_equal(at_ground, np.flatnonzero(found.judged))


def test_recorded_neon_modes_stand_above_the_start_of_their_waveforms(recorded: Path) -> None:
    found = references(recorded / "neon_harvard.npz")["decomposition"]
    assert (int(found.judged.sum()), len(found.position)) == (482, 713)
    with np.load(recorded / "neon_harvard.npz") as stored:
        samples, length = stored["samples"], stored["length"]
    bin = np.rint(found.position).astype(int)
    assert (bin < length[found.waveform]).all()
    assert (samples[found.waveform, bin] > samples[found.waveform, 0]).mean() > 0.9


BEAMS = {"BEAM0000": [4, 5, 6], "BEAM0101": [3, 3], "BEAM1011": [7]}
"""Samples of each waveform of the L1B; `gedi` numbers the shots of each beam from `SHOT` on."""

SHOT = 19640119100108615


def l2a(path: Path | io.BytesIO, beams: dict[str, dict[str, Any]]) -> None:
    """Write a GEDI L2A granule: datasets of each beam by their path in it, None leaves one out."""
    with h5py.File(path, "w") as file:
        file.create_group("METADATA")
        for beam, data in beams.items():
            file.create_group(beam)
            for name, value in data.items():
                if value is not None:
                    file[f"{beam}/{name}"] = value


def setting(number: int, count: list[int], locations: Any, zcross: list[float]) -> dict[str, Any]:
    group = f"rx_processing_a{number}"
    return {
        f"{group}/rx_nummodes": np.array(count, np.uint8),
        f"{group}/rx_modelocs": np.array(locations, np.float32).reshape(len(count), -1),
        f"{group}/zcross": np.array(zcross, np.float32),
    }


def first_beam(**changed: Any) -> dict[str, dict[str, Any]]:
    """All shots of BEAM0000 with one setting."""
    data = {"shot_number": SHOT + np.arange(3, dtype=np.uint64)}
    data |= setting(1, [2, 1, 1], [[1, 2.5], [4.25, 0], [5, 0]], [2.5, 4.25, 5])
    return {"BEAM0000": data | changed}


@pytest.fixture
def granule(tmp_path: Path) -> Path:
    """L1B of `BEAMS`."""
    gedi(tmp_path / "l1b", BEAMS)
    return tmp_path / "l1b"


def test_l2a_shots_are_found_by_their_number(granule: Path, tmp_path: Path) -> None:
    l2a(
        tmp_path / "l2a",
        {
            # In another order, with one of another granule, and without the second.
            "BEAM0000": {"shot_number": np.array([SHOT + 2, 7, SHOT], np.uint64)}
            | setting(1, [1, 2, 2], [[6, 0], [1, 1], [3.5, 2]], [6, 1, 3.5])
            | setting(10, [2, 0, 0], [[3, 1], [0, 0], [0, 0]], [3, 0, 0]),
            "BEAM1011": {"shot_number": np.array([SHOT], np.uint64)} | setting(1, [1], [[4.75]], [4.75]),
            "BEAM1000": {"shot_number": np.array([SHOT], np.uint64)} | setting(1, [1], [[9]], [9]),
        },
    )
    found = references(granule, tmp_path / "l2a")
    assert list(found) == ["a1", "a10"]
    assert modes(found["a1"]) == [[2, 3.5], [], [6], [], [], [4.75]]
    assert found["a1"].judged.tolist() == [True, False, True, False, False, True]
    np.testing.assert_array_equal(found["a1"].ground, [3.5, NAN, 6, NAN, NAN, 4.75])
    assert modes(found["a10"]) == [[], [], [1, 3], [], [], []]
    assert found["a10"].judged.tolist() == [True, False, True, False, False, False]
    np.testing.assert_array_equal(found["a10"].ground, [NAN, NAN, 3, NAN, NAN, NAN])


def test_shots_that_the_algorithm_did_not_run_on_are_not_judged(granule: Path, tmp_path: Path) -> None:
    flag = np.array([1, 0, 1], np.uint8)
    # Where it found more modes than there is room for, the L2A has none of them.
    full = {"rx_processing_a1/rx_algrunflag": flag, "rx_processing_a1/rx_nummodes": np.array([2, 1, 3], np.uint8)}
    l2a(tmp_path / "l2a", first_beam(**full))
    found = references(granule, tmp_path / "l2a")["a1"]
    assert found.judged.tolist() == [True] + [False] * 5
    assert modes(found) == [[1, 2.5], [], [], [], [], []]
    np.testing.assert_array_equal(found.ground, [2.5] + [NAN] * 5)


def test_a_ground_that_fills_in_for_none_is_none(granule: Path, tmp_path: Path) -> None:
    l2a(tmp_path / "l2a", first_beam(**{"rx_processing_a1/zcross": np.array([0, -9999, 1e30])}))
    found = references(granule, tmp_path / "l2a")["a1"]
    assert found.judged.tolist() == [True] * 3 + [False] * 3
    assert np.isnan(found.ground).all()


def test_an_l2a_beside_anything_else_is_refused(tmp_path: Path) -> None:
    npz(tmp_path / "a.npz")
    l2a(tmp_path / "l2a", first_beam())
    with pytest.raises(DataError, match=r"l2a: .*a.npz beside it is npz, expected GEDI L1B"):
        references(tmp_path / "a.npz", tmp_path / "l2a")


def test_an_l1b_without_shot_numbers_cannot_be_joined(tmp_path: Path) -> None:
    gedi(tmp_path / "l1b", BEAMS, shot_number=None)
    l2a(tmp_path / "l2a", first_beam())
    with pytest.raises(DataError, match="l1b: no dataset /BEAM0000/shot_number, expected it"):
        references(tmp_path / "l1b", tmp_path / "l2a")


A = "rx_processing_a1"


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"shot_number": None}, "no dataset .*BEAM0000/shot_number, expected it"),
        ({"shot_number": np.zeros(3)}, "BEAM0000/shot_number is of dtype float64, expected integers"),
        ({"shot_number": np.arange(3)}, "found no shot_number of .*l1b, expected the L2A of the same orbit"),
        ({f"{A}/rx_nummodes": None}, "no dataset /BEAM0000/rx_processing_a1/rx_nummodes"),
        ({f"{A}/rx_nummodes": np.zeros(3)}, "rx_nummodes is of dtype float64, expected integers"),
        ({f"{A}/rx_nummodes": np.zeros(2, int)}, r"rx_nummodes has shape \(2,\), expected \(3,\)"),
        ({f"{A}/rx_modelocs": None}, "no dataset /BEAM0000/rx_processing_a1/rx_modelocs"),
        ({f"{A}/rx_modelocs": np.zeros(3)}, r"rx_modelocs has shape \(3,\), expected \(3, m\)"),
        ({f"{A}/rx_modelocs": np.zeros((4, 2))}, r"rx_modelocs has shape \(4, 2\), expected \(3, m\)"),
        ({f"{A}/rx_modelocs": np.full((3, 2), b"x")}, r"rx_modelocs is of dtype \|S1, expected integers or floats"),
        ({f"{A}/rx_modelocs": np.full((3, 2), NAN)}, "rx_modelocs of row 0 is at bin nan, expected -1 to 65536"),
        ({f"{A}/rx_modelocs": np.full((3, 2), 65537)}, "rx_modelocs of row 0 is at bin 65537.0, expected -1 to 65536"),
        ({f"{A}/zcross": None}, "no dataset /BEAM0000/rx_processing_a1/zcross"),
        ({f"{A}/zcross": np.zeros(2)}, r"zcross has shape \(2,\), expected \(3,\)"),
        ({f"{A}/rx_algrunflag": np.zeros(4, int)}, r"rx_algrunflag has shape \(4,\), expected \(3,\)"),
        ({f"{A}/zcross": h5py.SoftLink("/BEAM0000/shot_number")}, "zcross is a SoftLink, expected a dataset in the"),
        ({"rx_processing_a2": np.zeros(3)}, "BEAM0000/rx_processing_a2 is no group, expected a group with rx_modelocs"),
    ],
)
def test_bad_l2a_is_told_in_one_line(granule: Path, tmp_path: Path, changed: dict[str, Any], message: str) -> None:
    l2a(tmp_path / "l2a", first_beam(**changed))
    with pytest.raises(DataError, match=message) as error:
        references(granule, tmp_path / "l2a")
    assert str(error.value).startswith(str(tmp_path / "l2a"))
    assert "\n" not in str(error.value)


def test_a_file_that_is_no_l2a_is_told_by_what_is_in_it(granule: Path, tmp_path: Path) -> None:
    for make, message in (
        (
            lambda path: gedi(path, BEAMS),
            "found BEAM0000, BEAM0101, BEAM1011, METADATA, expected BEAMxxxx/rx_processing",
        ),
        (lambda path: l2a(path, {}), "found METADATA, expected BEAMxxxx/rx_processing_aN"),
        (lambda path: npz(path), "expected readable GEDI L2A"),
        (lambda path: None, "expected readable GEDI L2A"),
    ):
        (tmp_path / "other").unlink(missing_ok=True)
        make(tmp_path / "other")
        with pytest.raises(DataError, match=message) as error:
            references(granule, tmp_path / "other")
        assert str(error.value).startswith(str(tmp_path / "other"))
        assert "\n" not in str(error.value)


def content_of(make: Any, *arguments: Any, **named: Any) -> bytes:
    file = io.BytesIO()
    make(file, *arguments, **named)
    return file.getvalue()


GROUND = {"has_modes": np.ones(4, bool), "ref_a1_zcross": np.arange(4.0), "ref_g1_gloc": np.arange(4.0)}
NPZ_CONTENT = content_of(npz, ref_decomposition=np.ones((2, 3)), ref_ground_bin=np.ones(4), **A1, **GROUND)
L2A_CONTENT = content_of(l2a, first_beam())
L1B_CONTENT = content_of(gedi, BEAMS)


@fuzz.fuzzed
@hypothesis.given(fuzz.damage(NPZ_CONTENT))
def test_damaged_npz_gives_references_or_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    fuzz.give_data_or_one_line(tmp_path / "a", references)


def some(numbers: st.SearchStrategy[Any], count: int) -> st.SearchStrategy[list[Any]]:
    return st.lists(numbers, min_size=count, max_size=count)


POSITIONS = st.integers(1, 4).map(float) | st.integers(1, 4).map(float) | st.floats(-1, 2**17) | st.floats()


@fuzz.fuzzed
@hypothesis.given(
    st.sampled_from(["a1", "g1", "decomposition"]),
    some(st.integers(0, 4) | st.integers(-(2**40), 2**40), 4),
    some(POSITIONS, 12),
    some(POSITIONS, 4),
)
def test_npz_of_any_numbers_gives_references_or_one_line(
    tmp_path: Path, name: str, count: list[int], locations: list[float], ground: list[float]
) -> None:
    table = np.array(locations).reshape(4, 3)
    keys: dict[str, dict[str, Any]] = {
        "a1": {"ref_a1_nummodes": np.array(count), "ref_a1_modelocs": table, "ref_a1_zcross": ground},
        "g1": {"ref_g1_gloc": table[:, 0], "ref_ground_bin": ground},
        "decomposition": {"ref_decomposition": table, "ref_ground_bin": ground},
    }
    npz(tmp_path / "a.npz", **keys[name])
    fuzz.give_data_or_one_line(tmp_path / "a.npz", references)


@fuzz.fuzzed
@hypothesis.given(fuzz.damage(L2A_CONTENT))
def test_damaged_l2a_gives_references_or_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "l1b").write_bytes(L1B_CONTENT)
    (tmp_path / "l2a").write_bytes(content)
    fuzz.give_data_or_one_line(tmp_path / "l1b", lambda path: references(path, tmp_path / "l2a"))


@fuzz.fuzzed
@hypothesis.given(
    some(st.integers(SHOT - 1, SHOT + 3), 4),
    some(st.integers(0, 4) | st.just(255), 4),
    some(POSITIONS, 12),
    some(POSITIONS, 4),
)
def test_l2a_of_any_numbers_gives_references_or_one_line(
    tmp_path: Path, shots: list[int], count: list[int], locations: list[float], ground: list[float]
) -> None:
    (tmp_path / "l1b").write_bytes(L1B_CONTENT)
    with np.errstate(over="ignore"):
        l2a(tmp_path / "l2a", {"BEAM0000": {"shot_number": shots} | setting(1, count, locations, ground)})
    fuzz.give_data_or_one_line(tmp_path / "l1b", lambda path: references(path, tmp_path / "l2a"))
