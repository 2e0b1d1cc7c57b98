"""What the picture of a recording shows: of one that fits, of one that does not, of one without a scenario."""

from collections.abc import Mapping, Sequence

import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.recording.arranging import camera_pose
from apo_bench.recording.camera_file import CameraFile
from apo_bench.recording.importing import ImportedRecording, planned_starts
from apo_bench.recording.log import Log, PoseTrack
from apo_bench.recording.operations import approaches
from apo_bench.recording.show.drawing import DrawnEnd, RecordingDrawing
from apo_bench.recording.stays import Stays, all_stays
from apo_bench.recording.without_scenario import UnplannedRecording
from apo_bench.scenario.scenario import Scenario


def drawing_of(
    recording: ImportedRecording, log: Log, tracks: Mapping[str, PoseTrack], camera: CameraFile
) -> RecordingDrawing:
    """Of a recording that was understood."""
    operations = recording.scenario.assembly.operations
    return RecordingDrawing(
        title=_title(log, recording.scenario),
        tracks=tracks,
        stays=recording.stays,
        T_world_camera=recording.camera.T_world_camera,
        ended=[
            (operation.main, seen.rest.begins)
            for operation, seen in zip(operations, recording.operations, strict=True)
            if seen.rest is not None
        ],
        solids=recording.scenario.assembly.solids,
        places=_places(camera, planned_starts(recording.scenario)),
        path_ends=_path_ends(recording),
    )


def unfit_drawing(
    log: Log, tracks: Mapping[str, PoseTrack], camera: CameraFile, scenario: Scenario
) -> RecordingDrawing:
    """Of a recording that is refused: as it was read, with the camera where it fits best."""
    stays = all_stays(tracks)
    planned = planned_starts(scenario)
    X = _camera(stays, camera, planned)
    return RecordingDrawing(
        title=f"{_title(log, scenario)}; it does not fit",
        tracks=tracks,
        stays=stays,
        T_world_camera=X,
        solids=scenario.assembly.solids,
        places={} if X is None else _places(camera, planned),
    )


def unplanned_drawing(recording: UnplannedRecording, log: Log, tracks: Mapping[str, PoseTrack]) -> RecordingDrawing:
    """Of a recording without a scenario."""
    return RecordingDrawing(
        title=_title(log, None),
        tracks=tracks,
        stays=recording.stays,
        T_world_camera=recording.camera.T_world_camera,
        ended=[(put.part, put.rest.begins) for put in recording.puts],
    )


def _title(log: Log, scenario: Scenario | None) -> str:
    return f"{log.file}{f', {scenario.name}' if scenario else ''}\n{'; '.join(log.notes)}"


def _places(camera: CameraFile, planned: Poses) -> Poses:
    """Known places, world, [m]."""
    return {part: planned[part] if T is None else T for part, T in camera.known.items()}


def _camera(stays: Stays, camera: CameraFile, planned: Poses) -> Array | None:
    try:
        return camera_pose(stays, camera, planned).T_world_camera
    except (InputError, LookupError, np.linalg.LinAlgError):
        return None


def _path_ends(recording: ImportedRecording) -> Sequence[DrawnEnd]:
    drawn = []
    X = recording.camera.T_world_camera
    for approach in approaches(recording.scenario, recording.operations, X):
        rest = recording.operations[approach.operation].rest
        if approach.end is not None and rest is not None:
            goal = X @ rest.T
            way = approach.end.length_m * goal[:3, :3] @ approach.end.direction
            part = recording.scenario.assembly.operations[approach.operation].main
            label = f"{approach.operation + 1}: {approach.macro}, {approach.off_deg:.0f} deg off"
            drawn.append(DrawnEnd(part, label, goal[:3, 3] - way, goal[:3, 3]))
    return drawn
