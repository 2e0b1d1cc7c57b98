"""A plan in macros, step by step: what is left, what is made, from where until where."""

from __future__ import annotations

from typing import NamedTuple

from apo_bench.assembly.goals import Plan
from apo_bench.assembly.topology import spelled
from apo_bench.geometry.arrays import Array
from apo_bench.insertion.arrival import Arrival
from apo_bench.insertion.macros import Macro
from apo_bench.insertion.operations import OperationMacros
from apo_bench.scenario.nominal import nominal_operations
from apo_bench.scenario.scenario import Grasp, Scenario


class PlanLine(NamedTuple):
    """One step of the schedule."""

    operation: int
    """Counted from 0."""
    undo: bool
    what: OperationMacros
    leaves: Arrival
    comes: Arrival
    came_from: str
    """The ODL of where the main part is taken from, or `start`."""
    relations: tuple[str, ...]
    """What is made: R1, R2, .."""
    grasp: Grasp
    goal: Array | None
    """(4, 4), world, [m]; None of what is undone: it goes back to where it was."""
    back_to: str
    """The ODL of that place; empty otherwise."""

    @property
    def macros(self) -> tuple[Macro, ...]:
        return (*self.leaves.departs, *self.comes.macros)

    @property
    def trouble(self) -> str:
        """What the plan knows to be wrong with the way in; empty if nothing is."""
        if self.comes.chain.locked:
            return "locked: no straight way leads there"
        return "" if self.comes.free else "no free way in was found"


def plan_lines(plan: Plan, scenario: Scenario) -> tuple[PlanLine, ...]:
    """What the robot is asked to do, step by step."""
    everything, odls, arcs = nominal_operations(scenario), plan.assembly.odls(), plan.assembly.arcs()
    made_by = [plan.assembly.relations()[arc[0]].made for arc in arcs]
    lost_at = [plan.assembly.relations()[arc[0]].lost for arc in arcs]
    lines = []
    for (k, undo), T in zip(plan.schedule, plan.targets, strict=True):
        what = everything[k]
        before = spelled(odls[k - 1][what.main]) if k and what.main in odls[k - 1] else "start"
        leaves, comes = (what.after, what.before) if undo else (what.before, what.after)
        mine = [i for i in range(len(arcs)) if (lost_at[i] if undo else made_by[i]) == k]
        lines.append(
            PlanLine(
                operation=k,
                undo=undo,
                what=what,
                leaves=leaves,
                comes=comes,
                came_from=f"T{k + 1}" if undo else before,
                relations=tuple(f"R{i + 1}" for i in mine),
                grasp=scenario.grasps[k],
                goal=None if undo else T,
                back_to=before if undo else "",
            )
        )
    return tuple(lines)
