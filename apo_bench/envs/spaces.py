"""Observation and action space of `APOReplay-v0`.

What a learner sees of one operation, and the space that it is in: `docs/guide/insertion.md` has every number.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from apo_bench.assembly import Observation, Plan
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.simulation.task.tip_control import PERIOD_S, TipControl

ROOM_M = 2.0
"""Every goal lies within this of the origin, per axis; a gross outlier beyond is given at the wall of this room."""
LARGEST_DEVIATION = np.repeat([0.5, np.pi], 3)
"""No stated standard deviation is larger, [m, rad]."""
_LARGEST_TWIST = np.repeat([0.1, 0.5], 3)
"""How far an action can move a goal per axis, [m, rad]."""
_FAR = np.repeat([ROOM_M, 1.0], [3, 4])
"""Of a packed pose, (7,); of a quaternion, rounding alone could be beyond."""

Action = NDArray[np.float64]
Seen = dict[str, Any]


def observation_space(n: int) -> spaces.Dict:
    """The observations of `n` operations."""
    far = np.tile(_FAR, (n, 1))
    unsure = np.tile(np.outer(LARGEST_DEVIATION, LARGEST_DEVIATION), (n, 1, 1))
    return spaces.Dict(
        {
            "poses": spaces.Box(-far, far, dtype=np.float64),
            "covariance": spaces.Box(-unsure, unsure, dtype=np.float64),
            "observed": spaces.MultiBinary(n),
        }
    )


def action_space(n: int) -> spaces.Space[Action]:
    """A body twist for each of `n` operations."""
    twist = np.tile(_LARGEST_TWIST, (n, 1))
    return spaces.Box(-twist, twist, dtype=np.float64)


def track_spaces(n: int) -> tuple[spaces.Dict, spaces.Dict]:
    """What is seen and done by who follows a human through `n` operations."""
    seen = observation_space(n)
    several = spaces.MultiBinary(n)
    twist = spaces.Box(-_LARGEST_TWIST, _LARGEST_TWIST, dtype=np.float64)
    return (
        spaces.Dict({**seen.spaces, "shown": several, "done": several, "placed": seen["poses"]}),
        spaces.Dict({"act": spaces.Discrete(3), "twist": twist}),
    )


def observation_entries(observation: Observation) -> Seen:
    """Fresh copies of what was seen."""
    return {
        "poses": packed(observation.poses),
        "covariance": observation.covariance.copy(),
        "observed": observation.observed.astype(np.int8),
    }


def packed(goals: Array) -> Array:
    """Goals (n, 4, 4) as observations hold them, (n, 7), within the bounds of their space."""
    return np.clip(pose.pack(goals), -_FAR, _FAR)


def moved(plan: Plan, action: Action, space: spaces.Space[Action]) -> Plan:
    """Every goal and every target of an operation with the displacement of that operation on its right.

    Raises:
        InputError: The action is not in the action space.
    """
    twist = np.asarray(action, dtype=np.float64)
    if not space.contains(twist):
        raise InputError(
            f"an action of shape {twist.shape} with numbers from {np.min(twist, initial=0):g} to "
            f"{np.max(twist, initial=0):g} was given; shape {space.shape} within 0.1 m and 0.5 rad is "
            "allowed, as `env.action_space` says."
        )
    displacements = pose.exp(twist)
    done = [step.operation for step in plan.schedule]
    return replace(
        plan, target_poses=plan.target_poses @ displacements, step_poses=plan.step_poses @ displacements[done]
    )


MM_DEG = np.repeat([1e3, 180.0 / math.pi], 3)
PIXELS = 96
_FAR_MM_DEG = np.repeat([500.0, 180.0], 3)
_SEEN = {
    "agent_pos": np.array([*_FAR_MM_DEG, *_FAR_MM_DEG, 100.0]),
    "wrench": np.repeat([1000.0, 1000.0], 3),
    "plan": np.array([1.0, 1.0, 1.0, 500.0, 500.0, 1e4, *_FAR_MM_DEG, *np.ones(7)]),
}
"""No number that is seen is larger."""


def insert_space(pixels: bool) -> spaces.Dict:
    """The space of what is seen."""
    seen: dict[str, spaces.Space[Any]] = {
        name: spaces.Box(-most.astype(np.float32), most.astype(np.float32), dtype=np.float32)
        for name, most in _SEEN.items()
    }
    if pixels:
        seen["pixels"] = spaces.Box(0, 255, (PIXELS, PIXELS, 3), np.uint8)
    return spaces.Dict(seen)


def insert_observation(
    control: TipControl, covariance: Array, best: float, left: int, action: NDArray[np.float32]
) -> dict[str, Any]:
    """What is seen now, but for pictures.

    Args:
        covariance: (6, 6), stated, of the twist of the part, [m, rad].
        best: The least that was left of the way in so far, [m].
        left: How many actions are left.
        action: (7,), the last one.
    """
    feel = control.reading
    way = (-1e3 * float(feel.tip[2]), 1e3 * best, PERIOD_S * left)
    seen: dict[str, Any] = {
        "agent_pos": [*feel.tip * MM_DEG, *feel.lag * MM_DEG, 1e3 * feel.opening],
        "wrench": feel.wrench,
        "plan": np.concatenate([control.start.direction, way, control.sigmas(covariance) * MM_DEG, action]),
    }
    return {name: np.clip(seen[name], -most, most).astype(np.float32) for name, most in _SEEN.items()}
