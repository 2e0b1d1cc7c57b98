"""What a real robot is told to feel is what the simulated one does, in whatever frames it is written."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np
import pytest

from apo_bench import Plan, Scene, build_scene, load_scenario
from apo_bench.formats.robot_frames import RobotFrames
from apo_bench.geometry import Array, pose
from apo_bench.scenario.layout import place_layout
from apo_bench.simulation.execution.prepare import plan_moves
from apo_bench.simulation.execution.probing.places import floor_places, opposite_places, wall_places
from apo_bench.simulation.execution.side_touches import STAND_OFF_M
from apo_bench.viz.probing_form import make_probing_form
from tests.viz.test_robot_form import BASE, TOOL, matrix

FRAMES = {"tip": RobotFrames(), "flange": RobotFrames(BASE, TOOL, "wxyz")}
PLACES = {"floor": floor_places, "walls": wall_places, "one_wall_from_both_sides": opposite_places}


@cache
def scene(name: str) -> Scene:
    return build_scene(load_scenario(name))


@cache
def plan(name: str) -> Plan:
    layout = place_layout(load_scenario(name), 0.1, 0.0, 0.3)
    return Plan(scene(name).scenario.assembly, layout.start, layout.poses)


@cache
def form(name: str, frames: str = "tip", sensor: str = "wrist") -> dict[str, Any]:
    return json.loads(json.dumps(make_probing_form(plan(name), scene(name), FRAMES[frames], sensor), allow_nan=False))


def tip(said: dict[str, Any], frames: str) -> Array:
    """A pose of the file as one of the tip in the world."""
    of, tool = FRAMES[frames].T_world_base, FRAMES[frames].T_flange_tip
    return of @ matrix(said) @ (np.eye(4) if tool is None else tool)


def plane(said: dict[str, Any], frames: str) -> tuple[Array, float]:
    """Normal and offset of the file in the world, [m]."""
    base = FRAMES[frames].T_world_base
    n = base[:3, :3] @ said["normal"]
    return n, 1e-3 * said["offset_mm"] + float(n @ base[:3, 3])


@pytest.mark.parametrize(("name", "frames"), [("stick_in_tower", "tip"), ("peg_in_hole", "flange")])
def test_touches_are_where_the_simulated_hand_touches(name: str, frames: str) -> None:
    said = form(name, frames)["touch"]
    for kind, places in PLACES.items():
        for one, place in zip(said[kind], places(plan(name), scene(name)), strict=True):
            T = tip(one["from"], frames)
            n, d = plane(one, frames)
            v = 1e-3 * np.array(one["point_in_tip_mm"])
            assert np.allclose(T, place.T_world_tip, atol=1e-9)
            assert np.allclose(v, place.patch.mean(axis=0), atol=1e-9)
            assert np.allclose(n, place.normal, atol=1e-9)
            assert d == pytest.approx(place.offset, abs=1e-9)
            assert np.allclose(FRAMES[frames].T_world_base[:3, :3] @ one["direction"], place.direction, atol=1e-9)
            assert n @ pose.apply(T, v[None])[0] - d == pytest.approx(STAND_OFF_M, abs=1e-9)
    assert said["at_most_mm"] > said["expected_after_mm"] == 1e3 * STAND_OFF_M


@pytest.mark.parametrize(("name", "frames"), [("stick_in_tower", "tip"), ("peg_in_hole", "flange")])
def test_steps_are_those_of_the_simulated_robot(name: str, frames: str) -> None:
    assert any(one["lay_flat"] for one in form(name)["steps"])
    for one, (step, t) in zip(
        form(name, frames)["steps"], plan_moves(plan(name), scene(name), True, True), strict=True
    ):
        assert (one["operation"], one["undo"], one["part"]) == (step.operation + 1, step.undo, t.part)
        for grip, said in zip((*t.squaring, t.grips[0]), (*one["square"], one["grasp_twice"]), strict=True):
            assert np.allclose(tip(said["at"], frames), t.T_world_start @ grip.T_part_tip, atol=1e-9)
            assert said["each_finger_open_mm"] > said["closed_on_part_mm"] == pytest.approx(1e3 * grip.half_width)
        assert one["guards_n"]["insert"] == pytest.approx(t.insert_n, abs=1e-6)
        assert (one["search_press_n"] is None) == (t.front is None)
        assert (one["lay_flat"] is None) == (t.flat is None)
        if t.flat is not None:
            laid = one["lay_flat"]
            part = tip(laid["at"], frames) @ matrix(laid["part_in_tip"])
            n, d = plane(laid, frames)
            feet = pose.apply(part, 1e-3 * np.array(laid["feet_in_part_mm"]))
            assert np.allclose(part, t.flat.T, atol=1e-9)
            assert feet @ n == pytest.approx(d, abs=1e-9)
            for told, place in zip(laid["then_walls"], t.side_touches, strict=True):
                begins = tip(told["from"], frames) @ matrix(laid["part_in_tip"])
                n, d = plane(told, frames)
                assert np.allclose(begins, place.T, atol=1e-9)
                touched = pose.apply(begins, 1e-3 * np.array([told["point_in_part_mm"]]))[0]
                assert n @ touched - d == pytest.approx(STAND_OFF_M, abs=1e-9)
