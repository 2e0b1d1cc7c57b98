"""Find the order of operations in a log without a scenario: parts that move together are one operation."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from apo_bench.errors import require
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import CameraPose, find_cameras
from apo_bench.importers.recording.rest_intervals import RestInterval, find_all_intervals
from apo_bench.importers.recording.rests import Rest, group_consecutive
from apo_bench.importers.recording.tracks import PoseTrack

_Move = tuple[RestInterval, RestInterval]
"""A motion of a part: the rest intervals before and after."""


class ObservedPlacement(NamedTuple):
    """One operation: a part was put down, perhaps with carried parts."""

    part: str
    carries: tuple[str, ...]
    rest: Rest


class UnplannedRecording(NamedTuple):
    """The camera and the operations of a recording without a scenario."""

    camera: CameraPose
    placements: tuple[ObservedPlacement, ...]


def unplanned_recording(tracks: Mapping[str, PoseTrack], camera: CameraFile, file: str) -> UnplannedRecording:
    """Return the order of operations as far as the poses alone show it.

    Raises:
        InputError: The camera file states no pose, or nothing moves.
    """
    intervals = find_all_intervals(tracks)
    # Without a scenario no part starts at a planned place.
    known = {part: T for part, T in camera.known.items() if T is not None}
    found = find_cameras(intervals, CameraFile(camera.conventions, camera.T_world_camera, known, camera.stays), {})[0]
    moves = sorted((move for known in intervals.values() for move in pairwise(known)), key=lambda move: move[1].begins)
    require(moves, f"{file}: no part comes to rest at another place than before, so there is no operation.")
    groups = group_consecutive(moves, lambda group, move: any(_is_together(move, other) for other in group))
    return UnplannedRecording(found, tuple(map(_place, groups)))


def _is_together(move: _Move, other: _Move) -> bool:
    """Whether two parts moved together, for more than half of the shorter motion."""
    (a, b), (c, d) = move, other
    shared = min(b.begins, d.begins) - max(a.ends, c.ends)
    return b.part != d.part and shared > 0.5 * min(b.begins - a.ends, d.begins - c.ends)


def _place(moves: Sequence[_Move]) -> ObservedPlacement:
    """Return motions that belong together as one operation; the part that was taken first is the main part."""
    (_, first), *others = sorted(moves, key=lambda move: move[0].ends)
    return ObservedPlacement(first.part, tuple(after.part for _, after in others), first.rests[-1])
