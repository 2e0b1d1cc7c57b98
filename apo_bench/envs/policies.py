"""Policies of `APOInsert-v0`: functions of environment and observation, and the environment they act in."""

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
"""Name -> import path; a policy that keeps a state is a class, and each episode makes an instance of it."""
_GAIN = 0.5
"""Share of the remaining error that one action corrects."""


def straight(env: APOInsert, seen: dict[str, Any]) -> Array:
    """Add nothing to the scripted approach."""
    return np.zeros(7)


def expert(env: APOInsert, seen: dict[str, Any]) -> Array:
    """Act as a teacher that knows the true error of the part: correct its translation and rotation across the axis."""
    # the third number, along the axis, is left to the approach
    aside = np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0]) * env.off / env.scale
    return np.append(np.clip(-_GAIN * aside, -1.0, 1.0), 0.0)


def insert_env(settings: TrialConfig) -> APOInsert:
    """Make the environment for trials with these settings; without a robot error it has its default one.

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
