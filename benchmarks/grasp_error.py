"""How a part turns and shifts in the hand when the gripper closes: `python -m benchmarks.grasp_error`.

A robot with the default hand-eye error picks each part of generated assemblies, which no table of the documentation
has, from its start. Printed for each number of the twist of the part in the frame of the tip, whose first axis is the
closing direction: the share that is left after closing (`KEPT` of `robot_draws`), and what closing adds per mm that
the pads push the part (`_DRAGGED` of `stated_error`). The tilt about the second axis is that of a part of 1 N, since
heavy parts tilt less.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from apo_bench import build_scene, load_scenario
from apo_bench.assembly import Plan
from apo_bench.envs.apo_insert import ROBOT_ERROR
from apo_bench.envs.insert_spaces import MM_DEG
from apo_bench.geometry import pose
from apo_bench.scenario import draw_layout
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.carry_out import pick
from apo_bench.simulation.execution.execution import moves_with_error
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.robot import ExecutionAborted, Robot
from apo_bench.simulation.scene import Scene, allow_sleep, get_part_pose
from apo_bench.trial.trial_stages import LAYOUT, draw_robot_error, stream

FAMILIES = ("corners", "pegs", "posts", "covers", "pinned", "bridges", "keys", "grooves")
FIRST = 9000
NAMES = ("x", "y", "z", "about x", "about y", "about z")


def pick_parts(scene: Scene, trial: int) -> Iterator[np.ndarray]:
    """Yield the twists of each part in the hand before closing and when it is lifted, and its weight, (3, 6).

    [mm, deg] and [N].
    """
    layout = draw_layout(scene.scenario, stream(trial, LAYOUT), scene.clearance_mm)
    plan = Plan(scene.scenario.assembly, scene.scenario.start, layout.poses)
    error = draw_robot_error(ROBOT_ERROR, scene, trial)
    for _, t in moves_with_error(plan, scene, ExecutionConfig("near-contact"), error):
        if t.carried or t.out.level:
            continue
        robot = Robot(scene, plan.start, Hooks(), "near-contact", error)
        grip = t.grips[0].T_part_tip
        before = pose.inverse(t.T_world_start @ grip) @ plan.start[t.part] @ grip
        with allow_sleep(scene.work, True):
            try:
                pick(robot, t)
            except ExecutionAborted:
                continue
        after = pose.inverse(robot.tip()) @ get_part_pose(scene.work, robot.data, t.part) @ grip
        yield np.vstack([pose.log(np.array([before, after])) * MM_DEG, np.full(6, t.weight_n)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--assemblies", type=int, default=3, help="of each family")
    parser.add_argument("--trials", type=int, default=4, help="of each assembly")
    given = parser.parse_args()
    scenes = (
        build_scene(load_scenario(f"generated:{family}:{seed}"))
        for family in FAMILIES
        for seed in range(1, given.assemblies + 1)
    )
    trials = range(FIRST, FIRST + given.trials)
    grasps = np.array([twists for scene in scenes for t in trials for twists in pick_parts(scene, t)])
    before, after, weights = grasps.swapaxes(0, 1)
    kept = (before * after).sum(axis=0) / (before**2).sum(axis=0)
    more = after - kept * before
    more[:, 4] = (after - before)[:, 4] * weights[:, 4]
    added = np.sqrt((more**2).sum(axis=0) / (before[:, 0] ** 2).sum())
    print(f"{len(before)} grasps", "| of the part | kept | added per mm, mm or degrees |", "|---|--:|--:|", sep="\n")
    for name, share, size in zip(NAMES, kept, added, strict=True):
        print(f"| {name} | {share:.2f} | {size:.3f} |")


if __name__ == "__main__":
    main()
