"""Read the TOML file of an arm, which states what its MJCF file does not show."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, structs

from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.io import FileTable, Finite, Text, read_typed
from apo_bench.scenario.values import Pose
from apo_bench.simulation.arms.gripper_file import gripper_path

_USUAL_BASE = Pose(at_mm=(-450.0, 0.0, 0.0))
"""Default base: behind the middle of the table."""
Names = Annotated[tuple[Text, ...], Meta(min_length=1, max_length=16)]
Numbers = Annotated[tuple[Finite, ...], Meta(min_length=1, max_length=16)]
Speed = Annotated[float, Meta(gt=0.0, le=3600.0)]
Torque = Annotated[float, Meta(gt=0.0, le=1e5)]


class GripperDescription(FileTable, frozen=True, kw_only=True):
    """The table `[gripper]`: a gripper file as `hand`, a gripper of `slides`, or neither.

    A gripper of slides has one sliding finger on each side, both driven by one actuator; its model is used as it is.
    Without either, two sliding fingers are looked for in the model of the arm.
    """

    hand: Text | None = None
    """Short name or path of the gripper file with its measured table."""
    mjcf: Text | None = None
    """Model file of the gripper; None: it is part of the arm's model."""
    mount: Pose = Pose(at_mm=(0.0, 0.0, 0.0))
    """Pose of the gripper in the flange."""
    speed_mm_s: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    """Largest speed of each pad; None: 50, as a Franka Hand."""
    slides: Names | None = None
    """The slide joints of the fingers, zero when closed."""
    tip: Text | None = None
    """The site between the fingertips: z points ahead, x along the closing direction."""
    opening_mm: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    """Widest opening per finger."""
    actuators: tuple[Text] | None = None
    """The position actuator that drives both fingers."""

    def __post_init__(self) -> None:
        stated = [each is not None for each in (self.slides, self.tip, self.opening_mm, self.actuators)]
        if self.mjcf and not any(stated) and self.hand is None:
            raise ValueError("what the gripper does is not stated; name its gripper file as 'hand', or state 'slides'.")
        if any(stated) and not all(stated):
            raise ValueError("'tip', 'slides', 'opening_mm' and 'actuators' are given together; state all of them.")
        if any(stated) and (self.hand or self.mjcf):
            raise ValueError("a gripper whose 'slides' are stated is part of the arm; leave 'hand' and 'mjcf' out.")


class ArmTable(FileTable, frozen=True, kw_only=True):
    """The keys of an arm file."""

    schema: Literal["apo-bench/arm/1"]
    mjcf: Text
    gripper: GripperDescription = GripperDescription()
    flange: Text | None = None
    """A site or a body; None: the last body of the one chain of hinges."""
    joints: Names | None = None
    home_deg: Numbers | None = None
    """None: chosen by a search."""
    base: Pose | None = None
    """Pose of the base; None: behind the middle of the table, or nearer for a short arm."""
    payload_kg: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    """Largest mass of the held parts, without the gripper."""
    speed_deg_s: Speed | Annotated[tuple[Speed, ...], Meta(min_length=1)] | None = None
    """Largest speed of all joints, or of each."""
    torque_nm: Torque | Annotated[tuple[Torque, ...], Meta(min_length=1)] | None = None
    """Largest torque of all joints, or of each; None: as in the model."""


class ArmDescription(ArmTable, frozen=True, kw_only=True):
    """The content of an arm file, or its equivalent for an arm of a collection."""

    file: Path
    """The arm file, for messages; other files are named relative to it."""

    @property
    def model_file(self) -> Path:
        """The model of the arm."""
        return self.file.parent / self.mjcf

    @property
    def gripper_file(self) -> Path | None:
        """The model of the gripper; None: it is part of the model of the arm."""
        return None if self.gripper.mjcf is None else self.file.parent / self.gripper.mjcf

    @property
    def hand_file(self) -> Path | None:
        """The gripper file; None if slides are stated, or found in the model."""
        return None if self.gripper.hand is None else gripper_path(self.gripper.hand, self.file.parent)

    @property
    def base_frame(self) -> Array:
        """The pose of the base, (4, 4), world frame, [m]."""
        return (self.base or _USUAL_BASE).matrix

    def of_each_joint(self, key: Literal["speed_deg_s", "torque_nm"], count: int) -> Array | None:
        """The stated values of a key for each of `count` joints, (count,); None if the key is not stated.

        Raises:
            InputError: The number of values is neither 1 nor `count`.
        """
        stated = getattr(self, key)
        if stated is None:
            return None
        numbers = np.atleast_1d(np.array(stated, dtype=np.float64))
        require(
            len(numbers) in (1, count), f"{self.file}: '{key}' has {len(numbers)} numbers; the arm has {count} joints."
        )
        return np.array(np.broadcast_to(numbers, count))


def read_description(path: Path) -> ArmDescription:
    """Read an arm file.

    Raises:
        InputError: A key or a value that an arm file cannot have, naming file and key.
    """
    return ArmDescription(file=path, **structs.asdict(read_typed(path, ArmTable, "arm file")))
