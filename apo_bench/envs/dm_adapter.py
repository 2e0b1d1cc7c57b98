"""Adapt an environment of Gymnasium to the interface of `dm_env`, for agents and wrappers that need it.

The package dm-env, which is pure Python, must be installed. The viewer of dm_control, and those of its wrappers that
use `physics`, also need dm-control, which is imported when `physics` is first used.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import dm_env
import gymnasium
import numpy as np
from dm_env import specs
from gymnasium import spaces

from apo_bench.errors import missing_package, require
from apo_bench.io import SAFE_PATH, set_environment
from apo_bench.simulation.scene import copy_data

_STREAM = 0x646D
"""Key of the random stream of `task.random`; no trial uses it."""


@final
@dataclass(frozen=True)
class DmTask:
    """The attributes of a task that wrappers of dm_control use."""

    random: np.random.Generator


@final
class DmAdapter(dm_env.Environment):  # type: ignore[misc]
    """Steps of Gymnasium as time steps; a step after the last one of an episode resets, as the interface requires.

    Observations are arrays in a dictionary by name; `info` holds the `info` of Gymnasium.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int | None) -> None:
        self._env = env
        self._seed = seed
        self._over = True
        self._physics: Any = None
        self.info: dict[str, Any] = {}
        self.task = DmTask(np.random.default_rng(None if seed is None else [seed, _STREAM]))

    @property
    def physics(self) -> Any:
        """The simulation as a `dm_control.mujoco.Physics`.

        It is a copy with a model of its own, which every reset and step update, so changes to it do not affect an
        episode. It holds the truth, so it is not for policies.

        Raises:
            InputError: The package dm-control is not installed, or this environment has no simulation.
        """
        if self._physics is None:
            base = self._env.unwrapped
            require(
                hasattr(base, "mujoco_data"),
                f"physics was asked of {type(base).__name__}, which has none; use APOReplay-v0, APOInsert-v0 or "
                "APOAssemble-v0.",
            )
            self._physics = _physics(base.mujoco_data())  # type: ignore[attr-defined]
        return self._physics

    def reset(self) -> dm_env.TimeStep:
        observation, self.info = self._env.reset(seed=self._seed)
        self._seed = None  # only the first episode has the given seed; the others follow from it
        self._over = False
        self._update_physics()
        return dm_env.restart(_arrays(observation))

    def step(self, action: Any) -> dm_env.TimeStep:
        if self._over:
            return self.reset()  # the action after the last step is ignored
        observation, reward, terminated, truncated, self.info = self._env.step(np.asarray(action))
        self._over = terminated or truncated
        self._update_physics()
        time_step = dm_env.termination if terminated else dm_env.truncation if truncated else dm_env.transition
        return time_step(float(reward), _arrays(observation))

    def observation_spec(self) -> Any:
        return _spec(self._env.observation_space, "observation")

    def action_spec(self) -> Any:
        return _spec(self._env.action_space, "action")

    def close(self) -> None:
        self._env.close()

    def _update_physics(self) -> None:
        """Copy the present state to `physics`, if that exists."""
        if self._physics is not None:
            copy_data(self._env.unwrapped.mujoco_data(), self._physics.data.ptr)  # type: ignore[attr-defined]


@set_environment({SAFE_PATH: "1"})
def _physics(data: Any) -> Any:
    """Return a dm_control copy of `mujoco.MjData` and its model.

    GLFW, which dm_control imports, starts a Python process during its import; the environment variable keeps that
    process from importing modules of the current folder.
    """
    try:
        from dm_control.mujoco import Physics
        from dm_control.mujoco.wrapper import MjData
    except ImportError as error:
        if error.name is None or error.name.split(".")[0] != "dm_control":
            raise
        raise missing_package("physics", "dm-control", " (Python 3.11 or 3.12)") from error
    made = Physics(MjData(copy.deepcopy(data)))
    copy_data(data, made.data.ptr)
    return made


def _spec(space: spaces.Space[Any], name: str) -> Any:
    """Return the `dm_env` specification of a space; of a `Dict`, one for each entry."""
    if isinstance(space, spaces.Dict):
        return {key: _spec(each, key) for key, each in space.spaces.items()}
    if isinstance(space, spaces.Box):
        return specs.BoundedArray(space.shape, space.dtype, space.low, space.high, name=name)
    if isinstance(space, spaces.MultiBinary):
        return specs.BoundedArray(space.shape, space.dtype, 0, 1, name=name)
    raise TypeError(f"{name}: {type(space).__name__} was given; Dict, Box and MultiBinary are known.")


def _arrays(observation: Any) -> Any:
    """Convert an observation, with its nested dictionaries, to arrays."""
    if isinstance(observation, Mapping):
        return {key: _arrays(value) for key, value in observation.items()}
    return np.asarray(observation)
