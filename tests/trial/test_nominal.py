"""The baseline that knows the scenario's file by heart: one and the same assembly, put where it fits best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from apo_bench import Observation, Scene, TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.geometry import Array, pose
from apo_bench.scenario.layout import place_layout
from apo_bench.trial.nominal_poses import fit_nominal_poses
from apo_bench.trial.planning import apply_method

SCENARIO = load_scenario("stick_in_tower")


def seen(goals: Array, sigma: float = 1e-3) -> Observation:
    n = len(SCENARIO.assembly)
    return Observation(
        SCENARIO.assembly, SCENARIO.start, goals, np.tile(sigma**2 * np.eye(6), (n, 1, 1)), np.ones(n, dtype=bool)
    )


@pytest.mark.parametrize("yaw", [0.4, 3.1])
def test_a_nominal_layout_is_found_wherever_it_stands(yaw: float) -> None:
    """The solver stops at a relative step of 1e-8: 1e-8 m was found."""
    layout = place_layout(SCENARIO, 0.13, -0.05, yaw)
    np.testing.assert_allclose(
        fit_nominal_poses(SCENARIO.nominal_poses, seen(layout.poses)), layout.poses, rtol=0, atol=1e-6
    )


def test_the_assembly_is_always_the_same() -> None:
    """Whatever was seen, goals lie to each other as in the file, and the assembly stands level on the table."""
    rng = np.random.default_rng(3)
    goals = place_layout(SCENARIO, 0.1, 0.0, 0.2, (0.004, -0.005)).poses @ np.array(
        [pose.exp(np.repeat([4e-3, 0.07], 3) * rng.standard_normal(6)) for _ in SCENARIO.nominal_poses]
    )
    planned = fit_nominal_poses(SCENARIO.nominal_poses, seen(goals))
    for k in range(1, len(planned)):
        apart, nominal = (pose.inverse(each[0]) @ each[k] for each in (planned, SCENARIO.nominal_poses))
        np.testing.assert_allclose(apart, nominal, rtol=0, atol=1e-12)
    np.testing.assert_allclose(planned[:, 2, 3], SCENARIO.nominal_poses[:, 2, 3], rtol=0, atol=1e-12)


def test_operations_that_were_not_seen_are_left_out() -> None:
    layout = place_layout(SCENARIO, 0.13, -0.05, 0.3)
    goals = np.array(layout.poses)
    goals[1, :3, 3] += 1.0
    partly = replace(seen(goals), observed=np.array([True, False, True]))
    np.testing.assert_allclose(fit_nominal_poses(SCENARIO.nominal_poses, partly), layout.poses, rtol=0, atol=1e-6)
    nothing = apply_method("nominal", replace(partly, observed=np.zeros(3, dtype=bool)), None, where=SCENARIO)
    assert nothing.plan is None
    assert nothing.failure is not None
    assert nothing.failure.code == "not_seen"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(SCENARIO)


def test_a_tower_that_may_stand_anywhere_is_built_by_heart(scene: Scene) -> None:
    """At 4 mm and degrees: no part is where it was shown, and the assembly is right in itself."""
    asked = TrialConfig(
        "stick_in_tower", 4.0, 4.0, human_error_scale=0.0, method="nominal", seed=1, fidelity="near-contact"
    )
    row = run_trial(asked, scene)
    assert (row["success"], row["as_demonstrated"]) == (True, True)
    assert row["planned_error_fixed_mm"] > 0.0
    assert (row["gap_after_mm"] < 1e-6, row["corrected_operations"], row["tried_corrections"]) == (True, [], [])
