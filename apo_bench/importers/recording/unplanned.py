"""Find the order of operations in a log without a scenario: parts that move together are one operation."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from apo_bench.errors import require
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import CameraPose, find_cameras
from apo_bench.importers.recording.rest_intervals import RestInterval, RestIntervals, find_all_intervals
from apo_bench.importers.recording.rests import Rest, group_consecutive
from apo_bench.importers.recording.tracks import PoseTrack


class ObservedPlacement(NamedTuple):
    """One operation: a part was put down, perhaps with carried parts."""

    part: str
    carries: tuple[str, ...]
    rest: Rest


class UnplannedRecording(NamedTuple):
    """The camera, rest intervals and operations of a recording without a scenario."""

    camera: CameraPose
    intervals: RestIntervals
    placements: tuple[ObservedPlacement, ...]


class _Move(NamedTuple):
    """A motion of a part from one rest interval to the next."""

    taken: float  # [s]
    to: RestInterval


def unplanned_recording(tracks: Mapping[str, PoseTrack], camera: CameraFile, file: str) -> UnplannedRecording:
    """Return the order of operations as far as the poses alone show it.

    Raises:
        InputError: The camera file states no pose, or nothing moves.
    """
    intervals = find_all_intervals(tracks)
    # Without a scenario no part starts at a planned place.
    known = {part: T for part, T in camera.known.items() if T is not None}
    found = find_cameras(intervals, CameraFile(camera.conventions, camera.T_world_camera, known, camera.stays), {})[0]
    moves = [_Move(before.ends, after) for known in intervals.values() for before, after in pairwise(known)]
    require(moves, f"{file}: no part comes to rest at another place than before, so there is no operation.")
    moves.sort(key=lambda move: move.to.begins)
    groups = group_consecutive(moves, lambda group, move: any(_is_together(move, other) for other in group))
    return UnplannedRecording(found, intervals, tuple(_place(group) for group in groups))


def _is_together(move: _Move, other: _Move) -> bool:
    """Whether two parts moved together, for more than half of the shorter motion."""
    shared = min(move.to.begins, other.to.begins) - max(move.taken, other.taken)
    shorter = min(move.to.begins - move.taken, other.to.begins - other.taken)
    return move.to.part != other.to.part and shared > 0.5 * shorter


def _place(moves: Sequence[_Move]) -> ObservedPlacement:
    """Return motions that belong together as one operation; the part that was taken first is the main part."""
    first, *others = sorted(moves, key=lambda move: move.taken)
    return ObservedPlacement(first.to.part, tuple(move.to.part for move in others), first.to.rests[-1])
