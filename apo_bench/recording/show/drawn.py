"""What the picture of a recording shows: of one that fits, of one that does not, of one without a scenario."""

from collections.abc import Mapping, Sequence

import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.errors import InputError
from apo_bench.recording.approach import approaches
from apo_bench.recording.arranging import camera_pose
from apo_bench.recording.bare import Bare
from apo_bench.recording.camera_file import CameraFile
from apo_bench.recording.importing import Imported, planned_starts
from apo_bench.recording.log import Log, Track
from apo_bench.recording.rests import rests_of
from apo_bench.recording.show.drawing import Drawing, Straight
from apo_bench.recording.stays import Stays, stays_of
from apo_bench.scenario.scenario import Scenario


def drawing_of(found: Imported, log: Log, tracks: Mapping[str, Track], camera: CameraFile) -> Drawing:
    """Of a recording that was understood."""
    operations = found.scenario.assembly.operations
    return Drawing(
        title=_title(log, found.scenario),
        tracks=tracks,
        stays=found.stays,
        T_world_camera=found.camera.T_world_camera,
        ended=[
            (operation.main, one.rest.begins)
            for operation, one in zip(operations, found.operations, strict=True)
            if one.rest is not None
        ],
        solids=found.scenario.assembly.solids,
        places=_places(camera, planned_starts(found.scenario)),
        straight=_straight(found),
    )


def unfit_drawing(log: Log, tracks: Mapping[str, Track], camera: CameraFile, scenario: Scenario) -> Drawing:
    """Of a recording that is refused: as it was read, with the camera where it fits best."""
    stays = {part: stays_of(part, rests_of(track)) for part, track in tracks.items()}
    planned = planned_starts(scenario)
    X = _camera(stays, camera, planned)
    return Drawing(
        title=f"{_title(log, scenario)}; it does not fit",
        tracks=tracks,
        stays=stays,
        T_world_camera=X,
        solids=scenario.assembly.solids,
        places={} if X is None else _places(camera, planned),
    )


def bare_drawing(found: Bare, log: Log, tracks: Mapping[str, Track]) -> Drawing:
    """Of a recording without a scenario."""
    return Drawing(
        title=_title(log, None),
        tracks=tracks,
        stays=found.stays,
        T_world_camera=found.camera.T_world_camera,
        ended=[(put.part, put.rest.begins) for put in found.puts],
    )


def _title(log: Log, scenario: Scenario | None) -> str:
    return f"{log.file}{f', {scenario.name}' if scenario else ''}\n{'; '.join(log.notes)}"


def _places(camera: CameraFile, planned: Poses) -> Poses:
    """Known places, world, [m]; parts that the scenario does not have stand nowhere."""
    return {
        part: planned[part] if T is None else T for part, T in camera.known.items() if T is not None or part in planned
    }


def _camera(stays: Stays, camera: CameraFile, planned: Poses) -> np.ndarray | None:
    try:
        return camera_pose(stays, camera, planned).T_world_camera
    except (InputError, LookupError, np.linalg.LinAlgError):
        return None


def _straight(found: Imported) -> Sequence[Straight]:
    drawn = []
    for one in approaches(found):
        rest = found.operations[one.operation].rest
        if one.straight is not None and rest is not None:
            goal = found.camera.T_world_camera @ rest.T
            way = one.straight.length_m * goal[:3, :3] @ one.straight.direction
            label = f"{one.operation + 1}: {one.macro}, {one.off_deg:.0f} deg off"
            drawn.append(
                Straight(found.scenario.assembly.operations[one.operation].main, label, goal[:3, 3] - way, goal[:3, 3])
            )
    return drawn
