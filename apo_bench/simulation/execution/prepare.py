"""Prepare the transfers of a plan: choose grips, lines and guards, and check that the arm reaches them.

Only information that is known before the robot moves is used.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Plan, Poses, Step
from apo_bench.geometry import Array, measure_extent, pose, remember
from apo_bench.planning.insertion.insertion_geometry import (
    OVER_M,
    WALL_MARGIN_M,
    list_entrance_distances,
    list_neighbours,
    list_slide_directions,
    measure_clearing_heights,
    measure_slow_stretch,
)
from apo_bench.scenario.attach_lines import list_nominal_operations
from apo_bench.simulation.execution.flat_placement import find_flat_placement
from apo_bench.simulation.execution.grips import centring_grips, squaring_grips, transfer_grips
from apo_bench.simulation.execution.side_touches import find_side_touches
from apo_bench.simulation.execution.transfer import (
    PUT_DOWN,
    SAFE_M,
    ApproachLine,
    Grip,
    Transfer,
    compute_transferred_poses,
    departure_motions,
    key_poses,
    motions,
    plan_arrival_line,
)
from apo_bench.simulation.robot import Trajectory, follow_waypoints, plan_waypoints, solve_end_angles
from apo_bench.simulation.scene import Scene, list_clamps

_GRAVITY = 9.81  # [m/s^2]
_PLACE_WEIGHTS = 6.0  # guard of putting down, in weights of the moved parts
_INSERT_WEIGHTS = 2.5  # guard of an insertion, in weights of the lightest part that it could push along
_SLIDE_WEIGHTS = 0.5  # guard of a slide, in weights of the lightest part at the side: friction of 0.8 holds 0.8 of them
_SEAT_N = 2.0  # least force limit of a motion that ends on the seat of a part that is clamped to a fixed one
_CARRIES = 0.1
"""A face carries weight if the vertical component of its normal is at least this."""
_FINGER_M = 0.01
"""Length of the fingers below the tip."""


class Move(NamedTuple):
    """A step of the schedule with its transfer; undoing an operation and repeating it at once is one move."""

    step: Step
    transfer: Transfer


@remember
def plan_moves(plan: Plan, scene: Scene, spiral: bool, probes: bool = False) -> tuple[Move, ...]:
    """Return the move of each step of the schedule.

    Cached, since both the plan check and the execution need the moves.

    Args:
        spiral: Whether the robot searches for a hole when a motion into it is stopped.
        probes: Whether the robot probes, which squares parts, lays them flat and searches in the last motion.
    """
    estimated: Poses = plan.start
    put_by: dict[str, int | None] = {}
    """Part -> the operation that put it where it is; None for its start."""
    before: dict[int, tuple[Array, int | None]] = {}
    """Operation -> pose of its part before it, (4, 4), and the operation that had put the part there."""
    prepared = []
    for i, (step, target) in enumerate(zip(plan.schedule, plan.step_poses, strict=True)):
        k = step.operation
        operation = plan.assembly.operations[k]
        again = plan.schedule[i + 1 : i + 2] == (Step(k),)
        # If the operation is repeated at once from above, the part goes straight to its new goal.
        if (
            step.undo
            and again
            and not plan_arrival_line(list_nominal_operations(scene.scenario)[k].after, plan.target_poses[k]).level
        ):
            continue
        was = put_by.get(operation.main)
        if step.undo:
            target, put_by[operation.main] = before.pop(k)
        else:
            before.setdefault(k, (estimated[operation.main], was))
            put_by[operation.main] = k
        after = compute_transferred_poses(operation, target, estimated)
        transfer = _transfer(plan.assembly, scene, step, was, target, estimated, after, spiral)
        if probes and not (step.undo or transfer.carried):
            transfer = _with_probing(plan.assembly, scene, k, transfer, estimated)
        prepared.append(Move(step, _turned_to_reach(scene, transfer)))
        estimated = after
    return tuple(prepared)


def _turned_to_reach(scene: Scene, transfer: Transfer) -> Transfer:
    """Return the transfer with its grips turned by a half turn if only that is in reach, else unchanged.

    The default arm (without `hand`) reaches the grips as they are, so it is not checked.
    """
    if scene.arm.hand is None or not solve_key_angles(transfer, scene).code:
        return transfer
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    other = tuple(Grip(grip.T_part_tip @ half_turn, grip.half_width) for grip in transfer.grips)
    turned = replace(transfer, grips=other)
    return transfer if solve_key_angles(turned, scene).code else turned


def in_reach(plan: Plan, scene: Scene) -> bool:
    """Whether the arm reaches both ends of every transfer of a plan."""
    return not any(solve_key_angles(move.transfer, scene).code for move in plan_moves(plan, scene, False))


def _transfer(
    assembly: Assembly,
    scene: Scene,
    step: Step,
    was: int | None,
    target: Array,
    estimated: Poses,
    after: Poses,
    spiral: bool,
) -> Transfer:
    """Return the transfer of one step.

    Args:
        was: The operation that put the part where it is, None if it stands where it started.
        target: Target pose of its main part, (4, 4), world.
        estimated: Estimated poses of all parts before the step.
        after: Their poses after it.
        spiral: Whether the robot searches for holes.
    """
    k, undo = step
    operation = assembly.operations[k]
    part = operation.main
    start = estimated[part]
    nominal = list_nominal_operations(scene.scenario)[k]
    # Contacts at the start and at the goal: before or after this operation, as the scenario states them.
    leaves = nominal.after if undo or was == k else nominal.before
    comes = nominal.before if undo else nominal.after
    contacts = tuple(each.contact for each in comes.touched)
    into = plan_arrival_line(comes, target)
    inserts = any(macro.inserts for macro in comes.macros)
    if undo and not into.level:  # back at its start the part is put down, whatever it touches there
        into = ApproachLine(PUT_DOWN.direction, PUT_DOWN.travel_m)
    out = plan_arrival_line(leaves, start)
    preferred = scene.scenario.grasps[k if was is None or not out.level else was]
    grips, out, into = transfer_grips(scene, part, preferred, out, into, estimated, after)
    macros = motions(comes, target, list_slide_directions(assembly, comes, after))
    top, bottom = measure_clearing_heights(assembly, operation.moves, estimated)
    # Height of the tip over the lowest point of the moved parts.
    hangs = float((start @ grips[0].T_part_tip)[2, 3]) - bottom
    mass = scene.work.model.body_subtreemass
    weight = {p: _GRAVITY * float(mass[scene.work.body[p]]) for p in scene.work.free}
    held = sum(weight[p] for p in operation.moves)
    ways = list_entrance_distances(assembly, comes, after, into.direction)
    # Slow from the first entrance on: at full speed the tip is up to 0.3 mm off its line, and strikes the rim.
    first = max(ways, default=0.0)
    clamps = list_clamps(scene.scenario)
    clamps_to = clamps.get(part, "") if operation.clamped and not undo else ""
    loose = [p for p in list_neighbours(contacts, operation.moves) if p in weight and p not in clamps]
    near = [weight[p] for p in loose]
    # A part that is clamped to a fixed one may be pressed against it; no other part could slide.
    seat_n = _SEAT_N if clamps_to in assembly.fixed else 0.0
    return Transfer(
        part=part,
        carried=operation.carries,
        T_world_start=start,
        T_world_goal=target,
        grips=grips,
        centring=() if undo or into.level else centring_grips(assembly, scene, k, grips[-1], macros, after),
        out=out,
        into=into,
        departs=departure_motions(leaves, start, list_slide_directions(assembly, leaves, estimated)),
        macros=macros,
        over=top + OVER_M + _FINGER_M,
        safe=max(SAFE_M, top + OVER_M + hangs),
        slow=max(measure_slow_stretch(assembly, comes, after, into.direction), first + WALL_MARGIN_M),
        entrances=ways,
        weight_n=held,
        place_n=_PLACE_WEIGHTS * held,
        insert_n=max(_INSERT_WEIGHTS * min(near, default=held), seat_n),
        slide_n=max(_SLIDE_WEIGHTS * min(near, default=held), seat_n),
        clearance=1e-3 * scene.clearance_mm,
        clamps_to=clamps_to,
        lands=not operation.clamped or any(each.normal[2] > _CARRIES for each in comes.touched),
        roofed=any(each.normal[2] < -_CARRIES for each in comes.touched),
        front=_front(scene, part, operation.moves, after, into.direction) if spiral and inserts else None,
    )


def _with_probing(assembly: Assembly, scene: Scene, k: int, t: Transfer, estimated: Poses) -> Transfer:
    """Return the transfer of a robot that probes.

    A part that is enclosed at its start, or touches another at its side, is neither squared nor laid down there.
    """
    free = not (t.out.level or t.away or t.drawn)
    laid = t.into.level or (bool(t.entrances) and free)
    flat = find_flat_placement(assembly, scene, t, estimated) if laid else None
    side_touches = (
        () if flat is None or t.into.level else find_side_touches(assembly, scene, t, flat.T[:3, :3], estimated)
    )
    return replace(
        t,
        in_last=True,
        squaring=squaring_grips(assembly, scene, k, t.grips[0], estimated) if free else (),
        flat=flat,
        side_touches=side_touches,
    )


def _front(scene: Scene, part: str, moves: tuple[str, ...], poses: Poses, direction: Array) -> Array:
    """Return the foremost point of the moved parts in the frame of the main part, (3,), [m].

    This is the middle of their bounding box in that frame, moved to their foremost end along the direction.

    Args:
        part: The main part.
        moves: All parts that move, the main part included.
        poses: Poses of all parts at the goal.
        direction: Unit vector of the insertion, (3,), world.
    """
    T = {p: pose.inverse(poses[part]) @ poses[p] for p in moves}

    def ends(axis: Array) -> tuple[float, float]:
        """Least and greatest coordinate of the moved parts along an axis of the main part, [m]."""
        spans = [np.add(measure_extent(scene.pieces[p], axis @ T[p][:3, :3]), axis @ T[p][:3, 3]) for p in moves]
        return float(np.min(spans)), float(np.max(spans))

    middle = np.array([np.mean(ends(axis)) for axis in np.eye(3)])
    ahead = poses[part][:3, :3].T @ direction
    return np.asarray(middle + (ends(ahead)[1] - middle @ ahead) * ahead)


class KeyAngles(NamedTuple):
    """Joint angles at the key tip poses of a transfer, [rad]."""

    code: str
    """Empty if all are in reach; else `unreachable_start` or `unreachable`, by the first pose that is not."""
    reached: tuple[Array, ...]
    """Joint angles, (joints,) each, at the poses before the first one out of reach."""
    ended: Array
    """Joint angles, (joints,), at which the last solution of inverse kinematics ended, also without success."""


@remember
def solve_key_angles(transfer: Transfer, scene: Scene) -> KeyAngles:
    """Solve inverse kinematics at the key tip poses of a transfer, in their order, from the home position.

    Cached, since both the failure prediction and the execution need the result.
    """
    q = np.array(scene.arm.home)
    before = None
    reached = list[Array]()
    taken, put = key_poses(transfer)
    for T in (*taken, *put):
        there = scene.kinematics.inverse(T, q)
        if there is None and scene.arm.hand is not None:
            # Along a line from the pose before, since a direct solution may end at a joint limit.
            start = scene.kinematics.forward(q) if before is None else before
            there = solve_end_angles(scene.kinematics, Trajectory(start, T, 1.0, np.asarray), 0.0, 1.0, q)
        if there is None:
            break
        q = there
        before = T
        reached.append(q)
    if len(reached) == len(taken + put) and scene.arm.hand is not None:
        # The way through the air, from the last pose at the start to the first at the goal, must be in reach too.
        k = len(taken)
        direction = plan_waypoints(scene.kinematics, scene.arm, taken[-1], put[0], reached[k - 1])
        if follow_waypoints(scene.kinematics, taken[-1], direction, reached[k - 1]) is None:
            reached = reached[:k]
    if len(reached) == len(taken + put):
        return KeyAngles("", tuple(reached), q)
    code = "unreachable_start" if len(reached) < len(taken) else "unreachable"
    return KeyAngles(code, tuple(reached), scene.kinematics.last)
