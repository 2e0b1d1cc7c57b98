"""What a log shows of one operation: where its part went, by which path, and what moved with it.

The last straight piece of the path says from where a part came to its goal, to be held beside how the plan brings it
there.
"""

from collections.abc import Iterator, Mapping, Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.geometry import Array, pose
from apo_bench.recording.ordering import quiet, taken
from apo_bench.recording.rests import RestSpan
from apo_bench.recording.setup_files import PoseTrack
from apo_bench.recording.stays import Stay, Stays, poses_at
from apo_bench.scenario import Scenario, nominal_operations

_STRAIGHT = 4.0
"""Frames may be so many standard deviations of their noise beside the line."""
_LEAST_M = 5e-3
"""A line that is shorter says no direction."""
_FEWEST = 4
_SPIKE_M = 0.015
"""A frame that is so far from the median of its neighbours is wrong: no hand turns off so fast."""


class SeenOperation(NamedTuple):
    """One operation as the log shows it."""

    stay: Stay | None
    """Where its main part stayed; None if it was not seen."""
    rest: RestSpan | None
    """The rest of it that is the goal: that at which the next operation began."""
    path: PoseTrack | None
    """Of the main part, from its stay before to this one, world."""
    carried: Mapping[str, Array]
    """Carried part -> the body twist by which it moved in the hand, (6,), [m, rad]."""
    adjusted: Mapping[str, Array]
    """Part that the operation does not move -> the body twist by which it was moved all the same, (6,)."""


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


def seen_operation(
    tracks: Mapping[str, PoseTrack],
    stays: Stays,
    chosen: Sequence[Stay | None],
    assembly: Assembly,
    T_world_camera: Array,
    k: int,
) -> SeenOperation:
    """Operation k, counted from 0.

    Args:
        tracks: Of parts, camera from part.
        chosen: The stay with which each operation ends.
    """
    operation = assembly.operations[k]
    stay = chosen[k]
    if stay is None:
        return SeenOperation(None, None, None, {}, {})
    over = quiet(assembly, stays, chosen, k)
    rest = stay.at(over)
    begins = taken(assembly, stays, chosen[:k], stay)
    track = tracks[operation.main]
    among = (track.t >= begins) & (track.t <= rest.begins)
    path = PoseTrack(track.t[among], T_world_camera @ track.T[among])
    # Where an operation before it put a part counts as its place, also if this one began before that was seen to rest.
    before = poses_at(stays, max([begins, *(earlier.begins for earlier in chosen[:k] if earlier is not None)]))
    after = poses_at(stays, over)
    # What the main part did, as a displacement in the frame of the camera, takes along what stands fast in the hand.
    displacement = after[operation.main] @ pose.inverse(before[operation.main])
    twists = {
        part: pose.log(pose.inverse(displacement @ T if part in operation.carries else T) @ after[part])
        for part, T in before.items()
        if part != operation.main
    }
    carried = {part: twist for part, twist in twists.items() if part in operation.carries}
    adjusted = {part: twist for part, twist in twists.items() if part not in carried and twist.any()}
    return SeenOperation(stay, rest, path, carried, adjusted)


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
