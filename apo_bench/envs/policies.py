"""Policies of `APOInsert-v0` by name, behind one protocol, and the environment that they act in."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias

import gymnasium
import numpy as np

from apo_bench.envs.apo_insert import ROBOT_ERROR, APOInsert
from apo_bench.geometry import Array
from apo_bench.records import NO_ROBOT_ERROR, TrialConfig


class Policy(Protocol):
    """A policy during one episode."""

    def __call__(self, observation: Mapping[str, Any], /) -> Any:
        """Return the action for an observation; numbers beyond -1 and 1 are clipped."""


MakePolicy: TypeAlias = Callable[[APOInsert], Policy]
"""Makes the policy of an episode after its reset, from the environment, whose truth it must not use."""

POLICIES: Mapping[str, str] = MappingProxyType(
    {
        "expert": "apo_bench.envs.policies:expert",
        "probe": "apo_bench.envs.policies:straight",
        "searcher": "apo_bench.envs.searcher:Searcher",
        "spiral": "apo_bench.envs.spiral:SpiralPolicy",
        "straight": "apo_bench.envs.policies:straight",
    }
)
"""Name -> import path of a `MakePolicy`. `probe` is the approach alone of a robot that probes before."""
PROBES = ("probe",)
"""Policies whose environment is made with `probe=True`."""
_GAIN = 0.5
"""Share of the remaining error that one action corrects."""


def straight(env: APOInsert) -> Policy:
    """Add nothing to the scripted approach."""
    still = np.zeros(env.action_size, np.float32)
    return lambda observation: still


def expert(env: APOInsert) -> Policy:
    """Act as a teacher that knows the true error of the part: correct its translation and rotation across the axis."""

    def act(observation: Mapping[str, Any]) -> Array:
        aside = np.clip((env.target.at - _GAIN * env.off) / env.target.reach, -1.0, 1.0)
        aside[2] = 0.0  # along the axis it is left to the approach
        return with_hand(env, aside)

    return act


def with_hand(env: APOInsert, action: Array) -> Array:
    """Return six numbers as an action of an environment, whose hand is left to the approach."""
    return np.concatenate([action, np.zeros(env.action_size - 6)])


def aim_at(env: APOInsert, target: Array, ahead: float = 0.0) -> Array:
    """Return the action that moves the front of the part to a target, (6,), [mm, deg], and it along the axis.

    Args:
        target: Displacement from the line into the estimated hole; the third number has no effect.
        ahead: The number of the action for the step along the axis.
    """
    action = target / (env.target.reach * np.repeat([1e3, 180.0 / math.pi], 3))
    action[2] = ahead
    return with_hand(env, action)


def insert_env(settings: TrialConfig, policy: str = "straight", **more: Any) -> APOInsert:
    """Make the environment for trials with these settings; without a robot error it has its default one.

    Args:
        policy: A policy by name, of which some have the robot probe first.
        more: Further arguments of the environment.

    Raises:
        InputError: A setting that the environment does not take.
    """
    env = gymnasium.make(
        "APOInsert-v0",
        scenario=settings.scenario,
        noise_level=(settings.noise_mm, settings.noise_deg),
        **{name: getattr(settings, name) for name in ("human_error_scale", "noise", "grasp", "clearance_mm", "arm")},
        corrector=settings.method,
        robot_error=ROBOT_ERROR if settings.robot_error == NO_ROBOT_ERROR else settings.robot_error,
        probe=policy in PROBES,
        **more,
    )
    assert isinstance(env.unwrapped, APOInsert)
    return env.unwrapped
