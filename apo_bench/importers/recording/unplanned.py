"""A recording without a scenario: which part was put where, in order; nothing is known of contacts."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.importers.recording.arranging import CameraPose, solved_camera
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.rests import RestSpan, consecutive
from apo_bench.importers.recording.stays import Stay, Stays, all_stays
from apo_bench.importers.recording.tracks import PoseTrack


class Put(NamedTuple):
    """A part was put somewhere, perhaps with others."""

    part: str
    carries: tuple[str, ...]
    stay: Stay

    @property
    def rest(self) -> RestSpan:
        return self.stay.rests[-1]


class UnplannedRecording(NamedTuple):
    """What a log says by itself."""

    camera: CameraPose
    stays: Stays
    puts: tuple[Put, ...]


class _Move(NamedTuple):
    taken: float
    stay: Stay


def unplanned_recording(tracks: Mapping[str, PoseTrack], camera: CameraFile, file: str) -> UnplannedRecording:
    """The order of operations, as far as poses alone tell it: parts that move together are one operation.

    Raises:
        InputError: A known place is not stated by a pose, or nothing moves.
    """
    stays = all_stays(tracks)
    X = _camera_pose(stays, camera)
    pairs = [pair for known in stays.values() for pair in pairwise(known)]
    moves = sorted((_Move(before.ends, after) for before, after in pairs), key=lambda move: move.stay.begins)
    require(moves, f"{file}: no part comes to rest at another place than before, so there is no operation.")
    groups = consecutive(moves, lambda group, move: any(_together(move, other) for other in group))
    return UnplannedRecording(X, stays, tuple(map(_put, groups)))


def _camera_pose(stays: Stays, camera: CameraFile) -> CameraPose:
    if camera.T_world_camera is not None:
        return CameraPose(camera.T_world_camera)
    places = {part: T for part, T in camera.known.items() if T is not None and stays.get(part)}
    require(
        places,
        "without --scenario the camera file has to state the pose of the camera, or poses of known parts that "
        'rest; "start" is a place of a scenario.',
    )
    return solved_camera(stays, camera, places)


def _together(move: _Move, other: _Move) -> bool:
    """Whether two parts were on their way at the same time, for more than half of the shorter way."""
    shared = min(move.stay.begins, other.stay.begins) - max(move.taken, other.taken)
    shorter = min(move.stay.begins - move.taken, other.stay.begins - other.taken)
    return move.stay.part != other.stay.part and shared > 0.5 * shorter


def _put(moves: Sequence[_Move]) -> Put:
    """What was taken first is taken for what the hand held."""
    first, *others = sorted(moves, key=lambda move: move.taken)
    return Put(first.stay.part, tuple(move.stay.part for move in others), first.stay)


def goals_of(recording: UnplannedRecording) -> Array:
    """Where parts were put, (n, 4, 4), world, [m]."""
    return np.array([recording.camera.T_world_camera @ put.rest.T for put in recording.puts])
