"""Reject a recording that contradicts its scenario: open contacts, or parts that moved without an operation."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.arrangement import Arrangement
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import rest_error
from apo_bench.importers.recording.log_poses import mirror
from apo_bench.importers.recording.observed_operation import LoggedOperation
from apo_bench.importers.recording.ordering import NoMatchingOrder, describe_moves
from apo_bench.importers.recording.rest_intervals import RestIntervals, is_near
from apo_bench.importers.recording.tracks import PoseTrack

_FITS_MM = 20.0
"""A larger misfit of a contact or of a known place cannot be noise; a degree counts like a millimetre."""
_BETTER = 0.4
"""Another convention is suggested only if it leaves less than this share of the misfit."""
_NOTED_MM = 4.0
"""A smaller misfit, and one that is smaller by less, may be noise."""
_UNITS = {"ten times larger": 10.0, "ten times smaller": 0.1}
"""Units of length to try: others are out of the range of a camera."""
_FAR = 5.0
"""A part moved if its displacement exceeds this many standard deviations."""


def check_arrangement(
    arrangement: Arrangement,
    arrange_tracks: Callable[[Mapping[str, PoseTrack]], Arrangement],
    tracks: Mapping[str, PoseTrack],
    models: Mapping[str, Array],
    file: str,
) -> tuple[str, ...]:
    """Return a sentence on another convention of the log if all fits clearly better with it.

    Args:
        arrange_tracks: Function that arranges tracks again, for other conventions.
        tracks: The tracks as read, camera from part.
        models: Part -> pose of its frame in the tracker's model, (4, 4), [m]; the identity if missing.
        file: Name of the log, for messages.

    Raises:
        InputError: Contacts are far open.
    """
    wrong = arrangement.wrong_mm
    best = min(wrong * _BETTER, wrong - _NOTED_MM, _FITS_MM)
    if best <= 0.0:
        return ()
    remedy = ""
    for key, change in _other_conventions():
        try:
            other = arrange_tracks(_change_models(tracks, models, change)).wrong_mm
        except (NoMatchingOrder, np.linalg.LinAlgError):
            continue
        if other < best:
            best = other
            remedy = f"state another `{key}` in the camera file, with which all is within {other:.1f} mm"
    if wrong > _FITS_MM:
        remedy = remedy or "check how the log is written in the camera file, and the ids and frames in the objects file"
        solved = arrangement.camera
        raise InputError(
            f"{file}: no contact fits as it is stated (they are open by up to {1e3 * arrangement.fit.gap_m:.0f} mm and "
            f"{np.degrees(arrangement.fit.angle_rad):.0f} deg, known places are missed by up to {solved.off_mm:.0f} mm "
            f"and {solved.off_deg:.0f} deg); {remedy}."
        )
    return (f"contacts and known places are within {wrong:.1f} mm; {remedy}",) if remedy else ()


def _other_conventions() -> Sequence[tuple[str, Callable[[Array], Array]]]:
    """Return the conventions to try: key of the camera file, and the change of model poses for another value of it."""
    return (
        *((f"length ({unit})", partial(_scale, factor=factor)) for unit, factor in _UNITS.items()),
        *(("quaternion", partial(_reorder, shift=shift)) for shift in (1, -1)),
        *(("mirror", partial(np.multiply, mirror(axis))) for axis in "xyz"),
        ("inverted", pose.inverse),
        ("pose (axes of OpenGL)", partial(np.matmul, np.diag([1.0, -1.0, -1.0, 1.0]))),
    )


def _scale(T: Array, factor: float) -> Array:
    """Return poses with positions multiplied by a factor."""
    out = np.array(T)
    out[..., :3, 3] *= factor
    return out


def _reorder(T: Array, shift: int) -> Array:
    """Return the pose with the numbers of its quaternion shifted cyclically, as if read in the other order."""
    packed = pose.pack(T)
    return np.asarray(pose.unpack(np.concatenate([packed[..., :3], np.roll(packed[..., 3:], shift, axis=-1)], axis=-1)))


def _change_models(
    tracks: Mapping[str, PoseTrack], models: Mapping[str, Array], change: Callable[[Array], Array]
) -> Mapping[str, PoseTrack]:
    """Return the tracks with the poses of models changed; poses of parts are converted to models and back."""
    M = {part: models.get(part, np.eye(4)) for part in tracks}
    return {part: PoseTrack(t, change(T @ pose.inverse(M[part])) @ M[part]) for part, (t, T) in tracks.items()}


def check_moved(
    intervals: RestIntervals,
    operations: Sequence[LoggedOperation],
    camera: CameraFile,
    assembly: Assembly,
    file: str,
) -> None:
    """Raise InputError if a part moved without an operation, by more than errors or an adjustment explain.

    Args:
        operations: The observed operations, in order.
        file: Name of the log, for messages.
    """
    unseen = {part for k, each in enumerate(operations) if each.rest is None for part in assembly.operations[k].moves}
    for k, operation in enumerate(operations):
        for part, twist in {**operation.carried, **operation.adjusted}.items():
            means = [rest.mean for interval in intervals[part] for rest in interval.rests]
            # Variance of the difference of two rests, each as uncertain as the least certain one.
            variance = np.max([np.diag(mean.covariance + rest_error(camera, mean)) for mean in means], axis=0)
            deviations = float(np.abs(twist / np.sqrt(2.0 * variance)).max())
            if part in unseen or is_near(twist) or deviations <= _FAR:
                continue
            raise InputError(
                f"{file}: '{part}' moved by {1e3 * np.linalg.norm(twist[:3]):.0f} mm and "
                f"{np.degrees(np.linalg.norm(twist[3:])):.0f} deg during operation {k + 1} "
                f"('{assembly.operations[k].main}'), which should not move it, {deviations:.0f} standard deviations of "
                "where it was observed; if it was hidden or flipped by the tracker, leave those poses out, or state "
                f"when operations ended by --operation-ends (moves in the log: {describe_moves(intervals)})."
            )
