"""Failure prediction: whether a plan will fail, where and why, from the plan, the sizes of the parts and the arm.

What is looked at stands in `prediction/measures.py`; what the arm does not reach comes before all but an unstable goal.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from types import MappingProxyType
from typing import Literal, final

from apo_bench.assembly import Plan
from apo_bench.planning.insertion.attach import Attach
from apo_bench.planning.prediction.measures import ArmMove, MeasureCode, measures
from apo_bench.records import Thresholds

ARM_CODES = ("unreachable_start", "unreachable", "gripper_room", "tip_error")
"""Of what another arm could do."""
_OUT_OF_REACH = MappingProxyType(
    {
        "unreachable_start": "the arm does not reach the part where it is taken",
        "unreachable": "the arm does not reach the goal, or the way to it",
    }
)


@final
@dataclass(frozen=True)
class Prediction:
    """What a plan says about itself."""

    fails: bool
    operation: int | None
    """The operation that will fail, counted from 0."""
    code: MeasureCode | Literal["ok", "unreachable_start", "unreachable"]
    sentence: str
    size_mm: float | None
    """`residual`, `tip_error`: the |e| that is too large; `interference`, `gripper_room`: the depth; `ok`: the largest
    |e| of a contact that enters; None for an unstable goal, what would lean, and what is out of reach."""
    mendable: bool = False
    """Whether it may fit if directions are changed that contacts leave free."""


def predict(
    plan: Plan,
    clearance_mm: float,
    thresholds: Thresholds,
    attach: Sequence[Attach] = (),
    arm: Sequence[ArmMove] = (),
) -> Prediction:
    """The first operation of the schedule that will fail.

    An unstable goal comes before everything else, and then what is out of reach, since a plan with one is not begun.

    Args:
        clearance_mm: Per side, of the parts that are used; fit contacts may be off by this and `fit_margin_mm`, a
            shaft in its hole by what the radii leave, too, others by `support_mm`; parts that should not touch may be
            as deep in each other as the judge lets one be pushed, `pushed_mm`, but only `fit_margin_mm` what carries
            others, which would shift on it, and not at all what comes down to where a level way in begins, and would
            stand there on another part.
        attach: The way in of each operation; without it every fit contact counts, and nothing but the goals.
        arm: What an arm makes of each operation; without it any arm will do.
    """
    worst_mm = 0.0
    refused = next((move for move in arm if move.refused is not None), None)
    for _, alike in groupby(
        measures(plan, clearance_mm, thresholds, attach, arm=arm), lambda each: (each.operation, each.kind)
    ):
        worst = max(alike, key=lambda each: each.size)
        if refused is not None and worst.kind != "falls":
            return _out_of_reach(plan, refused)
        if worst.exceeded:
            sentence = _sentence(plan, worst.operation, worst.why)
            size_mm = None if worst.kind in ("falls", "leans") else float(worst.size)
            mendable = worst.kind not in ("fit", "side", "own", "tip")
            return Prediction(True, worst.operation, worst.code, sentence, size_mm, mendable)
        if worst.kind == "fit":
            worst_mm = max(worst_mm, worst.size)
    return Prediction(False, None, "ok", "every operation should fit", worst_mm)


def _out_of_reach(plan: Plan, move: ArmMove) -> Prediction:
    assert move.refused is not None
    limit = f": its joint '{move.at_limit}' is at its limit" if move.at_limit else ""
    sentence = _sentence(plan, move.operation, _OUT_OF_REACH[move.refused] + limit)
    return Prediction(True, move.operation, move.refused, sentence, None, mendable=True)


def _sentence(plan: Plan, operation: int, why: str) -> str:
    return f"operation {operation + 1} ({plan.assembly.operations[operation].main}) will fail: {why}"
