"""Recordings that do not fit their scenario are refused, with what is likely wrong."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose, symmetries
from apo_bench.importers.recording.arranging import Arrange, Arrangement, staying
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.columns import mirror
from apo_bench.importers.recording.doubts import tell_hidden
from apo_bench.importers.recording.operations import SeenOperation
from apo_bench.importers.recording.ordering import NoOrder, moves_text
from apo_bench.importers.recording.stays import Stays, is_flip, is_near

_FITS_MM = 20.0
"""A contact that is open by more, or a known place that is missed by more, is no noise; degrees count like mm."""
_MENDS = 0.4
"""What fits better leaves at most this part of what was wrong."""
_FAR = 5.0
"""A part that moved by more standard deviations did move."""
_HELPLESS = (
    "check how the log is written, in the camera file, the frames and ids in the objects file, the pose of the camera, "
    "that no part is flipped to where it looks the same, and that the log goes on until the last part was put down"
)


def check_arrangement(
    arrangement: Arrangement,
    arrange: Arrange,
    stays: Stays,
    models: Mapping[str, Array],
    assembly: Assembly,
    file: str,
) -> None:
    """Refuse a recording in which no contact fits, with another convention or a flip that fits better.

    Args:
        models: Part -> where its frame lies in the tracker's model, (4, 4), [m]; the identity if it is missing.

    Raises:
        InputError: It does not fit.
    """
    if arrangement.wrong_mm <= _FITS_MM:
        return
    best = min(arrangement.wrong_mm * _MENDS, _FITS_MM)
    remedy = _HELPLESS
    for sentence, other in chain(_otherwise_stated(stays, models), _flipped(stays, assembly)):
        try:
            wrong = arrange(other).wrong_mm
        except (NoOrder, np.linalg.LinAlgError):
            continue
        if wrong < best:
            best = wrong
            remedy = f"{sentence}; then all is within {wrong:.1f} mm"
    solved = arrangement.camera
    missed = f", known places are missed by up to {solved.off_mm:.0f} mm and {solved.off_deg:.0f} deg"
    raise InputError(
        f"{file}: no contact fits as it is stated (they are open by up to {1e3 * arrangement.fit.gap_m:.0f} mm and "
        f"{np.degrees(arrangement.fit.angle_rad):.0f} deg{missed if solved.residuals else ''}); {remedy}."
    )


def _otherwise_stated(stays: Stays, models: Mapping[str, Array]) -> Iterator[tuple[str, Stays]]:
    """The stays under other conventions, each with what it says; these are of the poses of the tracker's models."""
    others: list[tuple[str, Callable[[Array], Array]]] = [
        *(("quaternion", partial(_reorder, shift=shift)) for shift in (1, -1)),
        *(("mirror", partial(np.multiply, mirror(axis))) for axis in "xyz"),
        ("inverted", pose.inverse),
    ]
    for key, change in others:
        yield f"another `{key}` in the camera file fits better", _changed(stays, models, change)


def _reorder(T: Array, shift: int) -> Array:
    """The rotation that the same four numbers are in the other order."""
    packed = pose.pack(T)
    return np.asarray(pose.unpack(np.concatenate([packed[:3], np.roll(packed[3:], shift)])))


def _changed(stays: Stays, models: Mapping[str, Array], change: Callable[[Array], Array]) -> Stays:
    """The stays of the same parts, once the poses of their models are changed."""
    out = {}
    for part, known in stays.items():
        M = models.get(part, np.eye(4))
        out[part] = tuple(stay.moved(partial(_change_model, M=M, change=change)) for stay in known)
    return out


def _change_model(T: Array, M: Array, change: Callable[[Array], Array]) -> Array:
    """The pose of a part whose frame lies at M in its model."""
    return change(T @ pose.inverse(M)) @ M


def _flipped(stays: Stays, assembly: Assembly) -> Iterator[tuple[str, Stays]]:
    """The stays with each part turned by each of its symmetries at its last place, and what to do about it."""
    for part, (*others, last) in stays.items():
        for g in symmetries(assembly.solids[part])[1:]:
            yield (
                f"'{part}' seems to be flipped by {np.degrees(np.linalg.norm(pose.log(g)[3:])):.0f} deg, by which it "
                f"looks the same, from {last.begins:.2f} s on: turn its poses back from there on",
                {**stays, part: (*others, last.moved(partial(np.dot, b=g)))},
            )


def check_moved(
    stays: Stays, operations: Sequence[SeenOperation], camera: CameraFile, assembly: Assembly, file: str
) -> None:
    """Refuse a recording in which a part moved that should not have, by more than errors or an adjustment explain.

    Args:
        operations: As the log shows them.

    Raises:
        InputError: It names the part, the operation, by how much it moved and why that may be.
    """
    unseen = {part for k, each in enumerate(operations) if each.rest is None for part in assembly.operations[k].moves}
    for k, operation in enumerate(operations):
        for part, twist in {**operation.carried, **operation.adjusted}.items():
            means = [rest.mean for stay in stays[part] for rest in stay.rests]
            # Of the difference of two rests, each as uncertain as the least certain one.
            deviation = np.sqrt(2.0 * np.max([np.diag(m.covariance + staying(camera, m)) for m in means], axis=0))
            if part in unseen or is_near(twist) or np.abs(twist / deviation).max() <= _FAR:
                continue
            main = assembly.operations[k].main
            moves = "carries along" if part in operation.carried else "does not move"
            raise InputError(
                f"{file}: '{part}' moved by {1e3 * np.linalg.norm(twist[:3]):.0f} mm and "
                f"{np.degrees(np.linalg.norm(twist[3:])):.0f} deg"
                f"{' in the hand' if part in operation.carried else ''} during operation {k + 1} ('{main}'), which "
                f"{moves} it, {np.abs(twist / deviation).max():.0f} standard deviations of where it was seen; "
                f"{_why_moved(stays, part, twist, assembly)}."
            )


def _why_moved(stays: Stays, part: str, twist: Array, assembly: Assembly) -> str:
    """The likely cause, and what to do about it."""
    if is_flip(assembly.solids[part], twist):
        return "it looks the same turned so, and was probably flipped: turn its poses back, or leave them out"
    unseen = next(tell_hidden({part: stays[part]}), "it may have been hidden")
    return f"{unseen}, or operations ended at other times: state them by --ends (moves in the log: {moves_text(stays)})"
