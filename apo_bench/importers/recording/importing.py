"""Import the tracks of a log as the observation of one demonstration of a scenario."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Observation, Poses, SharedError
from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Array
from apo_bench.importers.recording.arrangement import Arrangement, arrange
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import rest_error
from apo_bench.importers.recording.checks import check_arrangement, check_moved
from apo_bench.importers.recording.doubts import list_doubts
from apo_bench.importers.recording.folding import find_gross, fold_track, turn_as_reported
from apo_bench.importers.recording.matching import TagOffset, list_matchings
from apo_bench.importers.recording.observed_operation import LoggedOperation, observed_operation
from apo_bench.importers.recording.ordering import NoMatchingOrder, Stated
from apo_bench.importers.recording.rest_intervals import RestIntervals, find_all_intervals
from apo_bench.importers.recording.tracks import PoseTrack
from apo_bench.perception.observation.models import (
    UNOBSERVED_DEVIATION,
    add_shared_error,
    find_last_observed_poses,
    floor_covariance,
)
from apo_bench.scenario import Scenario, place_layout

_MANY = 0.25  # share of gross frames of a part that is doubtful


@final
@dataclass(frozen=True, eq=False)
class ImportedRecording:
    """An observation from a recording, with the intermediate results that led to it."""

    scenario: Scenario
    observation: Observation
    arrangement: Arrangement
    operations: tuple[LoggedOperation, ...]
    covariance: Array
    """(n, 6, 6), of each observed pose without errors of the camera pose and adjustments, [m, rad]."""
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
    planned = planned_starts(scenario)
    gross = {part: find_gross(track, assembly.solids[part]) for part, track in tracks.items()}
    tracks = {part: PoseTrack(t[~gross[part]], T[~gross[part]]) for part, (t, T) in tracks.items()}

    def arrange_log(intervals: RestIntervals) -> Arrangement:
        return arrange(intervals, camera, assembly, planned, stated)

    def arrange_tracks(tracks: Mapping[str, PoseTrack]) -> Arrangement:
        folded = {part: fold_track(track, assembly.solids[part]).track for part, track in tracks.items()}
        intervals = find_all_intervals(folded, assembly.solids)
        if not all(intervals.values()):
            raise NoMatchingOrder("a part never rests.")
        return _arrange_identical(intervals, arrange_log, identical)[0]

    folded = {part: fold_track(track, assembly.solids[part]) for part, track in tracks.items()}
    intervals = find_all_intervals({part: each.track for part, each in folded.items()}, assembly.solids)
    for part, known in intervals.items():
        require(known, f"{file}: '{part}' never rests; give a log in which it lies still at its places.")
    try:
        arrangement, owned = _arrange_identical(intervals, arrange_log, identical)
    except NoMatchingOrder as error:
        raise InputError(f"{file}: {error}") from error
    other = check_arrangement(arrangement, arrange_tracks, tracks, models or {}, file)
    raw = tracks
    tracks = {part: folded[own].track for part, own in owned.items()}
    intervals = arrangement.intervals
    X = arrangement.camera.T_world_camera
    chosen = arrangement.order.intervals
    operations = tuple(observed_operation(tracks, intervals, chosen, assembly, X, k) for k in range(len(assembly)))
    check_moved(intervals, operations, camera, assembly, file)
    observed = np.array([operation.rest is not None for operation in operations])
    poses = np.tile(np.eye(4), (len(operations), 1, 1))
    # The error that differs from frame to frame averages out; the constant one is added in full.
    covariance = np.tile(np.diag(UNOBSERVED_DEVIATION**2), (len(operations), 1, 1))
    for k, (_, rest, *_) in enumerate(operations):
        if rest is not None:
            part = assembly.operations[k].main
            reported = raw[owned[part]].T[rest.first : rest.last + 1]
            poses[k] = X @ turn_as_reported(assembly.solids[part], rest.T, reported)
            covariance[k] = rest.mean.covariance + rest_error(camera, rest.mean)
            for offset in (offsets or {}).get(assembly.operations[k].main, ()):
                frames = int(np.sum((offset.t >= rest.begins) & (offset.t <= rest.ends)))
                covariance[k] += min(1.0, frames / len(rest.mean.inlier)) ** 2 * offset.covariance
    observation = Observation(
        assembly=assembly,
        start=arrangement.start,
        poses=find_last_observed_poses(assembly, arrangement.start, poses, observed),
        covariance=floor_covariance(covariance + _adjustments(operations, assembly)),
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
    many = tuple(
        f"{n} of {n + len(tracks[part].t)} frames of '{part}' are far from the frames around, and were left out"
        for part, n in wrong.items()
        if n > _MANY * (n + len(tracks[part].t))
    )
    doubts = (*other, *many, *list_doubts(tracks, intervals, arrangement, covariance, assembly))
    return ImportedRecording(scenario, observation, arrangement, operations, covariance, tracks, turned, wrong, doubts)


def _arrange_identical(
    intervals: RestIntervals,
    arrange_log: Callable[[RestIntervals], Arrangement],
    identical: Sequence[Sequence[str]],
) -> tuple[Arrangement, Mapping[str, str]]:
    """Return the best arrangement of all ways in which identical parts may have their tracks, and part -> track."""
    tried: list[tuple[Arrangement, Mapping[str, str]]] = []
    failed: NoMatchingOrder | None = None
    for way in list_matchings(identical):
        own = {part: way.get(part, part) for part in intervals}
        try:
            changed = {
                part: tuple(replace(each, part=part) for each in intervals[other]) for part, other in own.items()
            }
            tried.append((arrange_log(changed), own))
        except NoMatchingOrder as error:
            failed = failed or error
    if not tried:
        raise failed or NoMatchingOrder("the moves of the log are not the operations of the scenario.")
    return min(tried, key=lambda each: each[0].wrong_mm)


def planned_starts(scenario: Scenario) -> Poses:
    """Return the start of every part in the scenario, world, [m]."""
    return place_layout(scenario, 0.0, 0.0, 0.0, clearance_mm=scenario.clearance_mm).start


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
