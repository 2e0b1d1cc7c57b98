"""The arm as data."""

from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.geometry.arrays import Array, copyable, frozen
from apo_bench.simulation.arms.hand import Hand


@final
@copyable
@dataclass(frozen=True, eq=False)
class ArmLimits:
    """What an arm can do; None: nothing is said."""

    payload_kg: float | None = None
    """Of what is held, without the gripper."""
    speed_rad_s: Array | None = None
    """(joints,), the fastest each may turn."""
    torque_nm: Array | None = None
    """(joints,), the most each can push; infinite where nothing is said."""
    fingers_m_s: float = 0.28
    """How fast the command of each finger moves at most."""


@final
@copyable
@dataclass(frozen=True, eq=False)
class Arm:
    """An arm with a gripper of two sides, ready to be put into a scene.

    `read_arm(FILE.toml)` makes one of the description of any arm: it finds joints, drives and pads, and measures the
    gripper, unless its file states that. Whoever has an MJCF file that is as the fields say may make one directly,
    without `model` and `hand`. The site `tip` lies between the fingertips: z points ahead, x along the closing
    direction.
    """

    mjcf: Path
    """The MJCF file of the whole, or the file by which the arm was described."""
    base: tuple[float, float, float]
    """Where its base stands, world, [m]."""
    joints: tuple[str, ...]
    """Each has a position actuator of the same name."""
    tip: str
    fingers: tuple[str, ...]
    """Slide joints, zero when closed, opening [m] per finger; those of the hand, where that was measured."""
    grip: str
    """The position actuator of the fingers; empty where the hand was measured."""
    mount: str
    """The body that a part is welded to by the ideal grasp."""
    home: Array
    """Joint angles near which inverse kinematics starts, [rad]."""
    opening_m: float
    """Widest opening per finger."""
    squeeze_m: float = 0.03
    """How far inside the part the fingers are commanded: beyond it the actuator's force limit rules."""
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """How its base is turned, quaternion (w, x, y, z), world."""
    model: str | None = None
    """The whole as MJCF text, where the arm was described by a file; None: `mjcf` is that file."""
    hand: Hand | None = None
    """What the gripper does, where that was measured."""
    limits: ArmLimits = ArmLimits()
    """What it can do."""
    files: tuple[Path, ...] = ()
    """All files that it was made of; none: `mjcf` alone."""
    control: str = "own position actuators"
    """What moves the joints, and how much stronger than in the model the drive of the gripper is, if it is."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "home", frozen(self.home, len(self.joints)))
        object.__setattr__(self, "files", self.files or (self.mjcf,))

    def finger_joints(self, opening: float) -> Array:
        """Where the joints of `fingers` are at an opening of the empty hand, (k,)."""
        return np.full(len(self.fingers), opening) if self.hand is None else self.hand.state(opening)
