"""Whether the arm reaches both ends of a transfer: joint angles at its key poses, looked for once."""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry.arrays import Array, remembered
from apo_bench.simulation.execution.transfer import Transfer, key_poses
from apo_bench.simulation.robot.paths import Trajectory
from apo_bench.simulation.robot.reach import at_end
from apo_bench.simulation.scene.scene import Scene


class KeyAngles(NamedTuple):
    """Joint angles at the tip poses of a transfer that must be in reach, [rad]."""

    code: str
    """Of the first end at which a tip pose has no joint angles, empty where all have."""
    reached: tuple[Array, ...]
    """(joints,) each, at the poses before that."""
    ended: Array
    """Where the search for the last of them ended, (joints,)."""


@remembered
def key_angles(transfer: Transfer, scene: Scene) -> KeyAngles:
    """Joint angles at the tip poses that must be in reach; remembered, since who predicts a transfer and who carries it
    out ask for the same."""
    q = np.array(scene.arm.home)
    before = None
    reached = list[Array]()
    for code, poses in zip(("unreachable_start", "unreachable"), key_poses(transfer), strict=True):
        for T in poses:
            there = scene.kinematics.inverse(T, q)
            if there is None and scene.arm.hand is not None:
                # Step by step from where the tip was, since a leap may end at the limit of a joint.
                start = scene.kinematics.forward(q) if before is None else before
                there = at_end(scene.kinematics, Trajectory(start, T, 1.0, np.asarray), 0.0, 1.0, q)
            if there is None:
                return KeyAngles(code, tuple(reached), scene.kinematics.last)
            q = there
            before = T
            reached.append(q)
    return KeyAngles("", tuple(reached), q)
