"""What a correction says of itself, as it stands in a row, and what the truth says of that."""

from __future__ import annotations

import math

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.goals import Observation, Plan
from apo_bench.correction.posterior import contains_truth
from apo_bench.geometry.arrays import Array
from apo_bench.observation.relations import culprit
from apo_bench.records.row import Row
from apo_bench.trial.planning import Planned
from apo_bench.trial.pose_error import goal_errors


def confidence(planned: Planned, seen: Observation, told: Observation, truth: Array | None) -> Row:
    """The test of the correction, whether the truth lies in its posterior, and how far the plan is from the truth.

    Args:
        seen: With the right relations.
        told: With those that the corrector was told.
        truth: (n, 4, 4), world frame, [m]; None if it is not known.
    """
    wrong = None if told.assembly is seen.assembly else culprit(seen.assembly, told.assembly)
    first: Row = {"wrong_relation": wrong}
    return first | _test(planned.correction) | _truth(planned, told, truth)


def _test(made: Correction | None) -> Row:
    if made is None:
        return {}
    dropped: Row = {"dropped": list(made.dropped)}
    if made.test is None:
        return dropped
    return dropped | {
        "chi_square": _finite(made.test.chi_square),
        "chi_square_freedom": int(made.test.freedom),
        "p_value": _finite(made.test.p_value),
        "test_passes": bool(made.test.passes),
        "suspects": [suspect.relation for suspect in made.test.ambiguous],
    }


def _truth(planned: Planned, told: Observation, truth: Array | None) -> Row:
    if truth is None:
        return {}
    made = planned.correction
    covered = None if made is None or not made.ok else contains_truth(told, made, truth)
    fixed, free = (None, None) if planned.plan is None else _errors(planned.plan, truth)
    return {
        "inside_95": covered,
        "planned_error_fixed_mm": fixed,
        "planned_error_free_mm": free,
    }


def _errors(plan: Plan, truth: Array) -> tuple[float | None, float | None]:
    fixed, free = goal_errors(plan.assembly, plan.start, truth, plan.goals)
    return _finite(fixed), _finite(free)


def _finite(x: float) -> float | None:
    """A number that JSON can hold, else null."""
    return float(x) if math.isfinite(x) else None
