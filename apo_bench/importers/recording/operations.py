"""What a log shows of one operation: where its part went, by which path, and what moved with it."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from apo_bench.assembly import Assembly
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.ordering import quiet, taken
from apo_bench.importers.recording.rests import RestSpan
from apo_bench.importers.recording.stays import Stay, Stays, poses_at
from apo_bench.importers.recording.tracks import PoseTrack


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
