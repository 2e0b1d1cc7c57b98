"""What a correction says of itself, as it stands in a row, and what the truth says of that."""

import math

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.goals import Observation, Plan
from apo_bench.correction.region import contains_truth
from apo_bench.geometry.arrays import Array
from apo_bench.observation.relations import culprit
from apo_bench.records.row import Row
from apo_bench.trial.planning import MethodResult
from apo_bench.trial.pose_error import goal_errors


def confidence(
    result: MethodResult, observation: Observation, corrector_input: Observation, truth: Array | None
) -> Row:
    """The test of the correction, whether the truth lies in its posterior, and how far the plan is from the truth.

    Args:
        observation: With the right relations.
        corrector_input: With those that the corrector was given.
        truth: (n, 4, 4), world frame, [m]; None if it is not known.
    """
    right = observation.assembly
    given = corrector_input.assembly
    wrong: Row = {"wrong_relation": None if given is right else culprit(right, given)}
    return wrong | _test(result.correction) | _truth(result, corrector_input, truth)


def _test(correction: Correction | None) -> Row:
    if correction is None:
        return {}
    out: Row = {"dropped": list(correction.dropped), "left_out": [k + 1 for k in correction.left_out]}
    test = correction.test
    if test is None:
        return out
    return out | {
        "chi_square": _finite(test.chi_square),
        "chi_square_freedom": int(test.freedom),
        "p_value": _finite(test.p_value),
        "test_passes": bool(test.passes),
        "suspects": [suspect.relation for suspect in test.ambiguous],
    }


def _truth(result: MethodResult, corrector_input: Observation, truth: Array | None) -> Row:
    if truth is None:
        return {}
    correction = result.correction
    fixed, free = (None, None) if result.plan is None else _errors(result.plan, truth)
    return {
        "inside_95": contains_truth(corrector_input, correction, truth) if correction and correction.ok else None,
        "planned_error_fixed_mm": fixed,
        "planned_error_free_mm": free,
    }


def _errors(plan: Plan, truth: Array) -> tuple[float | None, float | None]:
    fixed, free = goal_errors(plan.assembly, plan.start, truth, plan.goals)
    return _finite(fixed), _finite(free)


def _finite(x: float) -> float | None:
    """A number that JSON can hold, else null."""
    return float(x) if math.isfinite(x) else None
