"""Predicted success follows from what the planner knows; below `min_predicted_success` nothing moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from apo_bench import Scene, TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.assembly import Hypothesis
from apo_bench.correction.correctors import correct
from apo_bench.geometry import pose
from apo_bench.planning.prediction.plan_measures import measure_drawn_plans
from apo_bench.records import TrialRecord
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.controller import replay
from apo_bench.trial import run
from apo_bench.trial.planning import apply_method
from apo_bench.trial.predicted_success import predict_success
from apo_bench.trial.robot_draws import brought, stack_errors
from apo_bench.trial.run import noise_of
from apo_bench.trial.trial_stages import (
    SimulatedDemonstration,
    draw_robot_error,
    observe_demonstration,
    simulate_demonstration,
)

SCENARIO = "stick_in_tower"
SEED = 4


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario(SCENARIO))


@pytest.fixture(scope="module")
def simulated(scene: Scene) -> SimulatedDemonstration:
    return simulate_demonstration(scene, 1.0, SEED)


def asked(**more: Any) -> TrialConfig:
    return TrialConfig(SCENARIO, **({"seed": SEED, "fidelity": "near-contact", "method": "contact"} | more))


def row(scene: Scene, simulated: SimulatedDemonstration, **more: Any) -> TrialRecord:
    return run_trial(asked(**more), scene, simulated=simulated)


def test_a_promise_never_sees_the_truth(scene: Scene, simulated: SimulatedDemonstration) -> None:
    """The same observation before another truth: the same promise, though the plan is wrong now."""
    off = pose.at((0.0, 0.0, 0.03), (0.0, 0.0, 40.0))
    elsewhere = replace(simulated, layout=replace(simulated.layout, poses=simulated.layout.poses @ off))
    right, wrong = row(scene, simulated), row(scene, elsewhere)
    assert right["predicted_success"] == wrong["predicted_success"]
    assert wrong["planned_error_fixed_mm"] > 10.0 > right["planned_error_fixed_mm"]


def test_what_is_seen_worse_and_not_corrected_promises_less(scene: Scene) -> None:
    careful = simulate_demonstration(scene, 0.0, SEED)
    predicted_success = []
    for noise_level in (0.0, 0.1, 0.5, 4.0):
        settings = asked(noise_mm=noise_level, noise_deg=noise_level)
        means = []
        for seed in range(4):
            seen = observe_demonstration(careful, noise_of(settings, scene, careful), seed)
            planned = apply_method("uncorrected", seen, None, where=scene)
            assert planned.plan is not None
            means.append(predict_success(planned.plan, seen, None, scene.scenario))
        predicted_success.append(float(np.mean(means)))
    assert predicted_success == sorted(predicted_success, reverse=True)
    assert predicted_success[0] - predicted_success[-1] > 0.3


def test_a_robot_that_feels_promises_as_a_right_one_unless_parts_slip(
    scene: Scene, simulated: SimulatedDemonstration
) -> None:
    seen = observe_demonstration(simulated, noise_of(asked(), scene, simulated), SEED)
    planned = apply_method("contact", seen, None, where=scene)
    assert planned.plan is not None

    def predicted_success(error: str) -> float:
        assert planned.plan is not None
        return predict_success(planned.plan, seen, planned.correction, scene, error, True, True)

    right = predicted_success("none")
    assert predicted_success("hand_eye:1/0.2+tool:0.5") == right
    assert predicted_success("in_hand:0/20") < right


def test_a_robot_with_errors_brings_parts_where_physics_says() -> None:
    """Parts that are centred both ways, slid to others, and laid flat: where they rest when the next one is put."""
    error_name = "tool:0.25"
    pocket = build_scene(load_scenario("pocket_table"))
    shown = simulate_demonstration(pocket, 1.0, SEED)
    seen = observe_demonstration(shown, noise_of(asked(), pocket, shown), SEED)
    plan = correct(seen, "contact").plan(seen)
    error = draw_robot_error(error_name, pocket, SEED)
    assert error is not None
    reached = replay(plan, pocket, config=ExecutionConfig("near-contact", robot_error=error)).reached
    states = brought(plan, pocket, error)
    resting = [snapshot for snapshot in reached.after if snapshot is not None]
    for before, state, operation in zip(resting, states[1:], plan.assembly.operations[1:], strict=False):
        others = [part for part in state if part not in operation.moves]
        off = [np.linalg.norm(before.poses[part][:2, 3] - state[part][:2, 3]) for part in others]
        assert max(off) < 0.15e-3


def test_several_robots_at_once_bring_parts_where_each_does(scene: Scene, simulated: SimulatedDemonstration) -> None:
    seen = observe_demonstration(simulated, noise_of(asked(), scene, simulated), SEED)
    plan = correct(seen, "contact").plan(seen)
    drawn = [draw_robot_error("hand_eye:0.5/0.2+joints:0.02+in_hand:0.3/0.2", scene, seed) for seed in range(3)]
    errors = [error for error in drawn if error is not None]
    together = brought(plan, scene, stack_errors(errors))
    limits = scene.scenario.thresholds
    sizes = {
        (each.operation, each.kind): each.size
        for each in measure_drawn_plans(plan, scene.clearance_mm, limits, scene.scenario.attach, (), together)
    }
    for i, error in enumerate(errors):
        alone = brought(plan, scene, error)
        for every, each in zip(together, alone, strict=True):
            for part, T in each.items():
                at = every[part][i] if every[part].ndim == 3 else every[part]
                np.testing.assert_allclose(at, T, rtol=0, atol=1e-12)
        for one in measure_drawn_plans(plan, scene.clearance_mm, limits, scene.scenario.attach, (), alone):
            assert one.size.shape == (1,)
            if one.kind in ("fit", "side"):
                assert sizes[one.operation, one.kind][i] == pytest.approx(one.size[0], abs=1e-9)


def test_the_likelier_a_rival_whose_contacts_the_plan_breaks_the_less_it_promises(
    scene: Scene, simulated: SimulatedDemonstration
) -> None:
    """A goal half a millimetre beside its contacts: right if they are wrong, and wrong if they hold."""
    seen = observe_demonstration(simulated, noise_of(asked(noise_mm=0.1, noise_deg=0.1), scene, simulated), SEED)
    correction = correct(seen, "contact")
    last = len(seen.assembly) - 1
    relations = seen.assembly.relations()
    made = [any(relations[j].made == last for j in arc) for arc in seen.assembly.arcs()]
    dropped = tuple(f"R{i}" for i, own in enumerate(made, start=1) if own)
    aside = correction.poses.copy()
    aside[last, :3, 3] += 0.0005
    plan = correction.plan(seen).with_target_poses(aside)
    predicted_success = []
    for weight in (0.99, 0.8, 0.5, 0.1):
        without = Hypothesis(weight, aside, correction.covariance, seen, (), dropped)
        holding = Hypothesis(1.0 - weight, correction.poses, correction.covariance, seen)
        torn = replace(correction, poses=aside, hypotheses=(without, holding))
        predicted_success.append(predict_success(plan, seen, torn, scene.scenario))
    assert predicted_success == sorted(predicted_success, reverse=True)
    assert predicted_success[0] - predicted_success[-1] > 0.2


def test_below_abstain_the_arm_never_moves(
    scene: Scene, simulated: SimulatedDemonstration, monkeypatch: pytest.MonkeyPatch
) -> None:
    carried_out = row(scene, simulated)
    least = min(1.0, carried_out["predicted_success"] + 1e-6)
    monkeypatch.setattr(run, "replay_and_judge", lambda *given, **named: pytest.fail("the arm moved"))
    kept = row(scene, simulated, min_predicted_success=least)
    assert (kept["success"], kept["failure_stage"], kept["failure_code"]) == (False, "predicted-success", "abstained")
    assert (kept["sim_time_s"], kept["final_poses"]) == (None, None)
    assert kept["predicted_success"] == carried_out["predicted_success"]


def test_wrong_contacts_lower_the_prediction_where_nothing_else_fixes_them(
    scene: Scene, simulated: SimulatedDemonstration
) -> None:
    """Without the two sides that fix the stick sideways, its place there is a guess; a doubled contact is no loss."""
    seen = observe_demonstration(simulated, noise_of(asked(), scene, simulated), SEED)
    last = seen.assembly.operations[-1]
    sides = [c for c in last.contacts if c.manipulated.face in ("py", "ny")]

    def predicted_success(missing: list[Any], source: str) -> float:
        kept = tuple(c for c in last.contacts if c not in missing)
        assembly = replace(seen.assembly, operations=(*seen.assembly.operations[:-1], replace(last, contacts=kept)))
        planned = apply_method("contact", replace(seen, assembly=assembly), None, where=scene)
        assert planned.plan is not None
        given = replace(seen, assembly=assembly)
        return predict_success(planned.plan, given, planned.correction, scene.scenario, contact_source=source)

    whole = predicted_success([], "given")
    assert predicted_success(sides[:1], "false-negative") > whole - 0.1
    assert predicted_success(sides, "false-negative") < whole - 0.2
