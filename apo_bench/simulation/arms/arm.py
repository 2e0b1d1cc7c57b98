"""An arm with its gripper as data: model, names, limits, and pose of the base (`Arm`)."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.geometry import Array, freeze, make_copyable
from apo_bench.io import list_named_files

_GRADED = 0.6
"""If one row of a gripper's table changes the opening by this share of the range, it can only be open or closed."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class ArmLimits:
    """The limits of an arm; None: not stated."""

    payload_kg: float | None = None
    """Largest mass of the held parts, without the gripper."""
    speed_rad_s: Array | None = None
    """(joints,), largest speed of each joint."""
    torque_nm: Array | None = None
    """(joints,), largest torque of each joint; infinite if not stated."""
    fingers_m_s: float = 0.28
    """Largest speed of the command of each finger."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Hand:
    """A measured gripper: a table from closed to open.

    Openings are per finger, half the distance between the pads, [m].
    """

    actuators: tuple[str, ...]
    joints: tuple[str, ...]
    opening: Array
    """(n,), ascending; negative if the pads would penetrate each other."""
    commands: Array
    """(n, actuators): commands of the actuators at each opening, in their own units."""
    states: Array
    """(n, joints): joint positions of the empty gripper at each opening, [rad] or [m]."""
    force_n: float
    """Force of each pad on a part as wide as half the opening."""
    squeeze_m: float
    """Depth inside the part to which each finger is commanded for that force."""
    friction: float
    """Coefficient of friction of the pads."""
    seconds: float
    """Longest time to close or open."""
    pads: tuple[str, str]
    """Names of a geom of the left and of the right pad."""
    thick_m: float
    """Distance of the middles of these geoms, less that of their gripping surfaces."""

    def __post_init__(self) -> None:
        n = len(self.opening)
        freeze(self, opening=(n,), commands=(n, len(self.actuators)), states=(n, len(self.joints)))

    @cached_property
    def graded(self) -> bool:
        """Whether the gripper can be opened by any amount; otherwise it is either open or closed."""
        steps = np.diff(self.opening)
        return bool(steps.max() < _GRADED * steps.sum())

    def command(self, opening: float) -> Array:
        """The commands, (actuators,), for an opening of the empty gripper; at most fully open."""
        return self._at(self.commands, opening)

    def state(self, opening: float) -> Array:
        """The joint positions, (joints,), at an opening of the empty gripper."""
        return self._at(self.states, opening)

    def of_command(self, ctrl: Array) -> float:
        """The opening, [m], that actuator commands, (actuators,), demand."""
        k = int(np.abs(self.commands[-1] - self.commands[0]).argmax())
        # The actuator whose command changes most determines the opening; its commands may fall while the opening rises.
        order = np.argsort(self.commands[:, k], kind="stable")
        return float(np.interp(float(ctrl[k]), self.commands[order, k], self.opening[order]))

    def _at(self, rows: Array, opening: float) -> Array:
        """A table, (n, m), interpolated at an opening, (m,); closed or open if the gripper is not graded."""
        if not self.graded:
            return np.array(rows[-1 if opening > self.opening[0] else 0])  # -1: open, 0: closed
        return np.array([np.interp(opening, self.opening, column) for column in rows.T])


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Arm:
    """A robot arm with a gripper of two sides, for `build_scene`.

    `read_arm` makes one from a description of any arm: it finds joints, actuators and pads, and measures the gripper
    unless the file states its dimensions. An MJCF file with the names below can be used directly, without `model` and
    `hand`. The site `tip` lies between the fingertips: z points ahead, x along the closing direction.
    """

    mjcf: Path
    """The MJCF file of arm and gripper, or the file that describes them."""
    base: tuple[float, float, float]
    """Position of the base, world frame, [m]."""
    joints: tuple[str, ...]
    """Names of the joints; each has a position actuator of the same name."""
    tip: str
    """Name of the site between the fingertips."""
    fingers: tuple[str, ...]
    """Slide joints of the fingers, zero when closed, opening [m] per finger; or the joints of a measured gripper."""
    grip: str
    """The position actuator of the fingers; empty for a measured gripper."""
    mount: str
    """The body that a part is welded to by the ideal grasp."""
    home: Array
    """Joint angles near which inverse kinematics starts, [rad]."""
    opening_m: float
    """Widest opening per finger, [m]."""
    squeeze_m: float = 0.03
    """Depth to which the fingers are commanded into the part, [m]; the force limit of the actuator stops them."""
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """Orientation of the base, quaternion (w, x, y, z), world frame."""
    model: str | None = None
    """The model as MJCF text if a file described the arm; None: `mjcf` is the model."""
    hand: Hand | None = None
    """The measured gripper; None: `fingers` and `grip` state it."""
    limits: ArmLimits = ArmLimits()
    """Payload, speeds and torques."""
    files: tuple[Path, ...] = ()
    """All files of the arm. Default: `mjcf` and the files that it names."""
    control: str = "own position actuators"
    """The actuators of the joints, and the factor on the gripper's drive, in words."""

    def __post_init__(self) -> None:
        freeze(self, home=(len(self.joints),))
        object.__setattr__(self, "files", self.files or list_named_files(self.mjcf))

    def finger_joints(self, opening: float) -> Array:
        """Return the positions of the joints `fingers` at an opening [m] of the empty gripper, (k,)."""
        return np.full(len(self.fingers), opening) if self.hand is None else self.hand.state(opening)
