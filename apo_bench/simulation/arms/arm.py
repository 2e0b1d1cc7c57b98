"""The arm as data: what it can do, what its gripper does, where it stands.

The file that describes an arm, as TOML: what cannot be seen in its MJCF, and nothing else.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.errors import require
from apo_bench.geometry import Array, copyable, freeze, frozen, pose
from apo_bench.io import JsonNode, named_files, read_toml
from apo_bench.scenario.values import read_pose

_GRADED = 0.6
"""A gripper of which one step of the command makes this part of its opening knows open and closed only."""


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
    gives_m: float
    """How far the middle of each pad then gives way, beyond the surface of that part."""
    turns_deg: float
    """How far a pad turns while the empty hand closes to half of its opening."""
    friction: float
    """Of what pushes on that part."""
    seconds: float
    """How long it takes to close or open at most."""
    pads: tuple[str, str]
    """A geom of each side."""
    thick_m: float
    """How much farther apart the middles of these are than the surfaces that hold."""
    reach: Array
    """(n,), how far the pads reach beyond the tip, [m]."""
    evenness: float = 1.0
    """How hard the weaker pad pushes on that part, as a part of the stronger one."""

    def __post_init__(self) -> None:
        n = len(self.opening)
        freeze(self, opening=(n,), reach=(n,), commands=(n, len(self.actuators)), states=(n, len(self.joints)))

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
        # The actuator whose command changes most tells the opening; its commands may fall while the opening rises.
        order = np.argsort(self.commands[:, k], kind="stable")
        return float(np.interp(float(ctrl[k]), self.commands[order, k], self.opening[order]))

    def _at(self, rows: Array, opening: float) -> Array:
        if not self.graded:
            return np.array(rows[-1 if opening > self.opening[0] else 0])
        return np.array([np.interp(opening, self.opening, column) for column in rows.T])


@final
@check_arguments
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
    """All files that it was made of; none: `mjcf` and what that names."""
    control: str = "own position actuators"
    """What moves the joints, and how much stronger than in the model the drive of the gripper is, if it is."""

    def __post_init__(self) -> None:
        freeze(self, home=(len(self.joints),))
        object.__setattr__(self, "files", self.files or named_files(self.mjcf))

    def finger_joints(self, opening: float) -> Array:
        """Where the joints of `fingers` are at an opening of the empty hand, (k,)."""
        return np.full(len(self.fingers), opening) if self.hand is None else self.hand.state(opening)


_SCHEMA = "apo-bench/arm/1"
_MOST_JOINTS = 16
_MOST_PAYLOAD_KG = 1000.0
_MOST_NM = 1e5
_MOST_DEG_S = 3600.0
_MOST_MM_S = 1000.0
_MOST_FORCE_N = 60.0
_MOST_OPENING_MM = 1000.0
_STATED = ("tip", "slides", "opening_mm")
"""Keys of a gripper that is not measured."""
_USUAL_BASE = frozen(pose.at((-0.45, 0.0, 0.0)))
"""Where a base stands that nothing is said of and that reaches the table: behind its middle, (4, 4), world, [m]."""


@final
@dataclass(frozen=True)
class SlideGripper:
    """A gripper that is stated: a finger on each side that slides, both driven by one position actuator."""

    tip: str
    """The site between the fingertips: z points ahead, x along the closing direction."""
    joints: tuple[str, ...]
    """The slides, zero when closed."""
    opening_m: float
    """How far each finger opens."""


@final
@check_arguments
@dataclass(frozen=True, eq=False)
class GripperDescription:
    """The gripper, and how it is driven; None: found in the model."""

    mjcf: Path | None = None
    """None: it is part of the arm's file."""
    mount: Array = field(default_factory=lambda: np.eye(4))
    """Its frame in the flange, (4, 4), [m]."""
    actuators: tuple[str, ...] | None = None
    open: Array | None = None
    """The command at which it is widest open, one number for each actuator, in their own units."""
    closed: Array | None = None
    pads: tuple[str, str] | None = None
    """A body or geom of each side, whose surface holds a part."""
    speed_m_s: float | None = None
    """The fastest each pad moves; None: 0.05, as a Franka Hand."""
    force_n: float | None = None
    """How hard each pad pushes on a part of half the opening; None: as in the model, if that holds a part."""
    slides: SlideGripper | None = None
    """None: what the gripper does is measured."""


@final
@check_arguments
@dataclass(frozen=True, eq=False)
class ArmDescription:
    """An arm as its file says it."""

    file: Path
    mjcf: Path
    gripper: GripperDescription = GripperDescription()
    flange: str | None = None
    """A site or a body; None: the last body of the one chain of hinges."""
    joints: tuple[str, ...] | None = None
    home: Array | None = None
    """[rad]; None: looked for."""
    base: Array = field(default_factory=lambda: _USUAL_BASE)
    """Where the base stands, (4, 4), world, [m]."""
    base_is_stated: bool = False
    """Else an arm that is short is put nearer, where its home is not stated either."""
    payload_kg: float | None = None
    """Of what is held, without the gripper."""
    speed_rad_s: Array | None = None
    """The fastest each joint may turn."""
    torque_nm: Array | None = None
    """The most each joint may push; None: as the model says."""

    def of_each_joint(self, key: str, numbers: Array | None, count: int) -> Array | None:
        """What a key says of each of so many joints, (count,); None where it is not stated.

        Raises:
            InputError: It is stated of another number of joints.
        """
        if numbers is None:
            return None
        require(
            len(numbers) in (1, count), f"{self.file}: '{key}' has {len(numbers)} numbers; the arm has {count} joints."
        )
        return np.array(np.broadcast_to(numbers, count))


def read_description(path: Path) -> ArmDescription:
    """What stands in an arm file.

    Raises:
        InputError: Anything that is not as described, naming file and key.
    """
    optional = ("flange", "joints", "home_deg", "base", "gripper", "payload_kg", "speed_deg_s", "torque_nm")
    top = read_toml(path, "arm file").fields_of(_SCHEMA, ("mjcf",), optional)
    speed = _each(top, "speed_deg_s", _MOST_DEG_S)
    return ArmDescription(
        file=path,
        mjcf=_beside(path, top["mjcf"]),
        flange=top["flange"].text() if "flange" in top else None,
        joints=_names(top["joints"]) if "joints" in top else None,
        home=np.radians(_row(top["home_deg"])) if "home_deg" in top else None,
        base=read_pose(top["base"]) if "base" in top else _USUAL_BASE,
        base_is_stated="base" in top,
        gripper=_gripper(path, top["gripper"]) if "gripper" in top else GripperDescription(),
        payload_kg=top["payload_kg"].number(0.0, _MOST_PAYLOAD_KG, above=True) if "payload_kg" in top else None,
        speed_rad_s=None if speed is None else np.radians(speed),
        torque_nm=_each(top, "torque_nm", _MOST_NM),
    )


def _gripper(path: Path, node: JsonNode) -> GripperDescription:
    measured = ("mjcf", "mount", "open", "closed", "pads", "force_n")
    keys = node.fields((), (*measured, *_STATED, "actuators", "speed_mm_s"))
    if ("open" in keys) != ("closed" in keys):
        node.fail("'open' and 'closed' are given together, or neither")
    pads = _names(keys["pads"]) if "pads" in keys else None
    if pads is not None and (len(pads) != 2 or pads[0] == pads[1]):
        keys["pads"].fail("two names are needed, a body or geom of each side")
    if any(key in keys for key in _STATED) and not all(key in keys for key in (*_STATED, "actuators")):
        node.fail(f"{', '.join(map(repr, _STATED))} and 'actuators' are given together, or none of the first three")
    for key in measured:
        if key in keys and "slides" in keys:
            keys[key].fail("a gripper whose 'slides' are stated is not measured; leave this key out")
    return GripperDescription(
        mjcf=_beside(path, keys["mjcf"]) if "mjcf" in keys else None,
        mount=read_pose(keys["mount"]) if "mount" in keys else np.eye(4),
        actuators=_names(keys["actuators"]) if "actuators" in keys else None,
        open=_row(keys["open"]) if "open" in keys else None,
        closed=_row(keys["closed"]) if "closed" in keys else None,
        pads=None if pads is None else (pads[0], pads[1]),
        speed_m_s=1e-3 * keys["speed_mm_s"].number(0.0, _MOST_MM_S, above=True) if "speed_mm_s" in keys else None,
        force_n=keys["force_n"].number(1.0, _MOST_FORCE_N) if "force_n" in keys else None,
        slides=_slides(keys) if "slides" in keys else None,
    )


def _slides(keys: Mapping[str, JsonNode]) -> SlideGripper:
    opening_mm = keys["opening_mm"].number(0.0, _MOST_OPENING_MM, above=True)
    return SlideGripper(keys["tip"].text(), _names(keys["slides"]), 1e-3 * opening_mm)


def _beside(path: Path, node: JsonNode) -> Path:
    """A file that is named beside the one that names it."""
    return path.parent / node.text()


def _names(node: JsonNode) -> tuple[str, ...]:
    if not isinstance(node.value, str):
        _check_length(node, "names")
    return tuple(each.text() for each in node.items("name"))


def _row(node: JsonNode) -> Array:
    _check_length(node, "numbers")
    return node.numbers(len(node.value))


def _check_length(node: JsonNode, items: str) -> None:
    if not isinstance(node.value, list) or not 0 < len(node.value) <= _MOST_JOINTS:
        node.fail(f"a list of 1 to {_MOST_JOINTS} {items} is needed")


def _each(top: Mapping[str, JsonNode], key: str, most: float) -> Array | None:
    """A number above zero for each joint, or one for all."""
    if key not in top:
        return None
    node = top[key]
    numbers = _row(node) if isinstance(node.value, list) else np.array([node.number(0.0, most, above=True)])
    if not ((numbers > 0.0) & (numbers <= most)).all():
        node.fail(f"numbers above 0 and up to {most:g} are needed")
    return numbers
