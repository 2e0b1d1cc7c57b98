"""ROBOT.toml: in which frames, and in which order of quaternions, a plan goes out to a robot."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, cast, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.io import read_toml
from apo_bench.scenario.contacts import read_any_pose

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
