"""Read the TOML file of a gripper: its table of openings and commands, and its force."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.io import FileTable, Finite, NotNegative, Positive, Text, read_typed
from apo_bench.resources import folder
from apo_bench.scenario.values import AnyPose
from apo_bench.simulation.arms.arm import Hand

Numbers = Annotated[tuple[Finite, ...], Meta(min_length=2, max_length=64)]
Rows = Annotated[tuple[tuple[Finite, ...], ...], Meta(min_length=2, max_length=64)]


class GripperTable(FileTable, frozen=True, kw_only=True):
    """The keys of a gripper file; names are those in its MJCF, openings are of each finger."""

    schema: Literal["apo-bench/gripper/1"]
    mount: Text | None = None
    """The body that carries the fingers; None: the flange of the arm."""
    tip: AnyPose
    """Frame between the fingertips, in the mount: z ahead, x along the closing direction."""
    actuators: tuple[Text, ...]
    joints: tuple[Text, ...]
    pads: tuple[Text, Text]
    """A geom of each side, or a body, whose first box is the pad."""
    pads_apart_mm: Finite
    """Distance of the middles of these geoms, less that of their gripping surfaces."""
    force_n: Positive
    """Force of each pad on a part as wide as half the opening."""
    squeeze_mm: NotNegative
    """Depth inside the part to which each finger is commanded for that force."""
    friction: NotNegative
    seconds: Positive
    """Longest time to close or open."""
    drive_scale: Positive = 1.0
    """Factor on the strength of the drive in the model."""
    opening_mm: Numbers
    """Ascending; negative if the pads would penetrate each other."""
    commands: Rows
    """Commands of the actuators at each opening, in their own units."""
    states: Rows
    """Joint positions of the empty gripper at each opening, [rad] or [m]."""

    def __post_init__(self) -> None:
        n = len(self.opening_mm)
        if not (np.diff(self.opening_mm) > 0.0).all():
            raise ValueError("'opening_mm' must ascend.")
        if [len(row) for row in self.commands] != [len(self.actuators)] * n:
            raise ValueError(f"'commands' needs {n} rows of {len(self.actuators)} numbers.")
        if [len(row) for row in self.states] != [len(self.joints)] * n:
            raise ValueError(f"'states' needs {n} rows of {len(self.joints)} numbers.")

    def tip_frame(self, path: Path) -> Array:
        """The pose of the tip in the mount, (4, 4), [m].

        Args:
            path: The file, for messages.
        """
        return self.tip.matrix(f"{path}, tip")

    def hand(self, prefix: str, pads: tuple[str, str]) -> Hand:
        """The gripper as part of an arm.

        Args:
            prefix: Prefix of the gripper's names in the arm.
            pads: Names of the pad geoms in the arm.
        """
        return Hand(
            actuators=tuple(prefix + name for name in self.actuators),
            joints=tuple(prefix + name for name in self.joints),
            opening=1e-3 * np.array(self.opening_mm),
            commands=np.array(self.commands),
            states=np.array(self.states),
            force_n=self.force_n,
            squeeze_m=1e-3 * self.squeeze_mm,
            friction=self.friction,
            seconds=self.seconds,
            pads=pads,
            thick_m=1e-3 * self.pads_apart_mm,
        )


def gripper_path(name: str, place: Path) -> Path:
    """The file of a gripper by short name, or a TOML file relative to the folder `place`.

    Raises:
        InputError: There is no such file.
    """
    grippers = folder("assets") / "grippers"
    path = place / name if name.endswith(".toml") else grippers / f"{name}.toml"
    known = ", ".join(sorted(each.stem for each in grippers.glob("*.toml")))
    require(path.is_file(), f"unknown gripper '{name}'; known are {known}, or give the path of a gripper file.")
    return path


def read_gripper(path: Path) -> GripperTable:
    """Read a gripper file.

    Raises:
        InputError: A key or a value that a gripper file cannot have, naming file and key.
    """
    return read_typed(path, GripperTable, "gripper file")
