"""Observation and action spaces of `APOReplay-v0` and `APOTrack-v0`, and their observations."""

from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from apo_bench.assembly import Observation, Plan
from apo_bench.envs.actions import describe_numbers
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose

ROOM_M = 2.0
"""Bound of observed positions per axis, [m]; the position of a gross outlier is clipped to it."""
LARGEST_DEVIATION = np.repeat([0.5, np.pi], 3)
"""Bound of stated standard deviations per axis, [m, rad]."""
_LARGEST_TWIST = np.repeat([0.1, 0.5], 3)
"""Bound of the displacement by an action, per axis, [m, rad]."""
_FAR = np.repeat([ROOM_M, 1.0], [3, 4])
"""Bounds of a packed pose, (7,); clipping also removes rounding of quaternions beyond 1."""

Action = NDArray[np.float64]
Seen = dict[str, Any]


def observation_space(n: int) -> spaces.Dict:
    """Return the observation space of `APOReplay-v0` for n operations."""
    far = np.tile(_FAR, (n, 1))
    unsure = np.tile(np.outer(LARGEST_DEVIATION, LARGEST_DEVIATION), (n, 1, 1))  # bounds of covariances
    return spaces.Dict(
        {
            "poses": spaces.Box(-far, far, dtype=np.float64),
            "covariance": spaces.Box(-unsure, unsure, dtype=np.float64),
            "observed": spaces.MultiBinary(n),
        }
    )


def action_space(n: int) -> spaces.Space[Action]:
    """Return the action space of `APOReplay-v0`: a body twist for each of n operations."""
    twist = np.tile(_LARGEST_TWIST, (n, 1))
    return spaces.Box(-twist, twist, dtype=np.float64)


def track_spaces(n: int) -> tuple[spaces.Dict, spaces.Dict]:
    """Return observation and action space of `APOTrack-v0` for n operations."""
    seen = observation_space(n)
    several = spaces.MultiBinary(n)
    twist = spaces.Box(-_LARGEST_TWIST, _LARGEST_TWIST, dtype=np.float64)
    return (
        spaces.Dict({**seen.spaces, "shown": several, "done": several, "placed": seen["poses"]}),
        spaces.Dict({"act": spaces.Discrete(3), "twist": twist}),
    )


def observation_entries(observation: Observation) -> Seen:
    """Return an observation as a dictionary of new arrays in `observation_space`."""
    return {
        "poses": packed(observation.poses),
        "covariance": observation.covariance.copy(),
        "observed": observation.observed.astype(np.int8),
    }


def packed(goals: Array) -> Array:
    """Convert poses (n, 4, 4) to (n, 7), clipped to the bounds of the observation space."""
    return np.clip(pose.pack(goals), -_FAR, _FAR)


def moved(plan: Plan, action: Action, space: spaces.Space[Action]) -> Plan:
    """Return the plan with every target pose and step pose multiplied from the right by exp(twist) of its operation.

    Args:
        action: Body twists, (n, 6), [m, rad].
        space: The action space that limits them.

    Raises:
        InputError: The action is not in the action space.
    """
    twist = np.asarray(action, dtype=np.float64)
    if not space.contains(twist):
        raise InputError(
            f"{describe_numbers(twist)} was given as an action; an array of shape {space.shape}, a twist per "
            "operation within 0.1 m and 0.5 rad per axis, is needed."
        )
    displacements = pose.exp(twist)
    done = [step.operation for step in plan.schedule]  # operation of each step
    return replace(
        plan, target_poses=plan.target_poses @ displacements, step_poses=plan.step_poses @ displacements[done]
    )
