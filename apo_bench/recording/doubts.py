"""What is wrong with a recording that does not fit: each usual mistake is tried, and the one that mends it is named."""

from collections.abc import Mapping

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.recording.arranging import Arrange, Arrangement
from apo_bench.recording.camera_file import CameraFile
from apo_bench.recording.mistakes import mistakes, reversed_in_time
from apo_bench.recording.ordering import NoOrder
from apo_bench.recording.stays import Stays

_FITS_MM = 20.0
"""A contact that is open by more, or a known place that is missed by more, is no noise; degrees count like mm."""
_MENDS = 0.4
"""What mends a recording leaves at most this part of what was wrong."""
_HELPLESS = (
    "neither another order of the quaternions or of Euler angles, mirrored axes, inverted poses, another unit nor "
    "reversed time mends it, so check the frames of the parts in the objects file, the ids, the pose of the camera, "
    "and that the log goes on until the last part was put down"
)


def check_arrangement(
    found: Arrangement, arrange: Arrange, stays: Stays, models: Mapping[str, Array], camera: CameraFile, file: str
) -> None:
    """Refuse a recording in which no contact fits, with what would mend it.

    Args:
        models: Part -> where its frame lies in the tracker's model, (4, 4), [m]; the identity if it is missing.
        camera: As it was stated.

    Raises:
        InputError: It does not fit.
    """
    if found.wrong_mm <= _FITS_MM:
        return
    best = found.wrong_mm * _MENDS
    said = ""
    for sentence, other in mistakes(stays, models, camera):
        try:
            wrong = arrange(other).wrong_mm
        except (NoOrder, np.linalg.LinAlgError):
            continue
        if wrong < min(best, _FITS_MM):
            best = wrong
            said = f"{sentence}; then all is within {wrong:.1f} mm"
    raise InputError(f"{file}: no contact fits as it is stated ({_wrong(found)}); {said or _HELPLESS}.")


def check_direction(arrange: Arrange, stays: Stays, file: str) -> None:
    """Refuse a recording that is played backwards.

    Raises:
        InputError: Played the other way it has the operations of the scenario, and contacts fit.
    """
    try:
        wrong = arrange(reversed_in_time(stays)).wrong_mm
    except NoOrder:
        return
    if wrong < _FITS_MM:
        raise InputError(
            f"{file}: time seems to run backwards: played the other way, all is within {wrong:.1f} mm of the scenario; "
            "give the log as it was recorded."
        )


def _wrong(found: Arrangement) -> str:
    said = [f"they are open by up to {1e3 * found.fit.gap_m:.0f} mm and {np.degrees(found.fit.angle_rad):.0f} deg"]
    if found.camera.residuals:
        said.append(f"known places are missed by up to {found.camera.off_mm:.0f} mm and {found.camera.off_deg:.0f} deg")
    return ", ".join(said)
