"""Touching what is fixed with the closed, empty hand: down on the floor around the goals, and against walls.

Laying a part that is held on what is fixed, before it is inserted.

Pressed on lightly and giving way to torque, it comes to lie flush: a plane on a plane. Then its height and its tilts in
the hand are known, as well as the floor is and as its feet are apart. Before an insertion from above a wall tells more.

Touching a wall of what is fixed with the side of a part that is held, before it is inserted from above.
"""

from functools import partial

import numpy as np

from apo_bench.assembly import Touch
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.execution.beside import STAND_OFF_M, Beside, Flush, before_insertion
from apo_bench.simulation.execution.probing.feeling import ProbingState
from apo_bench.simulation.execution.probing.places import (
    OPENING_M,
    ROOM_M,
    TouchPlace,
    floor_places,
    opposite_places,
    wall_places,
)
from apo_bench.simulation.execution.transfer import Grip, Transfer
from apo_bench.simulation.hooks import TOUCHING
from apo_bench.simulation.robot import (
    BANDWIDTH_HZ,
    READING_S,
    Halt,
    Robot,
    comply,
    part_loads,
    press,
    reading,
    shifted,
    smooth,
    steady,
    turn_from,
    with_height,
)
from apo_bench.simulation.scene import sleeping

SPEED = 0.0025
"""Steady speed of a touch, [m/s]: a stiff hand four times as fast strikes harder than an arm may."""
BEYOND_M = 0.001
"""The floor or a wall is felt for so much farther beyond where it is expected than before."""
_DOWN = 0.4
_OVER = 0.8
_BACK = 0.3
"""Peak speeds of the empty hand, [m/s]."""
_HALF_TURN = 3.0
"""A hand that turns by more passes by its rest, [rad]: the shorter way may lead over where the wrist ends."""
_HIGH_M = 0.1
"""The hand passes from one place to the next so far above them."""


def find_out(robot: Robot, feeling: ProbingState) -> None:
    """Touch the floor, then walls from where the floor has told to be; the robot believes what it felt after each.

    Raises:
        Halt: The hand struck something, or a place is out of reach.
    """
    robot.stage = TOUCHING
    feeling.begin(robot)
    if "touch" not in feeling.acts:
        return
    robot.fingers(OPENING_M)
    for places in (floor_places, wall_places, opposite_places):
        those = places(feeling.plan, robot.scene, partial(_stand_off, robot, feeling))
        felt = list[tuple[Touch, Array]]()
        for place in those:
            try:
                felt += _touched(robot, feeling, place)
            except Halt as halt:
                halt.why = _room(robot, feeling, place)
                raise
        feeling.learn(robot, felt, differ=places is opposite_places)


def _stand_off(robot: Robot, feeling: ProbingState, T: Array, normal: Array) -> float:
    return max(STAND_OFF_M, feeling.off_m(robot, T, normal))


def _room(robot: Robot, feeling: ProbingState, place: TouchPlace) -> str:
    """What to say where something was struck: nothing if the robot had room for what it may be off."""
    far = max(feeling.off_m(robot, place.T_world_tip, way) for way in np.eye(3))
    if far <= ROOM_M:
        return ""
    before = f"it began {1e3 * place.stand_off:.1f} mm before what it would touch, with {1e3 * ROOM_M:g} mm of room"
    return f"{before} aside, and may be off by {1e3 * far:.1f} mm"


def _touched(robot: Robot, feeling: ProbingState, place: TouchPlace) -> list[tuple[Touch, Array]]:
    """Go there, press, come back; what it tells, if anything was felt, and what of the hand may have touched."""
    T = feeling.residual.hand_eye @ place.T_world_tip @ feeling.residual.tool
    way = feeling.residual.hand_eye[:3, :3] @ place.way
    high = max(robot.T[2, 3], T[2, 3] + _HIGH_M)
    robot.follow(smooth(robot.T, with_height(robot.T, high), _OVER))
    rest = robot.scene.kinematics.forward(robot.scene.arm.home)
    if abs(turn_from(rest, T) - turn_from(rest, robot.T)) > _HALF_TURN:
        robot.go(with_height(rest, high), _OVER)
    robot.go(with_height(T, high), _OVER)
    robot.follow(smooth(robot.T, T, _DOWN))
    robot.stand()
    # Nothing sleeps meanwhile: what the arm strikes is noticed, whatever rests.
    with sleeping(robot.scene.work, False), reading(robot, feeling.wrist):
        end = shifted(robot.T, way, 2.0 * place.stand_off + BEYOND_M)
        left = press(robot, steady(robot.T, end, SPEED), way, feeling.touch_n, feeling.wrist)
        touched = feeling.touch(robot, place.normal, place.offset, place.patch.mean(axis=0))
        robot.follow(smooth(robot.T, T, _BACK))
    robot.follow(smooth(robot.T, with_height(T, T[2, 3] + _HIGH_M), _BACK))
    return [] if left is None else [(touched, place.patch)]


_CARRY = 0.4
"""Peak speeds, [m/s]."""


def touch_beside(
    robot: Robot, feeling: ProbingState, operation: int, t: Transfer, place: Beside, grip: Grip, held: Array
) -> Grip:
    """Go there, press, come back; returns how the part is known to be held now.

    Args:
        held: Where it was believed in the frame of the tip when it was taken, (4, 4).

    Raises:
        Halt: It fell out of the hand, or something was struck.
    """
    T = place.T @ grip.T_part_tip
    high = max(t.safe, float(T[2, 3]))
    robot.macro = "touch-wall"
    robot.follow(smooth(robot.T, with_height(robot.T, high), _LAID_DOWN))
    robot.go(with_height(T, high), _CARRY)
    robot.follow(smooth(robot.T, T, _LAID_DOWN))
    robot.stand()
    touches = []
    # Nothing sleeps meanwhile: what the arm strikes is noticed, whatever rests.
    with sleeping(robot.scene.work, False), reading(robot, feeling.wrist):
        feeling.wrist.hold(*part_loads(robot.scene, {t.part: held}))
        end = shifted(robot.T, place.way, 2.0 * STAND_OFF_M + BEYOND_M)
        left = press(robot, steady(robot.T, end, SPEED), place.way, feeling.touch_n, feeling.wrist)
        if left is not None:
            n, d = feeling.is_uncorrected(place.normal, place.edge)
            touches = [feeling.touch(robot, n, d, place.point, (operation, held))]
        feeling.wrist.hold()
        robot.follow(smooth(robot.T, T, _LAID_DOWN))
    robot.follow(smooth(robot.T, with_height(T, high), _LAID_DOWN))
    return feeling.grip(operation, touches, held, grip)


PRESS_N = 3.0
"""How hard it is pressed on the floor."""
NEAR_M = 0.004
"""From so far above where the floor is expected it goes down by force."""
_LAID_DOWN = 0.2
_UP = 0.2
_OFF = 0.02
_OFF_M = 0.002
"""Peak speeds, [m/s]; off the floor it goes slowly at first."""
YIELD_M = 0.0005
_TURN_RAD = 0.015
"""How fast it gives way, [m/s] to a newton, and how fast it turns, [rad/s], while it lies on one foot only."""
FASTEST = 0.005
FASTEST_RAD = 0.05
"""[m/s], [rad/s]."""
CALM = 0.15
CALM_RAD = 6e-4
"""It lies when the press is met within this part of it, and it turns slower than this, [rad/s], for a while, [s]; both
are averaged over `averaged_s`."""
CALM_S = 0.1
_SURELY = 3.0
"""What is averaged has so many times less noise than tells lying."""
LONGEST_S = 3.0
"""A sensor that would have to be averaged longer cannot tell: nothing is laid then."""
MOST_S = 15.0
DEEPEST_M = 0.012


def lay(robot: Robot, feeling: ProbingState, operation: int, t: Transfer, grip: Grip) -> Grip:
    """Lay the held part down and lift it again, and touch a wall with its side; returns how it is known to be held now.

    Raises:
        Halt: It fell out of the hand, or something was struck.
    """
    if averaged_s(t.flush, feeling.wrist.sigma) > LONGEST_S:
        return grip
    T_before = robot.T
    held = pose.inverse(grip.T_part_tip @ pose.inverse(feeling.residual.tool))
    robot.stage, robot.macro = "attach", "lay-flat"
    robot.follow(smooth(robot.T, shifted(t.flush.T @ grip.T_part_tip, UP, NEAR_M), _LAID_DOWN))
    robot.stand()
    with sleeping(robot.scene.work, False), reading(robot, feeling.wrist):
        feeling.wrist.hold(*part_loads(robot.scene, {t.part: held}))
        touches = _laid(robot, feeling, operation, t.flush, held)
        feeling.wrist.hold()
        robot.follow(smooth(robot.T, shifted(robot.T, UP, _OFF_M), _OFF))
    grip = feeling.grip(operation, touches, held, grip)
    for place in t.beside:
        grip = touch_beside(robot, feeling, operation, t, place, grip, held)
    above = before_insertion(t) @ grip.T_part_tip if t.into.level else with_height(robot.T, float(T_before[2, 3]))
    robot.follow(smooth(robot.T, above, _UP))
    robot.stand()
    return grip


def _laid(robot: Robot, feeling: ProbingState, operation: int, flush: Flush, held: Array) -> list[Touch]:
    """Press the part on the floor until it lies; all its feet touch then."""
    law = _Laying(flush, averaged_s(flush, feeling.wrist.sigma))
    # About the middle of the feet: there, what rubs has no lever.
    feet = pose.apply(robot.T @ feeling.T_tip_held(held), flush.feet)
    comply(robot, law, feet.mean(axis=0), feeling.wrist)
    return [feeling.foot(robot, operation, flush, held, foot) for foot in flush.feet] if law.lies else []


def turn_yield(flush: Flush) -> float:
    """How fast a part gives way to a torque while it is laid flat, [rad/s/Nm]: on one foot as fast as `_TURN_RAD`."""
    lever = float(np.linalg.norm(flush.feet - flush.feet.mean(axis=0), axis=1).max())
    return _TURN_RAD / (PRESS_N * lever)


def averaged_s(flush: Flush, sigma: tuple[float, float]) -> float:
    """How long what is felt while a part is laid flat must be averaged, [s], so that noise looks like no motion.

    Args:
        sigma: Of what is felt behind the low pass, [N] and [Nm].
    """
    # An average over a time T has sqrt(t / T) of the noise of a low pass with the time constant t.
    turning = _SURELY * turn_yield(flush) * sigma[1] / CALM_RAD
    pushing = _SURELY * sigma[0] / (CALM * PRESS_N)
    return max(CALM_S, max(turning, pushing) ** 2 / (2.0 * np.pi * BANDWIDTH_HZ))


class _Laying:
    """Down until pushed back by the press, turning about level axes as the torque has it, until it lies."""

    def __init__(self, flush: Flush, averaged: float) -> None:
        self._n = flush.normal
        self._part = READING_S / averaged
        self._yield = turn_yield(flush)
        self._offset = np.zeros(6)
        self._turning = np.full(3, _TURN_RAD)
        self._push = 0.0
        self._calm = 0
        self._left = round(MOST_S / READING_S)
        self.lies = False

    def __call__(self, wrench: Array) -> Array | None:
        """How far the hand shall be from where it began, (6,), world; None at the end."""
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
