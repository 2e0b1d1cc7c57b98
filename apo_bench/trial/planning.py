"""What a method makes of an observation: a plan, or why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, final

from apo_bench.assembly.correction_record import Correction, Try
from apo_bench.assembly.equations import largest_gap
from apo_bench.assembly.goals import Observation, Plan
from apo_bench.assembly.reached import Outcome
from apo_bench.correction.own_code.own import correct_named
from apo_bench.geometry.arrays import Array
from apo_bench.trial.methods import with_simulated
from apo_bench.trial.stages import observation_failure


@final
@dataclass(frozen=True, eq=False)
class Planned:
    """What a method made of an observation: a plan, or why there is none."""

    plan: Plan | None
    refused: Outcome | None
    freed: tuple[int, ...]
    tried: tuple[Try, ...]
    gap_before_m: float
    gap_after_m: float
    """Of the plan; not a number where there is none."""
    correction: Correction | None = None
    """What the corrector returned; None where none was asked."""


def plan(method: Any, seen: Observation, truth: Array | None, told: Observation | None = None) -> Planned:
    """What a method would have the robot do.

    Args:
        method: `oracle` takes the truth, `none` what was seen, anything else is a corrector or names one; what is
            named as `module:name` runs in a process of its own.
        truth: (n, 4, 4) goals of the layout; only the oracle looks at them.
        told: What a corrector gets in place of `seen`, where the relations it is told are wrong. The plan has the
            right ones all the same: what is executed are goals.
    """
    if isinstance(method, str) and method == "oracle" and truth is not None:
        return _as_it_is(seen, truth, None)
    if isinstance(method, str) and method == "none":
        return _as_it_is(seen, seen.goals, observation_failure(seen))
    made = correct_named(seen if told is None else told, with_simulated(method))
    return Planned(
        plan=made.plan(seen) if made.ok else None,
        refused=None if made.ok else Outcome("correct", made.status, None, made.sentence),
        freed=made.freed,
        tried=made.tried,
        gap_before_m=made.gap_before_m,
        gap_after_m=made.gap_after_m if made.ok else math.nan,
        correction=made,
    )


def _as_it_is(seen: Observation, goals: Array, refused: Outcome | None) -> Planned:
    open_m = largest_gap(seen.assembly, seen.start, goals)
    if refused:
        return Planned(None, refused, (), (), open_m, math.nan)
    return Planned(Plan(seen.assembly, seen.start, goals), None, (), (), open_m, open_m)
