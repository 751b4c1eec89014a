"""Images of array scans: a pixel for each waveform, a row for each shot."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Chosen: TypeAlias = Literal["strongest", "first", "last"]


def scan_images(
    points: np.ndarray, shape: tuple[int, int], *, echo: Chosen = "strongest", platform: ArrayLike | None = None
) -> dict[str, Floats]:
    """Make images of a scan whose beams are fired side by side, row after row.

    Parameters
    ----------
    points : structured (n,) of `openecho.surface.points.POINT`
    shape : (int, int)
        Shots, and waveforms of a shot; waveform w is in row w // columns and in column w % columns.
    echo : str
        Of each waveform, which is shown.
    platform : array_like (3,) or (waveforms, 3), optional
        Where the instrument was, m, in the axes of the points.

    Returns
    -------
    dict
        ``elevation``, m; ``intensity``, counts; ``echoes`` of the waveform; and with a platform ``range``, m. Each
        float64 of that shape, nan where no echo has a place.

    Raises
    ------
    ValueError
        If there are points of other waveforms, or another number of places of the platform.
    """
    waveforms = shape[0] * shape[1]
    row = points["waveform"]
    if len(row) and not 0 <= row.min() <= row.max() < waveforms:
        raise ValueError(f"waveform: found {row.min()} to {row.max()}, expected 0 to {waveforms - 1} of {shape}")
    shown = points[_shown(points, echo)]
    images = {
        "elevation": _image(waveforms, shown, shown["z"]),
        "intensity": _image(waveforms, shown, shown["intensity"]),
        "echoes": _image(waveforms, shown, shown["count"]),
    }
    if platform is not None:
        place = np.broadcast_to(np.asarray(platform, np.float64), (waveforms, 3))[shown["waveform"]]
        away = np.column_stack([shown[axis] for axis in "xyz"]) - place
        images["range"] = _image(waveforms, shown, np.sqrt((away**2).sum(axis=1)))
    return {name: image.reshape(shape) for name, image in images.items()}


def _shown(points: np.ndarray, echo: Chosen) -> NDArray[np.int64]:
    """The chosen echo of each waveform, of those that have a place."""
    known = np.flatnonzero(np.isfinite(points["z"]))
    keys = {"strongest": -points["intensity"], "first": points["number"], "last": -points["number"].astype(np.int64)}
    order = known[np.lexsort((points["number"][known], keys[echo][known], points["waveform"][known]))]
    first = np.diff(points["waveform"][order], prepend=-1) != 0
    return np.asarray(order[first])


def _image(waveforms: int, shown: np.ndarray, values: np.ndarray) -> Floats:
    image = np.full(waveforms, np.nan)
    image[shown["waveform"]] = values
    return image
