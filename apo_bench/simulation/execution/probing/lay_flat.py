"""Lay a held part flat on what is fixed, before it is inserted.

Pressed on lightly and giving way to torque, it comes to lie flat: a plane on a plane. Then its height and its tilts in
the hand are known as well as the floor is and as its feet are apart. Before an insertion from above a wall shows more.
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
)
from apo_bench.simulation.scene import allow_sleep

PRESS_N = 3.0
"""How hard it is pressed on the floor."""
NEAR_M = 0.004
"""From so far above where the floor is expected it goes down by force."""
LAY_SPEED = 0.2  # peak speed [m/s] down to the floor
_UP = 0.2  # peak speed [m/s] up again
_OFF = 0.02  # peak speed [m/s] just off the floor
_OFF_M = 0.002  # so far it goes slowly off the floor
YIELD_M = 0.0005  # [m/s/N]: how fast the part gives way to force
_TURN_RAD = 0.015  # [rad/s]: how fast it turns while it lies on one foot only
FASTEST = 0.005  # [m/s] at most
FASTEST_RAD = 0.05  # [rad/s] at most
CALM = 0.15  # it lies when the press is met within this part of it
CALM_RAD = 6e-4  # and it turns slower than this, [rad/s], averaged over `averaged_s`
CALM_S = 0.1  # for so long
_SURELY = 3.0  # averaged forces have so many times less noise than the limit
LONGEST_S = 3.0
"""A sensor that would have to be averaged longer is too noisy: nothing is laid then."""
MOST_S = 15.0  # laying ends after this time
DEEPEST_M = 0.012  # or so far below its begin


def lay_flat(robot: Robot, probing: ProbingState, operation: int, t: Transfer, grip: Grip) -> Grip:
    """Lay the held part down and lift it again, and touch a wall with its side; returns how it is known to be held now.

    Raises:
        ExecutionAborted: It fell out of the hand, or something was struck.
    """
    if averaged_s(t.flat, probing.wrist.sigma) > LONGEST_S:
        return grip
    T_before = robot.T
    held = pose.inverse(grip.T_part_tip @ pose.inverse(probing.residual.tool))
    robot.stage, robot.macro = "attach", "lay-flat"
    robot.follow(smooth_trajectory(robot.T, translate(t.flat.T @ grip.T_part_tip, UP, NEAR_M), LAY_SPEED))
    robot.stand()
    with allow_sleep(robot.scene.work, False), read_wrist(robot, probing.wrist):
        probing.wrist.hold(*compute_part_loads(robot.scene, {t.part: held}))
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
    """Press the part on the floor until it lies; all its feet touch then."""
    law = _Laying(flat, averaged_s(flat, probing.wrist.sigma))
    # About the middle of the feet: there, what rubs has no lever.
    feet = pose.apply(robot.T @ probing.T_tip_held(held), flat.feet)
    comply(robot, law, feet.mean(axis=0), probing.wrist)
    return [probing.foot(robot, operation, flat, held, foot) for foot in flat.feet] if law.lies else []


def turn_yield(flat: FlatPlacement) -> float:
    """How fast a part gives way to a torque while it is laid flat, [rad/s/Nm]: on one foot as fast as `_TURN_RAD`."""
    lever = float(np.linalg.norm(flat.feet - flat.feet.mean(axis=0), axis=1).max())
    return _TURN_RAD / (PRESS_N * lever)


def averaged_s(flat: FlatPlacement, sigma: tuple[float, float]) -> float:
    """How long forces must be averaged while a part is laid flat, [s], so that noise looks like no motion.

    Args:
        sigma: Of force and torque behind the low pass, [N] and [Nm].
    """
    # An average over a time T has sqrt(t / T) of the noise of a low pass with the time constant t.
    turning = _SURELY * turn_yield(flat) * sigma[1] / CALM_RAD
    pushing = _SURELY * sigma[0] / (CALM * PRESS_N)
    return max(CALM_S, max(turning, pushing) ** 2 / (2.0 * np.pi * BANDWIDTH_HZ))


class _Laying:
    """Down until pushed back by the press, turning about level axes as the torque has it, until it lies."""

    def __init__(self, flat: FlatPlacement, averaged: float) -> None:
        self._n = flat.normal
        self._part = READING_S / averaged
        self._yield = turn_yield(flat)
        self._offset = np.zeros(6)
        self._turning = np.full(3, _TURN_RAD)
        self._push = 0.0
        self._calm = 0
        self._left = round(MOST_S / READING_S)
        self.lies = False

    def __call__(self, wrench: Array) -> Array | None:
        """How far the hand moves from where it began, (6,), world; None at the end."""
        push = float(wrench[:3] @ self._n)
        torque = wrench[3:] - (wrench[3:] @ self._n) * self._n
        down = float(np.clip(YIELD_M * (PRESS_N - push), -FASTEST, FASTEST))
        turn = np.zeros(3) if push < PRESS_N / 4 else np.clip(self._yield * torque, -FASTEST_RAD, FASTEST_RAD)
        self._offset = self._offset + READING_S * np.concatenate([-down * self._n, turn])
        self._left -= 1
        self._turning = self._turning + self._part * (turn - self._turning)
        self._push += self._part * (push - self._push)
        calm = abs(self._push - PRESS_N) < CALM * PRESS_N and float(np.abs(self._turning).max()) < CALM_RAD
        self._calm = self._calm + 1 if calm else 0
        self.lies = self._calm * READING_S >= CALM_S
        if self.lies or self._left <= 0 or -float(self._offset[:3] @ self._n) > DEEPEST_M:
            return None
        return self._offset
