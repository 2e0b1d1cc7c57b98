"""The tables [parts] and [[operations]] of a scenario file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly.topology import Operation
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.holds import FINGER_ROOM_M, PAD_M, holds, holds_whole
from apo_bench.geometry.solid import Solid, all_boxes, extent
from apo_bench.insertion.line import Preference
from apo_bench.io.documents import JsonNode
from apo_bench.parts import load_part, part_path
from apo_bench.parts.allowed import FACE_OR_PART_NAME
from apo_bench.scenario.contacts import Asked, check_kinds, read_contacts
from apo_bench.scenario.keys import LARGEST_LENGTH_MM, read_pose, read_span, read_unit_axis, refuse, refuse_name
from apo_bench.scenario.scenario import Grasp, Shift, Turn

_MOST_PARTS = 50
_MOST_OPERATIONS = 100
_MOST_CONTACTS = 50
_MOST_SHIFTS = 20
"""In a scenario, in a scenario, of an operation, in a scenario: what is checked in a moment."""
_ARM = "arm"
"""What the robot is called in a scene."""
_RAISED = 0.15
"""Height of a grasp over the middle of the part, as a part of the height of the part."""
_OPENING_M = 0.046
"""How far each finger of the arm that comes with the benchmark opens."""
_MOST_HELD_M = 2 * _OPENING_M - FINGER_ROOM_M
"""Width that the arm can hold where the file does not say how: so much room its fingers want before they close."""
_LEVEL = 1e-6
"""Vertical component below which a unit vector is level."""


@final
@dataclass(frozen=True, eq=False)
class PartEntry:
    """One entry of [parts]."""

    path: Path
    solid: Solid
    fixed: bool
    follows_site: bool
    start: Array
    """(4, 4), [m]."""
    color: tuple[float, float, float] | None


class OperationEntry(NamedTuple):
    """One entry of [[operations]]."""

    operation: Operation
    asked: Asked
    goal: Array
    """(4, 4), frame of the assembly, [m]."""
    attach: Preference
    grasp: Grasp
    varies: tuple[Shift | Turn, ...]


def read_parts(node: JsonNode, folder: Path) -> Mapping[str, PartEntry]:
    """Every part; a file that several parts share is loaded once. Paths are relative to `folder`."""
    if not isinstance(node.value, dict) or not node.value:
        node.fail("at least one table [parts.NAME] is needed")
    if len(node.value) > _MOST_PARTS:
        refuse(node, f"at most {_MOST_PARTS} parts are allowed, {len(node.value)} were given")
    solids: dict[Path, Solid] = {}
    return {name: _part(node.child(value, name), name, folder, solids) for name, value in node.value.items()}


def _part(node: JsonNode, name: str, folder: Path, solids: dict[Path, Solid]) -> PartEntry:
    if not FACE_OR_PART_NAME.fullmatch(name):
        refuse(node, f"a part cannot be called '{name}'; use a letter, then letters, digits and underscores")
    if name == _ARM:
        refuse(node, f"a part cannot be called '{_ARM}', as the robot is; give it another name")
    keys = node.fields(("file",), ("fixed", "follows_site", "start", "color"))
    fixed = "fixed" in keys and keys["fixed"].flag()
    follows = "follows_site" in keys and keys["follows_site"].flag()
    if follows and not fixed:
        refuse(keys["follows_site"], "only a fixed part can follow the site; say fixed = true, or leave this key out")
    if not fixed and "start" not in keys:
        refuse(node, "the key 'start' is missing; say where the part stands, such as start = { at_mm = [0, 260, 0] }")
    path, solid = _solid(keys["file"], folder, solids)
    start = read_pose(keys["start"]) if "start" in keys else np.eye(4)
    return PartEntry(path, solid, fixed, follows, start, _color(keys["color"]) if "color" in keys else None)


def _solid(node: JsonNode, folder: Path, solids: dict[Path, Solid]) -> tuple[Path, Solid]:
    try:
        path = part_path(node.text())
        path = path if path.is_absolute() else folder / path
        if path not in solids:
            solids[path] = load_part(path)
    except InputError as error:
        if str(error).startswith(f"{node.file}, "):
            raise
        raise InputError(f"{node.file}, {node.key}: {error}") from error
    return path, solids[path]


def _color(node: JsonNode) -> tuple[float, float, float]:
    r, g, b = node.numbers(3)
    if not (min(r, g, b) >= 0 and max(r, g, b) <= 1):
        node.fail("red, green and blue from 0 to 1 are needed")
    return float(r), float(g), float(b)


def read_operations(node: JsonNode, parts: Mapping[str, PartEntry]) -> tuple[OperationEntry, ...]:
    """Every operation in order, with defaults filled in."""
    nodes = node.items("operation")
    if not nodes:
        refuse(node, "the list is empty; give at least one [[operations]]")
    if len(nodes) > _MOST_OPERATIONS:
        refuse(node, f"at most {_MOST_OPERATIONS} operations are allowed, {len(nodes)} were given")
    poses = {name: part.start for name, part in parts.items()}
    there = {name for name, part in parts.items() if part.fixed}
    entries = []
    for k, each in enumerate(nodes):
        entry = _entry(each, k, parts, poses, there)
        entries.append(entry)
        check_kinds(each.child(None, "contacts"), [earlier.asked for earlier in entries])
        T = entry.goal @ pose.inverse(poses[entry.operation.main])
        poses |= {name: T @ poses[name] for name in entry.operation.carries} | {entry.operation.main: entry.goal}
        there |= set(entry.operation.moves)
    if sum(len(entry.varies) for entry in entries) > _MOST_SHIFTS:
        refuse(node, f"at most {_MOST_SHIFTS} 'vary' are allowed in all; each is checked at both ends")
    return tuple(entries)


def _entry(
    node: JsonNode, k: int, parts: Mapping[str, PartEntry], poses: Mapping[str, Array], there: set[str]
) -> OperationEntry:
    keys = node.fields(("move", "goal", "contacts"), ("carries", "attach", "grasp", "vary"))
    main = _movable(keys["move"], parts)
    carries = tuple(_movable(n, parts) for n in _items(keys["carries"], "entry")) if "carries" in keys else ()
    for name in carries:
        if name == main:
            refuse(keys["carries"], f"'{name}' would carry itself, it is the moved part; leave it out of this list")
        if carries.count(name) > 1:
            refuse(keys["carries"], f"'{name}' stands here twice; name it once")
        if name not in there:
            refuse(keys["carries"], f"'{name}' is carried before any operation has moved it; move it first")
    goal = read_pose(keys["goal"])
    solids = {name: part.solid for name, part in parts.items()}
    contacts = _items(keys["contacts"], "contact")
    if len(contacts) > _MOST_CONTACTS:
        refuse(keys["contacts"], f"at most {_MOST_CONTACTS} contacts are allowed, {len(contacts)} were given")
    gaps = read_contacts(contacts, main, carries, solids, there)
    if not gaps:
        refuse(keys["contacts"], 'no contact was given; say what the part touches, such as [["bottom", "table.top"]]')
    return OperationEntry(
        Operation(main, tuple(gaps), carries),
        gaps,
        goal,
        _attach(keys["attach"]) if "attach" in keys else Preference(),
        _grasp(keys.get("grasp"), node, parts[main].solid, poses[main]),
        _varies(keys["vary"], k) if "vary" in keys else (),
    )


def _items(node: JsonNode, name: str) -> tuple[JsonNode, ...]:
    """The entries of a list within an operation, with the operation in their key."""
    return tuple(JsonNode(each.value, each.file, f"{node.key}, {each.key}") for each in node.items(name))


def _movable(node: JsonNode, parts: Mapping[str, PartEntry]) -> str:
    name = node.text()
    if name not in parts:
        refuse_name(node, "part", name, parts)
    if parts[name].fixed:
        refuse(node, f"'{name}' is fixed and cannot be moved; move another part, or take fixed = true away")
    return name


def _attach(node: JsonNode) -> Preference:
    """What is stated of the line to the goal."""
    keys = node.fields((), ("along", "travel_mm"))
    direction = read_unit_axis(keys["along"]) if "along" in keys else None
    travel_m = 1e-3 * keys["travel_mm"].number(0.0, above=True) if "travel_mm" in keys else None
    if travel_m is not None and travel_m > 1e-3 * LARGEST_LENGTH_MM:
        keys["travel_mm"].fail(f"a length of at most {LARGEST_LENGTH_MM:g} mm is needed")
    return Preference(direction, travel_m)


def _grasp(node: JsonNode | None, entry: JsonNode, solid: Solid, before: Array) -> Grasp:
    """The grasp; unless the file says otherwise, above the middle, across the narrower level axis of a part of boxes.

    Where that leaves pads beside the part, and of other parts, it is the best place that the shape offers.
    """
    keys = node.fields((), ("at_mm", "across")) if node else {}
    low, high = solid.bounds
    level = [axis for axis in range(3) if abs(before[2, axis]) < _LEVEL]
    across = None
    point = _above_middle(solid, before)
    if "at_mm" in keys:
        point = 1e-3 * keys["at_mm"].numbers(3)
        over = PAD_M[1] * np.round(before[2, :3], 9)
        ends = np.minimum(low, low + over), np.maximum(high, high + over)
        if ((point < ends[0]) | (point > ends[1])).any():
            span = " to ".join("(" + ", ".join(f"{1e3 * x:g}" for x in corner) + ")" for corner in ends)
            needed = f"a point of the part, or up to {1e3 * PAD_M[1]:g} mm over it, from {span} mm, is needed"
            keys["at_mm"].fail(needed, "pads reach so far below the point")
    if "across" in keys:
        across = read_unit_axis(keys["across"])
        if abs((before[:3, :3] @ across)[2]) > _LEVEL:
            keys["across"].fail(
                "an axis that is level where the part is picked is needed", "the gripper comes from above"
            )
    elif len(level) >= 2:
        across = np.eye(3)[min(level, key=lambda axis: (high - low)[axis])]
    stated = Grasp(point, across) if across is not None else None
    if stated and (keys.keys() == {"at_mm", "across"} or _holds_box(solid, stated, before)):
        ends = extent(solid.pieces, stated.across)
        if keys or ends[1] - ends[0] <= _MOST_HELD_M or not holds(solid, np.round(before[2, :3], 9), _OPENING_M):
            return stated
    return _by_shape(keys, entry, solid, before, point)


def _holds_box(solid: Solid, grasp: Grasp, T: Array) -> bool:
    """Whether this is a grasp of a part of boxes, with the part between the pads."""
    up = T[2, :3]
    return all_boxes(solid.pieces) and holds_whole(solid.pieces, grasp.point, grasp.across, np.round(up, 9))


def _by_shape(keys: Mapping[str, JsonNode], entry: JsonNode, solid: Solid, T: Array, point: Array) -> Grasp:
    """The best place for pads; of those that are near to what is stated, if something is."""
    grasps = [Grasp(hold.point, hold.across) for hold in holds(solid, np.round(T[2, :3], 9), _OPENING_M)]
    if "across" in keys:
        across = read_unit_axis(keys["across"])
        grasps = [grasp for grasp in grasps if abs(grasp.across @ across) > 1.0 - _LEVEL]
    if not grasps:
        size = " x ".join(f"{round(1e3 * x, 1):g}" for x in solid.bounds[1] - solid.bounds[0])
        refuse(
            entry,
            f"'{entry.value['move']}', {size} mm, has no opposite faces, and no shaft, within {1e3 * _MOST_HELD_M:g} "
            f"mm of each other that pads from above reach; the gripper opens to {2e3 * _OPENING_M:g} mm, so say "
            "grasp = { at_mm = [x, y, z], across = [x, y, z] }, give it something to hold, or let it stand otherwise",
        )
    if "at_mm" in keys:
        return Grasp(point, min(grasps, key=lambda grasp: float(np.linalg.norm(grasp.point - point))).across)
    return grasps[0]


def _above_middle(solid: Solid, T: Array) -> Array:
    """Over the middle of the part as it stands, so that fingers which reach below it clear what it stands on."""
    low, high = solid.bounds
    up = T[2, :3]
    point: Array = (low + high) / 2 + _RAISED * (np.abs(up) @ (high - low)) * up
    return np.clip(point, low, high)


def _varies(node: JsonNode, operation: int) -> tuple[Shift | Turn, ...]:
    many = node.items(node.key) if isinstance(node.value, list) else (node,)
    return tuple(_turn(each, operation) if _is_turn(each) else _shift(each, operation) for each in many)


def _is_turn(node: JsonNode) -> bool:
    return isinstance(node.value, dict) and "about" in node.value


def _shift(node: JsonNode, operation: int) -> Shift:
    keys = node.fields(("along", "mm"))
    low, high = read_span(keys["mm"], -LARGEST_LENGTH_MM, LARGEST_LENGTH_MM)
    return Shift(operation, read_unit_axis(keys["along"]), 1e-3 * low, 1e-3 * high)


def _turn(node: JsonNode, operation: int) -> Turn:
    keys = node.fields(("about", "deg"), ("at_mm",))
    low, high = np.radians(read_span(keys["deg"], -360.0, 360.0))
    point = 1e-3 * keys["at_mm"].numbers(3) if "at_mm" in keys else np.zeros(3)
    if np.abs(point).max() > 1e-3 * LARGEST_LENGTH_MM:
        keys["at_mm"].fail(f"three lengths from -{LARGEST_LENGTH_MM:g} to {LARGEST_LENGTH_MM:g} mm are needed")
    return Turn(operation, read_unit_axis(keys["about"]), point, float(low), float(high))
