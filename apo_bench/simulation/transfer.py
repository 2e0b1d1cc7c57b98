"""One part, with what it carries, from one place to another: pick, lift, carry, attach, release, depart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.simulation.paths import at_height, moved, smooth, steady
from apo_bench.simulation.robot import Guard, Halt, Robot

UP = np.array([0.0, 0.0, 1.0])
FREE, NEAR = 1.4, 0.55
"""Peak speeds of the empty hand, [m/s]: in the air, close to parts."""
LIFT, CARRY, LOWER = 0.25, 0.35, 0.2
"""Peak speeds with a part, [m/s]: it drifts in the hand by some hundredths of a millimetre, the faster the more."""
PLACE, TOUCH, INSERT, SLIDE = 0.06, 0.01, 0.06, 0.005
"""Steady speeds [m/s]: down to just above the support, onto it, along an insertion, against a part at the side."""
SAFE_M = 0.15
"""Height of the tip at which parts are carried over the others."""
HOVER_M, DEPART_M = 0.11, 0.09
OPEN_TO_PICK_M, OPEN_TO_RELEASE_M = 0.012, 0.008
"""How far each finger stands off before it closes, and when it has let go."""
OVERTRAVEL_M = 0.002
"""Contact is sought this far beyond the goal."""
ARRIVED_M = 0.001
"""An insertion that stops earlier than this before its end was stopped by force."""
LOST_M = 0.002
"""Fingers that close this far beyond the part's surface hold nothing."""
LOST_LOAD = 0.8
"""A hand that feels less than this part of the weight of a group has lost some of it."""
ASIDE_M, BEYOND_M, OFF_M = 0.006, 0.004, 0.0003
"""A slide begins this far from the side it shall touch, may go this much beyond the goal, this high over the floor;
what touches at its side is moved off as far before it is lifted, since in the hand it drifts into its neighbour."""


class Grip(NamedTuple):
    """How the gripper holds the part."""

    T_part_tip: Array
    half_width: float
    """Half the part's width between the fingers, [m]."""


@final
@dataclass(frozen=True, eq=False)
class Line:
    """A straight way of the part, in the direction in which the part is attached."""

    way: Array
    """Unit vector of the motion towards the goal, (3,), world."""
    travel: float
    left: float | None = None
    """How far before its end the grip changes, [m]; None if it does not."""

    @property
    def level(self) -> bool:
        return bool(abs(self.way[2]) < 0.5)


@final
@dataclass(frozen=True, eq=False)
class Transfer:
    """What the controller needs to move one part; every pose in the world."""

    part: str
    carried: tuple[str, ...]
    T_world_start: Array
    T_world_goal: Array
    grips: tuple[Grip, ...]
    """In the order of their use; the next one at each change of grip."""
    out: Line
    """The way out of where it is, as it was once attached there: it is gone backwards."""
    into: Line
    centring: tuple[Grip, ...]
    """After it was put down, the fingers close and open again here: closing, they centre the part between them."""
    sides: tuple[Array, ...]
    """Directions in which the part is slid onto another one at its side, (3,) each."""
    away: tuple[Array, ...]
    """Directions in which the part is first moved off another one at its side, (3,) each."""
    slow: float
    """From this far before the goal a motion from above goes slowly: contact may come any moment, [m]."""
    weight_n: float
    """Of the part and what it carries, [N]."""
    place_n: float
    """Guard of a motion onto a support, [N]."""
    insert_n: float
    """Guard of an insertion, below the force at which a neighbour would slide, [N]."""
    slide_n: float
    """Guard of a slide, below the force at which what is touched would slide, [N]."""
    clearance: float
    """What lay free falls by this onto the floor of its slot, [m]."""

    @property
    def floats(self) -> Array:
        """Half the clearance up: a part that was seen at rest lay on the floor of its slot."""
        return 0.5 * self.clearance * UP


def transfer(robot: Robot, t: Transfer) -> None:
    """Carry it out.

    Raises:
        Halt: Something went wrong; the stage and code say what.
    """
    grips = iter(t.grips)
    grip = next(grips)
    _pick(robot, t, grip)
    if t.out.level:
        grip = _pull_out(robot, t, grip, next(grips) if t.out.left is not None else None)
    _lift(robot, t)
    _carry(robot, t, grip)
    if t.into.level:
        left, grip = _insert(robot, t, grip, next(grips) if t.into.left is not None else None)
    else:
        _come_down(robot, t, grip)
        left = 0.0
    _release(robot, t, grip)
    _depart(robot)
    if left > ARRIVED_M:
        raise Halt("attach", "force_stop")
    for other in t.centring:
        _centre(robot, t, other)


def key_poses(t: Transfer) -> tuple[Array, ...]:
    """Tip poses that must be in reach for the transfer to be possible."""
    first, last = t.grips[0].T_part_tip, t.grips[-1].T_part_tip
    carrying = t.grips[1 if t.out.left is not None else 0].T_part_tip
    pick, goal = t.T_world_start @ first, t.T_world_goal @ last
    free = moved(t.T_world_start @ carrying, t.out.way, -t.out.travel)
    before = moved(t.T_world_goal @ carrying, t.into.way, -t.into.travel)
    high = [at_height(T, max(SAFE_M, T[2, 3])) for T in (free, before)]
    return (at_height(pick, _hover(pick)), pick, *([free] if t.out.level else []), *high, before, goal)


def _pick(robot: Robot, t: Transfer, grip: Grip) -> None:
    robot.stage = "pick"
    _grasp(robot, t, grip, t.T_world_start @ grip.T_part_tip)


def _grasp(robot: Robot, t: Transfer, grip: Grip, at: Array) -> None:
    """Come down to the part with open fingers, and close them."""
    hover = at_height(at, _hover(at))
    robot.follow(smooth(robot.T, at_height(robot.T, max(robot.T[2, 3], hover[2, 3])), NEAR))
    robot.follow(smooth(robot.T, at_height(hover, robot.T[2, 3]), FREE, turn_speed=3.0))
    robot.handle(t.part)
    robot.fingers(min(grip.half_width + OPEN_TO_PICK_M, robot.arm.opening_m), 0.1)
    robot.follow(smooth(robot.T, at, NEAR))
    robot.wait(0.05)
    robot.hold(t.part, *t.carried)
    if robot.scene.grasp == "weld":
        robot.weld(t.part, True)
    else:
        robot.fingers(grip.half_width - robot.arm.squeeze_m, 0.25)
    _check_grasp(robot, grip)


def _pull_out(robot: Robot, t: Transfer, grip: Grip, second: Grip | None) -> Grip:
    """Backwards along the way of an insertion; returns the grip at its end."""
    robot.stage = "lift"
    robot.follow(smooth(robot.T, moved(robot.T, t.floats, 1.0), 0.01))
    if t.out.left is None or second is None:
        robot.follow(smooth(robot.T, moved(robot.T, t.out.way, -t.out.travel), 0.1))
        return grip
    robot.follow(smooth(robot.T, moved(robot.T, t.out.way, -t.out.left), 0.1))
    part = moved(t.T_world_start, t.out.way, -t.out.left)
    _change(robot, t, grip, second, part @ second.T_part_tip)
    robot.follow(smooth(robot.T, moved(robot.T, t.floats, 1.0), 0.01))
    robot.follow(smooth(robot.T, moved(robot.T, t.out.way, t.out.left - t.out.travel), 0.1))
    return second


def _lift(robot: Robot, t: Transfer) -> None:
    robot.stage = "lift"
    if t.carried:
        robot.follow(smooth(robot.T, moved(robot.T, UP, 0.004), 0.02))
    if t.away:
        robot.follow(smooth(robot.T, moved(robot.T, UP, OFF_M), 0.01))
    for side in t.away:
        robot.follow(smooth(robot.T, moved(robot.T, side, ASIDE_M), 0.03))
    robot.follow(smooth(robot.T, at_height(robot.T, max(SAFE_M, robot.T[2, 3])), LIFT))


def _carry(robot: Robot, t: Transfer, grip: Grip) -> None:
    robot.stage = "carry"
    before = moved(_aim(t) @ grip.T_part_tip, t.into.way, -t.into.travel)
    if t.into.level:
        before = moved(before, t.floats, 1.0)
    robot.follow(smooth(robot.T, at_height(before, max(SAFE_M, before[2, 3])), CARRY))
    robot.follow(smooth(robot.T, before, LOWER))
    robot.wait(0.1)
    _check_grasp(robot, grip)
    if t.carried and robot.scene.grasp == "friction" and robot.load() < LOST_LOAD * t.weight_n:
        raise Halt("carry", "lost_grasp")


def _aim(t: Transfer) -> Array:
    """Where the part first comes down: at its goal, or aside of what it shall touch."""
    return moved(t.T_world_goal, np.sum(t.sides, axis=0), -ASIDE_M) if t.sides else t.T_world_goal


def _insert(robot: Robot, t: Transfer, grip: Grip, second: Grip | None) -> tuple[float, Grip]:
    """The guarded level line, pushed to where the grip changes and pulled from there; returns what is left of it."""
    robot.stage = "attach"
    guard, rise = Guard(t.into.way, t.insert_n), t.floats
    if t.into.left is not None and second is not None:
        there = moved(moved(t.T_world_goal, t.into.way, -t.into.left), rise, 1.0)
        left = robot.follow(steady(robot.T, there @ grip.T_part_tip, INSERT), guard)
        if left > ARRIVED_M:
            return left + t.into.left, grip
        _change(robot, t, grip, second, moved(there, rise, -1.0) @ second.T_part_tip)
        grip, rise = second, t.clearance * UP
        robot.follow(smooth(robot.T, moved(robot.T, rise, 1.0), 0.01))
    left = robot.follow(steady(robot.T, moved(t.T_world_goal @ grip.T_part_tip, rise, 1.0), INSERT), guard)
    lower = moved(robot.T, UP, -rise[2] - OVERTRAVEL_M)
    robot.follow(steady(robot.T, lower, TOUCH), Guard(-UP, t.place_n))
    robot.wait(0.05)
    return left, grip


def _change(robot: Robot, t: Transfer, grip: Grip, second: Grip, at: Array) -> None:
    """Let go, and take the part at another place."""
    stage = robot.stage
    robot.wait(0.05)
    _release(robot, t, grip)
    _depart(robot)
    robot.stage = stage
    _grasp(robot, t, second, at)


def _come_down(robot: Robot, t: Transfer, grip: Grip) -> None:
    robot.stage = "attach"
    down = Guard(t.into.way, t.place_n)
    goal = _aim(t) @ grip.T_part_tip
    left = robot.follow(steady(robot.T, moved(goal, t.into.way, -t.slow), PLACE), down)
    if left == 0.0:
        robot.follow(steady(robot.T, moved(goal, t.into.way, OVERTRAVEL_M), TOUCH), down)
    robot.wait(0.05)
    for side in t.sides:
        _slide(robot, t, side)


def _slide(robot: Robot, t: Transfer, side: Array) -> None:
    """Off the floor by a hair, sideways until it touches, and down again."""
    robot.follow(smooth(robot.T, moved(robot.T, UP, OFF_M), 0.01))
    robot.wait(0.05)
    robot.follow(steady(robot.T, moved(robot.T, side, ASIDE_M + BEYOND_M), SLIDE), Guard(side, t.slide_n))
    robot.follow(steady(robot.T, moved(robot.T, UP, -OFF_M - OVERTRAVEL_M), TOUCH), Guard(-UP, t.place_n))
    robot.wait(0.05)


def _release(robot: Robot, t: Transfer, grip: Grip) -> None:
    robot.stage = "release"
    if robot.scene.grasp == "weld":
        robot.weld(t.part, False)
    robot.fingers(min(grip.half_width + OPEN_TO_RELEASE_M, robot.arm.opening_m), 0.25)
    robot.hold()


def _centre(robot: Robot, t: Transfer, grip: Grip) -> None:
    """Close the fingers on the part where it should stand, and open them again."""
    robot.stage = "release"
    _grasp(robot, t, grip, t.T_world_goal @ grip.T_part_tip)
    _release(robot, t, grip)
    _depart(robot)


def _depart(robot: Robot) -> None:
    robot.stage = "depart"
    robot.follow(smooth(robot.T, moved(robot.T, -robot.T[:3, 2], DEPART_M), NEAR))
    robot.handle(None)
    robot.follow(smooth(robot.T, at_height(robot.T, max(SAFE_M, robot.T[2, 3])), FREE))


def _check_grasp(robot: Robot, grip: Grip) -> None:
    if robot.scene.grasp == "friction" and robot.opening() < grip.half_width - LOST_M:
        raise Halt(robot.stage, "lost_grasp")


def _hover(grasp: Array) -> float:
    return float(grasp[2, 3]) + HOVER_M
