"""The JSON forms of an observation and a plan: one each, versioned, in mm and degrees.

A file names its scenario, which carries the topology; the file itself carries numbers only. A pose is
`position_mm` [x, y, z] and `quaternion_wxyz` [w, x, y, z] in the world frame. Operations are numbered from 1.
A covariance is that of the body twist (x, y, z, rx, ry, rz) in mm and degrees.

ROBOT.toml: in which frames, and in which order of quaternions, a plan goes out to a robot.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, cast, final

import numpy as np

from apo_bench.assembly import Assembly, Observation, OutlierModel, Plan, Poses, SharedError, Step, Tails
from apo_bench.geometry import Array, pose
from apo_bench.io import read_toml, write_file
from apo_bench.scenario.contacts import read_any_pose

OBSERVATION_SCHEMA = "apo-bench/observation/2"
PLAN_SCHEMA = "apo-bench/plan/2"

TO_MM_DEG = np.array([1e3] * 3 + [180.0 / np.pi] * 3)

OUTLIER_KEYS = MappingProxyType(
    {
        "gross_rate": "gross",
        "broad_rate": "broad",
        "broad_times": "times",
        "wrong_relation_rate": "relation",
        "turned_share": "flip",
        "stale_share": "stale",
        "swapped_share": "swap",
        "shifted_share": "shift",
        "displaced_view_rate": "view",
        "repeat_rate": "repeat",
    }
)
"""Key of a form -> field of `OutlierModel`."""
Form = dict[str, Any]
"""What `json` can write."""


def observation_form(observation: Observation, scenario: str) -> Form:
    """The JSON form of an observation."""
    extra = [
        {"covariance_mm_deg": covariance_form(C), "seen": bool(s)}
        for C, s in zip(observation.covariance, observation.seen, strict=True)
    ]
    return {
        **_head(OBSERVATION_SCHEMA, scenario, observation.start),
        "gap_mm": observation.gap_m * 1e3,
        "play_mm": observation.play_m * 1e3,
        "operations": _operations_form(observation.assembly, observation.goals, extra),
        **({} if observation.outliers is None else {"outliers": _outliers_form(observation.outliers)}),
        "shared": [_shared_form(error) for error in observation.shared],
        **({} if observation.tails is None else {"tails": _tails_form(observation.tails)}),
    }


def plan_form(plan: Plan, scenario: str) -> Form:
    """The JSON form of a plan; a step has a pose of its own where that is not the goal of its operation."""
    return {
        **_head(PLAN_SCHEMA, scenario, plan.start),
        "operations": _operations_form(plan.assembly, plan.goals, [{}] * len(plan.assembly)),
        "schedule": [_step_form(plan, step, T) for step, T in zip(plan.schedule, plan.targets, strict=True)],
    }


def write_form(form: Form, path: str | Path) -> None:
    """Write a form as UTF-8 JSON.

    Raises:
        InputError: The file cannot be written.
    """
    write_file(path, json.dumps(form, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def _head(schema: str, scenario: str, start: Poses) -> Form:
    return {"schema": schema, "scenario": scenario, "start": {part: pose_form(T) for part, T in start.items()}}


def pose_form(T: Array) -> Form:
    """A pose (4, 4), [m], in mm and as a quaternion."""
    packed = pose.pack(T)
    return {"position_mm": (packed[:3] * 1e3).tolist(), "quaternion_wxyz": packed[3:].tolist()}


def covariance_form(C: Array) -> list[list[float]]:
    """A covariance (6, 6), [m, rad], in mm and degrees."""
    return (C * np.outer(TO_MM_DEG, TO_MM_DEG)).tolist()


def _outliers_form(outliers: OutlierModel) -> Form:
    camera = {} if outliers.camera_m is None else {"camera_mm": [1e3 * x for x in outliers.camera_m]}
    return {key: getattr(outliers, name) for key, name in OUTLIER_KEYS.items()} | camera


def _shared_form(error: SharedError) -> Form:
    """A shared error; without a frame its twist is in the frame of each part."""
    frame = {} if error.frame is None else {"frame": pose_form(error.frame), "local": error.local}
    correlation = {} if error.correlation is None else {"correlation": error.correlation.tolist()}
    return {
        "name": error.name,
        "operations": [k + 1 for k in error.operations],
        "covariance_mm_deg": covariance_form(error.covariance),
        **frame,
        **correlation,
    }


def _tails_form(tails: Tails) -> Form:
    """How errors are distributed: four numbers each, across and along the ray, tilt and turn about it."""
    units = TO_MM_DEG[[0, 0, 3, 3]]
    return {
        "axes": [frame.tolist() for frame in tails.frames],
        "scales_mm_deg": (tails.scales * units).tolist(),
        "degrees_of_freedom": tails.freedom.tolist(),
        "deviations_mm_deg": (np.sqrt(tails.variances) * units).tolist(),
        "limits_mm_deg": (tails.limits * units[[0, 2]]).tolist(),
        "joined": tails.joined,
    }


def _operations_form(assembly: Assembly, goals: Array, extra: list[Form]) -> list[Form]:
    return [
        {"operation": k + 1, "part": operation.main, **pose_form(goals[k]), **extra[k]}
        for k, operation in enumerate(assembly.operations)
    ]


def _step_form(plan: Plan, step: Step, target: Array) -> Form:
    own = {} if np.array_equal(target, plan.goals[step.operation]) else pose_form(target)
    return {"operation": step.operation + 1, "undo": step.undo, **own}


_SCHEMA = "apo-bench/robot/1"


@final
@dataclass(frozen=True, eq=False)
class RobotFrames:
    """Where a robot stands, what its poses are of, and how its quaternions are written."""

    T_world_base: Array = field(default_factory=lambda: np.eye(4))
    """(4, 4), [m]."""
    T_flange_tip: Array | None = None
    """(4, 4), [m]; None: poses are those of the tip."""
    quaternion: Literal["xyzw", "wxyz"] = "xyzw"


def read_robot_frames(path: str | Path) -> RobotFrames:
    """What a robot file states.

    Raises:
        InputError: Anything that is not as described, naming file and key.
    """
    top = read_toml(path, "robot file").fields_of(_SCHEMA, (), ("base", "flange_to_tip", "quaternion"))
    order = top["quaternion"].text() if "quaternion" in top else "xyzw"
    top["quaternion"].require(order in ("xyzw", "wxyz"), "xyzw or wxyz is needed")
    return RobotFrames(
        read_any_pose(top["base"]) if "base" in top else np.eye(4),
        read_any_pose(top["flange_to_tip"]) if "flange_to_tip" in top else None,
        cast(Literal["xyzw", "wxyz"], order),
    )
