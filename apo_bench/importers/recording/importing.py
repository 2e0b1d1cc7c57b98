"""Import the tracks of a log as the observation of one demonstration of a scenario."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Observation, SharedError
from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Array
from apo_bench.importers.recording.arrangement import Arrangement, Task, arrange
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import rest_error
from apo_bench.importers.recording.checks import check_arrangement, check_moved
from apo_bench.importers.recording.doubts import list_doubts
from apo_bench.importers.recording.folding import FoldedTrack, find_gross, fold_track, turn_as_reported
from apo_bench.importers.recording.observed_operation import LoggedOperation, observed_operation
from apo_bench.importers.recording.ordering import NoMatchingOrder, Stated
from apo_bench.importers.recording.rest_intervals import find_all_intervals
from apo_bench.importers.recording.rests import Rest
from apo_bench.importers.recording.tags import TagOffset
from apo_bench.importers.recording.tracks import PoseTrack
from apo_bench.perception.observation.models import (
    UNOBSERVED_DEVIATION,
    add_shared_error,
    find_last_observed_poses,
    floor_covariance,
)
from apo_bench.scenario import Scenario, place_layout


@final
@dataclass(frozen=True, eq=False)
class ImportedRecording:
    """An observation from a recording, with the intermediate results that led to it."""

    observation: Observation
    arrangement: Arrangement
    operations: tuple[LoggedOperation, ...]
    covariance: Array
    """(n, 6, 6), of each observed pose without the error of the camera pose, which all share, [m, rad]."""
    tracks: Mapping[str, PoseTrack]
    """Folded track of each part, camera from part."""
    folded: Mapping[str, int]
    """Part -> number of frames folded to another image than most."""
    gross: Mapping[str, int]
    """Part -> number of frames that were left out, as they are far from the frames around."""
    doubts: tuple[str, ...]
    """What may be wrong with the recording, one sentence each."""


def import_recording(
    tracks: Mapping[str, PoseTrack],
    camera: CameraFile,
    scenario: Scenario,
    stated: Stated,
    file: str,
    models: Mapping[str, Array] | None = None,
    identical: Sequence[Sequence[str]] = (),
    offsets: Mapping[str, Sequence[TagOffset]] | None = None,
) -> ImportedRecording:
    """Return the observation that the tracks of one demonstration give.

    Args:
        tracks: Track of each part, camera from part.
        file: Name of the log, for messages.
        models: Part -> pose of its frame in the tracker's model, (4, 4), [m]; None: the identity for all.
        identical: Groups of parts whose tracks may belong to one another.
        offsets: Part -> uncertainty of the places of its tags.

    Raises:
        InputError: A part is not of the scenario or is missing, the moves are not its operations, or no contact fits.
    """
    assembly = scenario.assembly
    for part in tracks:
        require_known("part", part, assembly.solids, place=file)
    for k, operation in enumerate(assembly.operations, start=1):
        require(
            operation.main in tracks,
            f"{file}: '{operation.main}', which operation {k} moves, is not tracked; name its id in the objects file.",
        )
    gross = {part: find_gross(track, assembly.solids[part]) for part, track in tracks.items()}
    raw = {part: PoseTrack(t[~gross[part]], T[~gross[part]]) for part, (t, T) in tracks.items()}
    layout = place_layout(scenario, 0.0, 0.0, 0.0, clearance_mm=scenario.clearance_mm)
    task = Task(assembly, layout.start, layout.poses, camera, stated, identical)
    try:
        folded, arrangement = arrange_tracks(raw, task)
    except NoMatchingOrder as error:
        raise InputError(f"{file}: {error}") from error
    other = check_arrangement(arrangement, lambda tracks: arrange_tracks(tracks, task)[1], raw, models or {}, file)
    owned = arrangement.tracks
    followed = {part: folded[own].track for part, own in owned.items()}
    intervals = arrangement.intervals
    X = arrangement.camera.T_world_camera
    chosen = arrangement.order
    operations = tuple(observed_operation(followed, intervals, chosen, assembly, X, k) for k in range(len(assembly)))
    check_moved(intervals, operations, camera, assembly, file)
    observed = np.array([operation.rest is not None for operation in operations])
    poses = np.tile(np.eye(4), (len(operations), 1, 1))
    covariance = np.tile(np.diag(UNOBSERVED_DEVIATION**2), (len(operations), 1, 1))
    for k, (_, rest, *_) in enumerate(operations):
        if rest is not None:
            part = assembly.operations[k].main
            reported = raw[owned[part]].T[rest.first : rest.last + 1]
            poses[k] = X @ turn_as_reported(assembly.solids[part], rest.T, reported)
            covariance[k] = compute_rest_covariance(rest, camera, (offsets or {}).get(part, ()))
    covariance += _adjustments(operations, assembly)
    observation = Observation(
        assembly=assembly,
        start=arrangement.start,
        poses=find_last_observed_poses(assembly, arrangement.start, poses, observed),
        covariance=floor_covariance(covariance),
        observed=observed,
        gap_m=scenario.gap_mm * 1e-3,
        play_m=scenario.clearance_mm * 1e-3,
    )
    if arrangement.camera.covariance is not None and observed.any():
        # The error of the camera pose is common to all observed poses.
        sharing = tuple(np.flatnonzero(observed).tolist())
        observation = add_shared_error(observation, SharedError("camera", sharing, arrangement.camera.covariance, X))
    turned = {part: int(each.turned.sum()) for part, each in folded.items()}
    wrong = {part: int(each.sum()) for part, each in gross.items()}
    doubts = (*other, *list_doubts(followed, wrong, arrangement, covariance, assembly))
    return ImportedRecording(observation, arrangement, operations, covariance, followed, turned, wrong, doubts)


def arrange_tracks(tracks: Mapping[str, PoseTrack], task: Task) -> tuple[Mapping[str, FoldedTrack], Arrangement]:
    """Return the folded tracks of parts, and their arrangement.

    Raises:
        NoMatchingOrder: A part never rests, or the motions in the log do not match the operations.
    """
    folded = {part: fold_track(track, task.assembly.solids[part]) for part, track in tracks.items()}
    intervals = find_all_intervals({part: each.track for part, each in folded.items()}, task.assembly.solids)
    for part, known in intervals.items():
        if not known:
            raise NoMatchingOrder(f"'{part}' never rests; give a log in which it lies still at its places.")
    return folded, arrange(intervals, task)


def compute_rest_covariance(rest: Rest, camera: CameraFile, offsets: Sequence[TagOffset] = ()) -> Array:
    """Return the covariance of the pose of a rest, (6, 6), [m, rad].

    The error that differs from frame to frame averages out; the constant one is added in full, and that of the place of
    a tag as far as the frames of the rest are of this tag.
    """
    C = rest.mean.covariance + rest_error(camera, rest.mean)
    for offset in offsets:
        frames = int(np.sum((offset.t >= rest.begins) & (offset.t <= rest.ends)))
        C = C + min(1.0, frames / len(rest.mean.inlier)) ** 2 * offset.covariance
    return C


def _adjustments(operations: Sequence[LoggedOperation], assembly: Assembly) -> Array:
    """Return for each operation the squared twists by which later ones displaced its part, (n, 6, 6), [m, rad]."""
    C = np.zeros((len(assembly), 6, 6))
    for k, operation in enumerate(operations):
        for part, twist in operation.adjusted.items():
            # Operations that had placed the part before.
            placed = [j for j in range(k) if assembly.operations[j].main == part]
            if placed:
                C[placed[-1]] += np.outer(twist, twist)
    return C
