"""The plan of a correction as it is written, and how likely it is to succeed."""

from typing import NamedTuple

from apo_bench.assembly import Correction, Observation, Plan
from apo_bench.scenario.scenario import Scenario


class PlannedCorrection(NamedTuple):
    """A plan, and what is to be said of it."""

    plan: Plan
    moved: str
    """What of it is not as corrected, so that it fits; empty if nothing."""
    predicted_success: float
    """The probability of success, whichever arm carries it out."""


def plan_correction(scenario: Scenario, observation: Observation, correction: Correction) -> PlannedCorrection:
    """Move a plan that would not fit; a simulator is asked only then."""
    from apo_bench.planning.prediction.failure import predict
    from apo_bench.trial.predicted_success import predict_success

    plan = correction.plan(observation)
    moved = ""
    if predict(plan, scenario.clearance_mm, scenario.thresholds, scenario.attach).fails:
        from apo_bench.trial.fitting import fitting_plan

        fitting = fitting_plan(correction, observation, scenario)
        plan = fitting.plan
        moved = fitting.sentence
    return PlannedCorrection(plan, moved, predict_success(plan, observation, correction, scenario))
