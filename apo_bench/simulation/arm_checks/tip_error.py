"""Measure how far the tip of an arm is off its line at a speed, by trying."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import Array, remember
from apo_bench.simulation.robot import (
    ExecutionAborted,
    Robot,
    Trajectory,
    plan_steady_trajectory,
    smooth_trajectory,
    translate,
)
from apo_bench.simulation.robot.reach import along, limit_speed
from apo_bench.simulation.scene import Scene

SPEEDS = (0.01, 0.06, 0.5)
"""[m/s], at which the robot touches, inserts, and carries."""
_HIGH_M = 0.35
"""Height at which errors are measured where the arm reaches it, else the height of its home."""
_AHEAD_M = 0.25
"""Farther ahead of its base than this: a line beside its axis turns it fast."""
STRETCH_M = 0.15
"""Length of the line along which the errors are measured."""
STAND_S = 0.3
"""How long the arm stands before it."""
_RESTS_M = 2e-5  # the tip rests when it is this near to its command
_MOST_CHECKS = 10  # the arm waits for that so often: weak joints swing behind


@final
@dataclass(frozen=True, eq=False)
class TipError:
    """How far the tip is off where it should be at a speed."""

    speed: float
    """[m/s]"""
    across_mm: float
    """At most, beside the line."""
    along_mm: float
    turn_deg: float
    tilt_deg: float
    """How much of the turn the way ahead of the tip turns by; the rest is about that."""


@remember
def motion_error(scene: Scene, speed: float = SPEEDS[1]) -> TipError | None:
    """The error of the tip of an empty hand in free air at a speed [m/s]; None where it has no way there.

    It is found by trying, once for a scene.
    """
    robot = Robot(scene, scene.scenario.start)
    try:
        with robot.watch_stability():
            rise(robot, SPEEDS[-1])
            length = STRETCH_M if speed > SPEEDS[0] else STRETCH_M / 10
            line = plan_steady_trajectory(robot.T, translate(robot.T, np.array([0.0, 1.0, 0.0]), length), speed)
            return error_on(line, trace(robot, line), speed)
    except ExecutionAborted:
        return None


def trace(robot: Robot, line: Trajectory) -> Array:
    """Follow a line through free air; returns where the tip really is at each step, (n, 4, 4).

    Raises:
        ExecutionAborted: The line leaves the arm's reach.
    """
    kinematics = robot.scene.kinematics
    line, knots = limit_speed(kinematics, line, robot.q, robot.arm.limits.speed_rad_s)
    n = max(2, round(line.seconds / robot.step_s))
    path = robot.reached(along(kinematics, line, line.progress(np.arange(n + 1) / n), robot.q, knots))
    tips = []
    for q, velocity in list(zip(path, np.gradient(path, robot.step_s, axis=0), strict=True))[1:]:
        robot.servo_step(q, velocity=velocity)
        tips.append(robot.tip())
    robot.q = path[-1]
    robot.T = line.end
    return np.array(tips)


def rise(robot: Robot, speed: float) -> None:
    """Go to where errors are measured, at a speed [m/s], and come to rest there."""
    up = np.array(robot.T)
    up[0, 3] = max(up[0, 3], robot.arm.base[0] + _AHEAD_M)
    up[2, 3] = _HIGH_M
    if robot.scene.kinematics.inverse(up, robot.q) is None:
        up[2, 3] = robot.T[2, 3]
    if np.abs(up - robot.T).max() > 0.0:
        trace(robot, smooth_trajectory(robot.T, up, speed))
    robot.wait(STAND_S)
    checks = 0
    while checks < _MOST_CHECKS and np.linalg.norm(robot.tip()[:3, 3] - robot.T[:3, 3]) > _RESTS_M:
        robot.wait(STAND_S)
        checks += 1


def error_on(line: Trajectory, tips: Array, speed: float) -> TipError:
    """Of where the tip was at each step, (n, 4, 4): beside the line, along it behind the command, and turned."""
    direction = line.end[:3, 3] - line.start[:3, 3]
    direction = direction / np.linalg.norm(direction)
    n = len(tips)
    commanded = line.poses(line.progress(np.arange(1, n + 1) / n))
    off = tips[:, :3, 3] - commanded[:, :3, 3]
    along = off @ direction
    beside = np.linalg.norm(off - along[:, None] * direction, axis=1)
    # The trace of R_commanded^T R is 1 + 2 cos(angle between them).
    turned = np.einsum("nij,nij->n", tips[:, :3, :3], commanded[:, :3, :3])
    angle = np.degrees(np.arccos(np.clip((turned - 1.0) / 2.0, -1.0, 1.0)))
    ahead = np.linalg.norm(np.cross(tips[:, :3, 2], commanded[:, :3, 2]), axis=1)
    tilt = float(np.degrees(np.arcsin(min(ahead.max(), 1.0))))
    return TipError(speed, 1e3 * float(beside.max()), 1e3 * float(np.abs(along).max()), float(angle.max()), tilt)
