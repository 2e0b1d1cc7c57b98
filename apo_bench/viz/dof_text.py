"""The directions that contacts fix and leave free, as sentences, as a table, and as one JSON object."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from apo_bench.assembly import Hypothesis, spell
from apo_bench.correction.explanation import Explanation, FreeDirection
from apo_bench.correction.relation_equations import RelationHold
from apo_bench.formats.json_forms import TO_MM_DEG, make_covariance_form, make_pose_form
from apo_bench.geometry import Array
from apo_bench.io import group_by

_SCHEMA = "apo-bench/explanation/1"
DOF_COLUMNS = {"operation": "d", "part": "", "fixed": "", "free": "", "relations": "", "agreeing": ""}
"""Columns of `list_dof_rows`, with their formats."""
PART_COLUMNS = {"part": "", "odl": "", "rank": "d", "deviation_mm": ".2f", "deviation_deg": ".2f"}
"""Columns of the uncertainty of each part at the end: keys of a part in `make_dof_form`, with their formats."""


def count_directions(explanation: Explanation) -> str:
    """Count directions: `the contacts fix 13 of 18 directions; 5 are free and 14 of 27 equations redundant`."""
    redundant = f"{explanation.redundant} of {explanation.rank + explanation.redundant} equations redundant"
    fixed = f"{explanation.rank} of {6 * len(explanation.poses)} directions"
    return f"the contacts fix {fixed}; {explanation.freedom} are free and {redundant}"


def list_dof_rows(explanation: Explanation) -> list[dict[str, Any]]:
    """Return one table row per operation with its fixed and free directions, for columns `DOF_COLUMNS`."""
    rows = []
    for o in explanation.operations:
        free = []
        # shared directions are grouped by the operations that move along
        for along, some in group_by((direction.along, direction) for direction in o.free).items():
            names = ", ".join(f"{each.direction} {format_deviation(each)}" for each in some)
            others = dict.fromkeys(explanation.operations[j].part for j in along)
            free.append(f"{names}{' with ' * bool(others)}{', '.join(others)}")
        # a relation that is lost later holds `until` that operation
        until = {hold.relation: "" if hold.lost is None else f" until {hold.lost + 1}" for hold in o.through}
        rows.append(
            {
                "operation": o.operation + 1,
                "part": o.part,
                "fixed": list(o.fixed),
                "free": "; ".join(free) or "nothing",
                "relations": [relation + end for relation, end in until.items()],
                "agreeing": [hold.relation for hold in o.agreeing],
            }
        )
    return rows


def format_shared_errors(explanation: Explanation) -> list[str]:
    """Return a line for each shared error: `camera: off by (-0.30 ± 0.50, ...) mm and (..) deg`."""
    lines = []
    for estimate in explanation.shared:
        numbers = zip(estimate.twist * TO_MM_DEG, estimate.deviations * TO_MM_DEG, strict=True)
        each = [f"{x:.2f} ± {s:.2f}" for x, s in numbers]
        lines.append(f"{estimate.error.name}: off by ({', '.join(each[:3])}) mm and ({', '.join(each[3:])}) deg")
    return lines


def format_hypotheses(hypotheses: Sequence[Hypothesis]) -> list[str]:
    """Return a line for each hypothesis, `0.92: without the observation of operation 2`; none if there is only one."""
    lines = [f"{each.weight:.2g}: {each.sentence or 'as observed'}" for each in hypotheses]
    return lines if len(lines) > 1 else []


def format_deviation(free: FreeDirection) -> str:
    """Return the standard deviation along a free direction: `1.00 mm` or `0.58 deg`."""
    return f"{_get_deviation(free):.2f} {'deg' if free.direction.turns else 'mm'}"


def make_dof_form(scenario: str, explanation: Explanation) -> dict[str, Any]:
    """Return an explanation as a JSON object: mm, degrees, operations from 1; an infinite spectral gap is null."""
    return {
        "schema": _SCHEMA,
        "scenario": scenario,
        "operations": [
            {
                "operation": o.operation + 1,
                "part": o.part,
                "rank": o.rank,
                "fixed": list(o.fixed),
                "free": [_make_direction_form(free, explanation.poses[o.operation]) for free in o.free],
                "through": list(map(_make_hold_form, o.through)),
                "agreeing": list(map(_make_hold_form, o.agreeing)),
                "covariance_mm_deg": make_covariance_form(o.covariance),
            }
            for o in explanation.operations
        ],
        "parts": [
            {
                "part": part.part,
                "placed": part.placed + 1,
                "odl": spell(part.odl),
                **make_pose_form(part.pose),
                "rank": part.rank,
                "fixed": list(part.fixed),
                "free": [_make_direction_form(free, part.pose) for free in part.free],
                "deviation_mm": (part.deviations * TO_MM_DEG)[:3].tolist(),
                "deviation_deg": (part.deviations * TO_MM_DEG)[3:].tolist(),
                "covariance_mm_deg": make_covariance_form(part.covariance),
            }
            for part in explanation.parts
        ],
        "rank": explanation.rank,
        "freedom": explanation.freedom,
        "redundant": explanation.redundant,
        "shared": [
            {
                "name": estimate.error.name,
                "operations": [k + 1 for k in estimate.error.operations],
                "twist_mm_deg": (estimate.twist * TO_MM_DEG).tolist(),
                "covariance_mm_deg": make_covariance_form(estimate.covariance),
            }
            for estimate in explanation.shared
        ],
        "left_out": [k + 1 for k in explanation.left_out],
        "spectral_gap": explanation.spectral_gap if np.isfinite(explanation.spectral_gap) else None,
    }


def make_hypothesis_forms(hypotheses: Sequence[Hypothesis]) -> list[dict[str, Any]]:
    """Return hypotheses as JSON objects: operations from 1, poses and covariances in mm and degrees."""
    return [
        {
            "weight": each.weight,
            "sentence": each.sentence,
            "left_out": [k + 1 for k in each.left_out],
            "dropped": list(each.dropped),
            "operations": list(map(make_pose_form, each.poses)),
            "covariances_mm_deg": None if each.covariance is None else list(map(make_covariance_form, each.covariance)),
        }
        for each in hypotheses
    ]


def _get_deviation(free: FreeDirection) -> float:
    """Return the standard deviation along a free direction, in mm or degrees."""
    # the first three entries of TO_MM_DEG convert to mm, the last three to degrees
    return float(free.deviation * TO_MM_DEG[3 if free.direction.turns else 0])


def _make_direction_form(free: FreeDirection, T: Array) -> dict[str, Any]:
    """Return a free direction as a JSON object.

    Args:
        T: Pose of the part, (4, 4), world, [m].

    Returns:
        The object; its twist is per mm of a shift or per degree of a turn, in the frame of the part.
    """
    d = free.direction
    return {
        "name": str(d),
        "twist_mm_deg": (d.twist * TO_MM_DEG / TO_MM_DEG[3 if d.turns else 0]).tolist(),
        "axis": d.axis.tolist(),
        "axis_world": (T[:3, :3] @ d.axis).tolist(),
        **({"point_mm": (d.point * 1e3).tolist()} if d.turns else {}),
        "deviation_deg" if d.turns else "deviation_mm": _get_deviation(free),
        "with": [k + 1 for k in free.along],
    }


def _make_hold_form(hold: RelationHold) -> dict[str, Any]:
    """Return a relation that holds a part, as a JSON object; `lost` is null if the relation holds until the end."""
    return {
        "relation": hold.relation,
        "parts": list(hold.parts),
        "made": hold.made + 1,
        "lost": None if hold.lost is None else hold.lost + 1,
        "equation": spell(hold.word),
        "operations": sorted({term.operation + 1 for term in hold.word}),
    }
