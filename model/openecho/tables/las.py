"""Tables of echoes as points: LAS 1.4, or LAZ, with a dimension more for each column that LAS has not."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
from laspy.vlrs.known import WktCoordinateSystemVlr
from numpy.typing import NDArray

from openecho.decompose.columns import COLUMNS
from openecho.tables.table import Table, TableError

PLACED = ("x", "y", "z", "beam")
"""Columns that LAS has places of its own for: coordinates, and the point source for the beam."""

POINTS = 2**16
"""Points that are converted at a time."""

MOST_RETURNS = 15
"""Of one pulse, in the four bits that LAS has for them."""

RANGE_GIVEN = 0b110
"""Options of an extra dimension that say that its least and greatest value are given."""

GPS_STANDARD = "GPS seconds less 1e9"
"""Time unit of a recording whose times LAS 1.4 takes as they are."""


def write(path: Path, table: Table) -> int:
    """Write ``.las`` or ``.laz``, point format 6, an echo a point where its peak is.

    Intensity is the amplitude in whole counts, number and count of the return are the echo's, up to 15, the point
    source is the beam, from 1. All other columns are extra dimensions under their own names. Coordinates are in steps
    of the recording's, from the first point on; longitudes are from -180 to 180 degrees.

    Parameters
    ----------
    path : Path
        File to write; its suffix decides on compression.
    table : Table
        With positions.

    Returns
    -------
    int
        Points: echoes whose position is a number.

    Raises
    ------
    TableError
        For a position too far from the first to be written in the recording's steps.
    """
    names = table.dtype.names or ()
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams(column.name, column.dtype, column.meaning)
            for column in COLUMNS
            if column.name in names and column.name not in PLACED
        ]
    )
    for described in header.vlrs.get("ExtraBytesVlr")[0].extra_bytes_structs:
        described.options &= ~RANGE_GIVEN  # laspy would give that of the first points alone
    header.scales = np.array(_steps(table))
    header.offsets = _origin(table)
    header.creation_date = table.date
    header.generating_software = "OpenEcho"
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType(int(table.time_unit == GPS_STANDARD))
    header.global_encoding.wkt = True
    if table.wkt is not None:
        header.vlrs.append(WktCoordinateSystemVlr(table.wkt))
    written = 0
    with laspy.open(path, "w", header=header, do_compress=path.suffix.casefold() == ".laz") as writer:
        for chunk in table.chunks(POINTS):
            points = _points(path, chunk, table, header)
            writer.write_points(points)
            written += len(points)
    return written


def _points(path: Path, echoes: np.ndarray, table: Table, header: laspy.LasHeader) -> laspy.ScaleAwarePointRecord:
    """Points of the echoes that have a position."""
    _, waveform, count = np.unique(echoes["waveform"], return_inverse=True, return_counts=True)
    located = np.isfinite(_positions(echoes, table)).all(axis=1)
    echoes, returns = echoes[located], count[waveform][located]
    points = laspy.ScaleAwarePointRecord.zeros(len(echoes), header=header)
    for name in echoes.dtype.names or ():
        if name not in PLACED:
            points[name] = echoes[name]
    try:
        points.x, points.y, points.z = _positions(echoes, table).T
    except OverflowError as error:
        reach = ", ".join(f"{2**31 * scale:g}" for scale in header.scales)
        origin = ", ".join(f"{value:g}" for value in header.offsets)
        raise TableError(
            f"{path}: found echoes too far apart, expected x, y and z within {reach} of {origin}"
        ) from error
    points.intensity = np.rint(echoes["amplitude"]).clip(0, 2**16 - 1)
    points.return_number = np.minimum(echoes["number"] + 1, MOST_RETURNS)
    points.number_of_returns = np.minimum(returns, MOST_RETURNS)
    if table.time_unit is not None and "GPS" in table.time_unit:
        points.gps_time = echoes["shot_time"]
    if table.beams:
        points.point_source_id = 1 + np.searchsorted(table.beams, echoes["beam"])
    return points


def _positions(echoes: np.ndarray, table: Table) -> NDArray[np.float64]:
    """x, y, z (n, 3); longitudes from -180 to 180."""
    positions: NDArray[np.float64] = np.empty((len(echoes), 3))
    for axis, name in enumerate("xyz"):
        positions[:, axis] = echoes[name]
    if _geographic(table):
        positions[:, 0] = np.remainder(positions[:, 0] + 180, 360) - 180
    return positions


def _origin(table: Table) -> NDArray[np.float64]:
    """Whole numbers at the first position: the nearer it is, the further the 32 bits of LAS reach.

    Degrees count from 0 where all of them fit, as a recording may cross 180 degrees.
    """
    origin = np.zeros(3)
    if _geographic(table) and min(_steps(table)[:2]) * 2**31 >= 180:
        return origin
    for block in table.blocks():
        positions = _positions(block, table)
        located = positions[np.isfinite(positions).all(axis=1)]
        if len(located):
            origin[:] = np.floor(located[0])
            break
    return origin


def _steps(table: Table) -> tuple[float, float, float]:
    return table.resolution or (1e-3, 1e-3, 1e-3)


def _geographic(table: Table) -> bool:
    """Whether x and y are degrees: a projected coordinate system has a geographic one within it."""
    return table.wkt is not None and "PROJC" not in table.wkt and ("GEOGC" in table.wkt or "GEODC" in table.wkt)
