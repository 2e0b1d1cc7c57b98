"""Will a plan fail, where and why? Said before anything moves, from the plan, the sizes of the parts and the arm.

Four things are looked at. A goal at which a part would not stand. Contacts that are planned further off than the
judge allows: of faces that fit into one another, and of axes, those across the way in, since along it the robot goes on
until it feels contact; of sides that are slid onto each other what stays open once one corner touches, since the slide
does not turn the part; of supports none, since weight closes them however wrong the plan is. A part that stays where it
does not stand on what lies below alone: it leans as far as clearances let it. Parts that are planned into one another
where no contact is meant, at the goal or on the way in; of those that touch in the same operation the contacts have
told, except where a level way in begins: there a part comes down beside all others.

Where it is known what an arm makes of the plan (`prediction/arm.py`): whether it reaches all of it, whether its open
gripper has room, and whether contacts that would be near enough still are with the error of its tip.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from types import MappingProxyType
from typing import Literal, NamedTuple, final

import numpy as np

from apo_bench.assembly.goals import Plan, Poses, placements
from apo_bench.assembly.joint_play import joint_play_mm
from apo_bench.assembly.kinds import contact_kind, play_mm
from apo_bench.assembly.topology import Assembly, Contact, Operation
from apo_bench.geometry.arrays import Array
from apo_bench.insertion.line import Attach
from apo_bench.prediction.arm import ArmMove
from apo_bench.prediction.interference import depths_from_above, depths_on_way, physical_solids
from apo_bench.prediction.resting import between, enters, is_support, residual, resting_poses
from apo_bench.prediction.stability import BALANCED, imbalance
from apo_bench.records.thresholds import Thresholds

_Code = Literal[
    "ok",
    "residual",
    "interference",
    "unstable_goal",
    "unreachable_start",
    "unreachable",
    "gripper_room",
    "tip_error",
]
ARM_CODES = ("unreachable_start", "unreachable", "gripper_room", "tip_error")
"""Of what another arm could do."""
_ACROSS = 0.5
"""A face whose normal makes a smaller cosine with the way in is a wall beside it."""
_BESIDE_MM = 1e-3
"""Parts that are less deep in each other only touch, whatever was rounded."""
_CODES: Mapping[str, _Code] = MappingProxyType(
    {
        "falls": "unstable_goal",
        "fit": "residual",
        "side": "residual",
        "leans": "residual",
        "on_way": "interference",
        "from_above": "interference",
        "gripper": "gripper_room",
        "own": "tip_error",
        "tip": "tip_error",
    }
)
_CONTACTS_OFF = "its contacts are planned {:.2f} mm off, {:g} mm are allowed"
_WHY = MappingProxyType(
    {
        "falls": "the part would fall there",
        "fit": _CONTACTS_OFF,
        "side": _CONTACTS_OFF,
        "leans": "the part would lean against what lies above it, as far as both clearances let it",
        "on_way": "it would be {:.2f} mm deep in another part, {:g} mm are allowed",
        "from_above": "its way in begins {:.2f} mm deep in another part",
        "gripper": "the open gripper would be {:.2f} mm deep in '{what}', {:g} mm are allowed",
        "own": "the arm holds its way to {:.3f} mm only, and the play is {:g} mm",
        "tip": "with the error of the arm's tip its contacts are {:.2f} mm off, {:g} mm are allowed",
    }
)
_OUT_OF_REACH = MappingProxyType(
    {
        "unreachable_start": "the arm does not reach the part where it is taken",
        "unreachable": "the arm does not reach the goal, or the way to it",
    }
)


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
    """`residual`, `tip_error`: the |e| that is too large; `interference`, `gripper_room`: the depth; `ok`: the largest
    |e| of a contact that enters; None for an unstable goal, what would lean, and what is out of reach."""
    mendable: bool = False
    """Whether it may fit if directions are changed that contacts leave free."""


class _Doing(NamedTuple):
    """One operation about to be done, alone."""

    operation: int
    alone: Assembly
    before: Poses
    planned: Poses
    """Every part where the plan has it after the operation."""
    rests: Poses
    """Every part where it will have come to rest."""


class Measure(NamedTuple):
    """How far something is off, and how far it may be."""

    operation: int
    """Counted from 0."""
    kind: Literal["falls", "fit", "side", "leans", "on_way", "from_above", "gripper", "own", "tip"]
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
    def code(self) -> _Code:
        """What is said of it if it is too much."""
        return _CODES[self.kind]

    @property
    def why(self) -> str:
        """`it would be 7.59 mm deep in another part, 1 mm are allowed`."""
        return _WHY[self.kind].format(self.size, self.allowed, what=self.what)


def predict(
    plan: Plan,
    clearance_mm: float,
    thresholds: Thresholds,
    attach: Sequence[Attach] = (),
    arm: Sequence[ArmMove] = (),
) -> Prediction:
    """The first operation of the schedule that will fail.

    An unstable goal comes before everything else, and then what is out of reach, since a plan with one is not begun.

    Args:
        clearance_mm: Per side, of the parts that are used; fit contacts may be off by this and `fit_margin_mm`, a
            shaft in its hole by what the radii leave, too, others by `support_mm`; parts that should not touch may be
            as deep in each other as the judge lets one be pushed, `pushed_mm`, but only `fit_margin_mm` what carries
            others, which would shift on it, and not at all what comes down to where a level way in begins, and would
            stand there on another part.
        attach: The way in of each operation; without it every fit contact counts, and nothing but the goals.
        arm: What an arm makes of each operation; without it any arm will do.
    """
    worst_mm = 0.0
    refused = next((move for move in arm if move.refused is not None), None)
    measured = measures(plan, clearance_mm, thresholds, attach, arm=arm)
    for _, alike in groupby(measured, lambda one: (one.operation, one.kind)):
        worst = max(alike, key=lambda one: one.size)
        if refused is not None and worst.kind != "falls":
            return _out_of_reach(plan, refused)
        if worst.exceeded:
            main = plan.assembly.operations[worst.operation].main
            sentence = f"operation {worst.operation + 1} ({main}) will fail: {worst.why}"
            size_mm = None if worst.kind in ("falls", "leans") else float(worst.size)
            mendable = worst.kind not in ("fit", "side", "own", "tip")
            return Prediction(True, worst.operation, worst.code, sentence, size_mm, mendable)
        if worst.kind == "fit":
            worst_mm = max(worst_mm, worst.size)
    return Prediction(False, None, "ok", "every operation should fit", worst_mm)


def _out_of_reach(plan: Plan, move: ArmMove) -> Prediction:
    assert move.refused is not None
    main = plan.assembly.operations[move.operation].main
    why = _OUT_OF_REACH[move.refused]
    limit = f": its joint '{move.at_limit}' is at its limit" if move.at_limit else ""
    sentence = f"operation {move.operation + 1} ({main}) will fail: {why}{limit}"
    return Prediction(True, move.operation, move.refused, sentence, None, mendable=True)


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
    doings = tuple(_doings(plan))
    for doing in doings:
        size = imbalance(doing.alone, _operation(doing), doing.planned, 1e-3 * room_mm)
        yield Measure(doing.operation, "falls", size, BALANCED)
    physical = physical_solids(plan.assembly, clearance_mm)
    for doing in doings:
        how = attach[doing.operation] if attach else None
        k = doing.operation
        operation = _operation(doing)
        deep_mm = thresholds.fit_margin_mm if operation.carries else thresholds.pushed_mm
        yield _fit(doing, how, clearance_mm, thresholds)
        yield Measure(k, "side", _side_mm(doing), thresholds.support_mm)
        if _stays(plan.assembly, k) and clearance_mm > thresholds.fit_margin_mm:
            leans = imbalance(doing.alone, operation, doing.planned, 1e-3 * room_mm, ceilings=False)
            yield Measure(k, "leans", leans, BALANCED)
        for depth_m in depths_on_way(operation, doing.planned, how, physical):
            yield Measure(k, "on_way", 1e3 * depth_m, deep_mm)
        for depth_m in depths_from_above(operation, doing.planned, how, physical):
            yield Measure(k, "from_above", 1e3 * depth_m, _BESIDE_MM)
        for move in (each for each in arm if each.operation == k and not each.undo):
            yield Measure(k, "gripper", move.struck_mm, thresholds.pushed_mm, move.struck)
            yield from _tip(doing, move, how, clearance_mm, thresholds)


def _stays(assembly: Assembly, k: int) -> bool:
    """Whether the part that an operation moves stays there to the end."""
    main = assembly.operations[k].main
    return not any(main in later.moves for later in assembly.operations[k + 1 :])


def _doings(plan: Plan) -> Iterator[_Doing]:
    """What the schedule does, in order; undoing only changes where the parts are."""
    for (k, alone, before, planned), (_, _, _, rests) in zip(_walk(plan, False), _walk(plan, True), strict=True):
        yield _Doing(k, alone, before, planned, rests)


def _walk(plan: Plan, settling: bool) -> Iterator[tuple[int, Assembly, Poses, Poses]]:
    """Each operation alone, and all poses before and after; what it carries goes along, also when it is undone."""
    now = plan.start
    origin = dict[int, Array]()
    for (k, undo), target in zip(plan.schedule, plan.targets, strict=True):
        operation = plan.assembly.operations[k]
        before = now
        alone = replace(plan.assembly, operations=(operation,))
        if undo:
            (now,) = placements(alone, before, origin[k][None])
            continue
        origin[k] = before[operation.main]
        (now,) = placements(alone, before, target[None])
        now = resting_poses(alone, operation, now) if settling else now
        yield k, alone, before, now


def _fit(doing: _Doing, how: Attach | None, clearance_mm: float, thresholds: Thresholds) -> Measure:
    """The |e| across the way in, nominal faces as planned, of the contact that enters and exceeds its play the most."""
    k = doing.operation
    sides = [(0.0, clearance_mm + thresholds.fit_margin_mm)]
    for contact in _operation(doing).contacts:
        if enters(doing.alone, contact):
            a, b = map(doing.alone.face_of, contact)
            play = play_mm(a, b, clearance_mm)
            allowed = thresholds.support_mm if play is None else play + thresholds.fit_margin_mm
            deep_m, apart_m = _misfits_m(doing, contact, None if how is None else _way(doing, how))
            sides.append((1e3 * deep_m, allowed))
            if 1e3 * apart_m > allowed:
                play = joint_play_mm(doing.alone, contact, 0, doing.planned, clearance_mm)
                allowed = allowed if play is None else max(allowed, play + thresholds.fit_margin_mm)
            sides.append((1e3 * apart_m, allowed))
    size, allowed = max(sides, key=lambda each: each[0] - each[1])
    return Measure(k, "fit", size, allowed)


def _tip(
    doing: _Doing, move: ArmMove, how: Attach | None, clearance_mm: float, thresholds: Thresholds
) -> Iterator[Measure]:
    """Of what enters: how far off the arm alone is, which play must take, and how far with what is planned wrong."""
    if not any(enters(doing.alone, contact) for contact in _operation(doing).contacts):
        return
    moved = {part: move.sag @ doing.planned[part] for part in _operation(doing).moves}
    sagging = doing._replace(planned=MappingProxyType({**doing.planned, **moved}))
    planned, off = (_fit(each, how, clearance_mm, thresholds) for each in (doing, sagging))
    own = max(0.0, off.size - planned.size) + move.beside_mm
    yield Measure(doing.operation, "own", own, max(off.allowed - thresholds.fit_margin_mm, 0.0))
    yield Measure(doing.operation, "tip", off.size + move.beside_mm, off.allowed)


def _misfits_m(doing: _Doing, contact: Contact, way: Array | None) -> tuple[float, float]:
    """How deep and how far apart a contact is across a way at most; of round faces, twice, how far apart the axes are,
    across it.
    """
    a, b = map(doing.alone.face_of, contact)
    if contact_kind(a, b) not in ("plane on plane", "shaft on plane"):
        lie = between(doing.alone, contact, doing.planned)
        if way is None:
            return lie.gap_m, lie.gap_m
        beside = float(np.linalg.norm(lie.off - np.outer(lie.off @ way, way), axis=1).max())
        off = beside if abs(lie.axis @ way) >= _ACROSS else max(beside, abs(lie.rise_m) * lie.sine)
        return off, off
    e, n = residual(doing.alone, contact, doing.planned)
    if way is not None and abs(n @ way) >= _ACROSS:
        return 0.0, 0.0
    return max(0.0, -float(e.min())), max(0.0, float(e.max()))


def _side_mm(doing: _Doing) -> float:
    """Largest |e| of the sides that the operation slides onto others, once its part rests."""
    found = [0.0]
    for contact in _operation(doing).contacts:
        if not enters(doing.alone, contact) and not is_support(doing.alone, contact, doing.rests):
            found.append(1e3 * float(np.abs(residual(doing.alone, contact, doing.rests)[0]).max()))
    return max(found)


def _goal(doing: _Doing) -> Array:
    return doing.planned[_operation(doing).main]


def _way(doing: _Doing, how: Attach) -> Array:
    return np.asarray(_goal(doing)[:3, :3] @ how.direction)


def _operation(doing: _Doing) -> Operation:
    return doing.alone.operations[0]
