"""An environment of Gymnasium as one of `dm_env`, for agents and wrappers that know that interface.

Needs the package dm-env, which is pure Python itself; dm-control is not needed.
"""

from collections.abc import Mapping
from typing import Any, final

import dm_env
import gymnasium
import numpy as np
from dm_env import specs
from gymnasium import spaces


@final
class DmAdapter(dm_env.Environment):  # type: ignore[misc]
    """Steps of Gymnasium as time steps. A step after the last one of an episode resets, as the interface asks.

    Observations are float64 and integer arrays, in a dictionary by name; `info` holds what Gymnasium's `info` held.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int | None) -> None:
        self._env = env
        self._seed = seed
        self._over = True
        self.info: dict[str, Any] = {}

    def reset(self) -> dm_env.TimeStep:
        observation, self.info = self._env.reset(seed=self._seed)
        self._seed = None  # the first episode alone is that of the seed; the others follow from it
        self._over = False
        return dm_env.restart(_arrays(observation))

    def step(self, action: Any) -> dm_env.TimeStep:
        if self._over:
            return self.reset()
        observation, reward, terminated, truncated, self.info = self._env.step(np.asarray(action))
        self._over = terminated or truncated
        time_step = dm_env.termination if terminated else dm_env.truncation if truncated else dm_env.transition
        return time_step(float(reward), _arrays(observation))

    def observation_spec(self) -> Any:
        return _spec(self._env.observation_space, "observation")

    def action_spec(self) -> Any:
        return _spec(self._env.action_space, "action")

    def close(self) -> None:
        self._env.close()


def _spec(space: spaces.Space[Any], name: str) -> Any:
    if isinstance(space, spaces.Dict):
        return {key: _spec(each, key) for key, each in space.spaces.items()}
    if isinstance(space, spaces.Box):
        return specs.BoundedArray(space.shape, space.dtype, space.low, space.high, name=name)
    if isinstance(space, spaces.MultiBinary):
        return specs.BoundedArray(space.shape, space.dtype, 0, 1, name=name)
    raise TypeError(f"{name}: {type(space).__name__} was given; Dict, Box and MultiBinary are known.")


def _arrays(observation: Any) -> Any:
    if isinstance(observation, Mapping):
        return {key: _arrays(value) for key, value in observation.items()}
    return np.asarray(observation)
