"""A plan in a robot's terms: poses of tip or flange in the frame of its base, motions with guards, mm.

The tip lies between the fingertips: z points ahead, x along the direction in which the fingers close. Each motion is a
straight line `from` a pose `to` a pose. One that is guarded ends where contact is felt against its direction, which
should be at `to`; it begins as far before as the plan comes from, or 5 mm where nothing else says so.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from apo_bench.assembly import Plan, placements
from apo_bench.formats.robot_frames import RobotFrames
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.scenario.scenario import Grasp, Scenario
from apo_bench.viz.plan_text import PlanLine

_SCHEMA = "apo-bench/robot-plan/1"
_GUARDED_FROM_M = 0.005
"""A guarded motion whose length nothing else says begins so far before contact."""
_BEYOND_M = 0.002
"""Contact is sought this far beyond where it should be."""
_ABOVE_M = 0.1
"""A part is approached from so far above, and left by so far back along the tip."""
_ALONG = 0.999


def robot_form(
    lines: Sequence[PlanLine], plan: Plan, scenario: Scenario, frames: RobotFrames, notes: Sequence[str] = ()
) -> dict[str, Any]:
    """What `json` can write: one entry per step, undone steps too, mm and unit vectors.

    Args:
        lines: Of the plan, step by step.
        notes: What is to be said with it.
    """
    poses: Mapping[str, Array] = plan.start
    to_base = pose.inverse(frames.T_world_base)
    steps = []
    history: list[Mapping[str, Array]] = []
    for line in lines:
        after = history.pop() if line.undo else _after(plan, line, poses)
        history += [] if line.undo else [poses]
        steps.append(_step(line, poses, after, plan, frames))
        poses = after
    return {
        "schema": _SCHEMA,
        "scenario": scenario.name,
        "poses": {
            "of": "tip" if frames.T_flange_tip is None else "flange",
            "in": "base",
            "position": "mm",
            "quaternion": frames.quaternion,
            "tip": "between the fingertips: z ahead, x along the direction in which the fingers close",
            "base_in_world": pose_form(frames.T_world_base, frames),
            "flange_to_tip": None if frames.T_flange_tip is None else pose_form(frames.T_flange_tip, frames),
        },
        "parts": {
            part: {"starts": pose_form(to_base @ T, frames), "fixed": part in plan.assembly.fixed}
            for part, T in plan.start.items()
        },
        "steps": steps,
        "notes": list(notes),
    }


def _after(plan: Plan, line: PlanLine, poses: Mapping[str, Array]) -> Mapping[str, Array]:
    """Where every part is when a step is done."""
    assert line.goal is not None
    return placements(
        type(plan.assembly)(plan.assembly.solids, (plan.assembly.operations[line.operation],), plan.assembly.fixed),
        poses,
        line.goal[None],
    )[0]


def _step(
    line: PlanLine,
    poses: Mapping[str, Array],
    after: Mapping[str, Array],
    plan: Plan,
    frames: RobotFrames,
) -> dict[str, Any]:
    part = line.what.main
    here = poses[part]
    goal = after[part]
    grip = tip_in_part(line.grasp, here)
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
            "tip_in_part": pose_form(grip, frames),
            "part_is_at_most_mm_wide": round(1e3 * width, 6),
        },
        "pick": {
            "above": tip_form(_shifted(tip, UP if line.grasp.ahead is None else -tip[:3, 2], _ABOVE_M), frames),
            "at": tip_form(tip, frames),
        },
        "motions": [
            *_departs(line, here, grip, frames),
            *_arrives(line, goal, grip, frames),
        ],
        "leave": tip_form(_shifted(end, end[:3, 2], -_ABOVE_M), frames),
        "part_at_goal": pose_form(pose.inverse(frames.T_world_base) @ goal, frames),
        "trouble": line.trouble or None,
    }


def tip_in_part(grasp: Grasp, T_world_part: Array) -> Array:
    """The tip in the frame of the part, (4, 4): looking down where the part stands like this, or as the grasp says."""
    # world -z in the frame of the part: z of the tip; x is the grasp's direction with what is along z taken out
    down = -T_world_part[2, :3] if grasp.ahead is None else grasp.ahead
    across = grasp.across - (grasp.across @ down) * down
    across = across / np.linalg.norm(across)
    T = np.eye(4)
    T[:3] = np.column_stack([across, np.cross(down, across), down, grasp.point])
    return T


def _departs(line: PlanLine, here: Array, grip: Array, frames: RobotFrames) -> list[dict[str, Any]]:
    """The motions by which the part leaves the contacts that it is in, one after the other."""
    motions = []
    to = here
    for macro in line.leaves.departs:
        at = to
        way = here[:3, :3] @ line.leaves.own(macro.direction)
        to = _shifted(at, way, macro.length_m or _GUARDED_FROM_M)
        motions.append(_motion(macro.name, False, at, to, way, grip, frames))
    return motions


def _arrives(line: PlanLine, goal: Array, grip: Array, frames: RobotFrames) -> list[dict[str, Any]]:
    """The motions by which the part comes to its goal: the last one ends there, each where the next one begins."""
    way_in = goal[:3, :3] @ line.comes.line.direction
    macros = list(line.comes.macros)
    if not macros:
        return [
            _motion("put down", False, _shifted(goal, way_in, -line.comes.line.travel_m), goal, way_in, grip, frames)
        ]
    motions = []
    begin = goal
    ways = [goal[:3, :3] @ line.comes.own(macro.direction) for macro in macros]
    # the first motion along the way in is as long as the plan's own way; others as long as their macro says
    along = next((i for i, way in enumerate(ways) if way @ way_in > _ALONG), None)
    for i, (macro, way) in reversed(list(enumerate(zip(macros, ways, strict=True)))):
        end = begin
        begin = _shifted(end, way, -(line.comes.line.travel_m if i == along else macro.length_m or _GUARDED_FROM_M))
        motions.append(_motion(macro.name, macro.guarded, begin, end, way, grip, frames))
    return motions[::-1]


def _motion(
    name: str, guarded: bool, begin: Array, end: Array, way: Array, grip: Array, frames: RobotFrames
) -> dict[str, Any]:
    direction = pose.inverse(frames.T_world_base)[:3, :3] @ way
    return {
        "macro": name,
        "from": tip_form(begin @ grip, frames),
        "to": tip_form(end @ grip, frames),
        "direction": (np.round(direction, 12) + 0.0).tolist(),
        "length_mm": round(1e3 * float(np.linalg.norm(end[:3, 3] - begin[:3, 3])), 6),
        "guarded": guarded,
        "seek_beyond_mm": 1e3 * _BEYOND_M if guarded else None,
    }


def tip_form(T_world_tip: Array, frames: RobotFrames) -> dict[str, Any]:
    """A pose of the tip, or of the flange that carries it, in the frame of the base."""
    T = pose.inverse(frames.T_world_base) @ T_world_tip
    return pose_form(T if frames.T_flange_tip is None else T @ pose.inverse(frames.T_flange_tip), frames)


def pose_form(T: Array, frames: RobotFrames) -> dict[str, Any]:
    packed = pose.pack(T)
    q = packed[3:] if frames.quaternion == "wxyz" else np.roll(packed[3:], -1)
    return {"position_mm": (packed[:3] * 1e3).round(9).tolist(), f"quaternion_{frames.quaternion}": q.tolist()}


def _shifted(T: Array, way: Array, far: float) -> Array:
    return pose.at(far * way) @ T
