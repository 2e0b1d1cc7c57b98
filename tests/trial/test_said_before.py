"""What a plan says of itself before it is carried out follows from what its planner was given, not from the truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from apo_bench import TrialConfig
from apo_bench.assembly import Observation
from apo_bench.geometry import Array
from apo_bench.records import WITHOUT_CORRECTOR, parse_method
from apo_bench.simulation.scene import Scene
from apo_bench.trial import run
from apo_bench.trial.trial_stages import observe_demonstration, scene_of, simulate_demonstration

MISSED = TrialConfig(
    "peg_in_hole",
    method="contact-robust",
    contact_source="false-negative",
    noise_mm=1.0,
    noise_deg=1.0,
    seed=839900,
    min_predicted_success=1.0,
)
SAID = (
    *("failure_prediction", "predicted_success", "gap_before_mm", "gap_after_mm", "fit_adjustments"),
    *("corrected_operations", "tried_corrections", "chi_square", "sentence"),
)


@pytest.fixture(scope="module")
def given() -> tuple[Scene, Observation, Array]:
    scene = scene_of(MISSED)
    simulated = simulate_demonstration(scene, MISSED.human_error_scale, MISSED.seed)
    seen = observe_demonstration(simulated, run.noise_of(MISSED, scene, simulated), MISSED.seed)
    return scene, seen, simulated.layout.poses


def test_another_truth_changes_no_word_of_a_plan(given: tuple[Scene, Observation, Array]) -> None:
    scene, seen, truth = given
    told = run._choose_contacts(MISSED, seen, truth)
    missed = replace(seen, assembly=told.assembly)
    assert len(told.assembly.relations()) == len(seen.assembly.relations()) - 1
    said: list[dict[str, Any]] = []
    for right in (seen, missed):
        context = run.RunContext(scene, MISSED, parse_method(MISSED.method))
        row: Any = run._plan_and_replay(context, right, told, truth, None)
        said.append({name: row[name] for name in SAID})
    assert said[0] == said[1]
    assert (said[0]["failure_prediction"]["fails"], said[0]["failure_prediction"]["code"]) == (False, "ok")


def test_a_contact_that_was_missed_is_not_foreseen_to_fail(given: tuple[Scene, Observation, Array]) -> None:
    scene, *_ = given
    row: Any = run.run_trial(MISSED, scene)
    assert row["predicted_success"] > 0.9
    assert not row["failure_prediction"]["fails"]
    assert row["contacts_false_negative"] == 1


@pytest.mark.parametrize("method", WITHOUT_CORRECTOR)
def test_what_is_not_corrected_keeps_the_right_contacts(method: str, given: tuple[Scene, Observation, Array]) -> None:
    _, seen, truth = given
    assert run._choose_contacts(replace(MISSED, method=method), seen, truth) is seen
