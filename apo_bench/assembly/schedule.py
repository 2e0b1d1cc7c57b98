"""Schedules of do and undo steps: whether one makes sense, and what is in force before work is taken apart."""

from collections.abc import Sequence

import numpy as np

from apo_bench.assembly.goals import Plan, Step
from apo_bench.geometry.arrays import Array

REMEDY = "do operations in order, undo the last one that is done, and have everything done at the end"


def schedule_fault(schedule: Sequence[Step], operations: int) -> str:
    """What is wrong with it, such as `undoes operation 2, which is not done`; empty if nothing is.

    What is done is always the first few operations: an operation may stand on all that came before it, and what was
    undone last first leaves free the place that it came from.
    """
    done = 0
    for k, undo in schedule:
        if not 0 <= k < operations:
            return f"names operation {k + 1}, where {operations} are known"
        if undo and k >= done:
            return f"undoes operation {k + 1}, which is not done"
        if undo and k < done - 1:
            return f"undoes operation {k + 1} before operation {done}, which came after it"
        if not undo and k < done:
            return f"does operation {k + 1} again, which is done"
        if not undo and k > done:
            return f"does operation {k + 1} before operation {done + 1}"
        done += -1 if undo else 1
    return f"leaves operation {done + 1} undone" if done < operations else ""


def stages(plan: Plan) -> list[tuple[int, Array]]:
    """How many operations are done, and the goals in force, before each time something is undone and at the end."""
    goals = np.array(plan.goals)
    done = 0
    found = []
    for i, (step, target) in enumerate(zip(plan.schedule, plan.targets, strict=True)):
        if not step.undo:
            goals[step.operation] = target
            done = step.operation + 1
        if i + 1 == len(plan.schedule) or (plan.schedule[i + 1].undo and not step.undo):
            found.append((done, np.array(goals)))
    return found
