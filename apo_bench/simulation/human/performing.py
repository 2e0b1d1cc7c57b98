"""Carry out one planned operation with two hands."""

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.human.hands import Hands
from apo_bench.simulation.human.operation import HandOperation
from apo_bench.simulation.robot import (
    Trajectory,
    interpolate_minimum_jerk,
    move_to_height,
    smooth_trajectory,
    translate,
)
from apo_bench.simulation.scene import release_clamp, weld_clamp

_SPEED = 0.9
"""Peak speed of a hand that carries a part through the air, [m/s]."""
_STROKE = 0.15
"""Peak speed of a hand that brings a part to its place, [m/s]."""
_SHIFT = 0.03
"""Peak speed of a small adjustment, and of coming to lie against another part, [m/s]."""
_NUDGE = 0.01
"""Peak speed of lifting and lowering a part for an adjustment, [m/s]."""
_SAFE_M = 0.16
"""Least height at which parts are carried over the others."""
_DROP_M = 0.0002
"""Height above the support at which a part is released, since a hand does not press it down."""
_LIFT_M = 0.0003
"""Lift of a part during an adjustment, so that it does not drag the one below."""
STAND_STILL_S = 0.3
"""Wait after an operation, until everything rests."""
_SETTLE_S = 0.15
"""Wait until a group has caught up with a quick hand, which it lags by a millimetre."""


def perform(hands: Hands, operation: HandOperation, clearance_m: float) -> None:
    """Carry out an operation, and wait until everything rests."""
    release_clamp(hands.world, hands.data, operation.part)
    T = hands.grab(0, operation.part)
    for part in operation.carries:
        hands.add(0, part)
    before, beside, goal = _ends(hands, operation, T, clearance_m)
    if operation.out.any():
        T = _free(hands, T, operation.out, clearance_m)
    safe = max(_SAFE_M, operation.over, before[2, 3])
    for end in (move_to_height(T, max(safe, T[2, 3])), move_to_height(before, safe), before):
        hands.move((0, smooth_trajectory(T, end, _SPEED, turn_speed=4.0)))
        T = end
    for part in (part for part in operation.late if part in operation.carries):
        hands.wait(_SETTLE_S)
        _shift_carried(hands, operation, part, clearance_m)
    _place(hands, operation, smooth_trajectory(before, beside, _STROKE))
    if operation.aside.any():
        hands.move((0, smooth_trajectory(beside, goal, _SHIFT)))
        hands.wait(0.05)
    if operation.clamps_to:
        # A hand yields a little; the screws draw the part to where the human holds it.
        weld_clamp(hands.world, hands.data, operation.part, operation.clamps_to, operation.target)
    hands.let_go(0, operation.part, *operation.carries)
    hands.wait(STAND_STILL_S)


def _free(hands: Hands, T: Array, out: Array, clearance_m: float) -> Array:
    """Move the held part from T by `out`, level, and return the pose at the end.

    The part is first raised by the clearance, off the floor of a hole, which would be dragged along.
    """
    raised = translate(T, UP, clearance_m)
    hands.move((0, smooth_trajectory(T, raised, _NUDGE)))
    hands.move((0, smooth_trajectory(raised, translate(raised, out, 1.0), _STROKE)))
    return translate(raised, out, 1.0)


def _ends(hands: Hands, operation: HandOperation, T: Array, clearance_m: float) -> tuple[Array, Array, Array]:
    """The poses of the last motion: its beginning, its end beside the goal, and the goal, where the part is released.

    Over a floor without play the part is raised by half the clearance, to avoid friction.
    """
    goal = target = translate(operation.target, UP, clearance_m / 2) if operation.drags else operation.target
    if operation.from_above and not operation.clamps_to:
        goal = translate(operation.target, UP, _DROP_M + (_rise(hands, operation, T) if operation.carries else 0.0))
    beside = translate(goal, operation.aside, 1.0) if operation.aside.any() else goal
    return translate(translate(target, operation.direction, -operation.travel), operation.aside, 1.0), beside, goal


def _rise(hands: Hands, operation: HandOperation, T: Array) -> float:
    """The height that a group must end higher than planned because it hangs tilted in the hand, [m].

    No part that makes a contact then ends too deep.
    """
    motion = operation.target @ pose.inverse(T)
    return max(float(operation.true[part][2, 3] - (motion @ hands.pose(part))[2, 3]) for part in operation.bearing)


def _place(hands: Hands, operation: HandOperation, stroke: Trajectory) -> None:
    """Move the main part along `stroke` to its place; the other hand corrects displaced parts, the last meanwhile."""
    standing = [part for part in operation.late if part not in operation.carries]
    for part in standing[:-1]:
        _adjust(hands, part, operation.true[part], _LIFT_M, ())
        hands.let_go(1, part)
    if standing:
        # Meanwhile the main part goes the first 15 % of its stroke.
        _adjust(hands, standing[-1], operation.true[standing[-1]], _LIFT_M, ((0, _first(stroke, 0.15)),))
        hands.move((0, smooth_trajectory(_first(stroke, 0.15).end, stroke.end, _STROKE)))
    else:
        hands.move((0, stroke))
    hands.wait(0.05)
    hands.let_go(1, *standing[-1:])


def _shift_carried(hands: Hands, operation: HandOperation, part: str, clearance_m: float) -> None:
    """Move a carried part to its true pose relative to the main part, lowered, so that it does not rub."""
    there = hands.pose(operation.part) @ pose.inverse(operation.true[operation.part]) @ operation.true[part]
    _adjust(hands, part, there, -clearance_m, (), held=True)
    hands.wait(0.05)
    hands.add(0, part)
    hands.let_go(1, part)


def _adjust(
    hands: Hands, part: str, true: Array, lift: float, meanwhile: tuple[tuple[int, Trajectory], ...], held: bool = False
) -> None:
    """Lift a part by `lift` [m], move it to its true pose at its present height, and lower it; hand 1 keeps holding it.

    Args:
        meanwhile: Motions of the other hand during the shift.
        held: Hand 0 holds the part before and releases it.
    """
    here = hands.grab(1, part)
    if held:
        hands.let_go(0, part)
    there = move_to_height(true, here[2, 3])
    hands.move((1, smooth_trajectory(here, translate(here, UP, lift), _NUDGE)))
    hands.move((1, smooth_trajectory(translate(here, UP, lift), translate(there, UP, lift), _SHIFT)), *meanwhile)
    hands.move((1, smooth_trajectory(translate(there, UP, lift), there, _NUDGE)))


def _first(stroke: Trajectory, fraction: float) -> Trajectory:
    """The first share of a stroke, in half of its time, as a motion of its own that stops at the end."""
    return Trajectory(
        stroke.start, stroke.poses(np.array([fraction]))[0], stroke.seconds * 0.5, interpolate_minimum_jerk
    )
