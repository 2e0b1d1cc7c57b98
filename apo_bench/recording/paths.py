"""The path of a part between two rests, and its last straight piece."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.recording.log import Track

_STRAIGHT = 4.0
"""Frames may be so many standard deviations of their noise beside the line."""
_LEAST_M = 5e-3
"""A line that is shorter says no direction."""
_FEWEST = 4
_SPIKE_M = 0.015
"""A frame that is so far from the median of its neighbours is wrong: no hand turns off so fast."""


@final
@dataclass(frozen=True, eq=False)
class Path:
    """Poses between two rests."""

    t: Array
    """(n,), [s]."""
    T: Array
    """(n, 4, 4), world, [m]."""


@final
@dataclass(frozen=True, eq=False)
class Straight:
    """The last straight piece of a path."""

    direction: Array
    """Unit vector of the motion, (3,), in the frame of the part at its goal."""
    length_m: float


def path_of(track: Track, begins: float, ends: float, T_world_camera: Array) -> Path:
    """The frames from one time to another."""
    among = (track.t >= begins) & (track.t <= ends)
    return Path(track.t[among], T_world_camera @ track.T[among])


def last_straight(path: Path, goal: Array) -> Straight | None:
    """The longest last piece that is straight within its noise; None if it is too short to have a direction.

    Noise is that of the frames themselves: what neighbours differ by beside their common motion.
    """
    points = _without_spikes(pose.apply(pose.inverse(goal), path.T[:, :3, 3]))
    if len(points) < _FEWEST:
        return None
    jerks = np.diff(points, 3, axis=0)
    noise = max(2e-4, 1.4826 * float(np.median(np.abs(jerks))) / np.sqrt(20.0)) if len(jerks) else 2e-4
    end = np.zeros(3)
    found = None
    for first in range(len(points) - _FEWEST, -1, -1):
        piece = points[first:]
        away = np.linalg.norm(piece[:1] - end)
        centre = piece.mean(axis=0)
        _, _, Vt = np.linalg.svd(np.concatenate([piece, end[None]]) - centre, full_matrices=False)
        off = np.linalg.norm((piece - centre) - np.outer((piece - centre) @ Vt[0], Vt[0]), axis=1)
        if away > _LEAST_M and (
            np.sort(off)[int(0.9 * (len(off) - 1))] > _STRAIGHT * noise or off[0] > 2.0 * _STRAIGHT * noise
        ):
            break
        if away > max(_LEAST_M, 3.0 * noise):
            way = end - piece[0]
            axis = Vt[0] if Vt[0] @ way > 0.0 else -Vt[0]
            found = Straight(axis, float(away))
    return found


def _without_spikes(points: Array) -> Array:
    """Points (n, 3) without frames that are far from the median of the five about them, which the next two are not."""
    if len(points) < 5:
        return points
    five = np.pad(points, ((2, 2), (0, 0)), mode="edge")[np.arange(len(points))[:, None] + np.arange(5)]
    return np.asarray(points[np.linalg.norm(points - np.median(five, axis=1), axis=1) < _SPIKE_M])
