"""Wait until all parts are at rest, for a limited time, before the next operation or the judge."""

import numpy as np

from apo_bench.simulation.robot import Robot
from apo_bench.simulation.scene import allow_sleep

_REST_M_S = 5e-5
"""Speed below which a part is at rest."""
_REST_RAD_S = 1e-3
"""Angular speed below which a part is at rest; a stick that rocks in its slot takes a while."""
LOOK_S = 0.04
"""Time between two checks of the speeds."""
PATIENCE_S = 1.5
"""Greatest waiting time."""
_STEPS = ((1.14, 3), (0.86, 2), (0.58, 8), (0.3, 4), (0.0, 1))
"""Pairs: from this waiting time on, [s], each physics step is divided into so many parts.

Of 19 states that rocked for ever with whole steps, quarters end 17, halves 10, and this sequence all.
"""


def wait_for_rest(robot: Robot) -> None:
    """Wait until all parts are at rest at two checks in a row, or until `PATIENCE_S` has passed.

    The true speeds of the parts decide when the arm continues, never where it moves. Sleeping is off meanwhile, since a
    stick in its slot that falls asleep and wakes in turn would rock on. After a while, the physics steps are divided.
    Two boxes that lie on each other in nearly one plane have four contact points in one step and one at another depth
    in the next. Steps of constant length can keep a stick rocking between both.
    """
    # Addresses in `qvel` of the velocities of each part, (parts, 6): three linear ones, then three angular ones.
    moving = np.array([np.arange(v, v + 6) for v in robot.scene.work.dof.values()])
    quiet = 0
    with allow_sleep(robot.scene.work, False):
        for i in range(round(PATIENCE_S / LOOK_S)):
            speed = np.abs(robot.data.qvel[moving]).max(axis=0)
            quiet = quiet + 1 if speed[:3].max() < _REST_M_S and speed[3:].max() < _REST_RAD_S else 0
            if quiet == 2:
                return
            robot.wait(LOOK_S, parts=next(parts for since, parts in _STEPS if i * LOOK_S >= since))
