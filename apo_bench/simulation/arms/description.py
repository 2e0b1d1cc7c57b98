"""The TOML file that describes an arm: what its MJCF does not show."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.errors import require
from apo_bench.geometry import Array, frozen, pose
from apo_bench.io import JsonNode, read_toml
from apo_bench.scenario.values import read_pose

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
