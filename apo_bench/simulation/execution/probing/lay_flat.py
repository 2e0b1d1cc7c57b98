"""Lay a held part flat on a fixed face before its insertion, to measure its pose in the hand.

The hand presses lightly and is compliant to torque, so the part comes to lie flat, plane on plane. This determines its
height and its two tilts; their accuracy depends on the floor and on the distance between the feet. Before an insertion
from above, side touches of a wall determine more.
"""

import numpy as np

from apo_bench.assembly import Touch
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.execution.flat_placement import FlatPlacement, before_insertion
from apo_bench.simulation.execution.probing.side_touch import touch_side
from apo_bench.simulation.execution.probing.state import ProbingState
from apo_bench.simulation.execution.transfer import Grip, Transfer
from apo_bench.simulation.robot import (
    BANDWIDTH_HZ,
    READING_S,
    Robot,
    comply,
    compute_part_loads,
    move_to_height,
    read_wrist,
    smooth_trajectory,
    translate,
    zero_again,
)
from apo_bench.simulation.scene import allow_sleep

PRESS_N = 3.0
"""Force with which the part is pressed on the floor."""
NEAR_M = 0.004
"""Height over the expected floor from which the part is lowered by force control."""
LAY_SPEED = 0.2  # peak speed [m/s] down to this height
_UP = 0.2  # peak speed [m/s] up again
_OFF = 0.02  # peak speed [m/s] just off the floor
_OFF_M = 0.002  # height up to which this speed applies
YIELD_M = 0.0005  # admittance to force, [m/s/N]
_TURN_RAD = 0.015  # angular speed [rad/s] under the full press on one foot only
FASTEST = 0.005  # greatest speed, [m/s]
FASTEST_RAD = 0.05  # greatest angular speed, [rad/s]
CALM = 0.15  # the part lies when its push is within this fraction of the press,
CALM_RAD = 6e-4  # and its angular speed, averaged over `averaged_s`, is below this, [rad/s],
CALM_S = 0.1  # both for this time
_SURELY = 3.0  # ratio of these limits to the noise of averaged forces
LONGEST_S = 3.0
"""Greatest averaging time; a sensor that needs a longer one is too noisy, and the part is not laid flat."""
MOST_S = 15.0  # time limit
DEEPEST_M = 0.012  # limit of the way down


def lay_flat(robot: Robot, probing: ProbingState, operation: int, t: Transfer, grip: Grip) -> Grip:
    """Lay the held part flat, lift it again, and make its side touches.

    Returns:
        The updated grip; the same if the sensor is too noisy.

    Raises:
        ExecutionAborted: The part fell out of the hand, or the arm collided.
    """
    if averaged_s(t.flat, probing.wrist.sigma) > LONGEST_S:
        return grip
    T_before = robot.T
    # The pose of the part in the frame of the tip as estimated at the pick: `grip` is that of the real tip.
    held = pose.inverse(grip.T_part_tip @ pose.inverse(probing.residual.pads))
    robot.stage, robot.macro = "attach", "lay-flat"
    robot.follow(smooth_trajectory(robot.T, translate(t.flat.T @ grip.T_part_tip, UP, NEAR_M), LAY_SPEED))
    robot.stand()
    robot.level()
    with allow_sleep(robot.scene.work, False), read_wrist(robot, probing.wrist):
        probing.wrist.hold(*compute_part_loads(robot.scene, {t.part: held}))
        zero_again(robot, probing.wrist)
        touches = _press_flat(robot, probing, operation, t.flat, held)
        probing.wrist.hold()
        robot.follow(smooth_trajectory(robot.T, translate(robot.T, UP, _OFF_M), _OFF))
    grip = probing.grip(operation, touches, held, grip)
    for place in t.side_touches:
        grip = touch_side(robot, probing, operation, t, place, grip, held)
    above = before_insertion(t) @ grip.T_part_tip if t.into.level else move_to_height(robot.T, float(T_before[2, 3]))
    robot.follow(smooth_trajectory(robot.T, above, _UP))
    robot.stand()
    return grip


def _press_flat(robot: Robot, probing: ProbingState, operation: int, flat: FlatPlacement, held: Array) -> list[Touch]:
    """Press the part on the floor until it lies flat; return one touch for each foot, none if it does not come to lie.

    Args:
        held: Estimated pose of the part in the frame of the tip, (4, 4).
    """
    law = _Laying(flat, averaged_s(flat, probing.wrist.sigma))
    # The torque is measured about the middle of the feet, where friction has no lever.
    feet = pose.apply(robot.T @ probing.T_tip_held(held), flat.feet)
    comply(robot, law, feet.mean(axis=0), probing.wrist)
    return [probing.foot(robot, operation, flat, held, foot) for foot in flat.feet] if law.lies else []


def turn_yield(flat: FlatPlacement) -> float:
    """Return the admittance to torque, [rad/s/Nm], with which a part on its farthest foot turns at `_TURN_RAD`."""
    lever = float(np.linalg.norm(flat.feet - flat.feet.mean(axis=0), axis=1).max())
    return _TURN_RAD / (PRESS_N * lever)


def averaged_s(flat: FlatPlacement, sigma: tuple[float, float]) -> float:
    """Return how long forces must be averaged, [s], so that noise stays below the limits of a part that lies.

    Args:
        sigma: Standard deviations of force and torque behind the low pass, [N] and [Nm].
    """
    # An average over a time T has sqrt(t / T) of the noise of a low pass with the time constant t.
    turning = _SURELY * turn_yield(flat) * sigma[1] / CALM_RAD
    pushing = _SURELY * sigma[0] / (CALM * PRESS_N)
    return max(CALM_S, max(turning, pushing) ** 2 / (2.0 * np.pi * BANDWIDTH_HZ))


class _Laying:
    """Control law for `comply`: press the part down, compliant to torque about level axes, until it lies flat."""

    def __init__(self, flat: FlatPlacement, averaged: float) -> None:
        self._n = flat.normal
        # Gain of the moving averages, for each reading.
        self._part = READING_S / averaged
        self._yield = turn_yield(flat)
        self._offset = np.zeros(6)
        self._turning = np.full(3, _TURN_RAD)  # averaged angular speed, at first above the limit
        self._push = 0.0  # averaged push, [N]
        self._calm = 0
        self._left = round(MOST_S / READING_S)  # readings until the time limit
        self.lies = False

    def __call__(self, wrench: Array) -> Array | None:
        """Return the displacement of the hand from where it began, (6,), world, [m, rad]; None at the end.

        Args:
            wrench: External force and torque, (6,), world, [N] and [Nm].
        """
        push = float(wrench[:3] @ self._n)
        torque = wrench[3:] - (wrench[3:] @ self._n) * self._n
        down = float(np.clip(YIELD_M * (PRESS_N - push), -FASTEST, FASTEST))
        # Turning starts with contact.
        turn = np.zeros(3) if push < PRESS_N / 4 else np.clip(self._yield * torque, -FASTEST_RAD, FASTEST_RAD)
        self._offset = self._offset + READING_S * np.concatenate([-down * self._n, turn])
        self._left -= 1
        self._turning = self._turning + self._part * (turn - self._turning)
        self._push += self._part * (push - self._push)
        calm = abs(self._push - PRESS_N) < CALM * PRESS_N and float(np.abs(self._turning).max()) < CALM_RAD
        self._calm = self._calm + 1 if calm else 0
        self.lies = self._calm * READING_S >= CALM_S  # `_calm` counts readings in a row
        if self.lies or self._left <= 0 or -float(self._offset[:3] @ self._n) > DEEPEST_M:
            return None
        return self._offset
