"""Failure prediction: find the first operation of a plan that will fail, from the plan, the part sizes and the arm.

`prediction/measures.py` computes the compared quantities. An arm that cannot reach takes precedence over all of them
but an unstable goal.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from types import MappingProxyType
from typing import Literal, final

from apo_bench.assembly import Plan
from apo_bench.planning.insertion.attach_line import Attach
from apo_bench.planning.prediction.arm_move import ArmMove
from apo_bench.planning.prediction.measure import MeasureCode
from apo_bench.planning.prediction.plan_measures import measure_plan
from apo_bench.records import Thresholds

ARM_CODES = ("unreachable_start", "unreachable", "gripper_room", "tip_error")
"""Failures that depend on the arm: another arm could execute the plan."""
# Reason of `ArmMove.refused` -> sentence.
_OUT_OF_REACH = MappingProxyType(
    {
        "unreachable_start": "the arm does not reach the part where it is taken",
        "unreachable": "the arm does not reach the goal, or the way to it",
    }
)


@final
@dataclass(frozen=True)
class Prediction:
    """The first predicted failure of a plan, or that every operation should fit."""

    fails: bool
    operation: int | None
    """The operation that will fail, counted from 0."""
    code: MeasureCode | Literal["ok", "unreachable_start", "unreachable"]
    sentence: str
    size_mm: float | None
    """`residual`, `tip_error`: the |e| that exceeds its limit. `interference`, `gripper_room`: the penetration depth.
    `ok`: the largest |e| of an insertion contact. None: unstable goal, leaning part, or out of reach."""
    is_correctable: bool = False
    """Whether moving target poses along free directions of the contacts may prevent the failure."""


def predict_failure(
    plan: Plan,
    clearance_mm: float,
    thresholds: Thresholds,
    attach: Sequence[Attach] = (),
    arm: Sequence[ArmMove] = (),
) -> Prediction:
    """Predict the first operation of the schedule that will fail.

    An unstable goal is reported first, then an unreachable pose, since such a plan is not started.

    Args:
        clearance_mm: Clearance per side of the parts. The errors that `thresholds` allow:

            - insertion contacts: `clearance_mm` + `fit_margin_mm`, for a shaft also the difference of the radii;
            - other contacts: `support_mm`;
            - depth in a part without a contact: `placed_part_shift_mm`, or `fit_margin_mm` if the moved part carries
              others, which would shift on it;
            - depth at the beginning of a level line: none, since the part would come to stand on another one.
        attach: The line of attach of each operation. Without it every insertion contact counts in all directions, and
            interference is checked at the goals alone.
        arm: The motion of an arm in each operation; empty: an arm that reaches everything without error.
    """
    worst_mm = 0.0
    refused = next((move for move in arm if move.refused is not None), None)
    for _, alike in groupby(
        # Of consecutive measures of one operation and one kind the largest counts.
        measure_plan(plan, clearance_mm, thresholds, attach, arm=arm),
        lambda each: (each.operation, each.kind),
    ):
        worst = max(alike, key=lambda each: each.size)
        if refused is not None and worst.kind != "falls":
            return _predict_refused_move(plan, refused)
        if worst.exceeded:
            sentence = _describe_failure(plan, worst.operation, worst.why)
            size_mm = None if worst.kind in ("falls", "leans") else float(worst.size)
            # Misaligned contacts and tip errors do not change along free directions.
            mendable = worst.kind not in ("fit", "side", "own", "tip")
            return Prediction(True, worst.operation, worst.code, sentence, size_mm, mendable)
        if worst.kind == "fit":
            worst_mm = max(worst_mm, worst.size)
    return Prediction(False, None, "ok", "every operation should fit", worst_mm)


def _predict_refused_move(plan: Plan, move: ArmMove) -> Prediction:
    """The prediction for a motion that the arm refuses."""
    assert move.refused is not None
    limit = f": its joint '{move.at_limit}' is at its limit" if move.at_limit else ""
    sentence = _describe_failure(plan, move.operation, _OUT_OF_REACH[move.refused] + limit)
    return Prediction(True, move.operation, move.refused, sentence, None, is_correctable=True)


def _describe_failure(plan: Plan, operation: int, why: str) -> str:
    """The failure with its operation, counted from 1, and main part."""
    return f"operation {operation + 1} ({plan.assembly.operations[operation].main}) will fail: {why}"
