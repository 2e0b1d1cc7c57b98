"""ROBOT.toml: frames and quaternions in which a plan goes out to a robot."""

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
    """Where a robot stands, what its poses are of, and how its quaternions are written."""

    T_world_base: Array = field(default_factory=lambda: np.eye(4))
    """(4, 4), [m]."""
    T_flange_tip: Array | None = None
    """(4, 4), [m]; None: poses are those of the tip."""
    quaternion: Literal["xyzw", "wxyz"] = "xyzw"


class RobotTable(FileTable, frozen=True, kw_only=True):
    """What stands in the file."""

    schema: Literal["apo-bench/robot/1"]
    base: AnyPose | None = None
    flange_to_tip: AnyPose | None = None
    quaternion: Literal["xyzw", "wxyz"] = "xyzw"


def read_robot_frames(path: str | Path) -> RobotFrames:
    """What a robot file states.

    Raises:
        InputError: Anything that is not as described, naming file and key.
    """
    top = read_typed(path, RobotTable, "robot file")
    return RobotFrames(
        T_world_base=np.eye(4) if top.base is None else top.base.matrix(f"{path}, base"),
        T_flange_tip=None if top.flange_to_tip is None else top.flange_to_tip.matrix(f"{path}, flange_to_tip"),
        quaternion=top.quaternion,
    )
