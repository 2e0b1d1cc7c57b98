"""Will a plan fail, where and why? Said before anything moves, from the plan and the sizes of the parts alone.

Three things are looked at. A goal at which a part would not stand. Faces that fit into one another and are planned
further off than the clearance lets them be; of these only faces across the way in, since along it the robot goes on
until it feels contact. Parts that are planned into one another where no contact is meant; of parts that touch in the
same operation the fit faces have already told, and the others are found by touch however wrong the plan is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Contact, Operation
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.clearance import physical_boxes
from apo_bench.geometry.intrusion import intrusion
from apo_bench.geometry.overlap import overlap
from apo_bench.geometry.solid import Solid
from apo_bench.placement import placed
from apo_bench.program import Plan, Poses
from apo_bench.scenario import Attach
from apo_bench.stability import unstable
from apo_bench.thresholds import Thresholds

Code = Literal["ok", "residual", "interference", "unstable_goal"]
ACROSS = 0.5
"""A face whose normal makes a smaller cosine with the way in is a wall beside it."""
SPACING_M = 0.02
"""The way in is looked at this densely, and at `MOST` places at most."""
MOST = 8


@final
@dataclass(frozen=True)
class Prediction:
    """What a plan says about itself."""

    fails: bool
    operation: int | None
    """The operation that will fail, counted from 0."""
    code: Code
    sentence: str
    size_mm: float | None
    """`residual` and `ok`: the largest |e| of a fit contact; `interference`: the depth; None of an unstable goal."""


class Doing(NamedTuple):
    """One operation about to be done: alone, with every part where it will then be believed."""

    operation: int
    alone: Assembly
    before: Poses
    poses: Poses


def predict(plan: Plan, clearance_mm: float, thresholds: Thresholds, attach: Sequence[Attach] = ()) -> Prediction:
    """The first operation of the schedule that will fail.

    An unstable goal comes before everything else, since a plan with one is not begun.

    Args:
        clearance_mm: Per side, of the parts that are used; fit contacts may be off by this and `fit_margin_mm`, and
            parts that should not touch may be as deep in each other as the judge lets one be pushed, `pushed_mm`.
        attach: The way in of each operation; without it every fit contact counts, and nothing but the goals.
    """
    doings = tuple(_doings(plan))
    for doing in doings:
        if unstable(doing.alone, doing.before, _goal(doing)[None]) is not None:
            return _fails(plan, doing, "unstable_goal", None, "the part would fall there")
    physical = _physical(plan.assembly, clearance_mm)
    allowed_mm, worst = clearance_mm + thresholds.fit_margin_mm, 0.0
    for doing in doings:
        how = attach[doing.operation] if attach else None
        off = max((1e3 * e for e in _residuals(doing, how)), default=0.0)
        worst = max(worst, off)
        if off > allowed_mm:
            why = f"faces that fit are planned {off:.2f} mm off, {allowed_mm:g} mm are allowed"
            return _fails(plan, doing, "residual", off, why)
        deep = 1e3 * float(_depth(doing, how, physical))
        if deep > thresholds.pushed_mm:
            why = f"it would be {deep:.2f} mm deep in another part, {thresholds.pushed_mm:g} mm are allowed"
            return _fails(plan, doing, "interference", deep, why)
    return Prediction(False, None, "ok", "every operation should fit", worst)


def _fails(plan: Plan, doing: Doing, code: Code, size_mm: float | None, why: str) -> Prediction:
    part = plan.assembly.operations[doing.operation].main
    sentence = f"operation {doing.operation + 1} ({part}) will fail: {why}"
    return Prediction(True, doing.operation, code, sentence, size_mm)


def _doings(plan: Plan) -> Iterator[Doing]:
    """Walk the schedule; what an operation carries goes along, and undoing it brings all of it back."""
    now, origin = plan.start, dict[int, Array]()
    for step, target in zip(plan.schedule, plan.targets, strict=True):
        operation = plan.assembly.operations[step.operation]
        alone = Assembly(plan.assembly.solids, (operation,), plan.assembly.fixed)
        before = now
        if step.undo:
            (now,) = placed(alone, before, origin[step.operation][None])
            continue
        origin[step.operation] = before[operation.main]
        (now,) = placed(alone, before, target[None])
        yield Doing(step.operation, alone, before, now)


def _residuals(doing: Doing, how: Attach | None) -> Iterator[float]:
    """|e| at the corners of each fit contact that the operation makes across its way in, nominal faces, [m]."""
    for contact in _operation(doing).contacts:
        T = doing.poses[contact.manipulated.part]
        plane = doing.alone.face(contact.manipulated).plane
        n = T[:3, :3] @ plane[:3]
        if doing.alone.is_fit(contact) and (how is None or abs(n @ _way(doing, how)) < ACROSS):
            corners = _corners(doing, contact)
            yield float(np.abs((corners - T[:3, 3]) @ n + plane[3]).max())


def _corners(doing: Doing, contact: Contact) -> Array:
    """Corners of the overlap, (k, 3), world, [m]; of the whole environment face if the faces miss each other."""
    m, e = contact
    face, T = doing.alone.face(e), doing.poses[e.part]
    found = overlap(doing.alone.face(m), doing.poses[m.part], face, T)
    return found.corners if found else pose.apply(T, face.outline)


def _depth(doing: Doing, how: Attach | None, physical: dict[str, Solid]) -> float:
    """How deep a part that moves comes into one that rests and that it should not touch, [m]."""
    moves = _operation(doing).moves
    touching = {frozenset((m.part, e.part)) for m, e in _operation(doing).contacts}
    pairs = [(a, b) for a in moves for b in physical if b not in moves and frozenset((a, b)) not in touching]
    back = _way_back(doing, how)
    return max((_along(physical[a], doing.poses[a], physical[b], doing.poses[b], back) for a, b in pairs), default=0.0)


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


def _way_back(doing: Doing, how: Attach | None) -> Array:
    """From the goal back along the way in, (k, 3), world, [m]."""
    if how is None:
        return np.zeros((1, 3))
    k = min(MOST, 1 + int(np.ceil(how.travel_m / SPACING_M)))
    return -np.outer(np.linspace(0.0, how.travel_m, k), _way(doing, how))


def _way(doing: Doing, how: Attach) -> Array:
    return np.asarray(_goal(doing)[:3, :3] @ how.direction)


def _goal(doing: Doing) -> Array:
    return doing.poses[_operation(doing).main]


def _operation(doing: Doing) -> Operation:
    return doing.alone.operations[0]


def _physical(assembly: Assembly, clearance_mm: float) -> dict[str, Solid]:
    """The parts as they are made, fit faces receded."""
    return {
        name: replace(solid, boxes=physical_boxes(solid, clearance_mm * 1e-3))
        for name, solid in assembly.solids.items()
    }
