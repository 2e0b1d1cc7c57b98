"""From a plan to transfers: grasps, ways, guards. Uses what is known before the robot moves, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from apo_bench.assembly import ODL, Contact, product
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.clearance import physical_boxes
from apo_bench.geometry.overlap import overlap
from apo_bench.program import Plan, Poses, Step
from apo_bench.scenario import Grasp
from apo_bench.simulation.scene import Scene
from apo_bench.simulation.transfer import UP, Transfer, key_poses

GRAVITY = 9.81
PLACE_WEIGHTS, INSERT_WEIGHTS = 6.0, 2.5
"""Guards in weights: of the part that is put down; of the lightest part that an insertion could push along."""
SLOW_M = 0.003
WALL_MARGIN_M = 0.002


def transfers(plan: Plan, scene: Scene) -> tuple[Transfer, ...]:
    """One transfer per step of the schedule."""
    believed = dict(plan.start)
    before: dict[int, Array] = {}
    made = []
    for step in plan.schedule:
        part = plan.assembly.operations[step.operation].main
        if step.undo:
            target = before[step.operation]
        else:
            before[step.operation] = believed[part]
            target = plan.goals[step.operation]
        made.append(_transfer(plan, scene, step, believed, target))
        believed[part] = target
    return tuple(made)


def unreachable(scene: Scene, transfer: Transfer) -> bool:
    """Whether a tip pose that the transfer needs has no joint angles."""
    q = np.array(scene.arm.home)
    for T in key_poses(transfer):
        found = scene.kinematics.inverse(T, q)
        if found is None:
            return True
        q = found
    return False


def _transfer(plan: Plan, scene: Scene, step: Step, believed: Poses, target: Array) -> Transfer:
    operation = plan.assembly.operations[step.operation]
    attach = scene.scenario.attach[step.operation]
    way = plan.goals[step.operation][:3, :3] @ attach.direction
    out = UP
    if step.undo:
        way, out = -UP, (-way if abs(way[2]) < 0.5 else UP)
    part, start = operation.main, believed[operation.main]
    grasp = scene.scenario.grasps[step.operation]
    weight = GRAVITY * np.array([_mass(scene, p) for p in (part, *_neighbours(scene, operation.contacts, part))])
    return Transfer(
        part=part,
        T_world_start=start,
        T_world_goal=target,
        T_part_tip=_tip(scene, grasp, start, target),
        half_width=_half_width(scene, part, grasp),
        way_in=way,
        travel=0.05 if step.undo else attach.travel_m,
        way_out=out,
        travel_out=attach.travel_m,
        slow=SLOW_M if step.undo else _slow(plan, step.operation, way),
        place_n=PLACE_WEIGHTS * float(weight[0]),
        insert_n=INSERT_WEIGHTS * float(weight[1:].min(initial=weight[0])),
        raise_by=0.5e-3 * scene.clearance_mm,
    )


def _tip(scene: Scene, grasp: Grasp, start: Array, goal: Array) -> Array:
    """The tip in the part's frame: looking down, closing along `across`; of the two ways round, the easier one."""
    ahead = -start[:3, :3].T @ UP
    candidates = []
    for across in (grasp.across, -grasp.across):
        T = np.eye(4)
        T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = across, np.cross(ahead, across), ahead, grasp.point
        candidates.append(T)
    rest = scene.kinematics.forward(scene.arm.home)
    return min(candidates, key=lambda T: max(_turn(rest, start @ T), _turn(rest, goal @ T)))


def _turn(rest: Array, T: Array) -> float:
    """How far the tip is turned about the vertical from its rest, [rad]."""
    a, b = rest[:2, 0], T[:2, 0]
    return abs(float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)))


def _half_width(scene: Scene, part: str, grasp: Grasp) -> float:
    boxes = physical_boxes(scene.scenario.assembly.solids[part], scene.clearance_mm * 1e-3)
    far = max(float(grasp.across @ box.center + np.abs(grasp.across) @ box.half) for box in boxes)
    near = min(float(grasp.across @ box.center - np.abs(grasp.across) @ box.half) for box in boxes)
    return (far - near) / 2


def _slow(plan: Plan, k: int, way: Array) -> float:
    """How far before the goal a motion from above turns slow: where the first wall begins, or just above the floor."""
    odls = plan.assembly.odls()[k]
    depth = SLOW_M
    for contact in plan.assembly.operations[k].contacts:
        T, on = plan.goals[k], _pose(plan, odls, contact.environment.part)
        environment = plan.assembly.face(contact.environment)
        if abs(on[:3, :3] @ environment.normal @ way) < 0.5:
            corners = overlap(plan.assembly.face(contact.manipulated), T, environment, on).corners
            if len(corners):
                depth = max(depth, float(np.ptp(corners @ way)) + WALL_MARGIN_M)
    return depth


def _pose(plan: Plan, odls: Mapping[str, ODL], part: str) -> Array:
    return product(odls[part], plan.goals) if part in odls else plan.start[part]


def _neighbours(scene: Scene, contacts: tuple[Contact, ...], part: str) -> list[str]:
    fixed = scene.scenario.assembly.fixed
    ends = {contact.environment.part for contact in contacts}
    return sorted(end for end in ends if end not in fixed and end != part)


def _mass(scene: Scene, part: str) -> float:
    return float(scene.work.model.body_subtreemass[scene.work.body[part]])
