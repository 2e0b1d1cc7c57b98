"""A plan as a robot executes it: poses of tip or flange in the frame of its base, motions with guards, in mm.

The tip is between the fingertips: z points ahead, x along the direction in which the fingers close. Each motion is a
straight line `from` a pose `to` a pose. A guarded motion ends when the robot measures contact against its direction,
which is expected at `to`. It begins at the plan's distance before that, or 5 mm if the plan states none.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from apo_bench.assembly import Plan, Poses, compute_placements
from apo_bench.formats.robot_frames import RobotFrames
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.scenario import Grasp, Scenario
from apo_bench.viz.plan_text import PlanLine

_SCHEMA = "apo-bench/robot-plan/1"
_GUARDED_FROM_M = 0.005  # length of a guarded motion for which the plan states none
_BEYOND_M = 0.002  # how far a guarded motion continues beyond the expected contact
_ABOVE_M = 0.1  # height of the approach above the grasp, and length of the retreat along the tip
_ALONG = 0.999  # directions whose cosine is larger count as equal


def make_robot_form(
    lines: Sequence[PlanLine], plan: Plan, scenario: Scenario, frames: RobotFrames, notes: Sequence[str] = ()
) -> dict[str, Any]:
    """Return a plan as a JSON object with an entry for each step, undone steps included; mm and unit vectors.

    Args:
        lines: The steps of the plan, of `list_plan_lines`.
        notes: Assumptions of the plan and objections to it, one sentence each.
    """
    assembly = plan.assembly
    poses = plan.start
    steps = []
    history: list[Poses] = []  # poses before each done operation, to which undoing it returns
    for line in lines:
        if line.target is None:
            after = history.pop()
        else:
            history.append(poses)
            one = type(assembly)(assembly.solids, (assembly.operations[line.operation],), assembly.fixed)
            after = compute_placements(one, poses, line.target[None])[0]
        steps.append(_make_step_form(line, poses[line.what.main], after[line.what.main], plan, frames))
        poses = after
    to_base = pose.inverse(frames.T_world_base)
    return {
        "schema": _SCHEMA,
        "scenario": scenario.name,
        "poses": {
            "of": "tip" if frames.T_flange_tip is None else "flange",
            "in": "base",
            "position": "mm",
            "quaternion": frames.quaternion,
            "tip": "between the fingertips: z ahead, x along the direction in which the fingers close",
            "base_in_world": format_robot_pose(frames.T_world_base, frames),
            "flange_to_tip": None if frames.T_flange_tip is None else format_robot_pose(frames.T_flange_tip, frames),
        },
        "parts": {
            part: {"starts": format_robot_pose(to_base @ T, frames), "fixed": part in plan.assembly.fixed}
            for part, T in plan.start.items()
        },
        "steps": steps,
        "notes": list(notes),
    }


def _make_step_form(line: PlanLine, here: Array, goal: Array, plan: Plan, frames: RobotFrames) -> dict[str, Any]:
    """Return a step that moves its main part.

    Args:
        here, goal: Pose of the part before and after, (4, 4), world, [m].
    """
    part = line.what.main
    grip = compute_tip_in_part(line.grasp, here)
    # extent of the part's bounding box along the closing direction: an upper bound of the width between the fingers
    width = float(np.abs(line.grasp.across) @ np.ptp(plan.assembly.solids[part].bounds, axis=0))
    tip = here @ grip
    end = goal @ grip
    contacts = () if line.undo else plan.assembly.operations[line.operation].contacts
    return {
        "operation": line.operation + 1,
        "undo": line.undo,
        "part": part,
        "carries": list(line.what.carries),
        "makes": [str(contact) for contact in contacts],
        "grasp": {
            "tip_in_part": format_robot_pose(grip, frames),
            "part_is_at_most_mm_wide": round(1e3 * width, 6),
        },
        "pick": {
            "above": make_tip_form(_translate(tip, UP if line.grasp.ahead is None else -tip[:3, 2], _ABOVE_M), frames),
            "at": make_tip_form(tip, frames),
        },
        "motions": [
            *_list_departure_motions(line, here, grip, frames),
            *_list_arrival_motions(line, goal, grip, frames),
        ],
        "leave": make_tip_form(_translate(end, end[:3, 2], -_ABOVE_M), frames),
        "part_at_goal": format_robot_pose(pose.inverse(frames.T_world_base) @ goal, frames),
        "trouble": line.obstacle or None,
    }


def compute_tip_in_part(grasp: Grasp, T_world_part: Array) -> Array:
    """Return the pose of the tip in the frame of the part, (4, 4), [m].

    The tip looks along `grasp.ahead`, or else straight down at a part of pose `T_world_part`.
    """
    # world -z in the frame of the part is the tip's z axis; its x axis is the part of `across` perpendicular to that
    down = -T_world_part[2, :3] if grasp.ahead is None else grasp.ahead
    across = grasp.across - (grasp.across @ down) * down
    across = across / np.linalg.norm(across)
    T = np.eye(4)
    T[:3] = np.column_stack([across, np.cross(down, across), down, grasp.point])
    return T


def _list_departure_motions(line: PlanLine, here: Array, grip: Array, frames: RobotFrames) -> list[dict[str, Any]]:
    """Return the motions by which the part leaves its contacts, in order, each from the end of the one before.

    Args:
        here: Pose of the part before them, (4, 4), world, [m].
        grip: Pose of the tip in the frame of the part, (4, 4), [m].
    """
    motions = []
    end = here
    for macro in line.leaves.departs:
        begin = end
        way = here[:3, :3] @ line.leaves.to_part_frame(macro.direction)
        end = _translate(begin, way, macro.length_m or _GUARDED_FROM_M)
        motions.append(_make_motion_form(macro.name, False, begin, end, way, grip, frames))
    return motions


def _list_arrival_motions(line: PlanLine, goal: Array, grip: Array, frames: RobotFrames) -> list[dict[str, Any]]:
    """Return the motions by which the part arrives, in order, the last of which ends at the goal.

    Args:
        goal: Pose of the part at the end, (4, 4), world, [m].
        grip: Pose of the tip in the frame of the part, (4, 4), [m].
    """
    axis = goal[:3, :3] @ line.comes.line.direction
    macros = list(line.comes.macros)
    if not macros:
        return [
            _make_motion_form(
                "put down", False, _translate(goal, axis, -line.comes.line.travel_m), goal, axis, grip, frames
            )
        ]
    motions = []
    begin = goal
    ways = [goal[:3, :3] @ line.comes.to_part_frame(macro.direction) for macro in macros]
    # the first motion along the insertion axis has its travel; others have the length of their macro
    along = next((i for i, way in enumerate(ways) if way @ axis > _ALONG), None)
    # from the goal backwards, since only the last pose is known
    for i, (macro, way) in reversed(list(enumerate(zip(macros, ways, strict=True)))):
        end = begin
        begin = _translate(end, way, -(line.comes.line.travel_m if i == along else macro.length_m or _GUARDED_FROM_M))
        motions.append(_make_motion_form(macro.name, macro.guarded, begin, end, way, grip, frames))
    return motions[::-1]


def _make_motion_form(
    name: str, guarded: bool, begin: Array, end: Array, way: Array, grip: Array, frames: RobotFrames
) -> dict[str, Any]:
    """Return a straight motion of the part from `begin` to `end`, (4, 4), world, in direction `way`, (3,), world."""
    direction = pose.inverse(frames.T_world_base)[:3, :3] @ way
    return {
        "macro": name,
        "from": make_tip_form(begin @ grip, frames),
        "to": make_tip_form(end @ grip, frames),
        "direction": (np.round(direction, 12) + 0.0).tolist(),
        "length_mm": round(1e3 * float(np.linalg.norm(end[:3, 3] - begin[:3, 3])), 6),
        "guarded": guarded,
        "seek_beyond_mm": 1e3 * _BEYOND_M if guarded else None,
    }


def make_tip_form(T_world_tip: Array, frames: RobotFrames) -> dict[str, Any]:
    """Return a pose of the tip, or of the flange that carries it, in the frame of the base.

    Args:
        T_world_tip: (4, 4), world, [m].
    """
    T = pose.inverse(frames.T_world_base) @ T_world_tip
    return format_robot_pose(T if frames.T_flange_tip is None else T @ pose.inverse(frames.T_flange_tip), frames)


def format_robot_pose(T: Array, frames: RobotFrames) -> dict[str, Any]:
    """Return a pose, (4, 4), [m], in mm, with the quaternion in the order of the robot."""
    packed = pose.pack(T)
    q = packed[3:] if frames.quaternion == "wxyz" else np.roll(packed[3:], -1)  # xyzw if not wxyz
    return {"position_mm": (packed[:3] * 1e3).round(9).tolist(), f"quaternion_{frames.quaternion}": q.tolist()}


def _translate(T: Array, way: Array, far: float) -> Array:
    """Translate a pose by `far` [m] along a unit vector of the world."""
    return pose.at(far * way) @ T
