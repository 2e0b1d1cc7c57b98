"""Will a plan fail, where and why? Said before anything moves, from the plan and the sizes of the parts alone.

Three things are looked at. A goal at which a part would not stand. Contacts that are planned further off than the
judge allows: of faces that fit into one another those across the way in, since along it the robot goes on until it
feels contact; of sides that are slid onto each other what stays open once one corner touches, since the slide does not
turn the part; of supports none, since weight closes them however wrong the plan is. Parts that are planned into one
another where no contact is meant; of those that touch in the same operation the contacts have told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, final

import numpy as np

from apo_bench.assembly.goals import Plan, Poses
from apo_bench.assembly.placement import placements
from apo_bench.assembly.topology import Assembly, Operation
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.clearance import physical_pieces
from apo_bench.geometry.intrusion import intrusion
from apo_bench.geometry.solid import Solid
from apo_bench.insertion.line import Attach
from apo_bench.prediction.resting import is_support, residual, resting_poses
from apo_bench.prediction.stability import first_unstable
from apo_bench.records.thresholds import Thresholds

_Code = Literal["ok", "residual", "interference", "unstable_goal"]
_ACROSS = 0.5
"""A face whose normal makes a smaller cosine with the way in is a wall beside it."""
_SPACING_M = 0.02
"""The way in is looked at this densely, and at `_MOST` places at most."""
_MOST = 8
_WHY = {
    "residual": "its contacts are planned {:.2f} mm off, {:g} mm are allowed",
    "interference": "it would be {:.2f} mm deep in another part, {:g} mm are allowed",
}


@final
@dataclass(frozen=True)
class Prediction:
    """What a plan says about itself."""

    fails: bool
    operation: int | None
    """The operation that will fail, counted from 0."""
    code: _Code
    sentence: str
    size_mm: float | None
    """`residual`: the |e| that is too large; `interference`: the depth; `ok`: the largest |e| of a fit contact; None
    for an unstable goal."""


class _Doing(NamedTuple):
    """One operation about to be done, alone."""

    operation: int
    alone: Assembly
    before: Poses
    planned: Poses
    """Every part where the plan has it after the operation."""
    rests: Poses
    """Every part where it will have come to rest."""


class _Measure(NamedTuple):
    """How far something is off, and how far it may be."""

    code: _Code
    size_mm: float
    allowed_mm: float


def predict(plan: Plan, clearance_mm: float, thresholds: Thresholds, attach: Sequence[Attach] = ()) -> Prediction:
    """The first operation of the schedule that will fail.

    An unstable goal comes before everything else, since a plan with one is not begun.

    Args:
        clearance_mm: Per side, of the parts that are used; fit contacts may be off by this and `fit_margin_mm`, others
            by `support_mm`; parts that should not touch may be as deep in each other as the judge lets one be
            pushed, `pushed_mm`.
        attach: The way in of each operation; without it every fit contact counts, and nothing but the goals.
    """
    doings = tuple(_doings(plan))
    for doing in doings:
        if first_unstable(doing.alone, doing.before, _goal(doing)[None]) is not None:
            return _fails(doing, "unstable_goal", None, "the part would fall there")
    physical, worst = _physical(plan.assembly, clearance_mm), 0.0
    for doing in doings:
        how = attach[doing.operation] if attach else None
        fit = _Measure("residual", _fit_mm(doing, how), clearance_mm + thresholds.fit_margin_mm)
        side = _Measure("residual", _side_mm(doing), thresholds.support_mm)
        depth = _Measure("interference", _depth_mm(doing, how, physical), thresholds.pushed_mm)
        for code, size_mm, allowed_mm in (fit, side, depth):
            if size_mm > allowed_mm:
                return _fails(doing, code, size_mm, _WHY[code].format(size_mm, allowed_mm))
        worst = max(worst, fit.size_mm)
    return Prediction(False, None, "ok", "every operation should fit", worst)


def _fails(doing: _Doing, code: _Code, size_mm: float | None, why: str) -> Prediction:
    sentence = f"operation {doing.operation + 1} ({_operation(doing).main}) will fail: {why}"
    return Prediction(True, doing.operation, code, sentence, size_mm)


def _doings(plan: Plan) -> Iterator[_Doing]:
    """What the schedule does, in order; undoing only changes where the parts are."""
    for (k, alone, before, planned), (_, _, _, rests) in zip(_walk(plan, False), _walk(plan, True), strict=True):
        yield _Doing(k, alone, before, planned, rests)


def _walk(plan: Plan, settling: bool) -> Iterator[tuple[int, Assembly, Poses, Poses]]:
    """Each operation alone, and all poses before and after; what it carries goes along, also when it is undone."""
    now, origin = plan.start, dict[int, Array]()
    for (k, undo), target in zip(plan.schedule, plan.targets, strict=True):
        operation, before = plan.assembly.operations[k], now
        alone = replace(plan.assembly, operations=(operation,))
        if undo:
            (now,) = placements(alone, before, origin[k][None])
            continue
        origin[k] = before[operation.main]
        (now,) = placements(alone, before, target[None])
        now = resting_poses(alone, operation, now) if settling else now
        yield k, alone, before, now


def _fit_mm(doing: _Doing, how: Attach | None) -> float:
    """Largest |e| of the fit contacts that the operation makes across its way in, nominal faces as planned."""
    found = [0.0]
    for contact in filter(doing.alone.is_fit, _operation(doing).contacts):
        e, n = residual(doing.alone, contact, doing.planned)
        if how is None or abs(n @ _way(doing, how)) < _ACROSS:
            found.append(1e3 * float(np.abs(e).max()))
    return max(found)


def _side_mm(doing: _Doing) -> float:
    """Largest |e| of the sides that the operation slides onto others, once its part rests."""
    found = [0.0]
    for contact in _operation(doing).contacts:
        if not doing.alone.is_fit(contact) and not is_support(doing.alone, contact, doing.rests):
            found.append(1e3 * float(np.abs(residual(doing.alone, contact, doing.rests)[0]).max()))
    return max(found)


def _depth_mm(doing: _Doing, how: Attach | None, physical: dict[str, Solid]) -> float:
    """How deep a part that moves comes into one that rests and that it should not touch."""
    moves, at, back = _operation(doing).moves, doing.planned, _way_back(doing, how)
    touching = {frozenset((m.part, e.part)) for m, e in _operation(doing).contacts}
    pairs = [(a, b) for a in moves for b in physical if b not in moves and frozenset((a, b)) not in touching]
    return 1e3 * max((float(_along(physical[a], at[a], physical[b], at[b], back)) for a, b in pairs), default=0.0)


def _along(a: Solid, T_a: Array, b: Solid, T_b: Array, back: Array) -> float:
    """The deepest intrusion over all displacements (k, 3) of a; those with a ball around a off b are skipped."""
    low, high = a.bounds
    centre, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    seen_from_b = pose.apply(pose.inverse(T_b), pose.apply(T_a, centre[None]) + back)
    near = np.linalg.norm(seen_from_b - np.clip(seen_from_b, *b.bounds), axis=1) < radius
    return max((intrusion(a, _shifted(T_a, d), b, T_b) for d in back[near]), default=0.0)


def _shifted(T: Array, d: Array) -> Array:
    out = np.array(T)
    out[:3, 3] += d
    return out


def _way_back(doing: _Doing, how: Attach | None) -> Array:
    """From the goal back along the way in, (k, 3), world, [m]."""
    if how is None:
        return np.zeros((1, 3))
    k = min(_MOST, 1 + int(np.ceil(how.travel_m / _SPACING_M)))
    return -np.outer(np.linspace(0.0, how.travel_m, k), _way(doing, how))


def _way(doing: _Doing, how: Attach) -> Array:
    return np.asarray(_goal(doing)[:3, :3] @ how.direction)


def _goal(doing: _Doing) -> Array:
    return doing.planned[_operation(doing).main]


def _operation(doing: _Doing) -> Operation:
    return doing.alone.operations[0]


def _physical(assembly: Assembly, clearance_mm: float) -> dict[str, Solid]:
    """The parts as they are made, fit faces receded."""
    return {
        name: replace(solid, pieces=physical_pieces(solid, clearance_mm * 1e-3))
        for name, solid in assembly.solids.items()
    }
