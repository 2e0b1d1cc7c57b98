"""One part from one place to another: pick, lift, carry, attach, release, depart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.simulation.paths import at_height, moved, smooth, steady
from apo_bench.simulation.robot import Guard, Halt, Robot

UP = np.array([0.0, 0.0, 1.0])
FREE, NEAR = 1.4, 0.55
"""Peak speeds of the empty hand, [m/s]: in the air, close to parts."""
LIFT, CARRY, LOWER = 0.25, 0.35, 0.2
"""Peak speeds with a part, [m/s]: it drifts in the hand by some hundredths of a millimetre, the faster the more."""
PLACE, TOUCH, INSERT = 0.06, 0.01, 0.06
"""Steady speeds [m/s]: down to just above the support, onto it, along an insertion."""
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


@final
@dataclass(frozen=True, eq=False)
class Transfer:
    """What the controller needs to move one part; every pose in the world."""

    part: str
    T_world_start: Array
    T_world_goal: Array
    T_part_tip: Array
    half_width: float
    """Half the part's width between the fingers, [m]."""
    way_in: Array
    """Unit vector of the last motion, (3,)."""
    travel: float
    way_out: Array
    """Unit vector of the first motion; up, unless the part must be pulled out of something."""
    travel_out: float
    slow: float
    """From this far before the goal a motion from above goes slowly: contact may come any moment, [m]."""
    place_n: float
    """Guard of a motion onto a support, [N]."""
    insert_n: float
    """Guard of an insertion, below the force at which a neighbour would slide, [N]."""
    raise_by: float
    """Half the clearance: a part that was seen at rest lay on the floor of its slot, [m]."""

    @property
    def from_above(self) -> bool:
        return bool(self.way_in[2] < -0.5)


def transfer(robot: Robot, t: Transfer) -> None:
    """Carry it out.

    Raises:
        Halt: Something went wrong; the stage and code say what.
    """
    _pick(robot, t)
    _lift(robot, t)
    _carry(robot, t)
    left = _attach(robot, t)
    _release(robot, t)
    if not t.from_above and left > ARRIVED_M:
        raise Halt("attach", "force_stop")


def key_poses(t: Transfer) -> tuple[Array, ...]:
    """Tip poses that must be in reach for the transfer to be possible."""
    pick, goal = t.T_world_start @ t.T_part_tip, t.T_world_goal @ t.T_part_tip
    before = moved(goal, t.way_in, -t.travel)
    return (at_height(pick, _hover(pick)), pick, at_height(before, max(SAFE_M, before[2, 3])), before, goal)


def _pick(robot: Robot, t: Transfer) -> None:
    robot.stage = "pick"
    grasp = t.T_world_start @ t.T_part_tip
    hover = at_height(grasp, _hover(grasp))
    robot.follow(smooth(robot.T, at_height(robot.T, max(robot.T[2, 3], hover[2, 3])), NEAR))
    robot.follow(smooth(robot.T, at_height(hover, robot.T[2, 3]), FREE, turn_speed=3.0))
    robot.handle(t.part)
    robot.fingers(min(t.half_width + OPEN_TO_PICK_M, robot.arm.opening_m), 0.1)
    robot.follow(smooth(robot.T, grasp, NEAR))
    robot.wait(0.05)
    robot.hold(t.part)
    if robot.scene.grasp == "weld":
        robot.weld(t.part, True)
    else:
        robot.fingers(t.half_width - robot.arm.squeeze_m, 0.25)
    _check_grasp(robot, t)


def _lift(robot: Robot, t: Transfer) -> None:
    robot.stage = "lift"
    if t.way_out[2] < 0.5:
        robot.follow(smooth(robot.T, moved(robot.T, UP, t.raise_by), 0.01))
        robot.follow(smooth(robot.T, moved(robot.T, t.way_out, t.travel_out), 0.1))
    robot.follow(smooth(robot.T, at_height(robot.T, max(SAFE_M, robot.T[2, 3])), LIFT))


def _carry(robot: Robot, t: Transfer) -> None:
    robot.stage = "carry"
    before = moved(t.T_world_goal @ t.T_part_tip, t.way_in, -t.travel)
    if not t.from_above:
        before = moved(before, UP, t.raise_by)
    robot.follow(smooth(robot.T, at_height(before, max(SAFE_M, before[2, 3])), CARRY))
    robot.follow(smooth(robot.T, before, LOWER))
    robot.wait(0.1)
    _check_grasp(robot, t)


def _attach(robot: Robot, t: Transfer) -> float:
    """The guarded straight line; returns what is left of it, [m]."""
    robot.stage = "attach"
    goal = t.T_world_goal @ t.T_part_tip
    if t.from_above:
        left = _come_down(robot, t, goal)
    else:
        left = robot.follow(steady(robot.T, moved(goal, UP, t.raise_by), INSERT), Guard(t.way_in, t.insert_n))
        lower = moved(robot.T, UP, -t.raise_by - OVERTRAVEL_M)
        robot.follow(steady(robot.T, lower, TOUCH), Guard(-UP, t.place_n))
    robot.wait(0.05)
    return left


def _come_down(robot: Robot, t: Transfer, goal: Array) -> float:
    down = Guard(t.way_in, t.place_n)
    left = robot.follow(steady(robot.T, moved(goal, t.way_in, -t.slow), PLACE), down)
    if left == 0.0:
        left = robot.follow(steady(robot.T, moved(goal, t.way_in, OVERTRAVEL_M), TOUCH), down)
    return left


def _release(robot: Robot, t: Transfer) -> None:
    robot.stage = "release"
    if robot.scene.grasp == "weld":
        robot.weld(t.part, False)
    robot.fingers(min(t.half_width + OPEN_TO_RELEASE_M, robot.arm.opening_m), 0.25)
    robot.hold(None)
    robot.stage = "depart"
    robot.follow(smooth(robot.T, moved(robot.T, -robot.T[:3, 2], DEPART_M), NEAR))
    robot.handle(None)
    robot.follow(smooth(robot.T, at_height(robot.T, max(SAFE_M, robot.T[2, 3])), FREE))


def _check_grasp(robot: Robot, t: Transfer) -> None:
    if robot.scene.grasp == "friction" and robot.opening() < t.half_width - LOST_M:
        raise Halt(robot.stage, "lost_grasp")


def _hover(grasp: Array) -> float:
    return float(grasp[2, 3]) + HOVER_M
