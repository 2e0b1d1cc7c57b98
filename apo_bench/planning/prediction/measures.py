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
    list_alternatives,
)
from apo_bench.geometry import Array, Mate, remember
from apo_bench.planning.insertion.attach import Attach
from apo_bench.planning.prediction.interference import Solids, depths_from_above, depths_on_way, physical_solids
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
    """Every part where the plan has it after the operation, or where each of several robots brings it."""
    rests: Poses
    """Every part where it will have come to rest."""
    known: Meetings
    """The contacts of all operations, with what is measured already."""

    @property
    def operation(self) -> Operation:
        return self.alone.operations[0]


class DrawnMeasure(NamedTuple):
    """A `Measure` of several draws of what is wrong with a robot."""

    operation: int
    kind: MeasureKind
    size: Array
    """(r,), as in `Measure`."""
    allowed: Array
    """(r,)."""
    what: str = ""

    def one(self) -> Measure:
        """Of a single draw."""
        return Measure(self.operation, self.kind, float(self.size[0]), float(self.allowed[0]), self.what)


def measures(
    plan: Plan,
    clearance_mm: float,
    thresholds: Thresholds,
    attach: Sequence[Attach] = (),
    room_mm: float = 0.0,
    arm: Sequence[ArmMove] = (),
) -> Iterator[Measure]:
    """Everything that a plan is measured by, the most important first; always the same things of one schedule.

    Args:
        room_mm: Centres of mass are looked at this far aside, too.
        arm: As in `predict`; its reach is not measured.
    """
    falls, of_acts = _as_planned(plan, clearance_mm, thresholds, tuple(attach), room_mm)
    yield from falls
    for act, found in of_acts:
        yield from found
        fit = DrawnMeasure(act.number, "fit", np.array([found[0].size]), np.array([found[0].allowed]))
        yield from (each.one() for each in _by_arm(act, arm, attach, clearance_mm, thresholds, fit))


@remember
def _as_planned(
    plan: Plan, clearance_mm: float, thresholds: Thresholds, attach: tuple[Attach, ...], room_mm: float
) -> tuple[tuple[Measure, ...], tuple[tuple[_Act, tuple[Measure, ...]], ...]]:
    """What falls, and what each operation is measured by without an arm, the fit first; a trial asks for it thrice."""
    acts = _acts(plan)
    physical = physical_solids(plan.assembly, clearance_mm)
    falls = [
        Measure(act.number, "falls", imbalance(act.known, act.operation, act.planned, 1e-3 * room_mm), BALANCED)
        for act in acts
    ]
    of_acts = []
    for act in acts:
        fit, side, *depths = (each.one() for each in _drawn(act, clearance_mm, thresholds, attach, physical))
        leans = list[Measure]()
        stays = not any(act.operation.main in later.moves for later in plan.assembly.operations[act.number + 1 :])
        if stays and clearance_mm > thresholds.fit_margin_mm:
            size = imbalance(act.known, act.operation, act.planned, 1e-3 * room_mm, ceilings=False)
            leans = [Measure(act.number, "leans", size, BALANCED)]
        of_acts.append((act, (fit, side, *leans, *depths)))
    return tuple(falls), tuple(of_acts)


def drawn_measures(
    plan: Plan,
    clearance_mm: float,
    thresholds: Thresholds,
    attach: Sequence[Attach],
    arm: Sequence[ArmMove],
    brought: Sequence[Poses],
) -> Iterator[DrawnMeasure]:
    """What a plan is measured by that robots with errors carry out, but for what falls or leans.

    Args:
        arm: As in `predict`; its reach is not measured.
        brought: Every part when one is put, (r, 4, 4) by r robots, for each step of the schedule that puts one.
    """
    physical = physical_solids(plan.assembly, clearance_mm)
    for act in _acts(plan, brought):
        fit, *others = _drawn(act, clearance_mm, thresholds, attach, physical)
        yield from (fit, *others, *_by_arm(act, arm, attach, clearance_mm, thresholds, fit))


def _drawn(
    act: _Act, clearance_mm: float, thresholds: Thresholds, attach: Sequence[Attach], physical: Solids
) -> Iterator[DrawnMeasure]:
    """What an operation is measured by without an arm, but for what falls or leans; the fit is the first."""
    k = act.number
    how = attach[k] if attach else None
    fit = _fit(act, how, clearance_mm, thresholds)
    same = np.ones_like(fit.size)
    yield fit
    yield DrawnMeasure(k, "side", _side_mm(act), thresholds.support_mm * same)
    deep_mm = thresholds.fit_margin_mm if act.operation.carries else thresholds.placed_part_shift_mm
    for depths_m in depths_on_way(act.operation, act.planned, how, physical):
        yield DrawnMeasure(k, "on_way", 1e3 * depths_m, deep_mm * same)
    for depths_m in depths_from_above(act.operation, act.planned, how, physical):
        yield DrawnMeasure(k, "from_above", 1e3 * depths_m, _BESIDE_MM * same)


def _by_arm(
    act: _Act,
    arm: Sequence[ArmMove],
    attach: Sequence[Attach],
    clearance_mm: float,
    thresholds: Thresholds,
    fit: DrawnMeasure,
) -> Iterator[DrawnMeasure]:
    """What an operation is measured by once it is known what an arm makes of it.

    Args:
        fit: How well it fits without the arm.
    """
    same = np.ones_like(fit.size)
    how = attach[act.number] if attach else None
    for move in (move for move in arm if move.operation == act.number and not move.undo):
        allowed = thresholds.placed_part_shift_mm * same
        yield DrawnMeasure(act.number, "gripper", move.struck_mm * same, allowed, move.struck)
        yield from _tip(act, move, how, clearance_mm, thresholds, fit)


def _acts(plan: Plan, brought: Sequence[Poses] = ()) -> tuple[_Act, ...]:
    """What the schedule does, in order; undoing only changes where the parts are, and takes what is carried along.

    All contacts are measured in one call.
    """
    acts = list[_Act]()
    known = Meetings(plan.assembly)
    given_poses = iter(brought)
    planned = rests = plan.start
    origins = dict[int, tuple[Array, Array]]()
    for (k, undo), target in zip(plan.schedule, plan.step_poses, strict=True):
        operation = plan.assembly.operations[k]
        alone = replace(plan.assembly, operations=(operation,))
        if undo:
            planned, rests = (_put(alone, *pair) for pair in zip((planned, rests), origins[k], strict=True))
            continue
        origins[k] = planned[operation.main], rests[operation.main]
        given = next(given_poses, None)
        planned, rests = [given] * 2 if given else (_put(alone, poses, target) for poses in (planned, rests))
        rests = resting_poses(alone, operation, rests)
        acts.append(_Act(k, alone, planned, rests, known))
    places = [(act.operation.contacts, poses) for act in acts for poses in (act.planned, act.rests)]
    known.measure((c, poses) for contacts, at in places for poses in list_alternatives(at) for c in contacts)
    return tuple(acts)


def _put(alone: Assembly, before: Poses, goal: Array) -> Poses:
    """All poses once the only operation has put its main part at a goal."""
    return compute_placements(alone, before, goal[None])[0]


def _fit(act: _Act, how: Attach | None, clearance_mm: float, thresholds: Thresholds) -> DrawnMeasure:
    """The |e| across the way in, nominal faces as planned, of the contact that enters and exceeds its play the most."""
    lengths = clearance_mm, thresholds.fit_margin_mm, thresholds.support_mm
    entering = [contact for contact in act.operation.contacts if enters(act.alone, contact)]
    limits = [compute_deep_limit_mm(act.alone, contact, *lengths) for contact in entering]
    alternatives = list_alternatives(act.planned)
    act.known.measure((contact, poses) for poses in alternatives for contact in entering)
    worst = []
    for poses in alternatives:
        off = [_misfit_mm(act, contact, poses, how) for contact in entering]
        sides = [(0.0, clearance_mm + thresholds.fit_margin_mm)]
        sides += [(deep, limit) for (deep, _), limit in zip(off, limits, strict=True)]
        most = max(sides, key=_excess)
        # Faces may be at least as far apart as deep; how much farther takes a linear program, where it may matter.
        for contact, (_, apart), limit in zip(entering, off, limits, strict=True):
            if apart > limit:
                if apart - limit <= _excess(most) + _ROUNDING_MM:
                    continue
                limit = compute_apart_limit_mm(act.alone, contact, 0, poses, *lengths)
            most = max(most, (apart, limit), key=_excess)
        worst.append(most)
    return DrawnMeasure(act.number, "fit", *np.array(worst).T)


def _excess(side: tuple[float, float]) -> float:
    """By how much a length is more than what is allowed."""
    return side[0] - side[1]


def _tip(
    act: _Act, move: ArmMove, how: Attach | None, clearance_mm: float, thresholds: Thresholds, planned: DrawnMeasure
) -> Iterator[DrawnMeasure]:
    """Of what enters: how far off the arm alone is, which play must take, and how far with what is planned wrong."""
    as_planned = not move.beside_mm and np.array_equal(move.sag, np.eye(4))
    if as_planned or not any(enters(act.alone, contact) for contact in act.operation.contacts):
        return
    moved = {part: move.sag @ act.planned[part] for part in act.operation.moves}
    off = _fit(act._replace(planned=MappingProxyType({**act.planned, **moved})), how, clearance_mm, thresholds)
    own = np.maximum(0.0, off.size - planned.size) + move.beside_mm
    yield DrawnMeasure(act.number, "own", own, np.maximum(off.allowed - thresholds.fit_margin_mm, 0.0))
    yield DrawnMeasure(act.number, "tip", off.size + move.beside_mm, off.allowed)


def _misfit_mm(act: _Act, contact: Contact, poses: Poses, how: Attach | None) -> tuple[float, float]:
    """How deep and how far apart a contact is across the way in at most, [mm]; of round faces, twice, how far apart the
    axes are, across it.
    """
    way = None if how is None else poses[act.operation.main][:3, :3] @ how.direction
    (lie,) = act.known.measure([(contact, poses)])
    if classify_contact(*map(act.alone.face_of, contact)) in ("plane on plane", "shaft on plane"):
        e, n = residual(act.alone, contact, lie, poses)
        if way is not None and abs(n @ way) >= _ACROSS:
            return 0.0, 0.0
        return max(0.0, -1e3 * float(e.min())), max(0.0, 1e3 * float(e.max()))
    assert isinstance(lie, Mate)
    off = 1e3 * _off_axis_m(lie, way)
    return off, off


def _off_axis_m(lie: Mate, way: Array | None) -> float:
    """How far apart the axes of two round faces are, or their walls, across the way in."""
    if way is None:
        return lie.gap_m
    # Along the way the robot goes on until it feels contact, so only the part of each offset across it counts.
    beside = float(np.linalg.norm(lie.off - np.outer(lie.off @ way, way), axis=1).max())
    return beside if abs(lie.axis @ way) >= _ACROSS else max(beside, abs(lie.rise_m) * lie.sine)


def _side_mm(act: _Act) -> Array:
    """Largest |e| of the sides that the operation slides onto others, once its part rests, of each draw, (r,)."""
    touched = [contact for contact in act.operation.contacts if not enters(act.alone, contact)]
    found = residuals(act.known, touched, act.rests)
    worst = np.zeros(len(found))
    for i, contact in enumerate(touched):
        most = np.array([1e3 * np.abs(each[i][0]).max() for each in found])
        worst = np.maximum(worst, np.where(is_support(act.alone, contact, act.rests), 0.0, most))
    return worst
