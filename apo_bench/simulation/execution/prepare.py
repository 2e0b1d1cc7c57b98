"""From a plan to transfers: grasps, ways, guards. Uses what is known before the robot moves, and nothing else."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.goals import Plan, Poses, Step
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, remembered
from apo_bench.geometry.clearance import physical_pieces
from apo_bench.geometry.solid import extent
from apo_bench.insertion.surroundings import (
    OVER_M,
    ends_of,
    later_walls,
    mouths,
    neighbours,
    slide_directions,
    slow_before,
)
from apo_bench.scenario.nominal import nominal_operations
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.execution.grasping import (
    Grips,
    RestingPart,
    Stroke,
    clear_across,
    grasp_at,
    grips_along,
    half_width,
    obstacles,
    tip_frame,
)
from apo_bench.simulation.execution.motions import PUT_DOWN, arrival_line, departure_motions, motions
from apo_bench.simulation.execution.transfer import SAFE_M, ApproachLine, Grip, Motion, Transfer, key_poses
from apo_bench.simulation.robot.paths import Trajectory, turn_from
from apo_bench.simulation.robot.reach import at_end
from apo_bench.simulation.scene.scene import Scene

_GRAVITY = 9.81
_PLACE_WEIGHTS = 6.0
_INSERT_WEIGHTS = 2.5
_SLIDE_WEIGHTS = 0.5
"""Guards in weights: of what is put down; of the lightest part that an insertion could push along; of the lightest
part at the side, which a friction of 0.8 holds against 0.8 of its weight."""
_FINGER_M = 0.01
"""How far fingers reach below their tip."""


class Move(NamedTuple):
    """A step of the schedule with its transfer; undoing and doing again at once is one move."""

    step: Step
    transfer: Transfer


class KeyAngles(NamedTuple):
    """Joint angles at the tip poses of a transfer that must be in reach, [rad]."""

    code: str
    """Of the first end at which a tip pose has no joint angles, empty where all have."""
    reached: tuple[Array, ...]
    """(joints,) each, at the poses before that."""
    ended: Array
    """Where the search for the last of them ended, (joints,)."""


class _Task(NamedTuple):
    """One transfer to be prepared, in terms of the plan."""

    step: Step
    was: int | None
    """The operation that had put the part where it is, None if it stands where it started."""
    target: Array


@remembered
def moves(plan: Plan, scene: Scene, searches: bool = False) -> tuple[Move, ...]:
    """What to do for each step of the schedule; what moves with a part is believed to stay with it.

    Remembered, since a plan is looked at whether the arm reaches it, and then carried out.

    Args:
        searches: Whether the robot feels for a hole where a motion into it is stopped.
    """
    believed: Poses = dict(plan.start)
    made = []
    for task in _tasks(plan, scene):
        operation = plan.assembly.operations[task.step.operation]
        made.append(Move(task.step, _turned_to_reach(scene, _transfer(plan, scene, task, believed, searches))))
        T = task.target @ pose.inverse(believed[operation.main])
        believed = {**believed, **{part: T @ believed[part] for part in operation.moves}}
    return tuple(made)


def unreachable(scene: Scene, transfer: Transfer) -> str:
    """The code of the first end of the transfer at which a tip pose has no joint angles, `` where all have."""
    return key_angles(transfer, scene).code


@remembered
def key_angles(transfer: Transfer, scene: Scene) -> KeyAngles:
    """Joint angles at the tip poses that must be in reach; remembered, since who foretells a transfer and who carries
    it out ask for the same."""
    q = np.array(scene.arm.home)
    before = None
    reached = list[Array]()
    for code, poses in zip(("unreachable_start", "unreachable"), key_poses(transfer), strict=True):
        for T in poses:
            found = scene.kinematics.inverse(T, q)
            if found is None and scene.arm.hand is not None:
                found = _reached_on_the_way(scene, before, T, q)
            if found is None:
                return KeyAngles(code, tuple(reached), scene.kinematics.last)
            q = found
            before = T
            reached.append(q)
    return KeyAngles("", tuple(reached), q)


def _reached_on_the_way(scene: Scene, before: Array | None, T: Array, q: Array) -> Array | None:
    """Joint angles at T, step by step from where the tip was: a leap may end at the limit of a joint."""
    start = scene.kinematics.forward(q) if before is None else before
    return at_end(scene.kinematics, Trajectory(start, T, 1.0, np.asarray), 0.0, 1.0, q)


def _turned_to_reach(scene: Scene, transfer: Transfer) -> Transfer:
    """The transfer with its grips the other way round, where only that is in reach; the usual arm has room for one."""
    if scene.arm.hand is None or not unreachable(scene, transfer):
        return transfer
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    other = tuple(Grip(grip.T_part_tip @ half_turn, grip.half_width) for grip in transfer.grips)
    turned = replace(transfer, grips=other)
    return transfer if unreachable(scene, turned) else turned


def in_reach(plan: Plan, scene: Scene) -> bool:
    """Whether the arm reaches both ends of every transfer of a plan."""
    return not any(unreachable(scene, move.transfer) for move in moves(plan, scene, False))


def _tasks(plan: Plan, scene: Scene) -> list[_Task]:
    """The schedule with its targets: an undone part goes back to where it was, unless it is done again at once.

    Operations are undone in reverse order, so the place a part came from is free again, and the arm has reached it.
    """
    at: Poses = dict(plan.start)
    put: dict[str, int] = {}
    before: dict[int, tuple[Array, int | None]] = {}
    tasks = []
    for i, (step, target) in enumerate(zip(plan.schedule, plan.targets, strict=True)):
        k = step.operation
        operation = plan.assembly.operations[k]
        again = i + 1 < len(plan.schedule) and plan.schedule[i + 1] == Step(k) and not _is_level(plan, scene, k)
        if step.undo and again:
            continue
        if step.undo:
            target, was = before.pop(k)
        else:
            was = put.get(operation.main)
            before.setdefault(k, (at[operation.main], was))
        tasks.append(_Task(step, put.get(operation.main), target))
        T = target @ pose.inverse(at[operation.main])
        at = {**at, **{part: T @ at[part] for part in operation.moves}}
        put[operation.main] = k
        if step.undo:
            put.pop(operation.main)
            if was is not None:
                put[operation.main] = was
    return tasks


def _transfer(plan: Plan, scene: Scene, task: _Task, believed: Poses, searches: bool) -> Transfer:
    k, undo = task.step
    operation = plan.assembly.operations[k]
    part = operation.main
    start = believed[operation.main]
    target = task.target
    T = target @ pose.inverse(start)
    after = {**believed, **{p: T @ believed[p] for p in operation.moves}}
    what = nominal_operations(scene.scenario)[k]
    leaves = what.after if undo or task.was == k else what.before
    comes = what.before if undo else what.after
    contacts = tuple(each.contact for each in comes.touched)
    into = arrival_line(comes, target)
    inserts = any(macro.inserts for macro in comes.macros)
    if undo and not into.level:
        into = ApproachLine(PUT_DOWN.direction, PUT_DOWN.travel_m)
    grips, out, into = _grips(scene, task, part, arrival_line(leaves, start), into, believed, after)
    macros = motions(comes, target, slide_directions(plan.assembly, comes, after))
    top, bottom = ends_of(plan.assembly, operation.moves, believed)
    hangs = float((start @ grips[0].T_part_tip)[2, 3]) - bottom
    weight = {p: _GRAVITY * _mass(scene, p) for p in scene.work.free}
    held = sum(weight[p] for p in operation.moves)
    near = [weight[p] for p in neighbours(contacts, operation.moves) if p in weight]
    return Transfer(
        part=part,
        carried=operation.carries,
        T_world_start=start,
        T_world_goal=target,
        grips=grips,
        centring=() if undo or into.level else _centring(plan.assembly, scene, k, grips[-1], macros, after),
        out=out,
        into=into,
        departs=departure_motions(leaves, start, slide_directions(plan.assembly, leaves, believed)),
        macros=macros,
        over=top + OVER_M + _FINGER_M,
        safe=max(SAFE_M, top + OVER_M + hangs),
        slow=slow_before(plan.assembly, comes, after, into.way),
        mouths=mouths(plan.assembly, comes, after, into.way),
        weight_n=held,
        place_n=_PLACE_WEIGHTS * held,
        insert_n=_INSERT_WEIGHTS * min(near, default=held),
        slide_n=_SLIDE_WEIGHTS * min(near, default=held),
        clearance=1e-3 * scene.clearance_mm,
        front=_front(scene, part, operation.moves, after, into.way) if searches and inserts else None,
    )


def _front(scene: Scene, part: str, moves: tuple[str, ...], poses: Poses, way: Array) -> Array:
    """The middle of where what moves ends ahead, in the frame of its main part, (3,), [m]."""
    T = {p: pose.inverse(poses[part]) @ poses[p] for p in moves}

    def ends(axis: Array) -> tuple[float, float]:
        found = [np.add(extent(scene.pieces[p], axis @ T[p][:3, :3]), axis @ T[p][:3, 3]) for p in moves]
        return float(np.min(found)), float(np.max(found))

    middle = np.array([np.mean(ends(axis)) for axis in np.eye(3)])
    ahead = poses[part][:3, :3].T @ way
    return np.asarray(middle + (ends(ahead)[1] - middle @ ahead) * ahead)


def _is_level(plan: Plan, scene: Scene, k: int) -> bool:
    return arrival_line(nominal_operations(scene.scenario)[k].after, plan.goals[k]).level


def _grips(
    scene: Scene, task: _Task, part: str, out: ApproachLine, into: ApproachLine, believed: Poses, after: Poses
) -> tuple[tuple[Grip, ...], ApproachLine, ApproachLine]:
    """Where to hold the part, and both lines with the place where the grip changes."""
    solids = scene.scenario.assembly.solids
    preferred = scene.scenario.grasps[task.step.operation]
    if task.was is not None and out.level:
        preferred = scene.scenario.grasps[task.was]
    start = RestingPart(believed[part], obstacles(solids, believed, (part,)))
    goal = RestingPart(after[part], obstacles(solids, after, (part,)))
    if into.level:
        stroke = Stroke(goal.T, into.way, into.travel, goal.around)
        found = grips_along(scene, part, preferred, (start,), stroke)
        into = ApproachLine(into.way, into.travel, found.left)
    elif out.level:
        stroke = Stroke(start.T, out.way, out.travel, start.around)
        backwards = grips_along(scene, part, preferred, (goal,), stroke)
        found = Grips(backwards.second or backwards.first, backwards.left, backwards.first)
        out = ApproachLine(out.way, out.travel, backwards.left)
    else:
        found = Grips(grasp_at(scene, part, preferred, (start, goal)))
    grasps = (found.first, found.second) if found.left is not None and found.second is not None else (found.first,)
    return tuple(_grip(scene, part, grasp, start.T, goal.T) for grasp in grasps), out, into


def _grip(scene: Scene, part: str, grasp: Grasp, start: Array, goal: Array) -> Grip:
    """The grasp as a pose of the tip; of the two ways round, the one that turns the wrist less."""
    other = Grasp(grasp.point, -grasp.across)
    rest = scene.kinematics.forward(scene.arm.home)
    tips = [tip_frame(each, start) for each in (grasp, other)]
    tip = min(tips, key=lambda T: max(abs(turn_from(rest, start @ T)), abs(turn_from(rest, goal @ T))))
    pieces = physical_pieces(scene.scenario.assembly.solids[part], scene.clearance_mm * 1e-3)
    return Grip(tip, half_width(pieces, grasp, start))


def _centring(
    assembly: Assembly, scene: Scene, k: int, grip: Grip, macros: tuple[Motion, ...], after: Poses
) -> tuple[Grip, ...]:
    """Grips across the level directions in which the part's place will matter and nothing has settled it.

    Closing fingers centre a part in their own direction only; along them it has drifted in the hand. What fits into
    or onto the part later needs it in its place across the walls of that fit.
    """
    part = assembly.operations[k].main
    T = after[assembly.operations[k].main]
    sides = [macro.way for macro in macros if macro.name == "slide-to-contact"]
    settled = [T[:3, :3] @ grip.T_part_tip[:3, 0], *sides]
    place = RestingPart(T, obstacles(assembly.solids, after, (part,)))
    grips = []
    for wall in later_walls(assembly, k, part):
        if abs((T[:3, :3] @ wall)[2]) < 0.5 and all(abs(T[:3, :3] @ wall @ way) < 0.5 for way in settled):
            settled.append(T[:3, :3] @ wall)
            grasp = clear_across(scene, part, wall, place)
            grips += [] if grasp is None else [_grip(scene, part, grasp, T, T)]
    return tuple(grips)


def _mass(scene: Scene, part: str) -> float:
    return float(scene.work.model.body_subtreemass[scene.work.body[part]])
