"""Fill the record columns of method, correction and replay: SI units in, mm and degrees out."""

import math
from collections.abc import Iterable

from apo_bench.assembly import (
    Assembly,
    Correction,
    Observation,
    Plan,
    ProbingResult,
    SlipInHand,
    Snapshot,
)
from apo_bench.correction.region import contains_truth
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.wrong_contacts import find_wrong_relation
from apo_bench.records import GraspSlip, TrialRecord, replace_infinite
from apo_bench.trial.planning import MethodResult
from apo_bench.trial.pose_error import measure_goal_errors, measure_pose_errors
from apo_bench.trial.trial_stages import Attempt


def fill_confidence_columns(
    result: MethodResult, observation: Observation, given: Observation, truth: Array | None
) -> TrialRecord:
    """Columns on how far the correction can be trusted: its consistency test, and how far it is from the truth.

    Args:
        observation: With the true contacts.
        given: With the contacts that the corrector got.
        truth: (n, 4, 4), world frame, [m]; None if it is not known.
    """
    right = observation.assembly
    wrong: TrialRecord = {
        "wrong_contact": None if given.assembly is right else find_wrong_relation(right, given.assembly)
    }
    return wrong | _fill_test_columns(result.correction) | _fill_truth_columns(result, right, given, truth)


def _fill_test_columns(correction: Correction | None) -> TrialRecord:
    """Columns of the correction's consistency test, and of contacts and observations that it rejected."""
    if correction is None:
        return {}
    inferred: TrialRecord = {
        "dropped_contacts": list(correction.dropped),
        "rejected_observations": [k + 1 for k in correction.left_out],
    }
    test = correction.test
    if test is None:
        return inferred
    return inferred | {
        "chi_square": float(test.chi_square) if math.isfinite(test.chi_square) else None,
        "chi_square_dof": int(test.freedom),
        "p_value": replace_infinite(test.p_value),
        "consistent": bool(test.passes),
        "suspects": [suspect.relation for suspect in test.ambiguous],
    }


def _fill_truth_columns(result: MethodResult, right: Assembly, given: Observation, truth: Array | None) -> TrialRecord:
    """Whether the 95 % region of the correction contains the truth, and the plan's pose errors; empty without truth."""
    if truth is None:
        return {}
    correction = result.correction
    plan = result.plan
    fixed, free = (None, None) if plan is None else measure_goal_errors(right, plan.start, truth, plan.target_poses)
    return {
        "inside_95": contains_truth(given, correction, truth) if correction and correction.ok else None,
        "planned_error_fixed_mm": replace_infinite(fixed),
        "planned_error_free_mm": replace_infinite(free),
    }


def fill_method_columns(result: MethodResult) -> TrialRecord:
    """Columns of the method: corrected operations, tried corrections, gaps, extra steps and fit adjustments."""
    columns: TrialRecord = {
        "corrected_operations": [],
        "tried_corrections": [],
        "gap_before_mm": _to_mm(result.gap_before_m),
        "gap_after_mm": _to_mm(result.gap_after_m),
    }
    if result.correction is not None:
        columns["corrected_operations"] = _number_operations(result.correction.freed)
        columns["tried_corrections"] = [
            {"step": int(step) + 1, "free": _number_operations(free), "gap_mm": _to_mm(gap_m)}
            for step, free, gap_m in result.correction.tried
        ]
    if result.plan is not None:
        columns["extra_steps"] = len(result.plan.schedule) - len(result.plan.assembly)  # steps beyond one per operation
    if result.fitting is not None:
        moves = result.fitting.moves
        columns["fit_adjustments"] = [{"operation": k + 1, "mm": mm, "deg": deg} for k, mm, deg in moves]
    return columns


def _number_operations(operations: Iterable[int]) -> list[int]:
    """Operations counted from 1, as `int`, since JSON cannot hold NumPy integers."""
    return [int(k) + 1 for k in operations]


def fill_replay_columns(attempt: Attempt, plan: Plan, truth: Array | None) -> TrialRecord:
    """Columns of a replay and its verdict.

    Args:
        truth: (n, 4, 4), world frame, [m]; None if it is not known, which leaves pose errors null.
    """
    result = attempt.result
    verdict = attempt.verdict
    conditions = verdict.rests_on
    fixed, free = (
        (None, None) if truth is None else measure_pose_errors(plan.assembly, plan.start, truth, result.reached)
    )
    return {
        "as_demonstrated": verdict.as_demonstrated,
        "as_demonstrated_code": verdict.demonstrated.code,
        "loose_success": verdict.loose_success,
        "conditions": dict(conditions.conditions),
        "worst_gap_mm": replace_infinite(conditions.gap_mm),
        "worst_angle_deg": replace_infinite(conditions.angle_deg),
        "least_overlap": replace_infinite(conditions.overlap),
        "penetration_mm": replace_infinite(conditions.penetration_mm),
        "placed_part_shift_mm": replace_infinite(conditions.placed_part_shift_mm),
        "final_poses": _format_poses(result.reached.final),
        "pose_error_fixed_mm": replace_infinite(fixed),
        "pose_error_free_mm": replace_infinite(free),
        "peak_force_n": replace_infinite(result.peak_force_n),
        "grasp_slip": list(map(_format_slip, result.in_hand)),
        "sim_time_s": result.sim_time_s,
    } | _fill_probing_columns(result.probing)


def _fill_probing_columns(found: ProbingResult | None) -> TrialRecord:
    """Columns of the robot's probing; empty if it did not probe."""
    if found is None:
        return {}
    return {
        "probe_contacts": found.touches,
        "probe_contacts_rejected": found.refused,
        "base_error_estimate_mm": found.mm,
        "base_error_estimate_deg": found.deg,
        "base_error_estimate_std_mm": found.sure_mm,
        "base_error_estimate_std_deg": found.sure_deg,
    }


def _format_slip(each: SlipInHand) -> GraspSlip:
    """Slip of a part in the hand, in mm and degrees: until its last motion began (`carried_*`), and until release."""
    return {
        "operation": each.operation + 1,
        "carried_mm": 1e3 * each.carried_m,
        "carried_deg": math.degrees(each.carried_rad),
        "mm": 1e3 * each.moved_m,
        "deg": math.degrees(each.moved_rad),
    }


def _format_poses(final: Snapshot | None) -> dict[str, list[float]] | None:
    """Part -> [x, y, z in mm, qw, qx, qy, qz], world frame; None if the replay did not end."""
    if final is None:
        return None
    packed = {part: pose.pack(T) for part, T in final.poses.items()}
    return {part: [*(p[:3] * 1e3).tolist(), *p[3:].tolist()] for part, p in packed.items()}


def _to_mm(metres: float) -> float | None:
    """Metres in millimetres; None if not finite."""
    return replace_infinite(metres * 1e3)
