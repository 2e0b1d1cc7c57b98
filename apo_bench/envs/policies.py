"""Policies of `APOInsert-v0`, functions of the environment and what is seen, and the environment that they act in."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import gymnasium
import numpy as np

from apo_bench.envs.apo_insert import ROBOT_ERROR, APOInsert
from apo_bench.geometry import Array
from apo_bench.records import NO_ROBOT_ERROR, TrialConfig

POLICIES: Mapping[str, str] = MappingProxyType(
    {
        "dagger-insert": "apo_bench.envs.dagger_insert:DaggerInsert",
        "expert": "apo_bench.envs.policies:expert",
        "straight": "apo_bench.envs.policies:straight",
    }
)
"""By name; one that remembers is a class, of which each episode makes one."""
_GAIN = 0.5
"""Of what it is off, so much is made up for with each action."""


def straight(env: APOInsert, seen: dict[str, Any]) -> Array:
    """The approach alone."""
    return np.zeros(7)


def expert(env: APOInsert, seen: dict[str, Any]) -> Array:
    """A teacher that sees where part and neighbours really are: goes where the part has to go, across and turned."""
    aside = np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0]) * env.off / env.scale
    return np.append(np.clip(-_GAIN * aside, -1.0, 1.0), 0.0)


def insert_env(settings: TrialConfig) -> APOInsert:
    """The environment of such trials, made by Gymnasium; without a robot error, with its usual one.

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
    )
    assert isinstance(env.unwrapped, APOInsert)
    return env.unwrapped
