"""What a log shows of one operation: where its part was put, along which path, and what moved with it."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from apo_bench.assembly import Assembly
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.ordering import end_of_operation, time_taken
from apo_bench.importers.recording.rest_intervals import RestInterval, RestIntervals, find_rest_poses
from apo_bench.importers.recording.rests import Rest
from apo_bench.importers.recording.tracks import PoseTrack


class LoggedOperation(NamedTuple):
    """One operation as the log shows it."""

    interval: RestInterval | None = None
    """Where its main part was put; None if that was not observed."""
    rest: Rest | None = None
    """The rest of it that counts: that at which the next operation began."""
    path: PoseTrack | None = None
    """Of the main part, from its interval before to this one, world."""
    carried: Mapping[str, Array] = {}
    """Carried part -> the body twist by which it moved in the hand, (6,), [m, rad]."""
    adjusted: Mapping[str, Array] = {}
    """Part that the operation does not move -> the body twist by which it moved all the same, (6,)."""


def observed_operation(
    tracks: Mapping[str, PoseTrack],
    intervals: RestIntervals,
    chosen: Sequence[RestInterval | None],
    assembly: Assembly,
    T_world_camera: Array,
    k: int,
) -> LoggedOperation:
    """Return operation k, counted from 0.

    Args:
        tracks: Of parts, camera from part.
        chosen: The interval with which each operation ends.
    """
    operation = assembly.operations[k]
    interval = chosen[k]
    if interval is None:
        return LoggedOperation()
    over = end_of_operation(assembly, intervals, chosen, k)
    rest = interval.at(over)
    begins = time_taken(assembly, intervals, chosen[:k], interval)
    track = tracks[operation.main]
    among = (track.t >= begins) & (track.t <= rest.begins)
    path = PoseTrack(track.t[among], T_world_camera @ track.T[among])
    # An operation before it had put its part, also if this one began before that part rested.
    before = find_rest_poses(
        intervals, max([begins, *(earlier.begins for earlier in chosen[:k] if earlier is not None)])
    )
    after = find_rest_poses(intervals, over)
    # The motion of the main part, a displacement in the frame of the camera, moves what stands fast in the hand.
    displacement = after[operation.main] @ pose.inverse(before[operation.main])
    carried = {
        part: pose.log(pose.inverse(displacement @ before[part]) @ after[part])
        for part in operation.carries
        if part in before
    }
    others = {part: pose.log(pose.inverse(T) @ after[part]) for part, T in before.items() if part != operation.main}
    adjusted = {part: twist for part, twist in others.items() if part not in carried and twist.any()}
    return LoggedOperation(interval, rest, path, carried, adjusted)
