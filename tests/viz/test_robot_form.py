"""A plan in a robot's terms says the same, whatever frames and order of quaternions it is written in."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from apo_bench import Plan, load_scenario
from apo_bench.assembly import Step
from apo_bench.formats.robot_frames import RobotFrames
from apo_bench.geometry import Array, pose
from apo_bench.scenario.layout import place_layout
from apo_bench.viz.plan_text import list_plan_lines
from apo_bench.viz.robot_form import make_robot_form

BASE = pose.at((-0.4, 0.1, 0.02), (0.0, 0.0, 30.0))
TOOL = pose.at((0.0, 0.01, 0.15), (0.0, 0.0, 45.0))


def form(name: str, frames: RobotFrames) -> dict[str, Any]:
    scenario = load_scenario(name)
    layout = place_layout(scenario, 0.1, 0.0, 0.3)
    plan = Plan(scenario.assembly, layout.start, layout.poses)
    return make_robot_form(list_plan_lines(plan, scenario), plan, scenario, frames)


def matrix(said: dict[str, list[float]]) -> Array:
    q = said["quaternion_wxyz"] if "quaternion_wxyz" in said else np.roll(said["quaternion_xyzw"], 1)
    return pose.unpack(np.concatenate([np.array(said["position_mm"]) * 1e-3, q]))


def numbers(said: Any) -> list[float | str]:
    """Every number and text of a document, in order."""
    if isinstance(said, dict):
        return [x for key, value in said.items() for x in (key, *numbers(value))]
    if isinstance(said, list):
        return [x for value in said for x in numbers(value)]
    return [float(said) if isinstance(said, int | float) else str(said)]


@pytest.mark.parametrize("name", ["stick_in_tower", "pocket_table"])
def test_motions_follow_each_other_and_end_with_the_part_at_its_goal(name: str) -> None:
    goals = place_layout(load_scenario(name), 0.1, 0.0, 0.3).poses
    for step, goal in zip(form(name, RobotFrames())["steps"], goals, strict=True):
        grip = matrix(step["grasp"]["tip_in_part"])
        assert np.allclose(matrix(step["motions"][-1]["to"]), goal @ grip, atol=1e-9)
        assert np.allclose(matrix(step["part_at_goal"]), goal, atol=1e-9)
        for motion in step["motions"]:
            begin, end = (np.array(motion[key]["position_mm"]) for key in ("from", "to"))
            assert np.allclose(begin + motion["length_mm"] * np.array(motion["direction"]), end, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "frames"), [("stick_in_tower", RobotFrames()), ("carried_bridge", RobotFrames(BASE, TOOL, "wxyz"))]
)
def test_a_reader_rebuilds_the_plan_from_the_file_alone(name: str, frames: RobotFrames) -> None:
    """Nothing but the file and the scenario that it names; grasps and motions then follow from it again."""
    said = json.loads(json.dumps(form(name, frames)))
    base = matrix(said["poses"]["base_in_world"])
    scenario = load_scenario(said["scenario"])
    start = {part: base @ matrix(one["starts"]) for part, one in said["parts"].items()}
    goals = np.array([base @ matrix(step["part_at_goal"]) for step in said["steps"]])
    plan = Plan(scenario.assembly, start, goals)
    assert {part for part, one in said["parts"].items() if one["fixed"]} == set(scenario.assembly.fixed)
    for step, operation in zip(said["steps"], scenario.assembly.operations, strict=True):
        assert (step["part"], *step["carries"]) == operation.moves
    again = make_robot_form(list_plan_lines(plan, scenario), plan, scenario, frames)
    for one, other in zip(numbers(said), numbers(json.loads(json.dumps(again))), strict=True):
        assert one == other if isinstance(one, str) else abs(one - other) < 1e-6


def test_a_part_that_is_taken_out_again_leaves_its_contacts_one_after_the_other() -> None:
    """The wedge under the roof comes out in two motions: the second begins where the first one ended."""
    scenario = load_scenario("wedge_under_roof")
    layout = place_layout(scenario, 0.1, 0.0, 0.3)
    schedule = (Step(0), Step(1), Step(1, undo=True), Step(1))
    plan = Plan(scenario.assembly, layout.start, layout.poses, schedule)
    lines = list_plan_lines(plan, scenario)
    undone = make_robot_form(lines, plan, scenario, RobotFrames())["steps"][2]
    departs = len(lines[2].leaves.departs)
    first, second = undone["motions"][:departs]
    assert undone["undo"]
    assert np.allclose(matrix(first["to"]), matrix(second["from"]), atol=1e-9)
    assert first["direction"] != second["direction"]
    grip = matrix(undone["grasp"]["tip_in_part"])
    assert np.allclose(matrix(first["from"]), layout.poses[1] @ grip, atol=1e-9)
    assert np.allclose(matrix(undone["part_at_goal"]), layout.start[undone["part"]], atol=1e-9)
