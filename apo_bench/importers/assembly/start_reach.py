"""Find the starts that the arm does not reach, at the height at which each part is carried over the others."""

from collections.abc import Mapping, Sequence

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, pose
from apo_bench.importers.assembly.order_search import Placement
from apo_bench.planning.insertion.insertion_geometry import OVER_M, measure_clearing_heights
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution import SAFE_M, find_hover_pose, make_tip_frame
from apo_bench.simulation.robot import move_to_height

_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])  # about the z axis of the tip


def list_unreachable_starts(
    kinematics: Kinematics,
    assembly: Assembly,
    starts: Poses,
    order: Sequence[Placement],
    grasps: Mapping[str, Grasp | None],
) -> list[str]:
    """Return the parts whose hover, pick or lifted pose at the start is out of reach.

    Args:
        assembly: All parts; its operations are not used.
        starts: Pose of every part before the first operation, world, [m].
    """
    now = dict(starts)
    far = list[str]()
    for placing in order:
        main = placing.moves[0]
        grasp = grasps[main]
        if grasp is not None:
            tip = make_tip_frame(grasp, now[main])
            top, bottom = measure_clearing_heights(assembly, placing.moves, now)
            # The robot uses the grasp or the opposite one.
            picks = [now[main] @ tip, now[main] @ tip @ _HALF_TURN]
            heights = [max(SAFE_M, top + OVER_M + float(pick[2, 3]) - bottom) for pick in picks]
            if not any(_is_reached(kinematics, *each) for each in zip(picks, heights, strict=True)):
                far.append(main)
        motion = placing.at @ pose.inverse(now[main])
        now |= {part: motion @ now[part] for part in placing.moves}
    return list(dict.fromkeys(far))


def _is_reached(kinematics: Kinematics, pick: Array, height_m: float) -> bool:
    """Whether the arm reaches a tip pose, (4, 4), the hover pose before it, and the pose at a height above it."""
    q = np.array(kinematics.arm.home)
    for T in (find_hover_pose(pick), pick, move_to_height(pick, height_m)):
        there = kinematics.inverse(T, q)
        if there is None:
            return False
        q = there
    return True
