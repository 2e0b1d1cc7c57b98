"""Measure the deviation of an arm's tip from a line at a given speed, by simulation."""

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
"""Speeds of touching, inserting and carrying, [m/s]."""
_HIGH_M = 0.35
"""Height of the measurement; if out of reach, the height of home."""
_AHEAD_M = 0.25
"""Least x distance of the measurement from the base, since a line near its axis needs fast rotation."""
STRETCH_M = 0.15
"""Length of the measured line."""
STAND_S = 0.3
"""Rest of the arm before the line."""
_RESTS_M = 2e-5  # the tip rests if it is nearer to its command
_MOST_CHECKS = 10  # largest number of waits for rest: weak joints vibrate


@final
@dataclass(frozen=True, eq=False)
class TipError:
    """Deviations of the tip from its commanded poses along a line."""

    speed: float
    """[m/s]"""
    across_mm: float
    """Largest deviation across the line."""
    along_mm: float
    """Largest deviation along the line."""
    turn_deg: float
    """Largest rotation error."""
    tilt_deg: float
    """Largest rotation error of the axis ahead of the tip (z)."""


@remember
def motion_error(scene: Scene, speed: float = SPEEDS[1]) -> TipError | None:
    """The error of the tip of an empty gripper in free air at a speed [m/s]; None if the line is out of reach.

    The motion is simulated once per scene and speed.
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
    """Follow a line through free air; return the actual poses of the tip at each step, (n, 4, 4).

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
    """Move to the pose where errors are measured, at a speed [m/s], and wait for rest."""
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
    """The error of actual tip poses, (n, 4, 4), at equal steps along a line."""
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
