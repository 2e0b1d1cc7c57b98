"""Write the JSON form of a plan."""

from typing import Any

import numpy as np

from apo_bench.assembly import Plan
from apo_bench.formats.json_forms import Form, make_pose_form

PLAN_SCHEMA = "apo-bench/plan/2"


def make_plan_form(plan: Plan, scenario: str) -> Form:
    """Return the JSON form of a plan; a step has its own pose only if that differs from the target of its operation.

    Args:
        scenario: Name or file of the scenario.
    """
    operations = [
        {"operation": k + 1, "part": operation.main, **make_pose_form(plan.target_poses[k])}
        for k, operation in enumerate(plan.assembly.operations)
    ]
    schedule: list[dict[str, Any]] = []
    for step, target in zip(plan.schedule, plan.step_poses, strict=True):
        schedule.append({"operation": step.operation + 1, "undo": step.undo})
        if not np.array_equal(target, plan.target_poses[step.operation]):
            schedule[-1] |= make_pose_form(target)
    start = {part: make_pose_form(T) for part, T in plan.start.items()}
    return {
        "schema": PLAN_SCHEMA,
        "scenario": scenario,
        "start": start,
        "operations": operations,
        "schedule": schedule,
    }
