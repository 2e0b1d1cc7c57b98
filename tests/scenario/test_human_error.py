"""How an error spreads: what is put against a displaced part goes along with it, as far as the face leads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import Layout, Scenario, draw_layout, load_scenario
from apo_bench.assembly import compute_placements
from apo_bench.geometry import pose
from apo_bench.scenario.human_error import NEGLIGIBLE_M, compute_human_error_covariance, spread_error
from apo_bench.scenario.scenario import HumanError
from apo_bench.scenario.scenario_file import list_scenario_names
from tests import rounds
from tests.scenes import Scene

SCENARIOS = {name: load_scenario(name) for name in list_scenario_names()}
CARELESS = sorted(name for name, scenario in SCENARIOS.items() if scenario.human_error)
ALIKE = {"vanished_fixture": {1, 2}, "nested_bushings": {0, 1}, "gearbox": {5, 6, 7}}
"""Operations, counted from 0, that show the error; elsewhere it is that of the error alone."""
LEFT = {"pocket_table": ("cube2",), "dovetail": ("base2",), "peg_in_hole": ("plate",)}
LEFT |= {"l_bracket_on_plate": ("plate2",), "shaft_through_brackets": ("bracket2",)}
LEFT |= {"nested_bushings": ("housing", "bush"), "wedge_under_roof": ("roof",), "gearbox": ("stand",)}
"""What is wrong until the last step; elsewhere it is castle 2."""


def layout(scenario: Scenario, seed: int = 3) -> Layout:
    return draw_layout(scenario, np.random.default_rng([seed, 0]))


@pytest.mark.parametrize("name", CARELESS)
@pytest.mark.parametrize("size_m", [-0.004, 0.0015])
def test_which_operations_show_the_error_and_what_is_left_of_it(name: str, size_m: float):
    scenario = SCENARIOS[name]
    found = spread_error(scenario, layout(scenario), size_m * scenario.human_error.axis)
    expected = np.zeros((len(scenario.assembly), 3))
    for k in ALIKE.get(name, {scenario.human_error.operation}):
        expected[k] = size_m * scenario.human_error.axis
    assert found.offsets == pytest.approx(expected, abs=1e-15)
    assert found.left == LEFT.get(name, ("castle2",))


@given(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01), st.integers(0, 20))
@settings(max_examples=30, deadline=None)
def test_a_castle_stays_in_contact_with_a_displaced_fixture(x: float, y: float, seed: int):
    """Whatever the direction of the error, the castle follows by what the face says and by nothing else.

    An error below `NEGLIGIBLE_M` is none, so it may stay open.
    """
    scenario = SCENARIOS["vanished_fixture"]
    truth = layout(scenario, seed)
    allowed = 1e-12 if np.hypot(x, y) > 2.0 * NEGLIGIBLE_M else 2.0 * NEGLIGIBLE_M
    offsets = spread_error(scenario, truth, np.array([x, y, 0.0])).offsets
    shown = truth.poses @ pose.exp(np.hstack([offsets, np.zeros_like(offsets)]))
    poses = compute_placements(scenario.assembly, truth.start, shown)[2]
    face, on = (scenario.assembly.face(of) for of in scenario.assembly.operations[2].contacts[1])
    corner = pose.apply(pose.inverse(poses["cube"]) @ poses["castle2"], face.outline[:1])[0]
    assert on.plane[:3] @ corner + on.plane[3] == pytest.approx(0.0, abs=allowed)
    assert offsets[2] == pytest.approx((0.0, y, 0.0), abs=allowed)


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_covariance_is_the_mean_square_of_every_operation_that_errs(name: str):
    scenario = SCENARIOS[name]
    covariance = compute_human_error_covariance(scenario, 2.0)
    expected = np.zeros_like(covariance)
    if scenario.human_error is not None:
        square = (
            np.outer(scenario.human_error.axis, scenario.human_error.axis) * (2.0 * scenario.human_error.rms_m) ** 2
        )
        for k in ALIKE.get(name, {scenario.human_error.operation}):
            expected[k, :3, :3] = square
    assert covariance == pytest.approx(expected, abs=1e-18)
    assert not compute_human_error_covariance(scenario, 0.0).any()


def led(scene: Scene, operation: int, offset: np.ndarray) -> np.ndarray:
    """The errors of all operations of a scene, (n, 3), where one is off; its last operation is a free one more."""
    last = replace(scene.assembly.operations[-1], contacts=())
    assembly = replace(scene.assembly, operations=(*scene.assembly.operations, last))
    goals = np.concatenate([scene.nominal_poses, scene.nominal_poses[-1:]])
    human_error = HumanError(operation, np.array([1.0, 0.0, 0.0]), 0.0, 0.01)
    scenario = replace(SCENARIOS["stick_in_tower"], assembly=assembly, nominal_poses=goals, human_error=human_error)
    return spread_error(scenario, Layout(goals, scene.start), offset).offsets[:-1]


def test_a_shaft_follows_its_bore_across_the_axis_and_not_along() -> None:
    scene = rounds.peg_in_plate()
    found = led(scene, 0, np.array([0.003, -0.002, 0.0]))
    assert found[1] == pytest.approx([0.003, -0.002, 0.0], abs=1e-12)
    scene = rounds.through()
    world = scene.nominal_poses[0][:3, :3] @ np.array([0.001, 0.0, 0.004])
    found = led(scene, 1, np.array([0.001, 0.0, 0.004]))
    peg = scene.nominal_poses[2][:3, :3] @ found[2]
    assert peg == pytest.approx([world[0], 0.0, world[2]], abs=1e-12)


def test_walls_that_are_not_at_right_angles_lead_as_far_as_all_agree() -> None:
    scene = rounds.dovetail()
    found = led(scene, 0, np.array([0.004, 0.003, 0.0]))
    assert found[1] == pytest.approx([0.0, 0.003, 0.0], abs=1e-9)
