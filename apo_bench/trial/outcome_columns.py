"""Columns of a row on what came out: what a method did, what its correction says of itself, where parts ended."""

import math
from collections.abc import Iterable

from apo_bench.assembly import Correction, Felt, InHand, Observation, Plan, Snapshot
from apo_bench.correction.region import contains_truth
from apo_bench.geometry import Array, pose
from apo_bench.observation.relations import culprit
from apo_bench.records import MovedInHand, Row, finite
from apo_bench.trial.planning import MethodResult
from apo_bench.trial.pose_error import goal_errors, pose_errors
from apo_bench.trial.stages import Attempt


def confidence_columns(
    result: MethodResult, observation: Observation, corrector_input: Observation, truth: Array | None
) -> Row:
    """The test of the correction, whether the truth lies in its posterior, and how far the plan is from the truth.

    Args:
        observation: With the right relations.
        corrector_input: With those that the corrector was given.
        truth: (n, 4, 4), world frame, [m]; None if it is not known.
    """
    right = observation.assembly
    given_assembly = corrector_input.assembly
    wrong: Row = {"wrong_relation": None if given_assembly is right else culprit(right, given_assembly)}
    return wrong | _test(result.correction) | _truth(result, corrector_input, truth)


def _test(correction: Correction | None) -> Row:
    if correction is None:
        return {}
    left_out: Row = {"dropped": list(correction.dropped), "left_out": [k + 1 for k in correction.left_out]}
    test = correction.test
    if test is None:
        return left_out
    return left_out | {
        "chi_square": float(test.chi_square) if math.isfinite(test.chi_square) else None,
        "chi_square_freedom": int(test.freedom),
        "p_value": finite(test.p_value),
        "test_passes": bool(test.passes),
        "suspects": [suspect.relation for suspect in test.ambiguous],
    }


def _truth(result: MethodResult, corrector_input: Observation, truth: Array | None) -> Row:
    if truth is None:
        return {}
    correction = result.correction
    plan = result.plan
    fixed, free = (None, None) if plan is None else goal_errors(plan.assembly, plan.start, truth, plan.goals)
    return {
        "inside_95": contains_truth(corrector_input, correction, truth) if correction and correction.ok else None,
        "planned_error_fixed_mm": finite(fixed),
        "planned_error_free_mm": finite(free),
    }


def method_columns(result: MethodResult) -> Row:
    """What the method did, and what carrying it out would take beyond doing every operation once."""
    extra = None if result.plan is None else len(result.plan.schedule) - len(result.plan.assembly)
    moved = None if result.fitting is None else result.fitting.moves
    freed, tried = ((), ()) if result.correction is None else (result.correction.freed, result.correction.tried)
    return {
        "freed": _numbers(freed),
        "tried": [{"step": int(step) + 1, "free": _numbers(free), "gap_mm": _mm(gap_m)} for step, free, gap_m in tried],
        "extra_operations": extra,
        "free_moved": None if moved is None else [{"operation": k + 1, "mm": mm, "deg": deg} for k, mm, deg in moved],
        "gap_before_mm": _mm(result.gap_before_m),
        "gap_after_mm": _mm(result.gap_after_m),
    }


def _numbers(operations: Iterable[int]) -> list[int]:
    """Counted from 1, as whole numbers that JSON can hold."""
    return [int(k) + 1 for k in operations]


def replay_columns(attempt: Attempt, plan: Plan, truth: Array | None) -> Row:
    """What a replay reached, and how far that is from the truth, (n, 4, 4), where it is known."""
    result = attempt.result
    verdict = attempt.verdict
    conditions = verdict.rests_on
    fixed, free = (None, None) if truth is None else pose_errors(plan.assembly, plan.start, truth, result.reached)
    return {
        "as_demonstrated": verdict.as_demonstrated,
        "as_demonstrated_code": verdict.demonstrated.code,
        "loose_success": verdict.loose_success,
        "conditions": dict(conditions.conditions),
        "worst_gap_mm": finite(conditions.gap_mm),
        "worst_angle_deg": finite(conditions.angle_deg),
        "least_overlap": finite(conditions.overlap),
        "penetration_mm": finite(conditions.penetration_mm),
        "pushed_mm": finite(conditions.pushed_mm),
        "reached": _poses(result.reached.final),
        "pose_error_fixed_mm": finite(fixed),
        "pose_error_free_mm": finite(free),
        "peak_force_n": finite(result.peak_force_n),
        "moved_in_hand": [_moved(each) for each in result.in_hand],
        "sim_seconds": result.sim_seconds,
    } | _felt(result.felt)


def _felt(felt: Felt | None) -> Row:
    if felt is None:
        return {}
    return {
        "touches": felt.touches,
        "touches_refused": felt.refused,
        "felt_mm": felt.mm,
        "felt_deg": felt.deg,
        "felt_sure_mm": felt.sure_mm,
        "felt_sure_deg": felt.sure_deg,
    }


def _moved(each: InHand) -> MovedInHand:
    return {
        "operation": each.operation + 1,
        "carried_mm": 1e3 * each.carried_m,
        "carried_deg": math.degrees(each.carried_rad),
        "mm": 1e3 * each.moved_m,
        "deg": math.degrees(each.moved_rad),
    }


def _poses(final: Snapshot | None) -> dict[str, list[float]] | None:
    """Part -> [x, y, z in mm, qw, qx, qy, qz], world frame."""
    if final is None:
        return None
    packed = {part: pose.pack(T) for part, T in final.poses.items()}
    return {part: [*(p[:3] * 1e3).tolist(), *p[3:].tolist()] for part, p in packed.items()}


def _mm(metres: float) -> float | None:
    return finite(metres * 1e3)
