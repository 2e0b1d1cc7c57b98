"""The plan of a correction as it is written, and its predicted success."""

from apo_bench.assembly import Correction, Observation, Plan
from apo_bench.scenario import Scenario


def plan_correction(scenario: Scenario, observation: Observation, correction: Correction) -> tuple[Plan, str, float]:
    """The plan, how it was moved so that it fits (empty if not), and its predicted success with any arm.

    Only a plan that would not fit needs a simulator.
    """
    from apo_bench.planning.prediction.first_failure import predict_failure
    from apo_bench.trial.predicted_success import predict_success

    plan = correction.plan(observation)
    moved = ""
    if predict_failure(plan, scenario.clearance_mm, scenario.thresholds, scenario.attach).fails:
        from apo_bench import fit_plan

        fitting = fit_plan(correction, observation, scenario)
        plan = fitting.plan
        moved = fitting.sentence
    return plan, moved, predict_success(plan, observation, correction, scenario)
