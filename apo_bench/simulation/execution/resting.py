"""Wait with bounded patience until parts rest."""

import numpy as np

from apo_bench.simulation.robot import Robot
from apo_bench.simulation.scene import allow_sleep

_REST_M_S = 5e-5
"""Slower than this parts rest, and the next operation may begin."""
_REST_RAD_S = 1e-3
"""As `_REST_M_S`, of their turning; a stick that rocks in its slot takes a while."""
LOOK_S = 0.04
"""Time between two looks at the speed of the parts."""
PATIENCE_S = 1.5
"""The arm waits so long at most."""
_STEPS = ((1.14, 3), (0.86, 2), (0.58, 8), (0.3, 4), (0.0, 1))
"""What has moved so long, [s], rocks: steps are taken in so many parts. Of 19 states that rocked on for ever in whole
steps quarters end 17, halves 10, and all of these in turn every one."""


def wait_for_rest(robot: Robot) -> None:
    """Wait until nothing moves at two looks in a row; then the judge looks.

    Only the simulation knows the speed of the parts; it decides when the arm goes on, never where to. Meanwhile nothing
    sleeps: a stick in its slot that falls asleep and wakes in turn would rock on. What still moves after a while is
    followed in parts of a step: where two boxes lie on each other in nearly one plane, the engine finds four points of
    contact at one depth and one at another, and steps of one length can keep a stick rocking between the two.
    """
    moving = np.array([np.arange(v, v + 6) for v in robot.scene.work.dof.values()])
    quiet = 0
    with allow_sleep(robot.scene.work, False):
        for i in range(round(PATIENCE_S / LOOK_S)):
            speed = np.abs(robot.data.qvel[moving]).max(axis=0)
            quiet = quiet + 1 if speed[:3].max() < _REST_M_S and speed[3:].max() < _REST_RAD_S else 0
            if quiet == 2:
                return
            robot.wait(LOOK_S, parts=next(parts for since, parts in _STEPS if i * LOOK_S >= since))
