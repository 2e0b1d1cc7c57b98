"""Columns of a row on what came out: what a method did, what its correction says of itself, where parts ended.

How far planned or reached poses are from the truth, split into what the contacts fix and what they leave free.

A row: what was asked for, and how it ended; what only a replay can say is filled in by `trial`.

A trial always has one: where its corrector misbehaves, its process dies or its time is over, a failed one.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import asdict
from itertools import dropwhile
from typing import cast

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Correction,
    InHand,
    Observation,
    Outcome,
    Plan,
    Poses,
    ProbingResult,
    Reached,
    Snapshot,
)
from apo_bench.assembly.equations import equations
from apo_bench.correction.region import contains_truth
from apo_bench.correction.solvers import LENGTH_M
from apo_bench.geometry import Array, pose, turn_alike
from apo_bench.io import clean
from apo_bench.perception.observation.wrong_contacts import culprit
from apo_bench.records import (
    ENV_ID,
    LONGEST_SENTENCE,
    RECORD_FIELDS,
    RECORD_SCHEMA,
    MovedInHand,
    TrialConfig,
    TrialRecord,
    finite,
    sentence,
    setting_columns,
)
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.trial.fingerprint import config_hash
from apo_bench.trial.planning import MethodResult
from apo_bench.trial.stages import Attempt

_RANK_CUT_OFF = 1e-7
"""At consistent goals the singular values of free directions are rounding; those of fixed ones are far above this."""


def pose_errors(
    assembly: Assembly, start: Poses, truth_goals: Array, reached: Reached
) -> tuple[float | None, float | None]:
    """The pose errors of main parts when their operations were over, as `goal_errors` has them.

    Returns:
        (fixed, free), [mm]; (None, None) if an operation was not finished.
    """
    if any(snapshot is None for snapshot in reached.after):
        return None, None
    at = [s.poses[operation.main] for operation, s in zip(assembly.operations, reached.after, strict=True) if s]
    return goal_errors(assembly, start, truth_goals, np.array(at).reshape(-1, 4, 4))


def goal_errors(assembly: Assembly, start: Poses, truth_goals: Array, goals: Array) -> tuple[float, float]:
    """Root mean square per operation of the error of goals, in fixed and in free directions, [mm].

    The error of an operation is the body twist from the true goal to the other one, rotations as the way of a point
    40 mm off the origin. How far a part of revolution is turned about its axis is no error, unless it carries others.
    The row space of the Jacobian of the contact equations at the truth is what the contacts
    fix, its null space what they leave free.

    Args:
        assembly: With the right relations.
        truth_goals: (n, 4, 4), consistent, world frame, [m].
        goals: (n, 4, 4), world frame, [m].

    Returns:
        (fixed, free).
    """
    # rotations count as ways of a point at LENGTH_M, so that all coordinates are lengths
    unit = np.tile([1.0, 1.0, 1.0, LENGTH_M, LENGTH_M, LENGTH_M], len(assembly))
    goals = _turned_back(assembly, truth_goals, goals)
    error = pose.log(pose.inverse(truth_goals) @ goals).ravel() * unit
    _, J = equations(assembly, start, truth_goals).linearised(truth_goals)
    # de = (J / unit) (unit dxi): the rows of J / unit span what contacts see, and B^t B projects onto that span
    basis = _row_space(J / unit)
    fixed = basis.T @ (basis @ error)
    return _rms_mm(fixed, len(assembly)), _rms_mm(error - fixed, len(assembly))


def _turned_back(assembly: Assembly, truth_goals: Array, goals: Array) -> Array:
    """Goals whose parts of revolution are turned about their axes as near to the truth as can be."""
    alone = [None if operation.carries else assembly.solids[operation.main] for operation in assembly.operations]
    pairs = zip(alone, goals, truth_goals, strict=True)
    return np.array([T if solid is None else turn_alike(solid, T, true) for solid, T, true in pairs]).reshape(-1, 4, 4)


def _rms_mm(error: Array, operations: int) -> float:
    return float(np.linalg.norm(error) / np.sqrt(operations)) * 1e3


def _row_space(J: Array) -> Array:
    """An orthonormal basis of the row space, (rank, columns)."""
    if not J.size:
        return np.zeros((0, J.shape[1]))
    _, w, Vt = np.linalg.svd(J, full_matrices=False)
    return Vt[w > _RANK_CUT_OFF * w[0]]


def confidence_columns(
    result: MethodResult, observation: Observation, corrector_input: Observation, truth: Array | None
) -> TrialRecord:
    """The test of the correction, whether the truth lies in its posterior, and how far the plan is from the truth.

    Args:
        observation: With the right relations.
        corrector_input: With those that the corrector was given.
        truth: (n, 4, 4), world frame, [m]; None if it is not known.
    """
    right = observation.assembly
    given_assembly = corrector_input.assembly
    wrong: TrialRecord = {"wrong_contact": None if given_assembly is right else culprit(right, given_assembly)}
    return wrong | _test(result.correction) | _truth(result, right, corrector_input, truth)


def _test(correction: Correction | None) -> TrialRecord:
    if correction is None:
        return {}
    left_out: TrialRecord = {
        "dropped": list(correction.dropped),
        "inferred_operations": [k + 1 for k in correction.left_out],
    }
    test = correction.test
    if test is None:
        return left_out
    return left_out | {
        "chi_square": float(test.chi_square) if math.isfinite(test.chi_square) else None,
        "chi_square_dof": int(test.freedom),
        "p_value": finite(test.p_value),
        "test_passes": bool(test.passes),
        "suspects": [suspect.relation for suspect in test.ambiguous],
    }


def _truth(result: MethodResult, right: Assembly, corrector_input: Observation, truth: Array | None) -> TrialRecord:
    if truth is None:
        return {}
    correction = result.correction
    plan = result.plan
    fixed, free = (None, None) if plan is None else goal_errors(right, plan.start, truth, plan.target_poses)
    return {
        "inside_95": contains_truth(corrector_input, correction, truth) if correction and correction.ok else None,
        "planned_error_fixed_mm": finite(fixed),
        "planned_error_free_mm": finite(free),
    }


def method_columns(result: MethodResult) -> TrialRecord:
    """What the method did, and what carrying it out would take beyond doing every operation once."""
    extra = None if result.plan is None else len(result.plan.schedule) - len(result.plan.assembly)
    moved = None if result.fitting is None else result.fitting.moves
    freed, tried = ((), ()) if result.correction is None else (result.correction.freed, result.correction.tried)
    return {
        "corrected_operations": _numbers(freed),
        "tried_corrections": [
            {"step": int(step) + 1, "free": _numbers(free), "gap_mm": _mm(gap_m)} for step, free, gap_m in tried
        ],
        "extra_operations": extra,
        "fit_adjustments": None
        if moved is None
        else [{"operation": k + 1, "mm": mm, "deg": deg} for k, mm, deg in moved],
        "gap_before_mm": _mm(result.gap_before_m),
        "gap_after_mm": _mm(result.gap_after_m),
    }


def _numbers(operations: Iterable[int]) -> list[int]:
    """Counted from 1, as whole numbers that JSON can hold."""
    return [int(k) + 1 for k in operations]


def replay_columns(attempt: Attempt, plan: Plan, truth: Array | None) -> TrialRecord:
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
        "displaced_mm": finite(conditions.displaced_mm),
        "reached": _poses(result.reached.final),
        "pose_error_fixed_mm": finite(fixed),
        "pose_error_free_mm": finite(free),
        "peak_force_n": finite(result.peak_force_n),
        "grasp_slip": [_moved(each) for each in result.in_hand],
        "sim_time_s": result.sim_time_s,
    } | _felt(result.felt)


def _felt(felt: ProbingResult | None) -> TrialRecord:
    if felt is None:
        return {}
    return {
        "probe_contacts": felt.touches,
        "probe_contacts_rejected": felt.refused,
        "base_error_estimate_mm": felt.mm,
        "base_error_estimate_deg": felt.deg,
        "base_error_std_mm": felt.sure_mm,
        "base_error_std_deg": felt.sure_deg,
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


_OUTCOME_COLUMNS = tuple(dropwhile(lambda column: column != "success", RECORD_FIELDS))
"""Columns of what came out."""
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]+")


def head(spec: TrialConfig, scenario: Scenario, hashed: str) -> TrialRecord:
    """What was asked for.

    Args:
        hashed: From `config_hash`.
    """
    versions = {"schema": RECORD_SCHEMA, "env_id": ENV_ID, "config_hash": hashed}
    return cast(
        TrialRecord, versions | setting_columns(spec, scenario.name) | {"thresholds": asdict(scenario.thresholds)}
    )


def result(end: Outcome, *, success: bool | None) -> TrialRecord:
    """The rest of a row of which nothing but its ending is known."""
    known: TrialRecord = {
        "success": success,
        "as_demonstrated": success,
        "loose_success": success,
        "failure_stage": end.stage if end.failed else None,
        "failure_code": end.code if end.failed else None,
        "failure_operation": None if end.operation is None else end.operation + 1,
        "sentence": clean(end.sentence)[:LONGEST_SENTENCE],
    }
    return cast(TrialRecord, dict.fromkeys(_OUTCOME_COLUMNS)) | known


def lost(spec: TrialConfig, content: str, code: str) -> TrialRecord:
    """The failed row of a trial whose process died (`worker_died`) or took too long.

    Nothing is compiled for it, and it says nothing of wall times, so that it is the same wherever it happens.

    Args:
        content: From `content_hash`.
        code: `worker_died` or `time_limit`.
    """
    return _failed(spec, content, None, Outcome("worker", code, None, sentence(code)))


def misbehaved(spec: TrialConfig, content: str, demonstration: str, why: str) -> TrialRecord:
    """The failed row of a trial whose corrector raised an error or returned what it must not.

    Args:
        why: What it did; addresses of objects, which differ from run to run, are left out.
    """
    why = _ADDRESS.sub("0x...", why.encode(errors="replace").decode())
    return _failed(spec, content, demonstration, Outcome("correct", "raised", None, why))


def _failed(spec: TrialConfig, content: str, demonstration: str | None, end: Outcome) -> TrialRecord:
    settings = head(spec, load_scenario(spec.scenario), config_hash(spec, content))
    return settings | {"demonstration": demonstration} | result(end, success=False)
