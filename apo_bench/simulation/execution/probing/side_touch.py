"""Touch a fixed wall with the side of a held part before its insertion from above, to measure its pose in the hand."""

from apo_bench.geometry import Array
from apo_bench.simulation.execution.probing.state import ProbingState
from apo_bench.simulation.execution.probing.touching import BEYOND_M, SPEED
from apo_bench.simulation.execution.side_touches import STAND_OFF_M, SideTouch
from apo_bench.simulation.execution.transfer import Grip, Transfer
from apo_bench.simulation.robot import (
    Robot,
    compute_part_loads,
    move_to_height,
    plan_steady_trajectory,
    press,
    read_wrist,
    smooth_trajectory,
    translate,
    zero_again,
)
from apo_bench.simulation.scene import allow_sleep

_CARRY = 0.4
"""Peak speed of the part in the air, [m/s]."""
_DOWN = 0.2
"""Peak speed down to the wall, to it and up again, [m/s]."""


def touch_side(
    robot: Robot, probing: ProbingState, operation: int, t: Transfer, place: SideTouch, grip: Grip, held: Array
) -> Grip:
    """Carry the part to a side touch, press it on the wall and come back.

    Args:
        place: The touch, from `find_side_touches`.
        grip: The present grip.
        held: Pose of the part in the frame of the tip as estimated at the pick, (4, 4).

    Returns:
        The updated grip; without contact the estimate stays as it was.

    Raises:
        ExecutionAborted: The part fell out of the hand, or the arm collided.
    """
    T = place.T @ grip.T_part_tip
    high = max(t.safe, float(T[2, 3]))
    robot.macro = "touch-wall"
    robot.follow(smooth_trajectory(robot.T, move_to_height(robot.T, high), _DOWN))
    robot.go(move_to_height(T, high), _CARRY)
    robot.follow(smooth_trajectory(robot.T, T, _DOWN))
    robot.stand()
    robot.level()
    touches = []
    # Sleeping is off, so that a collision with a part at rest is noticed.
    with allow_sleep(robot.scene.work, False), read_wrist(robot, probing.wrist):
        probing.wrist.hold(*compute_part_loads(robot.scene, {t.part: held}))
        zero_again(robot, probing.wrist)
        end = translate(robot.T, place.direction, 2.0 * STAND_OFF_M + BEYOND_M)
        left = press(
            robot, plan_steady_trajectory(robot.T, end, SPEED), place.direction, probing.touch_n, probing.wrist
        )
        if left is not None:
            n, d = probing.plane_by_camera(place.normal, place.edge)
            touches = [probing.touch(robot, n, d, place.point, (operation, held))]
        probing.wrist.hold()
        robot.follow(smooth_trajectory(robot.T, T, _DOWN))
    robot.follow(smooth_trajectory(robot.T, move_to_height(T, high), _DOWN))
    return probing.grip(operation, touches, held, grip)
