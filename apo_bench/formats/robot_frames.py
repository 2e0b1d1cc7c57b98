"""Read ROBOT.toml: the frames and the order of quaternions in which a plan is exported to a robot."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.io import FileTable, read_typed
from apo_bench.scenario.values import AnyPose


@final
@dataclass(frozen=True, eq=False)
class RobotFrames:
    """The frames and the order of quaternions that a robot uses."""

    T_world_base: Array = field(default_factory=lambda: np.eye(4))
    """(4, 4), pose of the robot's base in the world, [m]."""
    T_flange_tip: Array | None = None
    """(4, 4), flange from tip, [m]; None: exported poses are those of the tip."""
    quaternion: Literal["xyzw", "wxyz"] = "xyzw"


class RobotTable(FileTable, frozen=True, kw_only=True):
    """The tables of a robot file."""

    schema: Literal["apo-bench/robot/1"]
    base: AnyPose | None = None
    flange_to_tip: AnyPose | None = None
    quaternion: Literal["xyzw", "wxyz"] = "xyzw"


def read_robot_frames(path: str | Path) -> RobotFrames:
    """Read the frames of a robot file.

    Raises:
        InputError: The file deviates from the form; the message names file and key.
    """
    top = read_typed(path, RobotTable, "robot file")
    return RobotFrames(
        T_world_base=np.eye(4) if top.base is None else top.base.matrix(f"{path}, base"),
        T_flange_tip=None if top.flange_to_tip is None else top.flange_to_tip.matrix(f"{path}, flange_to_tip"),
        quaternion=top.quaternion,
    )
