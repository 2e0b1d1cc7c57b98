"""What a robot knows about itself at each action of `APOInsert-v0`, for data sets."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.insertion_progress import PHASES
from apo_bench.geometry import Array, pose

POSE_NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz")
"""The numbers of a pose, [m] and unit quaternion."""
STATE_NAMES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "tip": tuple(f"tip_{name}" for name in POSE_NAMES),
        "tip_command": tuple(f"tip_command_{name}" for name in POSE_NAMES),
        "phase": ("phase",),
    }
)
"""Entry of a state but `joints` -> the names of its numbers."""


def read_robot_state(env: APOInsert, phase: str) -> dict[str, Array]:
    """Return the state of the robot now.

    Args:
        phase: That of `info`; `approach` after a reset.

    Returns:
        `joints`: measured angles of the arm and opening of a finger, (joints + 1,), [rad, m]; `tip` and `tip_command`:
        measured and commanded pose of the tip in the frame of the base of the arm, (7,); `phase`, (1,): its index in
        `PHASES`.
    """
    robot = env.control.robot
    arm = robot.arm
    T_base_world = pose.inverse(pose.unpack(np.array([*arm.base, *arm.turn])))
    measured = robot.scene.kinematics.forward(robot.encoders())
    return {
        "joints": np.append(robot.encoders(), robot.opening()),
        "tip": pose.pack(T_base_world @ measured),
        "tip_command": pose.pack(T_base_world @ robot.T),
        "phase": np.array([PHASES.index(phase)], dtype=np.float64),
    }


def stack_states(states: list[dict[str, Any]]) -> dict[str, Array]:
    """Return states one after the other, entry -> (T, k)."""
    return {name: np.array([state[name] for state in states]) for name in states[0]}
