"""The TOML file that describes an arm: what its MJCF does not show."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, structs

from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.io import Finite, Table, Text, read_typed
from apo_bench.scenario.values import Pose

_USUAL_BASE = Pose(at_mm=(-450.0, 0.0, 0.0))
"""Reaches the table from behind its middle."""
Names = Annotated[tuple[Text, ...], Meta(min_length=1, max_length=16)]
Numbers = Annotated[tuple[Finite, ...], Meta(min_length=1, max_length=16)]
Speed = Annotated[float, Meta(gt=0.0, le=3600.0)]
Torque = Annotated[float, Meta(gt=0.0, le=1e5)]


class GripperDescription(Table, frozen=True, kw_only=True):
    """The gripper and its drive; what is None is found in the model, or measured.

    A gripper whose `slides` are stated is not measured: a finger on each side slides, and one actuator drives both.
    """

    mjcf: Text | None = None
    """None: it is part of the arm's file."""
    mount: Pose = Pose(at_mm=(0.0, 0.0, 0.0))
    """Its frame in the flange."""
    actuators: Names | None = None
    open: Numbers | None = None
    """The command at which it is widest open, one number for each actuator, in their own units."""
    closed: Numbers | None = None
    pads: tuple[Text, Text] | None = None
    """A body or geom of each side, whose surface holds a part."""
    speed_mm_s: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    """The fastest each pad moves; None: 50, as a Franka Hand."""
    force_n: Annotated[float, Meta(ge=1.0, le=60.0)] | None = None
    """How hard each pad pushes on a part of half the opening; None: as in the model, if that holds a part."""
    slides: Names | None = None
    """The slide joints of the fingers, zero when closed."""
    tip: Text | None = None
    """The site between the fingertips: z points ahead, x along the closing direction."""
    opening_mm: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    """How far each finger opens."""

    def __post_init__(self) -> None:
        if (self.open is None) != (self.closed is None):
            raise ValueError("'open' and 'closed' are given together, or neither.")
        if self.slides is None and self.tip is None and self.opening_mm is None:
            return
        if None in (self.slides, self.tip, self.opening_mm, self.actuators):
            raise ValueError("'tip', 'slides', 'opening_mm' and 'actuators' are given together; state all of them.")
        for key in ("mjcf", "open", "closed", "pads", "force_n"):
            if getattr(self, key) is not None:
                raise ValueError(f"a gripper whose 'slides' are stated is not measured; leave '{key}' out.")


class ArmTable(Table, frozen=True, kw_only=True):
    """The keys of an arm file."""

    schema: Literal["apo-bench/arm/1"]
    mjcf: Text
    gripper: GripperDescription = GripperDescription()
    flange: Text | None = None
    """A site or a body; None: the last body of the one chain of hinges."""
    joints: Names | None = None
    home_deg: Numbers | None = None
    """None: searched for."""
    base: Pose | None = None
    """Where the base stands; None: behind the middle of the table, or nearer where the arm is short."""
    payload_kg: Annotated[float, Meta(gt=0.0, le=1000.0)] | None = None
    """Of what is held, without the gripper."""
    speed_deg_s: Speed | Annotated[tuple[Speed, ...], Meta(min_length=1)] | None = None
    """The fastest each joint may turn."""
    torque_nm: Torque | Annotated[tuple[Torque, ...], Meta(min_length=1)] | None = None
    """The most each joint may push; None: as the model says."""


class ArmDescription(ArmTable, frozen=True, kw_only=True):
    """An arm file, or what stands for one."""

    file: Path
    """Of which messages speak; other files are named relative to it."""

    @property
    def model_file(self) -> Path:
        """The model of the arm."""
        return self.file.parent / self.mjcf

    @property
    def gripper_file(self) -> Path | None:
        """The model of the gripper; None: it is part of the model of the arm."""
        return None if self.gripper.mjcf is None else self.file.parent / self.gripper.mjcf

    @property
    def base_frame(self) -> Array:
        """Where the base stands, (4, 4), world, [m]."""
        return (self.base or _USUAL_BASE).matrix

    def of_each_joint(self, key: Literal["speed_deg_s", "torque_nm"], count: int) -> Array | None:
        """What a key states of each of so many joints, (count,); None where it is not stated.

        Raises:
            InputError: It is stated of another number of joints.
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
    """The description in an arm file.

    Raises:
        InputError: A key or a value that an arm file cannot have, naming file and key.
    """
    return ArmDescription(file=path, **structs.asdict(read_typed(path, ArmTable, "arm file")))
