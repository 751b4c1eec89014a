"""What somebody else found in the same waveforms: in the keys of an ``.npz``, or in a GEDI L2A beside its L1B."""

from __future__ import annotations

import re
import zipfile
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from openecho.formats.hdf5 import dataset, member
from openecho.formats.numpy_files import keys, unpacked
from openecho.formats.recording import MAX_LENGTH, DataError, Recording, one_line, printable

NOT_JUDGED = 255
"""Number of modes of a waveform that its reference says nothing of: what fills the 8 bits of such a count."""

SCANNED = 2**20
"""Entries of a table of modes that are read at a time."""

LOWEST, HIGHEST = -1, MAX_LENGTH
"""Positions that are believed, bins: those of a waveform, and a bin to either side of the longest."""


@dataclass(frozen=True)
class Reference:
    """Modes and ground that one method found in the waveforms of a recording.

    Attributes
    ----------
    name : str
        ``a1`` to ``a6``: settings of GEDI's L2A; ``g1``: its single Gaussian; ``decomposition``: NEON's Gaussians.
    waveform : int64 (m,)
        Waveform of the recording that each mode belongs to, ascending.
    position : float64 (m,)
        Of each mode, in bins from 0, the first recorded sample; ascending within a waveform.
    ground : float64 (n,)
        Of each waveform, in the same bins; nan where the method says nothing of it.
    judged : bool (n,)
        Whether the method says anything of a waveform. Of the others there are no modes and no ground.
    """

    name: str
    waveform: NDArray[np.int64]
    position: NDArray[np.float64]
    ground: NDArray[np.float64]
    judged: NDArray[np.bool_]


def references(recording: Recording, l2a: Path | None = None) -> tuple[Reference, ...]:
    """Read what others found in the waveforms of a recording.

    Parameters
    ----------
    recording : Recording
        Open. Of an ``.npz`` the keys ``ref_*`` are read, of which `_from_npz` tells; others have none of their own.
    l2a : Path, optional
        GEDI L2A granule to a GEDI L1B recording, with shots in any order and not necessarily all. Names are those of
        the product's data dictionary (lpdaac.usgs.gov, gedi_l2a_dictionary_P003_v2), positions bins of 1 ns from 0.

    Returns
    -------
    tuple of Reference
        None at all is no error.

    Raises
    ------
    DataError
        If a file holds what contradicts itself or the recording.
    """
    if l2a is not None:
        if recording.format != "GEDI L1B":
            raise DataError(f"{l2a}: {recording.path} beside it is {recording.format}, expected GEDI L1B")
        with one_line(recording.path, "readable GEDI L1B"):
            shots = _shots(recording)
        with one_line(l2a, "readable GEDI L2A"), np.errstate(over="ignore", invalid="ignore"):
            return _from_l2a(l2a, recording, shots)
    if recording.format == "npz":
        with one_line(recording.path, "readable .npz"), np.errstate(over="ignore", invalid="ignore"):
            return _from_npz(recording.path, recording.waveforms)
    return ()


def _from_npz(path: Path, n: int) -> tuple[Reference, ...]:
    """References of an ``.npz``.

    ``ref_<name>_modelocs`` (n, k) has the positions of modes, as many as ``ref_<name>_nummodes`` (n,) says: 255, or
    more than k, says that a waveform is not judged, as does ``has_modes`` (n,) where it is False.
    ``ref_<name>_zcross`` (n,) is the ground. ``ref_<name>_gloc`` (n,) is a single mode, nan where there is no fit.
    ``ref_decomposition`` (rows, 3 or more) has a mode a row: the waveform in column 0 and its bin in column 2, both
    from 1. ``ref_ground_bin`` (n,) is the ground of those that have none of their own. ``truth`` is what
    `openecho.scene.simulate` tells.
    """
    with ExitStack() as stack, zipfile.ZipFile(path) as archive:
        found = keys(archive)

        def column(key: str, kinds: str = "iuf") -> NDArray[Any]:
            return _checked(path, key, unpacked(path, archive, found[key], stack), (n,), kinds)

        judged = column("has_modes", "b") if "has_modes" in found else np.ones(n, bool)
        ground = column("ref_ground_bin") if "ref_ground_bin" in found else np.full(n, np.nan)
        made = []
        for name in _names(found, "modelocs"):
            key = f"ref_{name}_modelocs"
            if f"ref_{name}_nummodes" not in found:
                raise DataError(f"{path}: no key ref_{name}_nummodes, expected it beside {key}")
            table = _checked(path, key, unpacked(path, archive, found[key], stack), (n, None), "iuf")
            count, mine = _counted(column(f"ref_{name}_nummodes", "iu"), table.shape[1], judged)
            waveform, position = _listed(path, key, table, count)
            own = f"ref_{name}_zcross"
            zcross, grounded = (column(own), count > 0) if own in found else (ground, mine)
            made.append(_reference(name, waveform, position, zcross, mine, grounded))
        for name in _names(found, "gloc"):
            key = f"ref_{name}_gloc"
            centre = column(key).astype(np.float64)
            mine = judged & ~np.isnan(centre)
            waveform, position = _listed(path, key, centre[:, None], mine.astype(np.int64))
            made.append(_reference(name, waveform, position, ground, mine, mine))
        if "ref_decomposition" in found:
            key = "ref_decomposition"
            rows = _checked(path, key, unpacked(path, archive, found[key], stack), (None, None), "iuf")
            waveform, position = _decomposition(path, rows, n)
            mine = np.isin(np.arange(n), waveform)
            made.append(_reference("decomposition", waveform, position, ground, mine, mine))
        if "truth" in found:
            made.append(_truth(path, unpacked(path, archive, found["truth"], stack), n))
        return tuple(made)


def _truth(path: Path, rows: NDArray[Any], n: int) -> Reference:
    """Every surface that a simulated beam met, and the ground: the last one that is no leaf."""
    names = rows.dtype.names or ()
    if rows.ndim != 1 or not {"waveform", "bin", "incidence"} <= set(names):
        raise DataError(f"{path}: truth has the fields {', '.join(names) or 'none'}, expected waveform, bin, incidence")
    strange = np.flatnonzero(~((rows["waveform"] >= 0) & (rows["waveform"] < n)))
    if len(strange):
        found = rows["waveform"][strange[0]]
        raise DataError(f"{path}: truth of row {strange[0]} is waveform {found}, expected 0 to {n - 1}")
    # A surface may be beyond the window, and nobody can find it there.
    rows = rows[(rows["bin"] >= LOWEST) & (rows["bin"] <= HIGHEST)]
    ground, solid = np.full(n, -np.inf), ~np.isnan(rows["incidence"])
    np.maximum.at(ground, rows["waveform"][solid], rows["bin"][solid])
    waveform, position = rows["waveform"].astype(np.int64), rows["bin"].astype(np.float64)
    return _reference("truth", waveform, position, ground, np.ones(n, bool), np.isfinite(ground))


def _decomposition(path: Path, rows: NDArray[Any], n: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Waveform and position, both from 0, of each row of ``ref_decomposition``."""
    if rows.shape[1] < 3:
        raise DataError(f"{path}: ref_decomposition has shape {rows.shape}, expected at least three columns")
    number = rows[:, 0]
    strange = np.flatnonzero(~((number >= 1) & (number <= n) & (number == np.floor(number))))
    if len(strange):
        raise DataError(
            f"{path}: ref_decomposition of row {strange[0]} is waveform {number[strange[0]]}, "
            f"expected a whole number from 1 to {n}"
        )
    row, position = _listed(path, "ref_decomposition", rows[:, 2:3], np.ones(len(rows), np.int64), -1.0)
    return number.astype(np.int64)[row] - 1, position


def _shots(recording: Recording) -> list[tuple[str, NDArray[np.uint64]]]:
    """Beams of a GEDI L1B recording in the order of its waveforms, and the numbers of their shots."""
    with h5py.File(recording.path, "r") as file:
        return [
            (beam, dataset(recording.path, file, f"{beam}/shot_number", 1, count, "iu")[:].astype(np.uint64))
            for beam, count in recording.parts
            if beam is not None
        ]


def _from_l2a(path: Path, recording: Recording, shots: list[tuple[str, NDArray[np.uint64]]]) -> tuple[Reference, ...]:
    """References of a GEDI L2A: one for each setting that any of its beams was processed with."""
    with h5py.File(path, "r") as file:
        settings = {beam: _settings(path, file, beam) for beam in file if re.fullmatch("BEAM[01]{4}", beam)}
        numbers = sorted(set().union(*settings.values()))
        if not numbers:
            found = printable(", ".join(file)) or "nothing"
            raise DataError(f"{path}: found {found}, expected BEAMxxxx/rx_processing_aN (GEDI L2A)")
        first = np.cumsum([0, *(len(one) for _, one in shots)])
        # Which row of the L2A is which waveform, of each beam that both have.
        rows = {
            beam: _joined(path, file, beam, one, int(start))
            for (beam, one), start in zip(shots, first, strict=False)
            if beam in settings
        }
        if not any((waveform >= 0).any() for waveform in rows.values()):
            raise DataError(
                f"{path}: found no shot_number of {recording.path}, expected the L2A of the same orbit and part"
            )
        return tuple(_setting(path, file, number, settings, rows, recording.waveforms) for number in numbers)


def _settings(path: Path, file: h5py.File, beam: str) -> set[int]:
    """Numbers of the algorithm settings of a beam."""
    group = member(path, file, beam)
    if not isinstance(group, h5py.Group):
        raise DataError(f"{path}: {beam} is no group, expected a group with rx_processing_aN")
    return {int(found[1]) for name in group if (found := re.fullmatch("rx_processing_a([1-9][0-9]{0,2})", name))}


def _joined(path: Path, file: h5py.File, beam: str, shots: NDArray[np.uint64], first: int) -> NDArray[np.int64]:
    """Waveform of each row of an L2A beam, by the number of the shot; -1 where the recording doesn't have it."""
    theirs = dataset(path, file, f"{beam}/shot_number", 1, None, "iu")[:].astype(np.uint64)
    # Numbers are unique in both; where a damaged file repeats one, the first counts.
    _, ours, rows = np.intersect1d(shots, theirs, return_indices=True)
    waveform = np.full(len(theirs), -1)
    waveform[rows] = first + ours
    return waveform


def _setting(
    path: Path, file: h5py.File, number: int, settings: dict[str, set[int]], rows: dict[str, NDArray[np.int64]], n: int
) -> Reference:
    """Modes of one algorithm setting in all beams."""
    ground, judged, grounded = np.full(n, np.nan), np.zeros(n, bool), np.zeros(n, bool)
    waveforms, positions = [np.zeros(0, np.int64)], [np.zeros(0)]
    for beam, waveform in rows.items():
        if number not in settings[beam]:
            continue
        where = f"{beam}/rx_processing_a{number}"
        group, shots = member(path, file, where), len(waveform)
        if not isinstance(group, h5py.Group):
            raise DataError(f"{path}: {where} is no group, expected a group with rx_modelocs")
        table = dataset(path, group, "rx_modelocs", 2, shots)
        run = waveform >= 0
        if "rx_algrunflag" in group:
            run &= dataset(path, group, "rx_algrunflag", 1, shots, "iu")[:] != 0
        count, run = _counted(dataset(path, group, "rx_nummodes", 1, shots, "iu")[:], table.shape[1], run)
        row, position = _listed(path, table.name, table, count)
        waveforms.append(waveform[row])
        positions.append(position)
        known, zcross = waveform >= 0, dataset(path, group, "zcross", 1, shots)[:]
        # Position 0 fills in for no mode: users of the L2A are told to ask for a zcross above 0.
        grounded[waveform[known]] = ((count > 0) & (zcross > 0))[known]
        ground[waveform[known]], judged[waveform[known]] = zcross[known], run[known]
    return _reference(f"a{number}", np.concatenate(waveforms), np.concatenate(positions), ground, judged, grounded)


def _counted(number: NDArray[Any], k: int, judged: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """How many of k modes each row lists, 0 where it is not judged; and which rows are judged.

    GEDI's algorithm gives no modes where it found more than its table has room for (max_mode_counts).
    """
    listed = judged & (number >= 0) & (number <= k) & (number != NOT_JUDGED)
    return np.where(listed, number, 0).astype(np.int64), listed


def _listed(
    path: Path, name: str, table: Any, count: NDArray[np.int64], offset: float = 0.0
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Row and position of each of the first `count` entries of each row, read piece by piece.

    Parameters
    ----------
    path, name : Path, str
        What an error names.
    table : array or Dataset (rows, k)
    count : int64 (rows,)
        At most k.
    offset : float
        What makes bins from 0 of its entries.

    Raises
    ------
    DataError
        For a position that is not a number or not within `LOWEST` to `HIGHEST`.
    """
    rows, positions = [np.zeros(0, np.int64)], [np.zeros(0)]
    size = max(SCANNED // max(table.shape[1], 1), 1)
    for first in range(0, len(count), size):
        piece = count[first : first + size]
        listed = np.arange(table.shape[1]) < piece[:, None]
        row = first + np.repeat(np.arange(len(piece)), piece)
        position = table[first : first + size][listed].astype(np.float64) + offset
        strange = np.flatnonzero(~((position >= LOWEST) & (position <= HIGHEST)))
        if len(strange):
            raise DataError(
                f"{path}: {name} of row {row[strange[0]]} is at bin {position[strange[0]]}, "
                f"expected {LOWEST} to {HIGHEST}"
            )
        rows.append(row)
        positions.append(position)
    return np.concatenate(rows), np.concatenate(positions)


def _reference(
    name: str,
    waveform: NDArray[np.int64],
    position: NDArray[np.float64],
    ground: NDArray[Any],
    judged: NDArray[np.bool_],
    grounded: NDArray[np.bool_],
) -> Reference:
    """A reference with its modes in order, and its ground where that is `grounded` and a position at all.

    A ground outside any waveform is what products fill in where they found none, and no error.
    """
    order = np.lexsort((position, waveform))
    ground = ground.astype(np.float64)
    known = grounded & (ground >= LOWEST) & (ground <= HIGHEST)
    return Reference(name, waveform[order], position[order], np.where(known, ground, np.nan), judged)


def _names(found: dict[str, Any], quantity: str) -> list[str]:
    """Names of the references that have a quantity, a2 before a10."""
    pattern = re.compile(f"ref_([A-Za-z0-9]{{1,16}})_{quantity}")
    return sorted((match[1] for key in found if (match := pattern.fullmatch(key))), key=lambda name: (len(name), name))


def _checked(path: Path, key: str, array: NDArray[Any], shape: tuple[int | None, ...], kinds: str) -> NDArray[Any]:
    """Array of an ``.npz``, if its shape and type are as expected."""
    if array.dtype.kind not in kinds:
        expected = {"b": "booleans", "iu": "integers"}.get(kinds, "integers or floats")
        raise DataError(f"{path}: {key} are of dtype {array.dtype}, expected {expected}")
    if array.ndim != len(shape) or any(side not in (None, have) for side, have in zip(shape, array.shape, strict=True)):
        sides = ", ".join(letter if side is None else str(side) for letter, side in zip("mk", shape, strict=False))
        raise DataError(f"{path}: {key} has shape {array.shape}, expected ({sides}{',' * (len(shape) == 1)})")
    return array
