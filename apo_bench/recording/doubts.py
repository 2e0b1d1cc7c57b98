"""What is wrong with a recording that does not fit, and what stays unclear of one that does, so that it can be stated.

Of a recording that does not fit each usual mistake is undone, and the one whose undoing mends it is named.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose, symmetries
from apo_bench.recording.arranging import Arrange, Arrangement, staying
from apo_bench.recording.averaging import per_axis
from apo_bench.recording.operations import SeenOperation
from apo_bench.recording.ordering import NoOrder, moves_text
from apo_bench.recording.setup_files import CameraFile
from apo_bench.recording.stays import Stays, is_flip, is_near, mistakes, reversed_in_time

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
    "that no part is flipped to where it looks the same, and that the log goes on until the last part was put down"
)
_FAR = 5.0
"""A part that moved by more standard deviations did move."""


def check_arrangement(
    arrangement: Arrangement,
    arrange: Arrange,
    stays: Stays,
    models: Mapping[str, Array],
    camera: CameraFile,
    assembly: Assembly,
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
    for sentence, mended in chain(mistakes(stays, models, camera), _flipped(stays, assembly)):
        try:
            wrong = arrange(mended).wrong_mm
        except (NoOrder, np.linalg.LinAlgError):
            continue
        if wrong < min(best, _FITS_MM):
            best = wrong
            remedy = f"{sentence}; then all is within {wrong:.1f} mm"
    solved = arrangement.camera
    missed = f", known places are missed by up to {solved.off_mm:.0f} mm and {solved.off_deg:.0f} deg"
    raise InputError(
        f"{file}: no contact fits as it is stated (they are open by up to {1e3 * arrangement.fit.gap_m:.0f} mm and "
        f"{np.degrees(arrangement.fit.angle_rad):.0f} deg{missed if solved.residuals else ''}); {remedy}."
    )


def _flipped(stays: Stays, assembly: Assembly) -> Iterator[tuple[str, Stays]]:
    """What to do about each symmetry by which a part may be flipped at its last place, and the stays that it gives."""
    for part, (*others, last) in stays.items():
        for g in symmetries(assembly.solids[part])[1:]:
            rests = tuple(replace(rest, mean=replace(rest.mean, T=rest.T @ g)) for rest in last.rests)
            yield (
                f"'{part}' seems to be flipped by {np.degrees(np.linalg.norm(pose.log(g)[3:])):.0f} deg, by which it "
                f"looks the same, from {last.begins:.2f} s on: turn its poses back from there on",
                {**stays, part: (*others, replace(last, rests=rests))},
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
    unseen = next(hidden({part: stays[part]}), "it may have been hidden")
    return f"{unseen}, or operations ended at other times: state them by --ends (moves in the log: {moves_text(stays)})"


def hidden(stays: Stays) -> Iterator[str]:
    """One sentence for each part that was not seen for a while after it had rested."""
    for part, known in stays.items():
        for rest in (rest for stay in known for rest in stay.rests if rest.gone > rest.ends):
            yield f"'{part}' was hidden from {rest.ends:.2f} to {rest.gone:.2f} s"


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
