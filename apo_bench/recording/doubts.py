"""What is wrong with a recording that does not fit, and what stays unclear of one that does, so that it can be stated.

Of a recording that does not fit each usual mistake is undone, and the one whose undoing mends it is named.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.recording.arranging import Arrange, Arrangement
from apo_bench.recording.averaging import per_axis
from apo_bench.recording.operations import SeenOperation
from apo_bench.recording.ordering import NoOrder, moves_text
from apo_bench.recording.setup_files import CameraFile
from apo_bench.recording.stays import Stays, mistakes, reversed_in_time

_FITS_MM = 20.0
"""A contact that is open by more, or a known place that is missed by more, is no noise; degrees count like mm."""
_MENDS = 0.4
"""What mends a recording leaves at most this part of what was wrong."""
_MOVED_MM = 10.0
"""A part that moves by more during an operation of another one was not only adjusted."""
_OPEN_MM = 3.0
_OPEN = 5.0
"""Contacts are open if by more than this, and more than so many deviations; a degree counts like a millimetre."""
_HELPLESS = (
    "neither another order of the quaternions or of Euler angles, mirrored axes, inverted poses, another unit nor "
    "reversed time mends it, so check the frames of the parts in the objects file, the ids, the pose of the camera, "
    "and that the log goes on until the last part was put down"
)


def check_arrangement(
    arrangement: Arrangement,
    arrange: Arrange,
    stays: Stays,
    models: Mapping[str, Array],
    camera: CameraFile,
    file: str,
) -> None:
    """Refuse a recording in which no contact fits, with what would mend it.

    Args:
        models: Part -> where its frame lies in the tracker's model, (4, 4), [m]; the identity if it is missing.
        camera: As it was stated.

    Raises:
        InputError: It does not fit.
    """
    if arrangement.wrong_mm <= _FITS_MM:
        return
    best = arrangement.wrong_mm * _MENDS
    remedy = _HELPLESS
    for sentence, mended in mistakes(stays, models, camera):
        try:
            wrong = arrange(mended).wrong_mm
        except (NoOrder, np.linalg.LinAlgError):
            continue
        if wrong < min(best, _FITS_MM):
            best = wrong
            remedy = f"{sentence}; then all is within {wrong:.1f} mm"
    pose = arrangement.camera
    missed = f", known places are missed by up to {pose.off_mm:.0f} mm and {pose.off_deg:.0f} deg"
    raise InputError(
        f"{file}: no contact fits as it is stated (they are open by up to {1e3 * arrangement.fit.gap_m:.0f} mm and "
        f"{np.degrees(arrangement.fit.angle_rad):.0f} deg{missed if pose.residuals else ''}); {remedy}."
    )


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


def unclear(
    stays: Stays,
    arrangement: Arrangement,
    operations: Sequence[SeenOperation],
    covariance: Array,
    assembly: Assembly,
) -> tuple[str, ...]:
    """One sentence for each doubt.

    Args:
        operations: As the log shows them.
        covariance: Of each goal, (n, 6, 6), [m, rad].
    """
    return (
        *_rivals(arrangement),
        *_open(arrangement, covariance, assembly),
        *_moved_too(stays, operations),
        *(
            f"'{part}' stood otherwise at the start than in the scenario; its start is as it was seen"
            for part in stays
            if arrangement.whence[part] == "otherwise"
        ),
        *_pauses(stays, arrangement, assembly),
    )


def _rivals(arrangement: Arrangement) -> Iterator[str]:
    chosen, rival = arrangement.order
    for k, (mine, other) in enumerate(zip(chosen, rival or chosen, strict=True)):
        if mine is not None and other is not None and mine is not other:
            yield (
                f"operation {k + 1} ({mine.part}) ended at {mine.begins:.2f} s, or at {other.begins:.2f} s: both "
                "are about as likely; state the right ones by --ends"
            )


def _open(arrangement: Arrangement, covariance: Array, assembly: Assembly) -> Iterator[str]:
    for k, fit in arrangement.fits.items():
        mm, deg = np.multiply(per_axis(covariance[k]), (1e3, np.degrees(1.0)))
        if fit.wrong_mm > _OPEN_MM + _OPEN * (mm + deg):
            yield (
                f"operation {k + 1} ({assembly.operations[k].main}) leaves a contact open by {1e3 * fit.gap_m:.1f} mm "
                f"and {np.degrees(fit.angle_rad):.1f} deg, more than frames that are off by {mm:.1f} mm and "
                f"{deg:.1f} deg explain; check the frames in the objects file, and that the part was put down"
            )


def _moved_too(stays: Stays, operations: Sequence[SeenOperation]) -> Iterator[str]:
    for k, operation in enumerate(operations):
        for part, twist in operation.adjusted.items():
            far = float(np.linalg.norm(twist[:3])) * 1e3
            if far > _MOVED_MM:
                yield (
                    f"operation {k + 1}: '{part}' moved too, by {far:.0f} mm, which the scenario does not say; "
                    f"moves in the log: {moves_text(stays)}"
                )


def _pauses(stays: Stays, arrangement: Arrangement, assembly: Assembly) -> Iterator[str]:
    mains = {operation.main for operation in assembly.operations}
    carried = {part for operation in assembly.operations for part in operation.carries}
    for part, known in stays.items():
        pauses = [f"{stay.begins:.2f} s" for stay in known[1:] if stay not in arrangement.order.stays]
        if part in carried or not pauses:
            continue
        if part in mains:
            at = ", ".join(pauses)
            yield f"'{part}' also rested at {at}, on its way: taken as a pause; state --ends if it was put down"
        else:
            yield f"'{part}' moved at {pauses[0]}, although no operation of the scenario moves it"
