"""What stays unclear of a recording that fits, so that it can be stated: one sentence for each doubt."""

from collections.abc import Iterator, Sequence

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.geometry import Array
from apo_bench.importers.recording.arranging import Arrangement
from apo_bench.importers.recording.averaging import per_axis
from apo_bench.importers.recording.operations import SeenOperation
from apo_bench.importers.recording.ordering import moves_text
from apo_bench.importers.recording.stays import Stays

_MOVED_MM = 10.0
"""A part that moves by more during an operation of another one was not only adjusted."""
_OPEN_MM = 3.0
_OPEN = 5.0
"""Contacts are open if by more than this, and more than so many deviations; a degree counts like a millimetre."""


def tell_doubts(
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
        *tell_hidden(stays),
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


def tell_hidden(stays: Stays) -> Iterator[str]:
    """One sentence for each part that was not seen for a while after it had rested."""
    for part, known in stays.items():
        for rest in (rest for stay in known for rest in stay.rests if rest.gone > rest.ends):
            yield f"'{part}' was hidden from {rest.ends:.2f} to {rest.gone:.2f} s"
