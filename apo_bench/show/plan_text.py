"""A plan in macros: one line per operation, and one JSON object.

Directions are those of the frame of the assembly at the nominal goals; what is measured stands in the last column
alone, so that another motion parameter changes the line of its operation and no other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from apo_bench.assembly.placement import placements
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.insertion.arrival import Arrival, turning_state
from apo_bench.insertion.macros import Macro
from apo_bench.scenario.nominal import nominal_start
from apo_bench.scenario.scenario import Scenario
from apo_bench.show.plan_lines import PlanLine

_MACROS = "apo-bench/macros/1"
_HEADS = ("", "operation", "state", "macros", "from", "guarded", "position", "walls", "grasp", "until")


def plan_text(lines: Sequence[PlanLine]) -> list[str]:
    """A table of text, then what is wrong with single operations."""
    table = [_HEADS, *(_cells(line) for line in lines)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    rows = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in table]
    wrong = [f"operation {line.operation + 1} ({line.what.main}): {line.trouble}" for line in lines if line.trouble]
    return [*rows, *([""] if wrong else []), *wrong]


def plan_lines_form(lines: Sequence[PlanLine], scenario: Scenario, notes: Sequence[str] = ()) -> dict[str, Any]:
    """What `json` can write: mm, degrees, operations from 1.

    Args:
        notes: What is to be said with it: what was assumed, and what speaks against the plan.
    """
    start = nominal_start(scenario)
    stages = (start, *placements(scenario.assembly, start, scenario.goals))
    forms = []
    for line in lines:
        poses = stages[line.operation if line.undo else line.operation + 1]
        screw = turning_state(scenario.assembly, line.comes, poses)
        position, felt, across = line.comes.axes
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
                "until": {"relations": list(line.relations), "back_to": line.back_to or None} | _pose(line.goal),
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


def direction(v: Array) -> str:
    """`-z`, or three numbers."""
    for i, axis in enumerate("xyz"):
        if abs(v[i]) > 1.0 - 1e-9:
            return f"{'+' if v[i] > 0 else '-'}{axis}"
    return f"({', '.join(f'{x + 0.0:.3g}' for x in np.round(v, 3))})"


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
    numbers = np.round([*(1e3 * line.goal[:3, 3]), *_turns(line.goal)], 3) + 0.0
    return f"{' '.join(line.relations):11} {' '.join(f'{x:9.3f}' for x in numbers)}"


def _turns(T: Array) -> Array:
    """Turns about the fixed x, then y, then z axis, (3,), [degrees], as in a scenario file."""
    R = T[:3, :3]
    level = float(np.hypot(R[0, 0], R[1, 0]))
    if level < 1e-9:
        turns = [np.arctan2(-R[1, 2], R[1, 1]), np.arctan2(-R[2, 0], level), 0.0]
    else:
        turns = [np.arctan2(R[2, 1], R[2, 2]), np.arctan2(-R[2, 0], level), np.arctan2(R[1, 0], R[0, 0])]
    return np.degrees(turns)


def _listed(words: Iterator[str]) -> str:
    return " ".join(words) or "-"


def _point(p: Array) -> str:
    return f"({', '.join(f'{v:.4g}' for v in np.round(1e3 * p, 6) + 0.0)})"


def _state(found: Arrival) -> dict[str, Any]:
    return {"letter": found.state.letter, "translation": list(found.state)}


def _macro(found: Arrival, macro: Macro) -> dict[str, Any]:
    return {
        "name": macro.name,
        "direction": macro.direction.tolist(),
        "direction_in_part": found.own(macro.direction).tolist(),
        "length_mm": None if macro.length_m is None else round(1e3 * macro.length_m, 6),
        "guarded": macro.guarded,
        "contacts": [str(contact) for contact in found.contacts(macro)],
        "keeps": [str(found.touched[i].contact) for i in macro.keeps],
    }


def _pose(T: Array | None) -> dict[str, Any]:
    if T is None:
        return {"position_mm": None, "quaternion_wxyz": None}
    packed = pose.pack(T)
    return {"position_mm": (packed[:3] * 1e3).tolist(), "quaternion_wxyz": packed[3:].tolist()}
