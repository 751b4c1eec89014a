"""Where the beams of a flight are: one a shot, or an array, from a platform that moves and a mirror that turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from openecho.scene.schema import Line, Platform, Raster, Scene, Zigzag

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Beams:
    """Beams of consecutive shots, those of one shot together.

    Attributes
    ----------
    waveform : int64 (n,)
        Number of each among all of the scene.
    time : float64 (n,)
        Since the first shot, s.
    origin, direction : float64 (n, 3)
        Where it leaves the platform, m, and where to, a unit vector; x east, y north, z up.
    """

    waveform: NDArray[np.int64]
    time: Floats
    origin: Floats
    direction: Floats


def beams(scene: Scene, shots: NDArray[np.int64]) -> Beams:
    """Beams of some shots.

    Parameters
    ----------
    scene : Scene
    shots : int64 (k,)
        Their numbers, from 0.

    Returns
    -------
    Beams
        n is k times the beams of a shot; of an array row by row, the rearmost and leftmost first.
    """
    each = scene.beams
    time = shots / scene.laser.rate
    aim = aims(scene.platform, time).reshape(-1, 3)
    time = np.repeat(time, each)
    heading = np.array([math.sin(scene.platform.heading), math.cos(scene.platform.heading)])
    origin = np.empty((len(time), 3))
    origin[:, :2] = scene.platform.start + scene.platform.speed * time[:, None] * heading
    origin[:, 2] = scene.platform.altitude
    return Beams((shots[:, None] * each + np.arange(each)).ravel(), time, origin, aim)


def aims(platform: Platform, time: Floats) -> Floats:
    """Directions of the beams at some times.

    Parameters
    ----------
    platform : Platform
    time : float64 (n,)
        s.

    Returns
    -------
    float64 (n, beams, 3)
        Unit vectors, x east, y north, z up.
    """
    across, along = _angles(platform.scan, time)
    body = np.stack([np.sin(along), np.cos(along) * np.sin(across), np.cos(along) * np.cos(across)], axis=-1)
    attitude = platform.attitude
    # Forward, right, down, turned by yaw, pitch, roll, is north, east, down: the aircraft's usual angles.
    turned = Rotation.from_euler("ZYX", [platform.heading + attitude.yaw, attitude.pitch, attitude.roll])
    north, east, down = np.moveaxis(turned.apply(body.reshape(-1, 3)).reshape(body.shape), -1, 0)
    return np.stack([east, north, -down], axis=-1)


def _angles(scan: Line | Zigzag | Raster | None, time: Floats) -> tuple[Floats, Floats]:
    """How far beams are turned to the right and forward, each (n, beams), rad."""
    still = np.zeros((len(time), 1))
    if scan is None:
        return still, still
    if isinstance(scan, Raster):
        along, across = ((np.arange(count) - (count - 1) / 2) * scan.spacing for count in (scan.rows, scan.columns))
        grid = np.broadcast_arrays(across[None, None, :], along[None, :, None], time[:, None, None])
        return np.reshape(grid[0], (len(time), -1)), np.reshape(grid[1], (len(time), -1))
    phase = np.mod(time * scan.rate, 1)
    share = 2 * phase - 1 if isinstance(scan, Line) else 1 - abs(4 * phase - 2)
    return np.asarray((scan.half_angle * share)[:, None]), still
