"""A plan in macros, step by step: one line per operation, and one JSON object.

Directions are those of the frame of the assembly at the nominal goals; what is measured stands in the last column
alone, so that another motion parameter changes the line of its operation and no other.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Plan, placements, spell
from apo_bench.formats.json_forms import pose_form
from apo_bench.geometry import Array, pose
from apo_bench.io import columns, direction
from apo_bench.planning.insertion.arrival import Arrival, OperationMacros, turning_state
from apo_bench.planning.insertion.macros import Macro
from apo_bench.scenario import Grasp, Scenario, nominal_operations, nominal_start

_MACROS = "apo-bench/macros/1"
_HEADS = ("", "operation", "state", "macros", "from", "guarded", "position", "walls", "grasp", "until")


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
    everything = nominal_operations(scenario)
    odls = plan.assembly.odls()
    relations = [plan.assembly.relations()[arc[0]] for arc in plan.assembly.arcs()]
    lines = []
    for (k, undo), T in zip(plan.schedule, plan.step_poses, strict=True):
        what = everything[k]
        before = spell(odls[k - 1][what.main]) if k and what.main in odls[k - 1] else "start"
        leaves, comes = (what.after, what.before) if undo else (what.before, what.after)
        lines.append(
            PlanLine(
                operation=k,
                undo=undo,
                what=what,
                leaves=leaves,
                comes=comes,
                came_from=f"T{k + 1}" if undo else before,
                relations=tuple(
                    f"R{i}" for i, of in enumerate(relations, start=1) if (of.lost if undo else of.made) == k
                ),
                grasp=scenario.grasps[k],
                goal=None if undo else T,
                back_to=before if undo else "",
            )
        )
    return tuple(lines)


def plan_text(lines: Sequence[PlanLine]) -> list[str]:
    """A table of text, then what is wrong with single operations."""
    table = [_HEADS, *(_cells(line) for line in lines)]
    wrong = [f"operation {line.operation + 1} ({line.what.main}): {line.trouble}" for line in lines if line.trouble]
    return [*columns(table), *([""] if wrong else []), *wrong]


def plan_lines_form(lines: Sequence[PlanLine], scenario: Scenario, notes: Sequence[str] = ()) -> dict[str, Any]:
    """What `json` can write: mm, degrees, operations from 1.

    Args:
        notes: What is to be said with it: what was assumed, and what speaks against the plan.
    """
    start = nominal_start(scenario)
    stages = (start, *placements(scenario.assembly, start, scenario.goals))
    forms = []
    for line in lines:
        screw = turning_state(
            scenario.assembly, line.comes, stages[line.operation if line.undo else line.operation + 1]
        )
        position, felt, across = line.comes.axes
        goal = {"position_mm": None, "quaternion_wxyz": None} if line.goal is None else pose_form(line.goal)
        forms.append(
            {
                "operation": line.operation + 1,
                "undo": line.undo,
                "part": line.what.main,
                "carries": list(line.what.carries),
                "before": _state(line.leaves),
                "after": _state(line.comes) | {"screw": list(screw.all), "rotation": list(screw.rotation)},
                "macros": [_macro(line.leaves, macro) for macro in line.leaves.departs]
                + [_macro(line.comes, macro) for macro in line.comes.macros],
                "from": line.came_from,
                "until": {"contact_source": list(line.relations), "back_to": line.back_to or None} | goal,
                "guarded": felt.tolist(),
                "position": position.tolist(),
                "walls": across.tolist(),
                "line": {
                    "along": line.comes.line.direction.tolist(),
                    "travel_mm": round(1e3 * line.comes.line.travel_m, 6),
                    "free": line.comes.free,
                },
                "trouble": line.trouble or None,
                "grasp": {"at_mm": (1e3 * line.grasp.point).tolist(), "across": line.grasp.across.tolist()},
            }
        )
    return {"schema": _MACROS, "scenario": scenario.name, "steps": forms, "notes": list(notes)}


def _cells(line: PlanLine) -> tuple[str, ...]:
    position, felt, across = line.comes.axes
    name = " with ".join((line.what.main, *filter(None, [" and ".join(line.what.carries)])))
    return (
        str(line.operation + 1),
        f"undo: {name}" if line.undo else name,
        f"{line.leaves.state.letter} -> {line.comes.state.letter}",
        ", ".join(_chain(line)) or ("-" if line.trouble else "put down"),
        line.came_from,
        _listed(direction(v) for v in felt),
        _listed(direction(v).lstrip("+-") for v in position),
        _listed(direction(v).lstrip("+-") for v in across),
        f"{_point(line.grasp.point)} across {direction(line.grasp.across).lstrip('+-')}",
        _until(line),
    )


def _chain(line: PlanLine) -> Iterator[str]:
    """`depart +x`, `insert-into +x 140 mm`: how far only where that is known before."""
    for macro in line.macros:
        far = "" if macro.length_m is None else f" {1e3 * macro.length_m:.4g} mm"
        yield f"{macro.name} {direction(macro.direction)}{far}"


def _until(line: PlanLine) -> str:
    if line.goal is None:
        return f"back at {line.back_to}"
    numbers = np.round([*(1e3 * line.goal[:3, 3]), *pose.turn_deg(line.goal)], 3) + 0.0
    return f"{' '.join(line.relations):11} {' '.join(f'{x:9.3f}' for x in numbers)}"


def _listed(words: Iterator[str]) -> str:
    return " ".join(words) or "-"


def _point(p: Array) -> str:
    return f"({', '.join(f'{v:.4g}' for v in np.round(1e3 * p, 6) + 0.0)})"


def _state(arrival: Arrival) -> dict[str, Any]:
    return {"letter": arrival.state.letter, "translation": list(arrival.state)}


def _macro(arrival: Arrival, macro: Macro) -> dict[str, Any]:
    return {
        "name": macro.name,
        "direction": macro.direction.tolist(),
        "direction_in_part": arrival.own(macro.direction).tolist(),
        "length_mm": None if macro.length_m is None else round(1e3 * macro.length_m, 6),
        "guarded": macro.guarded,
        "contacts": [str(contact) for contact in arrival.contacts(macro)],
        "keeps": [str(arrival.touched[i].contact) for i in macro.keeps],
    }
