"""The order of operations from a log alone: parts that move together are one operation."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from apo_bench.errors import require
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import CameraPose, find_camera
from apo_bench.importers.recording.rest_intervals import RestInterval, RestIntervals, find_all_intervals
from apo_bench.importers.recording.rests import Rest, group_consecutive
from apo_bench.importers.recording.tracks import PoseTrack


class ObservedPlacement(NamedTuple):
    """A part was put somewhere, perhaps with others."""

    part: str
    carries: tuple[str, ...]
    rest: Rest


class UnplannedRecording(NamedTuple):
    """A recording without a scenario."""

    camera: CameraPose
    intervals: RestIntervals
    placements: tuple[ObservedPlacement, ...]


class _Move(NamedTuple):
    taken: float
    to: RestInterval


def unplanned_recording(tracks: Mapping[str, PoseTrack], camera: CameraFile, file: str) -> UnplannedRecording:
    """Return the order of operations as far as poses alone show it.

    Raises:
        InputError: The camera file states no pose, or nothing moves.
    """
    intervals = find_all_intervals(tracks)
    known = {part: T for part, T in camera.known.items() if T is not None}
    found = find_camera(intervals, CameraFile(camera.conventions, camera.T_world_camera, known, camera.stays), {})
    moves = [_Move(before.ends, after) for known in intervals.values() for before, after in pairwise(known)]
    require(moves, f"{file}: no part comes to rest at another place than before, so there is no operation.")
    moves.sort(key=lambda move: move.to.begins)
    groups = group_consecutive(moves, lambda group, move: any(_is_together(move, other) for other in group))
    return UnplannedRecording(found, intervals, tuple(_place(group) for group in groups))


def _is_together(move: _Move, other: _Move) -> bool:
    """Whether two parts moved at the same time, for more than half of the shorter move."""
    shared = min(move.to.begins, other.to.begins) - max(move.taken, other.taken)
    shorter = min(move.to.begins - move.taken, other.to.begins - other.taken)
    return move.to.part != other.to.part and shared > 0.5 * shorter


def _place(moves: Sequence[_Move]) -> ObservedPlacement:
    """The hand held the part that was taken first."""
    first, *others = sorted(moves, key=lambda move: move.taken)
    return ObservedPlacement(first.to.part, tuple(move.to.part for move in others), first.to.rests[-1])
