"""Finger actions: grasp a part, release it, change the grip, centre it, check that it is held."""

from apo_bench.geometry import Array
from apo_bench.simulation.execution.transfer import Grip, Transfer, find_hover_pose, is_tilted
from apo_bench.simulation.robot import (
    ExecutionAborted,
    Robot,
    follow_waypoints,
    move_to_height,
    plan_waypoints,
    smooth_trajectory,
    translate,
    weld,
)

_FREE = 2.0  # peak speed [m/s] of the empty hand in the air
_NEAR = 0.8  # as `_FREE`, close to parts
_DEPART_M = 0.09  # distance that the hand moves back after a release
OPEN_TO_PICK_M = 0.012  # distance of each finger from the part before it closes
OPEN_TO_RELEASE_M = 0.008  # distance of each finger from the part after a release
_LOST_M = 0.002
"""Fingers that close this far beyond the part's surface hold nothing. For the fingers of a described hand, whose
linkage may give way, the limit is at least a quarter of the half width."""


def grasp(robot: Robot, t: Transfer, grip: Grip, at: Array) -> None:
    """Move to the part with open fingers, close them, and check that they hold it.

    Args:
        at: The tip pose at which the fingers close, (4, 4), world.
    """
    above = find_hover_pose(at)
    least = max(above[2, 3], t.over)
    robot.follow(smooth_trajectory(robot.T, move_to_height(robot.T, max(robot.T[2, 3], least)), _NEAR))
    level = move_to_height(above, robot.T[2, 3])
    # A short arm cannot reach over the grasp at the present height; then it comes down to the least height on its way.
    between = plan_waypoints(robot.scene.kinematics, robot.arm, robot.T, level, robot.q)
    # `follow_waypoints` returns None out of reach.
    is_far = robot.arm.hand is not None and follow_waypoints(robot.scene.kinematics, robot.T, between, robot.q) is None
    robot.go(move_to_height(above, least) if is_far else level, _FREE, turn_speed=4.5)
    robot.forces.handle(t.part)  # from here on contact with this part is no collision
    robot.fingers(min(grip.half_width + OPEN_TO_PICK_M, robot.arm.opening_m))
    if is_tilted(at):
        robot.follow(smooth_trajectory(robot.T, above, _NEAR))
    robot.follow(smooth_trajectory(robot.T, at, _NEAR))
    robot.stand()
    robot.level()
    robot.forces.hold(t.part, *t.carried)
    if robot.scene.grasp == "weld":
        weld(robot.scene, robot.data, t.part, True)
    else:
        robot.fingers(grip.half_width - robot.arm.squeeze_m)  # inside the part, so that the fingers press
    robot.slip_monitor = robot.slip_monitor.grasp(robot.in_hand())
    check_hold(robot, grip)


def release(robot: Robot, t: Transfer, grip: Grip) -> None:
    """Open the fingers and note that the hand is empty."""
    robot.stage = "release"
    robot.slip_monitor = robot.slip_monitor.release(robot.in_hand())
    if robot.scene.grasp == "weld":
        weld(robot.scene, robot.data, t.part, False)
    robot.fingers(min(grip.half_width + OPEN_TO_RELEASE_M, robot.arm.opening_m))
    robot.forces.hold()


def depart(robot: Robot, t: Transfer) -> None:
    """Move the empty hand back from a released part, then up to the carrying height."""
    robot.stage = "depart"
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, -robot.T[:3, 2], _DEPART_M), _NEAR))
    robot.forces.handle(None)
    robot.follow(smooth_trajectory(robot.T, move_to_height(robot.T, max(t.safe, robot.T[2, 3])), _FREE))


def change_grip(robot: Robot, t: Transfer, grip: Grip, second: Grip, at: Array) -> None:
    """Release the part and grasp it at another place.

    Args:
        grip: The grip in use.
        second: The next grip.
        at: The tip pose of the next grip, (4, 4), world.
    """
    stage = robot.stage
    robot.stand()
    release(robot, t, grip)
    depart(robot, t)
    robot.stage = stage
    grasp(robot, t, second, at)


def centre(robot: Robot, t: Transfer, grip: Grip, at: Array) -> None:
    """Centre a standing part: close the fingers on it where it should stand, open them, and depart.

    Args:
        at: The pose at which the part should stand, (4, 4), world.
    """
    grasp(robot, t, grip, at @ grip.T_part_tip)
    release(robot, t, grip)
    depart(robot, t)


def grasp_again(robot: Robot, grip: Grip) -> None:
    """Open and close the fingers once more, to square a part that the first closing dragged and turned."""
    if robot.scene.grasp == "friction":
        robot.fingers(min(grip.half_width + OPEN_TO_PICK_M, robot.arm.opening_m))
        robot.stand()
        robot.fingers(grip.half_width - robot.arm.squeeze_m)
        robot.slip_monitor = robot.slip_monitor.grasp(robot.in_hand())
        check_hold(robot, grip)


def check_hold(robot: Robot, grip: Grip) -> None:
    """Abort with `lost_grasp` if the fingers have closed beyond the surface of the part."""
    lost = _LOST_M if robot.arm.hand is None else max(_LOST_M, grip.half_width / 4)
    if robot.scene.grasp == "friction" and robot.opening() < grip.half_width - lost:
        raise ExecutionAborted(robot.stage, "lost_grasp")
