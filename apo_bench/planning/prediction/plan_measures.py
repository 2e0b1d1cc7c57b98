"""Measures of a plan, operation by operation: how large an error is, and how large it may be.

- falls: at its goal the part would not stand.
- fit: misalignment of insertion contacts across the line of attach. Along it the robot moves on until contact.
- side: what stays open of a face once one corner touches, since a slide does not rotate the part. Supports have no
  such measure: weight closes them, however large the error.
- leans: without what lies above, the part would not stand, so it leans as far as clearances allow.
- on_way, from_above: penetration without a contact, at the goal, along the line of attach, and above the beginning of a
  level line. Parts that the operation brings into contact count only there, since their contacts cover the rest.
- gripper, own, tip: penetration of the open gripper; error of the arm alone; misalignment with that error. They need
  the motions of an arm (`ArmMove`), which the simulation computes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactMeasurements,
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
from apo_bench.planning.insertion.attach_line import Attach
from apo_bench.planning.prediction.arm_move import ArmMove
from apo_bench.planning.prediction.interference import (
    Solids,
    make_physical_solids,
    measure_depths_from_above,
    measure_depths_on_line,
)
from apo_bench.planning.prediction.measure import DrawnMeasure, Measure
from apo_bench.planning.prediction.rest_poses import (
    compute_residual,
    is_insertion,
    is_support,
    list_residuals,
    predict_rest_poses,
)
from apo_bench.planning.prediction.stability import BALANCED, measure_imbalance
from apo_bench.records import Thresholds

_AXIS_COSINE = 0.5
"""A face is a wall along the line of attach if the cosine of its normal with the line is smaller."""
_LEAST_BESIDE_MM = 1e-3
"""A smaller penetration is a touch; it absorbs rounding."""
_ROUNDING_MM = 1e-9
"""Lengths with a smaller difference are equal."""


class _PlannedOperation(NamedTuple):
    """One operation of the schedule, with the poses of all parts after it."""

    number: int
    """The operation, counted from 0."""
    alone: Assembly
    """The assembly with this operation only."""
    planned: Poses
    """Pose of every part after the operation by the plan, (4, 4), or by r robots with errors, (r, 4, 4)."""
    rests: Poses
    """The same once the parts have come to rest."""
    known: ContactMeasurements
    """Cache of the measured contacts of all operations."""

    @property
    def operation(self) -> Operation:
        return self.alone.operations[0]


def measure_plan(
    plan: Plan,
    clearance_mm: float,
    thresholds: Thresholds,
    attach: Sequence[Attach] = (),
    room_mm: float = 0.0,
    arm: Sequence[ArmMove] = (),
) -> Iterator[Measure]:
    """All measures of a plan, stability first, then operation by operation.

    The sequence of kinds depends on the schedule only, not on the poses.

    Args:
        room_mm: Stability is also checked with the centre of mass shifted by this distance to four sides.
        arm: As in `predict_failure`; reach is not measured here.
    """
    falls, of_acts = _measure_planned(plan, clearance_mm, thresholds, tuple(attach), room_mm)
    yield from falls
    for act, found in of_acts:
        yield from found
        fit = DrawnMeasure(act.number, "fit", np.array([found[0].size]), np.array([found[0].allowed]))
        yield from (each.first_draw() for each in _measure_arm(act, arm, attach, clearance_mm, thresholds, fit))


@remember
def _measure_planned(
    plan: Plan, clearance_mm: float, thresholds: Thresholds, attach: tuple[Attach, ...], room_mm: float
) -> tuple[tuple[Measure, ...], tuple[tuple[_PlannedOperation, tuple[Measure, ...]], ...]]:
    """The measures of a plan without an arm, cached, since a trial needs them three times.

    Returns:
        (falls, of_acts): one `falls` per operation; each operation with its other measures, of which the fit is the
        first.
    """
    acts = _list_planned_operations(plan)
    physical = make_physical_solids(plan.assembly, clearance_mm)
    falls = [
        Measure(act.number, "falls", measure_imbalance(act.known, act.operation, act.planned, 1e-3 * room_mm), BALANCED)
        for act in acts
    ]
    of_acts = []
    for act in acts:
        fit, side, *depths = (
            each.first_draw() for each in _measure_drawn_operation(act, clearance_mm, thresholds, attach, physical)
        )
        leans = list[Measure]()
        # A part that is moved again later may lean until then.
        stays = not any(act.operation.main in later.moves for later in plan.assembly.operations[act.number + 1 :])
        if stays and clearance_mm > thresholds.fit_margin_mm:
            size = measure_imbalance(act.known, act.operation, act.planned, 1e-3 * room_mm, ceilings=False)
            leans = [Measure(act.number, "leans", size, BALANCED)]
        of_acts.append((act, (fit, side, *leans, *depths)))
    return tuple(falls), tuple(of_acts)


def measure_drawn_plans(
    plan: Plan,
    clearance_mm: float,
    thresholds: Thresholds,
    attach: Sequence[Attach],
    arm: Sequence[ArmMove],
    brought: Sequence[Poses],
) -> Iterator[DrawnMeasure]:
    """The measures of a plan that robots with errors execute, without `falls` and `leans`.

    Args:
        arm: As in `predict_failure`; reach is not measured here.
        brought: Poses of every part, (r, 4, 4) for r robots, after each step of the schedule that is not an undo.
    """
    physical = make_physical_solids(plan.assembly, clearance_mm)
    for act in _list_planned_operations(plan, brought):
        fit, *others = _measure_drawn_operation(act, clearance_mm, thresholds, attach, physical)
        yield from (fit, *others, *_measure_arm(act, arm, attach, clearance_mm, thresholds, fit))


def _measure_drawn_operation(
    act: _PlannedOperation, clearance_mm: float, thresholds: Thresholds, attach: Sequence[Attach], physical: Solids
) -> Iterator[DrawnMeasure]:
    """The measures of one operation without an arm and without `falls` and `leans`; the fit is the first."""
    k = act.number
    how = attach[k] if attach else None
    fit = _measure_fit(act, how, clearance_mm, thresholds)
    same = np.ones_like(fit.size)
    yield fit
    yield DrawnMeasure(k, "side", _measure_side_errors(act), thresholds.support_mm * same)
    # A part that carries others would shift them, so it may penetrate less.
    deep_mm = thresholds.fit_margin_mm if act.operation.carries else thresholds.placed_part_shift_mm
    for depths_m in measure_depths_on_line(act.operation, act.planned, how, physical):
        yield DrawnMeasure(k, "on_way", 1e3 * depths_m, deep_mm * same)
    for depths_m in measure_depths_from_above(act.operation, act.planned, how, physical):
        yield DrawnMeasure(k, "from_above", 1e3 * depths_m, _LEAST_BESIDE_MM * same)


def _measure_arm(
    act: _PlannedOperation,
    arm: Sequence[ArmMove],
    attach: Sequence[Attach],
    clearance_mm: float,
    thresholds: Thresholds,
    fit: DrawnMeasure,
) -> Iterator[DrawnMeasure]:
    """The measures of one operation that depend on the arm.

    Args:
        fit: The fit without the errors of the arm.
    """
    same = np.ones_like(fit.size)
    how = attach[act.number] if attach else None
    for move in (move for move in arm if move.operation == act.number and not move.undo):
        allowed = thresholds.placed_part_shift_mm * same
        yield DrawnMeasure(act.number, "gripper", move.collision_mm * same, allowed, move.collides_with)
        yield from _measure_tip_errors(act, move, how, clearance_mm, thresholds, fit)


def _list_planned_operations(plan: Plan, brought: Sequence[Poses] = ()) -> tuple[_PlannedOperation, ...]:
    """The operations of the schedule, in order, with the poses after each; all contacts are measured in one call.

    Undo steps only change poses. What an undone part carries moves with it.

    Args:
        brought: Poses of every part, (r, 4, 4), by robots with errors, one per step that is not an undo; empty: the
            plan's.
    """
    acts = list[_PlannedOperation]()
    known = ContactMeasurements(plan.assembly)
    given_poses = iter(brought)
    planned = rests = plan.start
    origins = dict[int, tuple[Array, Array]]()  # operation -> (planned, resting) pose of its main part before it
    for (k, undo), target in zip(plan.schedule, plan.step_poses, strict=True):
        operation = plan.assembly.operations[k]
        alone = replace(plan.assembly, operations=(operation,))
        if undo:
            planned, rests = (_place_part(alone, *pair) for pair in zip((planned, rests), origins[k], strict=True))
            continue
        origins[k] = planned[operation.main], rests[operation.main]
        given = next(given_poses, None)
        planned, rests = [given] * 2 if given else (_place_part(alone, poses, target) for poses in (planned, rests))
        rests = predict_rest_poses(alone, operation, rests)
        acts.append(_PlannedOperation(k, alone, planned, rests, known))
    places = [(act.operation.contacts, poses) for act in acts for poses in (act.planned, act.rests)]
    known.measure((c, poses) for contacts, at in places for poses in list_alternatives(at) for c in contacts)
    return tuple(acts)


def _place_part(alone: Assembly, before: Poses, goal: Array) -> Poses:
    """The poses of all parts after the only operation of `alone` has put its main part at `goal`, (4, 4)."""
    return compute_placements(alone, before, goal[None])[0]


def _measure_fit(
    act: _PlannedOperation, how: Attach | None, clearance_mm: float, thresholds: Thresholds
) -> DrawnMeasure:
    """The fit of one operation: misalignment of the insertion contact that exceeds its limit the most.

    Per draw the size is the |e| across the line of attach, of nominal faces at the planned poses.
    """
    lengths = clearance_mm, thresholds.fit_margin_mm, thresholds.support_mm
    entering = [contact for contact in act.operation.contacts if is_insertion(act.alone, contact)]
    limits = [compute_deep_limit_mm(act.alone, contact, *lengths) for contact in entering]
    alternatives = list_alternatives(act.planned)
    act.known.measure((contact, poses) for poses in alternatives for contact in entering)
    worst = []
    for poses in alternatives:
        off = [_misfit_mm(act, contact, poses, how) for contact in entering]
        sides = [(0.0, clearance_mm + thresholds.fit_margin_mm)]  # pairs (size, limit); this one if nothing enters
        sides += [(deep, limit) for (deep, _), limit in zip(off, limits, strict=True)]
        most = max(sides, key=_excess_over_limit)
        # The limit for faces apart is at least that for faces deep. Its exact value takes a linear programme, which is
        # solved only if the contact may be the worst.
        for contact, (_, apart), limit in zip(entering, off, limits, strict=True):
            if apart > limit:
                if apart - limit <= _excess_over_limit(most) + _ROUNDING_MM:
                    continue
                limit = compute_apart_limit_mm(act.alone, contact, 0, poses, *lengths)
            most = max(most, (apart, limit), key=_excess_over_limit)
        worst.append(most)
    return DrawnMeasure(act.number, "fit", *np.array(worst).T)


def _excess_over_limit(side: tuple[float, float]) -> float:
    """Size less limit of a pair (size, limit)."""
    return side[0] - side[1]


def _measure_tip_errors(
    act: _PlannedOperation,
    move: ArmMove,
    how: Attach | None,
    clearance_mm: float,
    thresholds: Thresholds,
    planned: DrawnMeasure,
) -> Iterator[DrawnMeasure]:
    """The errors of insertion contacts due to the arm: of the arm alone (`own`), and with those of the plan (`tip`).

    Nothing is yielded if the arm has no error, or nothing is inserted.

    Args:
        planned: The fit without the errors of the arm.
    """
    as_planned = not move.beside_mm and np.array_equal(move.sag, np.eye(4))
    if as_planned or not any(is_insertion(act.alone, contact) for contact in act.operation.contacts):
        return
    moved = {part: move.sag @ act.planned[part] for part in act.operation.moves}
    off = _measure_fit(act._replace(planned=MappingProxyType({**act.planned, **moved})), how, clearance_mm, thresholds)
    # The arm alone must stay within the play; the plan's own errors may also use the margin.
    own = np.maximum(0.0, off.size - planned.size) + move.beside_mm
    yield DrawnMeasure(act.number, "own", own, np.maximum(off.allowed - thresholds.fit_margin_mm, 0.0))
    yield DrawnMeasure(act.number, "tip", off.size + move.beside_mm, off.allowed)


def _misfit_mm(act: _PlannedOperation, contact: Contact, poses: Poses, how: Attach | None) -> tuple[float, float]:
    """(deep, apart): the largest penetration and gap of a contact across the line of attach, [mm].

    For two round faces both are the offset of the axes across the line.
    """
    way = None if how is None else poses[act.operation.main][:3, :3] @ how.direction
    (lie,) = act.known.measure([(contact, poses)])
    if classify_contact(*map(act.alone.face_of, contact)) in ("plane on plane", "shaft on plane"):
        e, n = compute_residual(act.alone, contact, lie, poses)
        if way is not None and abs(n @ way) >= _AXIS_COSINE:
            # The face stops the motion along the line: contact ends it, whatever the planned error.
            return 0.0, 0.0
        return max(0.0, -1e3 * float(e.min())), max(0.0, 1e3 * float(e.max()))
    assert isinstance(lie, Mate)
    off = 1e3 * _measure_axis_offset(lie, way)
    return off, off


def _measure_axis_offset(lie: Mate, way: Array | None) -> float:
    """Offset of the axes (or walls) of two round faces across the line of attach `way`, [m]; in full without a line."""
    if way is None:
        return lie.gap_m
    # Along the line the robot moves on until contact, so only the offset across it counts.
    beside = float(np.linalg.norm(lie.offsets - np.outer(lie.offsets @ way, way), axis=1).max())
    return beside if abs(lie.axis @ way) >= _AXIS_COSINE else max(beside, abs(lie.rise_m) * lie.sine)


def _measure_side_errors(act: _PlannedOperation) -> Array:
    """The largest |e| of the contacts that the operation slides onto, once the part rests, of each draw, (r,), [mm]."""
    touched = [contact for contact in act.operation.contacts if not is_insertion(act.alone, contact)]
    found = list_residuals(act.known, touched, act.rests)
    worst = np.zeros(len(found))
    for i, contact in enumerate(touched):
        most = np.array([1e3 * np.abs(each[i][0]).max() for each in found])
        # Weight closes supports, so they do not count.
        worst = np.maximum(worst, np.where(is_support(act.alone, contact, act.rests), 0.0, most))
    return worst
