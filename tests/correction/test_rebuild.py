"""Scenes of the paper are taken apart and built again when a step turns out wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
import pytest

from apo_bench import Plan, Scene, build_scene, draw_layout, load_scenario
from apo_bench.assembly import Step
from apo_bench.geometry import pose
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.trial.trial_stages import LAYOUT, Attempt, replay_and_judge, stream

SEED = 3


@cache
def scene_of(name: str) -> Scene:
    return build_scene(load_scenario(name))


def built(scene: Scene, schedule: tuple[Step, ...], wrong_mm: Mapping[int, Sequence[float]]) -> Attempt:
    """Follow a schedule at the truth; operations done for the first time are `wrong_mm` off in the part's frame."""
    layout = draw_layout(scene.scenario, stream(SEED, LAYOUT), scene.clearance_mm)
    seen: set[int] = set()
    targets = []
    for k, undo in schedule:
        first = k not in seen or undo
        off = pose.at(1e-3 * np.array(wrong_mm[k])) if first and k in wrong_mm else np.eye(4)
        targets.append(layout.poses[k] @ off)
        seen |= {k} if not undo else set()
        if undo:
            wrong_mm = {j: w for j, w in wrong_mm.items() if j != k}
    plan = Plan(scene.scenario.assembly, layout.start, layout.poses, schedule, np.array(targets))
    return replay_and_judge(plan, scene, layout.poses, config=ExecutionConfig("near-contact"))


def back_to(oldest: int, step: int, n: int) -> tuple[Step, ...]:
    """Do all before `step`, undo back to `oldest`, do the rest (operations from 1, as in Section 4.2)."""
    ahead = [Step(k) for k in range(step - 1)]
    back = [Step(k, undo=True) for k in range(step - 2, oldest - 2, -1)]
    return (*ahead, *back, *(Step(k) for k in range(oldest - 1, n)))


@pytest.mark.parametrize(
    ("name", "step", "wrong_mm"), [("carried_bridge", 5, {1: (0, 3, 0)}), ("pocket_table", 6, {1: (3, 0, 0)})]
)
def test_the_robot_takes_apart_what_was_wrong_and_builds_it_again(
    name: str, step: int, wrong_mm: Mapping[int, Sequence[float]]
) -> None:
    """Fig. 14, and the same for Fig. 6: back to operation 2, which the human had got wrong."""
    scene = scene_of(name)
    tried = built(scene, back_to(2, step, len(scene.scenario.assembly)), wrong_mm)
    assert (tried.result.outcome.code, tried.verdict.demonstrated.code) == ("ok", "ok")
    assert tried.verdict.success
    assert tried.verdict.demonstrated.placed_part_shift_mm < 0.5
