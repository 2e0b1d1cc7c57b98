"""A plan step by step: one table line for each operation, and one JSON object.

Directions are in the frame of the assembly at its nominal poses. Only the last column depends on the target poses, so
another pose changes the line of its operation and no other.
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Plan, compute_placements, spell
from apo_bench.formats.json_forms import make_pose_form
from apo_bench.geometry import Array, pose
from apo_bench.io import align_columns, format_direction
from apo_bench.planning.insertion.arrival import Arrival, compute_screw_state
from apo_bench.planning.insertion.macros import Macro
from apo_bench.planning.insertion.operation_macros import OperationMacros
from apo_bench.scenario import Grasp, Scenario, find_nominal_start, list_nominal_operations

_SCHEMA = "apo-bench/macros/1"
_HEADS = ("", "operation", "state", "macros", "from", "guarded", "position", "walls", "grasp", "until")


class PlanLine(NamedTuple):
    """One step of the schedule: an operation, done or undone."""

    operation: int
    """Counted from 0."""
    undo: bool
    what: OperationMacros
    came_from: str
    """The ODL of the place that the main part is taken from, or `start`."""
    relations: tuple[str, ...]
    """The relations that the step makes, or makes again if it undoes an operation: R1, R2, .."""
    grasp: Grasp
    target: Array | None
    """Target pose of the main part, (4, 4), world, [m]; None for an undone operation."""
    back_to: str
    """The ODL of the place that an undone operation returns the part to; empty otherwise."""

    @property
    def leaves(self) -> Arrival:
        """The place that the part leaves, with the macros by which it departs."""
        return self.what.after if self.undo else self.what.before

    @property
    def comes(self) -> Arrival:
        """The place that the part arrives at, with the macros by which it arrives."""
        return self.what.before if self.undo else self.what.after

    @property
    def macros(self) -> tuple[Macro, ...]:
        return (*self.leaves.departs, *self.comes.macros)

    @property
    def obstacle(self) -> str:
        """A sentence on why no straight insertion leads to the place; empty if one does."""
        if self.comes.chain.locked:
            return "locked: no straight motion leads there"
        return "" if self.comes.free else "no free insertion axis"


def list_plan_lines(plan: Plan, scenario: Scenario) -> tuple[PlanLine, ...]:
    """Return the steps of a plan, with macros computed at the nominal poses of the scenario."""
    everything = list_nominal_operations(scenario)
    odls = plan.assembly.odls()
    relations = [plan.assembly.relations()[arc[0]] for arc in plan.assembly.arcs()]
    lines = []
    for (k, undo), T in zip(plan.schedule, plan.step_poses, strict=True):
        main = everything[k].main
        before = spell(odls[k - 1][main]) if k and main in odls[k - 1] else "start"
        # relations are numbered by arcs; an undone operation makes those that it had ended
        made = tuple(f"R{i}" for i, of in enumerate(relations, start=1) if (of.lost if undo else of.made) == k)
        came_from, target, back_to = (f"T{k + 1}", None, before) if undo else (before, T, "")
        lines.append(PlanLine(k, undo, everything[k], came_from, made, scenario.grasps[k], target, back_to))
    return tuple(lines)


def format_plan(lines: Sequence[PlanLine]) -> list[str]:
    """Return an aligned table, followed by a sentence for each operation without a free insertion axis."""
    wrong = [f"operation {line.operation + 1} ({line.what.main}): {line.obstacle}" for line in lines if line.obstacle]
    return [*align_columns([_HEADS, *map(_list_cells, lines)]), *([""] if wrong else []), *wrong]


def describe_plan(lines: Sequence[PlanLine], scenario: Scenario, notes: Sequence[str] = ()) -> dict[str, Any]:
    """Return a plan as a JSON object: mm, degrees, operations from 1.

    Args:
        notes: Assumptions of the plan and objections to it, one sentence each.
    """
    start = find_nominal_start(scenario)
    stages = (start, *compute_placements(scenario.assembly, start, scenario.nominal_poses))
    forms = []
    for line in lines:
        stage = stages[line.operation if line.undo else line.operation + 1]  # where the parts stand after the step
        screw = compute_screw_state(scenario.assembly, line.comes, stage)
        position, guarded, across = (axes.tolist() for axes in line.comes.axes)
        target = {"position_mm": None, "quaternion_wxyz": None} if line.target is None else make_pose_form(line.target)
        departs = [_make_macro_form(line.leaves, macro) for macro in line.leaves.departs]
        forms.append(
            {
                "operation": line.operation + 1,
                "undo": line.undo,
                "part": line.what.main,
                "carries": list(line.what.carries),
                "before": _make_state_form(line.leaves),
                "after": _make_state_form(line.comes) | {"screw": list(screw.all), "rotation": list(screw.rotation)},
                "macros": departs + [_make_macro_form(line.comes, macro) for macro in line.comes.macros],
                "from": line.came_from,
                "until": {"relations": list(line.relations), "back_to": line.back_to or None} | target,
                "guarded": guarded,
                "position": position,
                "walls": across,
                "line": {
                    "along": line.comes.line.direction.tolist(),
                    "travel_mm": round(1e3 * line.comes.line.travel_m, 6),
                    "free": line.comes.free,
                },
                "trouble": line.obstacle or None,
                "grasp": {"at_mm": (1e3 * line.grasp.point).tolist(), "across": line.grasp.across.tolist()},
            }
        )
    return {"schema": _SCHEMA, "scenario": scenario.name, "steps": forms, "notes": list(notes)}


def _list_cells(line: PlanLine) -> tuple[str, ...]:
    """Return the cells of a step, in the order of `_HEADS`."""
    # main part, and the parts that it carries
    name = " with ".join((line.what.main, *filter(None, [" and ".join(line.what.carries)])))
    macros = []
    for macro in line.macros:
        length = "" if macro.length_m is None else f" {1e3 * macro.length_m:.4g} mm"
        macros.append(f"{macro.name} {format_direction(macro.direction)}{length}")
    until = f"back at {line.back_to}"
    if line.target is not None:
        numbers = np.round([*(1e3 * line.target[:3, 3]), *pose.turn_deg(line.target)], 3) + 0.0
        until = f"{' '.join(line.relations):11} {' '.join(f'{x:9.3f}' for x in numbers)}"
    position, guarded, across = line.comes.axes
    grasp = ", ".join(f"{x:.4g}" for x in np.round(1e3 * line.grasp.point, 6) + 0.0)
    return (
        str(line.operation + 1),
        f"undo: {name}" if line.undo else name,
        f"{line.leaves.state.letter} -> {line.comes.state.letter}",
        ", ".join(macros) or ("-" if line.obstacle else "put down"),
        line.came_from,
        " ".join(map(format_direction, guarded)) or "-",
        _list_axes(position),
        _list_axes(across),
        f"({grasp}) across {_list_axes([line.grasp.across])}",
        until,
    )


def _list_axes(vectors: Iterable[Array]) -> str:
    """Format axes without their sign; `-` if there are none."""
    return " ".join(format_direction(v).lstrip("+-") for v in vectors) or "-"


def _make_state_form(arrival: Arrival) -> dict[str, Any]:
    return {"letter": arrival.state.letter, "translation": list(arrival.state)}


def _make_macro_form(arrival: Arrival, macro: Macro) -> dict[str, Any]:
    """Return a macro as a JSON object, with its direction also in the frame of the part."""
    return {
        "name": macro.name,
        "direction": macro.direction.tolist(),
        "direction_in_part": arrival.to_part_frame(macro.direction).tolist(),
        "length_mm": None if macro.length_m is None else round(1e3 * macro.length_m, 6),
        "guarded": macro.guarded,
        "contacts": [str(contact) for contact in arrival.contacts(macro)],
        "keeps": [str(arrival.touched[i].contact) for i in macro.keeps],
    }
