"""How a part came to its goal: the last straight piece of its path, beside how the plan brings it there."""

from collections.abc import Iterator, Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.operations import SeenOperation
from apo_bench.importers.recording.tracks import PoseTrack
from apo_bench.scenario import Scenario, nominal_operations

_STRAIGHT = 4.0
"""Frames may be so many standard deviations of their noise beside the line."""
_LEAST_M = 5e-3
"""A line that is shorter says no direction."""
_FEWEST = 4
_SPIKE_M = 0.015
"""A frame that is so far from the median of its neighbours is wrong: no hand turns off so fast."""


class StraightEnd(NamedTuple):
    """The last straight piece of a path."""

    direction: Array
    """Unit vector of the motion, (3,), in the frame of the part at its goal."""
    length_m: float


class Approach(NamedTuple):
    """How a part came to its goal, beside the plan."""

    operation: int
    """Counted from 0."""
    end: StraightEnd | None
    """None: too short, or too few frames."""
    macro: str
    """The motion of the plan that is nearest in direction."""
    off_deg: float
    """Between the two."""


def approaches(scenario: Scenario, operations: Sequence[SeenOperation], T_world_camera: Array) -> Iterator[Approach]:
    """Every operation that was seen."""
    for k, (operation, nominal) in enumerate(zip(operations, nominal_operations(scenario), strict=True)):
        if operation.path is None or operation.rest is None:
            continue
        end = last_straight(operation.path, T_world_camera @ operation.rest.T)
        arrival = nominal.after
        ways: dict[str, Array] = {macro.name: arrival.own(macro.direction) for macro in arrival.macros}
        ways.setdefault("put down", arrival.line.direction)
        cosine, macro = max(
            ((float(end.direction @ way), name) for name, way in ways.items() if end),
            default=(1.0, ""),
            key=itemgetter(0),
        )
        yield Approach(k, end, macro, float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))))


def last_straight(path: PoseTrack, goal: Array) -> StraightEnd | None:
    """The longest last piece that is straight within its noise; None if it is too short to have a direction.

    Noise is that of the frames themselves: what neighbours differ by beside their common motion.

    Args:
        path: Poses between two rests, world, [m].
        goal: (4, 4), where it ends.
    """
    points = _without_spikes(pose.apply(pose.inverse(goal), path.T[:, :3, 3]))
    if len(points) < _FEWEST:
        return None
    # Third differences of independent errors have 1 + 9 + 9 + 1 = 20 times their variance, those of a smooth motion
    # are hardly anything.
    jerks = np.diff(points, 3, axis=0)
    noise = max(2e-4, 1.4826 * float(np.median(np.abs(jerks))) / np.sqrt(20.0)) if len(jerks) else 2e-4
    longest = None
    for first in range(len(points) - _FEWEST, -1, -1):
        piece = points[first:]
        away = np.linalg.norm(piece[0])
        # The line of least squares through the piece and the goal, which is the origin: the first right singular vector
        # about the middle of the piece.
        centred = piece - piece.mean(axis=0)
        _, _, (line, *_) = np.linalg.svd(np.vstack([centred, -piece.mean(axis=0)]), full_matrices=False)
        off = np.linalg.norm(centred - np.outer(centred @ line, line), axis=1)
        # It bends where the 90 % quantile of the distances is too large, or the point that is farthest from the goal.
        if away > _LEAST_M and (
            np.sort(off)[int(0.9 * (len(off) - 1))] > _STRAIGHT * noise or off[0] > 2.0 * _STRAIGHT * noise
        ):
            break
        if away > max(_LEAST_M, 3.0 * noise):
            longest = StraightEnd(line if line @ piece[0] < 0.0 else -line, float(away))
    return longest


def _without_spikes(points: Array) -> Array:
    """Points (n, 3) without frames that are far from the median of the five about them, which the next two are not."""
    if len(points) < 5:
        return points
    five = np.pad(points, ((2, 2), (0, 0)), mode="edge")[np.arange(len(points))[:, None] + np.arange(5)]
    return np.asarray(points[np.linalg.norm(points - np.median(five, axis=1), axis=1) < _SPIKE_M])
