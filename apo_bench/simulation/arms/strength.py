"""Scale the drive of a gripper to the force that its file states, or where its model hardly pushes."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError
from apo_bench.simulation.arms.measuring import Measured

LEAST_FORCE_N = 10.0
"""Of each pad: below it parts slip."""
_USUAL_FORCE_N = 20.0
"""As the usual arm; of a drive that is made stronger unasked."""
_NEAR = 0.02
_TRIES = 5
_NOTHING_N = 0.01


def with_force(
    spec: Any, wanted_n: float | None, path: Path, measured: Callable[[Any], Measured]
) -> tuple[Measured, float]:
    """Measure the gripper of an arm, and scale its drive until each pad pushes as it should.

    Gains, damping and limits of its actuators, and limits of the joints they push, are scaled by one factor in `spec`,
    so that it closes as fast as before.

    Args:
        wanted_n: The force of each pad; None: as in the model, and 20 N where that is less than 10 N.
        path: The file, for messages.
        measured: Drives the gripper of a spec.

    Returns:
        What was measured at last, and how many times as strong as in the model the drive is then.

    Raises:
        InputError: The stated force is not reached, however strong the drive is.
    """
    first = measured(spec)
    if wanted_n is None and first.hand.force_n >= LEAST_FORCE_N:
        return first, 1.0
    aim = _USUAL_FORCE_N if wanted_n is None else wanted_n
    times = 1.0
    scaled = first
    for _ in range(_TRIES):
        if abs(scaled.hand.force_n - aim) <= _NEAR * aim:
            return scaled, times
        by = aim / max(scaled.hand.force_n, _NOTHING_N)
        _scale(spec, first.hand.actuators, by)
        times *= by
        scaled = measured(spec)
    if wanted_n is None:
        _scale(spec, first.hand.actuators, 1.0 / times)
        return first, 1.0
    raise InputError(
        f"{path}, gripper: 'force_n' is {wanted_n:g}, and each pad pushes with {scaled.hand.force_n:.1f} N after its "
        f"drive was made {times:.3g} times as strong; state what it can do, or correct its actuators."
    )


def _scale(spec: Any, actuators: Sequence[str], by: float) -> None:
    """A damping above zero is a ratio (`dampratio`), which needs no scale."""
    for name in actuators:
        actuator = spec.actuator(name)
        damping = actuator.biasprm[2]
        actuator.gainprm[:3] = by * actuator.gainprm[:3]
        actuator.biasprm[:2] = by * actuator.biasprm[:2]
        actuator.biasprm[2] = damping if damping > 0.0 else by * damping
        actuator.forcerange[:] = by * actuator.forcerange
        joint = spec.joint(actuator.target)
        if joint is not None:
            joint.actfrcrange[:] = by * joint.actfrcrange
