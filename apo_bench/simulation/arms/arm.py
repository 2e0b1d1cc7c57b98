"""An arm as data: what it can do, what its gripper does, where it stands."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.geometry import Array, freeze, make_copyable
from apo_bench.io import list_named_files

_GRADED = 0.6
"""A gripper of which one step of the command makes this part of its opening knows open and closed only."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class ArmLimits:
    """What an arm can do; None: not stated."""

    payload_kg: float | None = None
    """Of what is held, without the gripper."""
    speed_rad_s: Array | None = None
    """(joints,), the fastest each may turn."""
    torque_nm: Array | None = None
    """(joints,), the most each can push; infinite where not stated."""
    fingers_m_s: float = 0.28
    """How fast the command of each finger moves at most."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Hand:
    """Measured from closed to open; openings are of each finger, half the distance between the pads, [m]."""

    actuators: tuple[str, ...]
    joints: tuple[str, ...]
    opening: Array
    """(n,), ascending; below zero where pads would be inside each other."""
    commands: Array
    """(n, actuators), in their own units."""
    states: Array
    """(n, joints), [rad] or [m]."""
    force_n: float
    """How hard each pad pushes on a part of half its opening."""
    squeeze_m: float
    """How far inside the part its fingers are sent for that, each."""
    friction: float
    """Of what pushes on that part."""
    seconds: float
    """How long it takes to close or open at most."""
    pads: tuple[str, str]
    """A geom of each side."""
    thick_m: float
    """How much farther apart the middles of these are than the surfaces that hold."""

    def __post_init__(self) -> None:
        n = len(self.opening)
        freeze(self, opening=(n,), commands=(n, len(self.actuators)), states=(n, len(self.joints)))

    @cached_property
    def graded(self) -> bool:
        """Whether it can be opened by any amount; else it is open or closed."""
        steps = np.diff(self.opening)
        return bool(steps.max() < _GRADED * steps.sum())

    def command(self, opening: float) -> Array:
        """(actuators,), at which the fingers of the empty hand stand at an opening; all of it, if there is no more."""
        return self._at(self.commands, opening)

    def state(self, opening: float) -> Array:
        """(joints,), at an opening of the empty hand."""
        return self._at(self.states, opening)

    def of_command(self, ctrl: Array) -> float:
        """The opening that is commanded, [m]."""
        k = int(np.abs(self.commands[-1] - self.commands[0]).argmax())
        # The actuator whose command changes most determines the opening; its commands may fall while the opening rises.
        order = np.argsort(self.commands[:, k], kind="stable")
        return float(np.interp(float(ctrl[k]), self.commands[order, k], self.opening[order]))

    def _at(self, rows: Array, opening: float) -> Array:
        if not self.graded:
            return np.array(rows[-1 if opening > self.opening[0] else 0])
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
