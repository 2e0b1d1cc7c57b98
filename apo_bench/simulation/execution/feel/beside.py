"""Touching a wall of what is fixed with the side of a part that is held, before it is inserted from above."""

from apo_bench.geometry import Array
from apo_bench.simulation.execution.beside import STAND_OFF_M, Beside
from apo_bench.simulation.execution.feel.feeling import Feeling
from apo_bench.simulation.execution.feel.touching import BEYOND_M, SPEED
from apo_bench.simulation.execution.transfer import Grip, Transfer
from apo_bench.simulation.robot.by_wrist import press, reading
from apo_bench.simulation.robot.paths import shifted, smooth, steady, with_height
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.robot.wrist import part_loads
from apo_bench.simulation.scene.world import sleeping

_CARRY = 0.4
_DOWN = 0.2
"""Peak speeds, [m/s]."""


def touch_beside(
    robot: Robot, feeling: Feeling, operation: int, t: Transfer, place: Beside, grip: Grip, held: Array
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
    robot.follow(smooth(robot.T, with_height(robot.T, high), _DOWN))
    robot.go(with_height(T, high), _CARRY)
    robot.follow(smooth(robot.T, T, _DOWN))
    robot.stand()
    touches = []
    # Nothing sleeps meanwhile: what the arm strikes is noticed, whatever rests.
    with sleeping(robot.scene.work, False), reading(robot, feeling.wrist):
        feeling.wrist.hold(*part_loads(robot.scene, {t.part: held}))
        end = shifted(robot.T, place.way, 2.0 * STAND_OFF_M + BEYOND_M)
        left = press(robot, steady(robot.T, end, SPEED), place.way, feeling.touch_n, feeling.wrist)
        if left is not None:
            n, d = feeling.as_seen(place.normal, place.edge)
            touches = [feeling.touch(robot, n, d, place.point, (operation, held))]
        feeling.wrist.hold()
        robot.follow(smooth(robot.T, T, _DOWN))
    robot.follow(smooth(robot.T, with_height(T, high), _DOWN))
    return feeling.grip(operation, touches, held, grip)
