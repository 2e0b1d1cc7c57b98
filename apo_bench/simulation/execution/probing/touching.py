"""Touch what is fixed with the closed, empty hand: the floor around the goals, then walls."""

from functools import partial

import numpy as np

from apo_bench.assembly import Touch
from apo_bench.geometry import Array
from apo_bench.simulation.execution.probing.places import (
    OPENING_M,
    ROOM_M,
    TouchPlace,
    floor_places,
    opposite_places,
    wall_places,
)
from apo_bench.simulation.execution.probing.state import ProbingState
from apo_bench.simulation.execution.side_touches import STAND_OFF_M
from apo_bench.simulation.hooks import TOUCHING
from apo_bench.simulation.robot import (
    ExecutionAborted,
    Robot,
    measure_turn,
    move_to_height,
    plan_steady_trajectory,
    press,
    read_wrist,
    smooth_trajectory,
    translate,
)
from apo_bench.simulation.scene import allow_sleep

SPEED = 0.0025
"""Steady speed of a touch, [m/s]: a stiff hand four times as fast strikes harder than an arm may."""
BEYOND_M = 0.001
"""The floor or a wall may be so much farther than expected."""
_DOWN = 0.4  # peak speed [m/s] of the empty hand down to a place
_OVER = 0.8  # as `_DOWN`, over the parts
_BACK = 0.3  # as `_DOWN`, back from a touch
_HALF_TURN = 3.0
"""A hand that turns by more passes by its rest, [rad]: the shorter way may lead over where the wrist ends."""
_HIGH_M = 0.1
"""The hand passes from one place to the next so far above them."""


def probe_fixed_parts(robot: Robot, probing: ProbingState) -> None:
    """Touch the floor, then walls; the robot updates its calibration estimate after each.

    Raises:
        ExecutionAborted: The hand struck something, or a place is out of reach.
    """
    robot.stage = TOUCHING
    probing.begin(robot)
    if "touch" not in probing.actions:
        return
    robot.fingers(OPENING_M)
    for places in (floor_places, wall_places, opposite_places):
        those = places(probing.plan, robot.scene, partial(_stand_off, robot, probing))
        touches = list[tuple[Touch, Array]]()
        for place in those:
            try:
                touches += _touch(robot, probing, place)
            except ExecutionAborted as aborted:
                aborted.why = _room(robot, probing, place)
                raise
        probing.learn(robot, touches, differ=places is opposite_places)


def _stand_off(robot: Robot, probing: ProbingState, T: Array, normal: Array) -> float:
    return max(STAND_OFF_M, probing.off_m(robot, T, normal))


def _room(robot: Robot, probing: ProbingState, place: TouchPlace) -> str:
    """What to say where something was struck: nothing if the robot had room for what it may be off."""
    far = max(probing.off_m(robot, place.T_world_tip, direction) for direction in np.eye(3))
    if far <= ROOM_M:
        return ""
    before = f"it began {1e3 * place.stand_off:.1f} mm before what it would touch, with {1e3 * ROOM_M:g} mm of room"
    return f"{before} aside, and may be off by {1e3 * far:.1f} mm"


def _touch(robot: Robot, probing: ProbingState, place: TouchPlace) -> list[tuple[Touch, Array]]:
    """Go there, press, come back; the touch, if there was one, and what of the hand may have touched."""
    T = probing.residual.hand_eye @ place.T_world_tip @ probing.residual.tool
    direction = probing.residual.hand_eye[:3, :3] @ place.direction
    high = max(robot.T[2, 3], T[2, 3] + _HIGH_M)
    robot.follow(smooth_trajectory(robot.T, move_to_height(robot.T, high), _OVER))
    rest = robot.scene.kinematics.forward(robot.scene.arm.home)
    if abs(measure_turn(rest, T) - measure_turn(rest, robot.T)) > _HALF_TURN:
        robot.go(move_to_height(rest, high), _OVER)
    robot.go(move_to_height(T, high), _OVER)
    robot.follow(smooth_trajectory(robot.T, T, _DOWN))
    robot.stand()
    # Nothing sleeps meanwhile: what the arm strikes is noticed, whatever rests.
    with allow_sleep(robot.scene.work, False), read_wrist(robot, probing.wrist):
        end = translate(robot.T, direction, 2.0 * place.stand_off + BEYOND_M)
        left = press(robot, plan_steady_trajectory(robot.T, end, SPEED), direction, probing.touch_n, probing.wrist)
        touched = probing.touch(robot, place.normal, place.offset, place.patch.mean(axis=0))
        robot.follow(smooth_trajectory(robot.T, T, _BACK))
    robot.follow(smooth_trajectory(robot.T, move_to_height(T, T[2, 3] + _HIGH_M), _BACK))
    return [] if left is None else [(touched, place.patch)]
