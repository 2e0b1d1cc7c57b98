"""What a plan is measured by, operation by operation: how far something is off, and how far it may be.

A goal at which a part would not stand. Contacts that are planned further off than the judge allows: of faces that fit
into one another, and of axes, those across the way in, since along it the robot goes on until it feels contact; of
sides that are slid onto each other what stays open once one corner touches, since the slide does not turn the part; of
supports none, since weight closes them however wrong the plan is. A part that stays where it does not stand on what
lies below alone: it leans as far as clearances let it. Parts that are planned into one another where no contact is
meant, at the goal or on the way in; of those that touch in the same operation the contacts have told, except where a
level way in begins: there a part comes down next to all others.

Where it is known what an arm makes of the plan, as plain numbers that somebody who knows the arm works out: whether
its open gripper has room, and whether contacts that would be near enough still are with the error of its tip.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal, NamedTuple, final

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    Meetings,
    Operation,
    Plan,
    Poses,
    classify_contact,
    compute_apart_limit_mm,
    compute_deep_limit_mm,
    compute_placements,
)
from apo_bench.geometry import Array, Mate
from apo_bench.planning.insertion.attach import Attach
from apo_bench.planning.prediction.interference import depths_from_above, depths_on_way, physical_solids
from apo_bench.planning.prediction.resting import enters, is_support, residual, residuals, resting_poses
from apo_bench.planning.prediction.stability import BALANCED, imbalance
from apo_bench.records import Thresholds

Refused = Literal["unreachable_start", "unreachable"]


@final
@dataclass(frozen=True, eq=False)
class ArmMove:
    """One operation of a plan that is done, or undone, by an arm."""

    operation: int
    """Counted from 0."""
    undo: bool = False
    refused: Refused | None = None
    """Why it is not begun: there are no joint angles where the part is taken, or where it is put."""
    at_limit: str = ""
    """The joint that stands at its limit there; empty where the arm is too short, or nothing is refused."""
    struck: str = ""
    """The part that the open gripper is deepest in, where it takes hold or lets go."""
    struck_mm: float = 0.0
    sag: Array = field(default_factory=lambda: np.eye(4))
    """Where the weight of what is held takes it, a displacement of the world, (4, 4), [m]."""
    beside_mm: float = 0.0
    """How far the tip deviates from its line, moving, at most."""
    margin_deg: float | None = None
    """The least distance of a joint from its limits where the tip turns or stops; None where nothing is known of it."""


MeasureKind = Literal["falls", "fit", "side", "leans", "on_way", "from_above", "gripper", "own", "tip"]
MeasureCode = Literal["residual", "interference", "unstable_goal", "gripper_room", "tip_error"]
_ACROSS = 0.5
"""A face whose normal makes a smaller cosine with the way in is a wall along it."""
_BESIDE_MM = 1e-3
"""Parts that are less deep in each other only touch, whatever was rounded."""
_ROUNDING_MM = 1e-9
"""Lengths that differ by less are the same."""
_CONTACTS_OFF = "its contacts are planned {:.2f} mm off, {:g} mm are allowed"
_SAID: Mapping[MeasureKind, tuple[MeasureCode, str]] = MappingProxyType(
    {
        "falls": ("unstable_goal", "the part would fall there"),
        "fit": ("residual", _CONTACTS_OFF),
        "side": ("residual", _CONTACTS_OFF),
        "leans": (
            "residual",
            "the part would lean against what lies above it, as far as both clearances let it",
        ),
        "on_way": ("interference", "it would be {:.2f} mm deep in another part, {:g} mm are allowed"),
        "from_above": ("interference", "its way in begins {:.2f} mm deep in another part"),
        "gripper": (
            "gripper_room",
            "the open gripper would be {:.2f} mm deep in '{what}', {:g} mm are allowed",
        ),
        "own": ("tip_error", "the arm holds its way to {:.3f} mm only, and the play is {:g} mm"),
        "tip": (
            "tip_error",
            "with the error of the arm's tip its contacts are {:.2f} mm off, {:g} mm are allowed",
        ),
    }
)
"""What is measured -> the code of what is too much, and what is stated of it."""


class Measure(NamedTuple):
    """How far something is off, and how far it may be."""

    operation: int
    """Counted from 0."""
    kind: MeasureKind
    size: float
    """[mm], of parts that are apart negative; of what falls or leans, how much of the weight and its moments over 10 mm
    nothing balances."""
    allowed: float
    what: str = ""
    """The part that a gripper would strike."""

    @property
    def exceeded(self) -> bool:
        return self.size > self.allowed

    @property
    def code(self) -> MeasureCode:
        """What is stated of it if it is too much."""
        return _SAID[self.kind][0]

    @property
    def why(self) -> str:
        """`it would be 7.59 mm deep in another part, 1 mm are allowed`."""
        return _SAID[self.kind][1].format(self.size, self.allowed, what=self.what)


class _Act(NamedTuple):
    """One operation about to be done, alone."""

    number: int
    """The operation, counted from 0."""
    alone: Assembly
    """Without the other operations."""
    planned: Poses
    """Every part where the plan has it after the operation."""
    rests: Poses
    """Every part where it will have come to rest."""

    @property
    def operation(self) -> Operation:
        return self.alone.operations[0]


def measures(
    plan: Plan,
    clearance_mm: float,
    thresholds: Thresholds,
    attach: Sequence[Attach] = (),
    room_mm: float = 0.0,
    arm: Sequence[ArmMove] = (),
    brought: Sequence[Poses] = (),
) -> Iterator[Measure]:
    """Everything that a plan is measured by, the most important first; always the same things of one schedule.

    Args:
        room_mm: Centres of mass are looked at this far aside, too.
        arm: As in `predict`; its reach is not measured.
        brought: Every part when one is put, for each step of the schedule that puts one; empty: as planned. What falls
            or leans is not asked of them.
    """
    acts = tuple(_acts(plan, iter(brought)))
    for act in acts if not brought else ():
        yield Measure(act.number, "falls", imbalance(act.alone, act.operation, act.planned, 1e-3 * room_mm), BALANCED)
    physical = physical_solids(plan.assembly, clearance_mm)
    for act in acts:
        k, _, planned, _ = act
        operation = act.operation
        how = attach[k] if attach else None
        deep_mm = thresholds.fit_margin_mm if operation.carries else thresholds.displaced_mm
        fit = _fit(act, how, clearance_mm, thresholds)
        yield fit
        yield Measure(k, "side", _side_mm(act), thresholds.support_mm)
        stays = not any(operation.main in later.moves for later in plan.assembly.operations[k + 1 :])
        if stays and clearance_mm > thresholds.fit_margin_mm and not brought:
            leans = imbalance(act.alone, operation, planned, 1e-3 * room_mm, ceilings=False)
            yield Measure(k, "leans", leans, BALANCED)
        for depth_m in depths_on_way(operation, planned, how, physical):
            yield Measure(k, "on_way", 1e3 * depth_m, deep_mm)
        for depth_m in depths_from_above(operation, planned, how, physical):
            yield Measure(k, "from_above", 1e3 * depth_m, _BESIDE_MM)
        for move in (move for move in arm if move.operation == k and not move.undo):
            yield Measure(k, "gripper", move.struck_mm, thresholds.displaced_mm, move.struck)
            yield from _tip(act, move, how, clearance_mm, thresholds, fit)


def _acts(plan: Plan, brought: Iterator[Poses]) -> Iterator[_Act]:
    """What the schedule does, in order; undoing only changes where the parts are, and takes what is carried along."""
    planned = rests = plan.start
    origins = dict[int, tuple[Array, Array]]()
    for (k, undo), target in zip(plan.schedule, plan.step_poses, strict=True):
        operation = plan.assembly.operations[k]
        alone = replace(plan.assembly, operations=(operation,))
        if undo:
            planned, rests = (_put(alone, *pair) for pair in zip((planned, rests), origins[k], strict=True))
            continue
        origins[k] = planned[operation.main], rests[operation.main]
        given = next(brought, None)
        planned, rests = [given] * 2 if given else (_put(alone, poses, target) for poses in (planned, rests))
        rests = resting_poses(alone, operation, rests)
        yield _Act(k, alone, planned, rests)


def _put(alone: Assembly, before: Poses, goal: Array) -> Poses:
    """All poses once the only operation has put its main part at a goal."""
    return compute_placements(alone, before, goal[None])[0]


def _fit(act: _Act, how: Attach | None, clearance_mm: float, thresholds: Thresholds) -> Measure:
    """The |e| across the way in, nominal faces as planned, of the contact that enters and exceeds its play the most."""
    lengths = clearance_mm, thresholds.fit_margin_mm, thresholds.support_mm
    sides = [(0.0, clearance_mm + thresholds.fit_margin_mm)]
    apart = list[tuple[float, float, Contact]]()
    entering = [contact for contact in act.operation.contacts if enters(act.alone, contact)]
    for contact, (deep_m, apart_m) in zip(entering, _misfits_m(act, entering, how), strict=True):
        limit = compute_deep_limit_mm(act.alone, contact, *lengths)
        sides.append((1e3 * deep_m, limit))
        apart.append((1e3 * apart_m, limit, contact))
    worst = max(sides, key=_excess)
    # Faces may be at least as far apart as deep; how much farther, a linear program says, and only where it may matter.
    for size, limit, contact in apart:
        if size > limit:
            if size - limit <= _excess(worst) + _ROUNDING_MM:
                continue
            limit = compute_apart_limit_mm(act.alone, contact, 0, act.planned, *lengths)
        worst = max(worst, (size, limit), key=_excess)
    return Measure(act.number, "fit", *worst)


def _excess(side: tuple[float, float]) -> float:
    """By how much a length is more than what is allowed."""
    return side[0] - side[1]


def _tip(
    act: _Act, move: ArmMove, how: Attach | None, clearance_mm: float, thresholds: Thresholds, planned: Measure
) -> Iterator[Measure]:
    """Of what enters: how far off the arm alone is, which play must take, and how far with what is planned wrong."""
    as_planned = not move.beside_mm and np.array_equal(move.sag, np.eye(4))
    if as_planned or not any(enters(act.alone, contact) for contact in act.operation.contacts):
        return
    moved = {part: move.sag @ act.planned[part] for part in act.operation.moves}
    off = _fit(act._replace(planned=MappingProxyType({**act.planned, **moved})), how, clearance_mm, thresholds)
    own = max(0.0, off.size - planned.size) + move.beside_mm
    yield Measure(act.number, "own", own, max(off.allowed - thresholds.fit_margin_mm, 0.0))
    yield Measure(act.number, "tip", off.size + move.beside_mm, off.allowed)


def _misfits_m(act: _Act, contacts: Sequence[Contact], how: Attach | None) -> list[tuple[float, float]]:
    """How deep and how far apart contacts are across the way in at most; of round faces, twice, how far apart the axes
    are, across it.
    """
    way = None if how is None else act.planned[act.operation.main][:3, :3] @ how.direction
    out = []
    for contact, lie in zip(contacts, Meetings(act.alone).measure((c, act.planned) for c in contacts), strict=True):
        if classify_contact(*map(act.alone.face_of, contact)) in ("plane on plane", "shaft on plane"):
            e, n = residual(act.alone, contact, lie, act.planned)
            along = way is not None and abs(n @ way) >= _ACROSS
            out.append((0.0, 0.0) if along else (max(0.0, -float(e.min())), max(0.0, float(e.max()))))
        else:
            assert isinstance(lie, Mate)
            out.append((_off_axis_m(lie, way),) * 2)
    return out


def _off_axis_m(lie: Mate, way: Array | None) -> float:
    """How far apart the axes of two round faces are, or their walls, across the way in."""
    if way is None:
        return lie.gap_m
    # Along the way the robot goes on until it feels contact, so only the part of each offset across it counts.
    beside = float(np.linalg.norm(lie.off - np.outer(lie.off @ way, way), axis=1).max())
    return beside if abs(lie.axis @ way) >= _ACROSS else max(beside, abs(lie.rise_m) * lie.sine)


def _side_mm(act: _Act) -> float:
    """Largest |e| of the sides that the operation slides onto others, once its part rests."""
    sides = [c for c in act.operation.contacts if not enters(act.alone, c) and not is_support(act.alone, c, act.rests)]
    return max((1e3 * float(np.abs(e).max()) for e, _ in residuals(act.alone, sides, act.rests)), default=0.0)
