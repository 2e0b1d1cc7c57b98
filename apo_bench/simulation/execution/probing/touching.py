"""Probe fixed parts with the empty hand, first the floor, then walls, to calibrate the robot."""

from functools import partial

import numpy as np

from apo_bench.assembly import Touch
from apo_bench.geometry import Array
from apo_bench.simulation.execution.probing.places import (
    OPENING_M,
    ROOM_M,
    TouchPlace,
    floor_places,
    inner_places,
    opposite_places,
    wall_places,
)
from apo_bench.simulation.execution.probing.state import PADS, ProbingState
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
    zero_again,
)
from apo_bench.simulation.scene import allow_sleep

SPEED = 0.0025
"""Steady speed of a touch, [m/s]; at four times this speed a stiff hand exceeds the collision limit."""
BEYOND_M = 0.001
"""Further travel of a touch beyond twice its stand-off."""
_DOWN = 0.4  # peak speed [m/s] of the empty hand down to a place
_OVER = 0.8  # as `_DOWN`, over the parts
_BACK = 0.3  # as `_DOWN`, back from a touch
_HALF_TURN = 3.0
"""Turn, [rad], from which the hand passes by its rest pose, since the shorter turn may reach the end of the wrist."""
_HIGH_M = 0.1
"""Height over the places at which the hand passes from one to the next."""


def probe_fixed_parts(robot: Robot, probing: ProbingState) -> None:
    """Tare the wrist sensor, and touch the floor, then walls.

    The calibration estimate is updated after the floor, after the walls, after the two touches with opposite sides of
    the hand, and after those with its two pads.

    Raises:
        ExecutionAborted: The hand collided, or a place is out of reach.
    """
    robot.stage = TOUCHING
    probing.begin(robot)
    robot.fingers(OPENING_M)
    for places in (floor_places, wall_places, opposite_places, inner_places):
        if places is inner_places and not probing.has_unknown_pads:
            continue
        # Found with the present estimate, whose uncertainty sets how far before a face a touch begins.
        those = places(probing.plan, robot.scene, partial(_stand_off, robot, probing))
        touches = list[tuple[Touch, Array]]()
        for place in those:
            try:
                touches += _touch(robot, probing, place)
            except ExecutionAborted as aborted:
                aborted.why = _room(robot, probing, place)
                raise
        probing.learn(robot, touches, differ=places in (opposite_places, inner_places))


def _stand_off(robot: Robot, probing: ProbingState, T: Array, normal: Array) -> float:
    """Return how far before a face a touch begins, [m]: at least the greatest assumed error of the tip."""
    return max(STAND_OFF_M, probing.off_m(robot, T, normal))


def _room(robot: Robot, probing: ProbingState, place: TouchPlace) -> str:
    """Return the likely cause of a collision, as a phrase; empty if the room exceeds the assumed error of the tip."""
    far = max(probing.off_m(robot, place.T_world_tip, direction) for direction in np.eye(3))
    if far <= ROOM_M:
        return ""
    before = f"it began {1e3 * place.stand_off:.1f} mm before what it would touch, with {1e3 * ROOM_M:g} mm of room"
    return f"{before} aside, and may be off by {1e3 * far:.1f} mm"


def _touch(robot: Robot, probing: ProbingState, place: TouchPlace) -> list[tuple[Touch, Array]]:
    """Move to a place, press and come back.

    Returns:
        The touch and the patch of the hand that touched, as a list of one; empty without contact.
    """
    # The commands compensate for the estimate, so the hand goes where only the remaining errors lead it.
    hand = probing.residual.pads if place.inner else probing.residual.tool
    T = probing.residual.hand_eye @ place.T_world_tip @ hand
    direction = probing.residual.hand_eye[:3, :3] @ place.direction
    high = max(robot.T[2, 3], T[2, 3] + _HIGH_M)
    robot.follow(smooth_trajectory(robot.T, move_to_height(robot.T, high), _OVER))
    rest = robot.scene.kinematics.forward(robot.scene.arm.home)
    if abs(measure_turn(rest, T) - measure_turn(rest, robot.T)) > _HALF_TURN:
        robot.go(move_to_height(rest, high), _OVER)
    robot.go(move_to_height(T, high), _OVER)
    if place.opening != OPENING_M:
        robot.fingers(place.opening)
    robot.follow(smooth_trajectory(robot.T, T, _DOWN))
    robot.stand()
    robot.level()
    # Sleeping is off, so that a collision with a part at rest is noticed.
    with allow_sleep(robot.scene.work, False), read_wrist(robot, probing.wrist):
        zero_again(robot, probing.wrist)
        end = translate(robot.T, direction, 2.0 * place.stand_off + BEYOND_M)
        left = press(robot, plan_steady_trajectory(robot.T, end, SPEED), direction, probing.touch_n, probing.wrist)
        held = (PADS, np.eye(4)) if place.inner else None
        touched = probing.touch(robot, place.normal, place.offset, place.patch.mean(axis=0), held)
        robot.follow(smooth_trajectory(robot.T, T, _BACK))
    robot.follow(smooth_trajectory(robot.T, move_to_height(T, T[2, 3] + _HIGH_M), _BACK))
    return [] if left is None else [(touched, place.patch)]
