"""Plans that are foretold to fail: what contacts leave free is chosen so that they fit. Others are left alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from apo_bench import (
    ContactCorrector,
    Correction,
    Observation,
    Plan,
    Scene,
    TrialConfig,
    build_scene,
    correct,
    fit_plan,
    load_scenario,
    run_trial,
)
from apo_bench.assembly import Step
from apo_bench.geometry import pose
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.planning.prediction.first_failure import Prediction, predict_failure
from apo_bench.simulation.execution.prepare import in_reach
from apo_bench.trial.plan_fitting import FittingPlan
from apo_bench.trial.planning import apply_method
from apo_bench.trial.trial_stages import observe_demonstration, simulate_demonstration

plain = ContactCorrector()
SEVERAL_MM = 20.0
"""A cube that would be less than 20 mm deep in a castle need not be moved further than so: it has 15 mm of room."""


@cache
def scene_named(name: str) -> Scene:
    return build_scene(load_scenario(name))


@cache
def seen_at(name: str, seed: int, noise_level: float = 8.0) -> Observation:
    simulated = simulate_demonstration(scene_named(name), 0.0, seed)
    return observe_demonstration(simulated, make_noise("isotropic", NoiseLevel(noise_level, noise_level)), seed)


def foretold(plan: Plan, scene: Scene) -> Prediction:
    return predict_failure(plan, scene.clearance_mm, scene.scenario.thresholds, scene.scenario.attach)


@cache
def planned(name: str, seed: int, corrector: Any = plain) -> tuple[Correction, FittingPlan]:
    correction = correct(seen_at(name, seed), corrector)
    return correction, fit_plan(correction, seen_at(name, seed), scene_named(name))


@pytest.mark.parametrize(
    ("name", "seed", "why"),
    [
        ("carried_bridge", 4, "would fall"),
        ("carried_bridge", 96, "deep in another part"),
        ("carried_bridge", 23, "its way in begins"),
        ("stick_in_tower", 4, "would lean"),
    ],
)
def test_a_plan_that_would_fail_is_moved_so_that_it_fits(name: str, seed: int, why: str) -> None:
    scene = scene_named(name)
    seen = seen_at(name, seed)
    correction, found = planned(name, seed)
    assert foretold(correction.plan(seen), scene).fails
    assert not foretold(found.plan, scene).fails
    assert in_reach(found.plan, scene)
    assert why in found.why
    assert 0.0 < max(shift_mm for _, shift_mm, _ in found.moves) < SEVERAL_MM
    assert all(f"operation {k + 1} (" in found.sentence for k, _, _ in found.moves)


@pytest.mark.parametrize(("name", "seed"), [("carried_bridge", 1), ("stick_in_tower", 1)])
def test_a_plan_that_fits_stays_as_it_is_bit_for_bit(name: str, seed: int) -> None:
    correction, found = planned(name, seed)
    np.testing.assert_array_equal(found.plan.target_poses, correction.poses)
    np.testing.assert_array_equal(found.plan.step_poses, correction.plan(seen_at(name, seed)).step_poses)
    assert (found.moves, found.why, found.sentence) == ((), "", "")


@pytest.mark.parametrize("method", ["uncorrected", "oracle"])
def test_what_was_not_corrected_is_not_moved(method: str) -> None:
    seen = seen_at("carried_bridge", 96)
    scene = scene_named("carried_bridge")
    truth = scene.scenario.nominal_poses
    made = apply_method(method, seen, truth, where=scene)
    assert made.plan is not None
    assert made.fitting is None
    np.testing.assert_array_equal(made.plan.target_poses, seen.poses if method == "uncorrected" else truth)


def test_schedules_that_take_work_apart_move_with_their_goals() -> None:
    """Targets that are the final goals follow them; earlier ones stay, and their contacts hold as before."""
    seen = seen_at("carried_bridge", 96)
    scene = scene_named("carried_bridge")
    correction = correct(seen, plain)
    schedule = (*map(Step, range(5)), Step(4, undo=True), Step(4))
    targets = np.array([correction.poses[step.operation] for step in schedule])
    targets[4] = targets[5] = targets[4] @ pose.at((0.0, 0.0, 0.001), (0.0, 0.0, 0.0))
    found = fit_plan(replace(correction, schedule=schedule, step_poses=targets), seen, scene).plan
    np.testing.assert_array_equal(found.step_poses[[0, 1, 2, 3, 6]], found.target_poses)
    np.testing.assert_array_equal(found.step_poses[4:6], targets[4:6])


def test_a_trial_says_what_was_moved_and_succeeds() -> None:
    asked = TrialConfig(
        "carried_bridge", 8.0, 8.0, human_error_scale=0.0, method="paper", seed=96, fidelity="near-contact"
    )
    row = run_trial(asked, scene_named("carried_bridge"))
    assert row["success"]
    assert row["failure_prediction"] is not None
    assert not row["failure_prediction"]["fails"]
    assert row["fit_adjustments"]
    assert {moved["operation"] for moved in row["fit_adjustments"]} <= {1, 2, 3, 4, 5}
    assert row["gap_after_mm"] is not None
    assert row["gap_after_mm"] < 1e-6
    untouched = run_trial(replace(asked, method="uncorrected"), scene_named("carried_bridge"))
    assert untouched["fit_adjustments"] is None
