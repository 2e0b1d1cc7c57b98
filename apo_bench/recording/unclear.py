"""What stays unclear of a recording that fits, so that a person can state it."""

from collections.abc import Iterator, Sequence

import numpy as np

from apo_bench.assembly.topology import Assembly
from apo_bench.geometry.arrays import Array
from apo_bench.recording.arranging import Arrangement
from apo_bench.recording.operations import Seen
from apo_bench.recording.ordering import moves_text
from apo_bench.recording.stays import Stays

_MOVED_MM = 10.0
"""A part that moves by more during an operation of another one was not only adjusted."""
_OPEN_MM = 3.0
_OPEN = 5.0
"""Contacts are open if by more than this, and more than so many deviations; a degree counts like a millimetre."""


def unclear(
    stays: Stays, found: Arrangement, operations: Sequence[Seen], covariance: Array, assembly: Assembly
) -> tuple[str, ...]:
    """One sentence for each doubt.

    Args:
        operations: As the log shows them.
        covariance: Of each goal, (n, 6, 6), [m, rad].
    """
    return (
        *_rivals(found),
        *_open(found, covariance, assembly),
        *_moved_too(stays, operations),
        *(
            f"'{part}' stood otherwise at the start than in the scenario; its start is as it was seen"
            for part in stays
            if found.whence[part] == "otherwise"
        ),
        *_pauses(stays, found, assembly),
    )


def _rivals(found: Arrangement) -> Iterator[str]:
    order = found.order
    for k, (mine, other) in enumerate(zip(order.stays, order.rival or order.stays, strict=True)):
        if mine is not None and other is not None and mine is not other:
            yield (
                f"operation {k + 1} ({mine.part}) ended at {mine.begins:.2f} s, or at {other.begins:.2f} s: both "
                "are about as likely; state the right ones by --ends"
            )


def _open(found: Arrangement, covariance: Array, assembly: Assembly) -> Iterator[str]:
    for k, fit in found.fits.items():
        mm = 1e3 * np.sqrt(np.trace(covariance[k, :3, :3]) / 3.0)
        deg = np.degrees(np.sqrt(np.trace(covariance[k, 3:, 3:]) / 3.0))
        if fit.wrong_mm > _OPEN_MM + _OPEN * (mm + deg):
            yield (
                f"operation {k + 1} ({assembly.operations[k].main}) leaves a contact open by {1e3 * fit.gap_m:.1f} mm "
                f"and {np.degrees(fit.angle_rad):.1f} deg, more than frames that are off by {mm:.1f} mm and "
                f"{deg:.1f} deg explain; check the frames in the objects file, and that the part was put down"
            )


def _moved_too(stays: Stays, operations: Sequence[Seen]) -> Iterator[str]:
    for k, one in enumerate(operations):
        for part, moved in one.adjusted.items():
            far = float(np.linalg.norm(moved[:3])) * 1e3
            if far > _MOVED_MM:
                yield (
                    f"operation {k + 1}: '{part}' moved too, by {far:.0f} mm, which the scenario does not say; "
                    f"moves in the log: {moves_text(stays)}"
                )


def _pauses(stays: Stays, found: Arrangement, assembly: Assembly) -> Iterator[str]:
    used = {id(stay) for stay in found.order.stays}
    mains = {operation.main for operation in assembly.operations}
    carried = {part for operation in assembly.operations for part in operation.carries}
    for part, known in stays.items():
        if part in mains:
            pauses = [stay for stay in known[1:] if id(stay) not in used]
            if pauses and part not in carried:
                at = ", ".join(f"{stay.begins:.2f} s" for stay in pauses)
                yield f"'{part}' also rested at {at}, on its way: taken as a pause; state --ends if it was put down"
        elif part not in carried and len(known) > 1:
            yield f"'{part}' moved at {known[1].begins:.2f} s, although no operation of the scenario moves it"
