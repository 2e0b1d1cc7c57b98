"""From the log of a tracker to an observation: frames, rests, the order of operations, and what stays unclear."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Observation, Poses, SharedError
from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Array, turn_alike
from apo_bench.importers.recording.arranging import CameraPose, arrangement_of, staying
from apo_bench.importers.recording.averaging import per_axis
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.doubts import tell_doubts
from apo_bench.importers.recording.operations import SeenOperation, seen_operation
from apo_bench.importers.recording.ordering import ContactFit, NoOrder, Stated
from apo_bench.importers.recording.refusals import check_arrangement, check_moved
from apo_bench.importers.recording.rests import RestSpan, least_rest_s, rests_of
from apo_bench.importers.recording.stays import Stay, all_stays
from apo_bench.importers.recording.tracks import PoseTrack
from apo_bench.perception.observation.models import UNSEEN_DEVIATION, floor_covariance, last_seen, with_shared
from apo_bench.scenario import Scenario, layout_at


@final
@dataclass(frozen=True, eq=False)
class ImportedRecording:
    """A recording, understood."""

    scenario: Scenario
    observation: Observation
    camera: CameraPose
    stays: Mapping[str, tuple[Stay, ...]]
    operations: tuple[SeenOperation, ...]
    stood: Mapping[str, str]
    """Part -> where its start is from: `known`, `seen`, `scenario`, `otherwise`."""
    fit: ContactFit
    """The worst contact as seen."""
    stays_stated: bool
    """Whether the error that stays while a part rests was stated."""
    unclear: tuple[str, ...]


def import_recording(
    tracks: Mapping[str, PoseTrack],
    camera: CameraFile,
    scenario: Scenario,
    stated: Stated,
    file: str,
    models: Mapping[str, Array] | None = None,
) -> ImportedRecording:
    """The observation that a log of one demonstration gives.

    Args:
        tracks: Of parts, camera from part.
        file: The log, for messages.
        models: Part -> where its frame lies in the tracker's model, (4, 4), [m]; None: all frames are those of models.

    Raises:
        InputError: A part is not of the scenario or is missing, the moves are not its operations, or no contact fits.
    """
    assembly = scenario.assembly
    for part in tracks:
        require_known("part", part, assembly.solids, place=file)
    for k, operation in enumerate(assembly.operations):
        require(
            operation.main in tracks,
            f"{file}: '{operation.main}', which operation {k + 1} moves, is not tracked; name its id in the "
            "objects file.",
        )
    stays = all_stays(tracks)
    for part, track in tracks.items():
        if not stays[part]:
            raise InputError(f"{file}: {_never_rests(part, track, assembly)}")
    arrange = partial(arrangement_of, camera=camera, assembly=assembly, planned=planned_starts(scenario), stated=stated)
    try:
        arrangement = arrange(stays)
    except NoOrder as error:
        raise InputError(f"{file}: {error}") from error
    check_arrangement(arrangement, arrange, stays, models or {}, assembly, file)
    solved, order, start, whence, _, stays = arrangement
    X = solved.T_world_camera
    operations = tuple(seen_operation(tracks, stays, order.stays, assembly, X, k) for k in range(len(assembly)))
    check_moved(stays, operations, camera, assembly, file)
    seen = np.array([operation.rest is not None for operation in operations])
    goals = np.array([np.eye(4) if operation.rest is None else X @ operation.rest.T for operation in operations])
    # What frames differ by averages out, what stays does not.
    covariance = np.array(
        [
            np.diag(UNSEEN_DEVIATION**2) if rest is None else rest.mean.covariance + staying(camera, rest.mean)
            for rest in (operation.rest for operation in operations)
        ]
    )
    observation = Observation(
        assembly=assembly,
        start=start,
        poses=last_seen(assembly, start, goals, seen),
        covariance=floor_covariance(covariance + _adjustments(operations, assembly)),
        observed=seen,
        gap_m=scenario.gap_mm * 1e-3,
        play_m=scenario.clearance_mm * 1e-3,
    )
    if solved.covariance is not None and seen.any():
        # All goals were seen from one camera: they share the error of its pose.
        sharing = tuple(int(k) for k in np.flatnonzero(seen))
        observation = with_shared(observation, SharedError("camera", sharing, solved.covariance, X))
    return ImportedRecording(
        scenario=scenario,
        observation=observation,
        camera=solved,
        stays=stays,
        operations=operations,
        stood=whence,
        fit=arrangement.fit,
        stays_stated=camera.stays is not None,
        unclear=tell_doubts(stays, arrangement, operations, covariance, assembly),
    )


def _never_rests(part: str, track: PoseTrack, assembly: Assembly) -> str:
    still = [turn_alike(assembly.solids[part], T, track.T[0]) for T in track.T]
    spins = ""
    if rests_of(PoseTrack(track.t, np.array(still))):
        spins = " but for a turn about its axis of revolution, which the tracker is to hold"
    return (
        f"'{part}' never rests{spins}, so nothing is known of it (frames: {len(track.t)}, in {np.ptp(track.t):.2f} s); "
        f"give a log in which it lies still for {least_rest_s(track):.1f} s and more."
    )


def planned_starts(scenario: Scenario) -> Poses:
    """Where the scenario starts every part, world, [m]."""
    return layout_at(scenario, 0.0, 0.0, 0.0, clearance_mm=scenario.clearance_mm).start


def _adjustments(operations: Sequence[SeenOperation], assembly: Assembly) -> Array:
    """The square of what later operations moved unasked, at the operation that had placed it, (n, 6, 6)."""
    C = np.zeros((len(assembly), 6, 6))
    for k, operation in enumerate(operations):
        for part, twist in operation.adjusted.items():
            placed = [j for j in range(k) if assembly.operations[j].main == part]
            if placed:
                C[placed[-1]] += np.outer(twist, twist)
    return C


def deviations(rest: RestSpan, camera: CameraFile) -> tuple[float, float]:
    """Standard deviations per axis of one rest, [m, rad]: of its mean, and of what stays; else that of one frame."""
    return per_axis(rest.mean.covariance + staying(camera, rest.mean))
