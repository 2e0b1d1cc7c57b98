"""Extract one operation from a log: where its part was put, along which path, and which other parts moved with it."""

from collections.abc import Mapping
from typing import NamedTuple

from apo_bench.assembly import Assembly
from apo_bench.geometry import Array, find_nearest_equivalent_pose, pose
from apo_bench.importers.recording.ordering import Chosen, end_of_operation, list_settled, time_taken
from apo_bench.importers.recording.rest_intervals import RestInterval, RestIntervals, find_rest_poses
from apo_bench.importers.recording.rests import Rest
from apo_bench.importers.recording.tracks import PoseTrack


class LoggedOperation(NamedTuple):
    """One operation as observed in the log."""

    interval: RestInterval | None = None
    """The rest interval that ends the operation; None if the operation was not observed."""
    rest: Rest | None = None
    """The rest of the interval that counts: the last before the next operation began."""
    path: PoseTrack | None = None
    """Path of the main part to this rest, world; None if not observed."""
    carried: Mapping[str, Array] = {}
    """Carried part -> body twist by which it slipped relative to the main part, (6,), [m, rad]."""
    adjusted: Mapping[str, Array] = {}
    """Part that no operation moves from now on -> body twist by which it moved nevertheless, (6,), [m, rad]."""


def observed_operation(
    tracks: Mapping[str, PoseTrack],
    intervals: RestIntervals,
    chosen: Chosen,
    assembly: Assembly,
    T_world_camera: Array,
    k: int,
) -> LoggedOperation:
    """Return operation k, counted from 0, as observed.

    Args:
        intervals: Rest intervals of every part, camera from part.
        tracks: Track of each part, camera from part.
        chosen: The rest interval that ends each operation; None for operations that were not observed.
    """
    operation = assembly.operations[k]
    interval = chosen[k]
    if interval is None:
        return LoggedOperation()
    begins = time_taken(intervals, chosen[:k], interval)
    ends = end_of_operation(intervals, chosen, k)
    rest = interval.at(ends)
    track = tracks[operation.main]
    among = (track.t >= begins) & (track.t <= rest.begins)
    seen = track.T[among]
    if len(seen):  # the image of the rest
        image = find_nearest_equivalent_pose(assembly.solids[operation.main], seen[-1], rest.T)
        seen = seen @ pose.inverse(seen[-1]) @ image
    # Poses before this operation include what earlier operations put, even if their part came to rest after its begin.
    settled = max([begins, *(earlier.begins for earlier in chosen[:k] if earlier is not None)])
    before = find_rest_poses(intervals, settled, chosen[:k], chosen[k:], list_settled(assembly, k - 1))
    after = find_rest_poses(intervals, ends, chosen[: k + 1], chosen[k + 1 :], list_settled(assembly, k))
    # The displacement of the main part, in the frame of the camera, also moves whatever is fixed to it in the hand.
    displacement = after[operation.main] @ pose.inverse(before[operation.main])
    carried = {
        part: pose.log(pose.inverse(displacement @ before[part]) @ after[part])
        for part in operation.carries
        if part in before
    }
    placed = assembly.fixed | {part for earlier in assembly.operations[:k] for part in earlier.moves}
    moved = {part for other in assembly.operations[k:] for part in other.moves}
    twists = {
        part: pose.log(pose.inverse(before[part]) @ after[part]) for part in sorted(placed & before.keys() - moved)
    }
    adjusted = {part: twist for part, twist in twists.items() if twist.any()}
    return LoggedOperation(interval, rest, PoseTrack(track.t[among], T_world_camera @ seen), carried, adjusted)
