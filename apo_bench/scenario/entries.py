"""The tables [parts] and [[operations]] of a scenario file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Operation
from apo_bench.errors import InputError
from apo_bench.geometry import Array, Solid, pose
from apo_bench.insertion.arrival import Preference
from apo_bench.io import JsonNode
from apo_bench.parts import load_part, part_path
from apo_bench.parts.agreement import with_fit
from apo_bench.parts.allowed import FACE_OR_PART_NAME
from apo_bench.scenario.contacts import (
    LARGEST_LENGTH_MM,
    ContactGaps,
    check_kinds,
    read_contacts,
    read_point,
    read_pose,
    read_span,
    read_unit_axis,
    refuse_name,
    refuse_unless,
)
from apo_bench.scenario.grasps import read_grasp
from apo_bench.scenario.scenario import Grasp, Shift, Turn

_MOST_PARTS = 50
_MOST_OPERATIONS = 100
_MOST_CONTACTS = 50
_MOST_SHIFTS = 20
"""In a scenario, in a scenario, of an operation, in a scenario: what is checked in a moment."""
_MOST_UNDERSIZE_MM = 1.0
_ARM = "arm"
"""What the robot is called in a scene."""


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
    gaps: ContactGaps
    goal: Array
    """(4, 4), frame of the assembly, [m]."""
    attach: Preference
    grasp: Grasp
    varies: tuple[Shift | Turn, ...]


def read_parts(node: JsonNode, folder: Path, checked: bool = True) -> Mapping[str, PartEntry]:
    """Every part; a file that several parts share is loaded once, `checked` as in `load_part`. Paths are relative to
    `folder`."""
    node.require(isinstance(node.value, dict) and node.value, "at least one table [parts.NAME] is needed")
    refuse_unless(
        len(node.value) <= _MOST_PARTS, node, f"at most {_MOST_PARTS} parts are allowed, {len(node.value)} were given"
    )
    solids: dict[Path, Solid] = {}
    return {name: _part(node.child(value, name), name, folder, solids, checked) for name, value in node.value.items()}


def _part(node: JsonNode, name: str, folder: Path, solids: dict[Path, Solid], checked: bool) -> PartEntry:
    refuse_unless(
        FACE_OR_PART_NAME.fullmatch(name),
        node,
        f"a part cannot be called '{name}'; use a letter, then letters, digits and underscores",
    )
    refuse_unless(name != _ARM, node, f"a part cannot be called '{_ARM}', as the robot is; give it another name")
    keys = node.fields(("file",), ("fixed", "follows_site", "start", "color", "fit"))
    fixed = "fixed" in keys and keys["fixed"].flag()
    follows = "follows_site" in keys and keys["follows_site"].flag()
    refuse_unless(
        fixed or not follows,
        keys.get("follows_site", node),
        "only a fixed part can follow the site; say fixed = true, or leave this key out",
    )
    refuse_unless(
        fixed or "start" in keys,
        node,
        "the key 'start' is missing; say where the part stands, such as start = { at_mm = [0, 260, 0] }",
    )
    path, solid = _solid(keys["file"], folder, solids, checked)
    if "fit" in keys:
        solid = _with_fit(keys["fit"], solid)
    start = read_pose(keys["start"]) if "start" in keys else np.eye(4)
    return PartEntry(path, solid, fixed, follows, start, _color(keys["color"]) if "color" in keys else None)


def _solid(node: JsonNode, folder: Path, solids: dict[Path, Solid], checked: bool) -> tuple[Path, Solid]:
    try:
        path = part_path(node.text())
        path = path if path.is_absolute() else folder / path
        if path not in solids:
            solids[path] = load_part(path, checked)
    except InputError as error:
        if str(error).startswith(f"{node.file}, "):
            raise
        raise InputError(f"{node.file}, {node.key}: {error}") from error
    return path, solids[path]


def _with_fit(node: JsonNode, solid: Solid) -> Solid:
    """A part with faces that recede here: face -> by how much it lies deeper in the part than its file says, mm."""
    keys = node.fields((), (*solid.faces, *solid.rounds))
    undersizes = {name: key.number(-_MOST_UNDERSIZE_MM, _MOST_UNDERSIZE_MM) for name, key in keys.items()}
    try:
        return with_fit(solid, undersizes)
    except InputError as error:
        raise InputError(f"{node.file}, {node.key}: {error}") from error


def _color(node: JsonNode) -> tuple[float, float, float]:
    r, g, b = node.numbers(3)
    node.require(min(r, g, b) >= 0 and max(r, g, b) <= 1, "red, green and blue from 0 to 1 are needed")
    return float(r), float(g), float(b)


def read_operations(node: JsonNode, parts: Mapping[str, PartEntry]) -> tuple[OperationEntry, ...]:
    """Every operation in order, with defaults filled in."""
    nodes = node.items("operation")
    refuse_unless(nodes, node, "the list is empty; give at least one [[operations]]")
    refuse_unless(
        len(nodes) <= _MOST_OPERATIONS,
        node,
        f"at most {_MOST_OPERATIONS} operations are allowed, {len(nodes)} were given",
    )
    poses = {name: part.start for name, part in parts.items()}
    there = {name for name, part in parts.items() if part.fixed}
    entries = []
    for k, each in enumerate(nodes):
        entry = _entry(each, k, parts, poses, there)
        entries.append(entry)
        check_kinds(each.child(None, "contacts"), [earlier.gaps for earlier in entries])
        T = entry.goal @ pose.inverse(poses[entry.operation.main])
        poses |= {name: T @ poses[name] for name in entry.operation.carries} | {entry.operation.main: entry.goal}
        there |= set(entry.operation.moves)
    refuse_unless(
        sum(len(entry.varies) for entry in entries) <= _MOST_SHIFTS,
        node,
        f"at most {_MOST_SHIFTS} 'vary' are allowed in all; each is checked at both ends",
    )
    return tuple(entries)


def _entry(
    node: JsonNode, k: int, parts: Mapping[str, PartEntry], poses: Mapping[str, Array], there: set[str]
) -> OperationEntry:
    keys = node.fields(("move", "goal", "contacts"), ("carries", "attach", "grasp", "vary"))
    main = _movable(keys["move"], parts)
    carries = tuple(_movable(n, parts) for n in _items(keys["carries"], "entry")) if "carries" in keys else ()
    for name in carries:
        refuse_unless(
            name != main,
            keys["carries"],
            f"'{name}' would carry itself, it is the moved part; leave it out of this list",
        )
        refuse_unless(carries.count(name) <= 1, keys["carries"], f"'{name}' stands here twice; name it once")
        refuse_unless(
            name in there, keys["carries"], f"'{name}' is carried before any operation has moved it; move it first"
        )
    goal = read_pose(keys["goal"])
    solids = {name: part.solid for name, part in parts.items()}
    contacts = _items(keys["contacts"], "contact")
    refuse_unless(
        len(contacts) <= _MOST_CONTACTS,
        keys["contacts"],
        f"at most {_MOST_CONTACTS} contacts are allowed, {len(contacts)} were given",
    )
    gaps = read_contacts(contacts, main, carries, solids, there)
    refuse_unless(
        gaps, keys["contacts"], 'no contact was given; say what the part touches, such as [["bottom", "table.top"]]'
    )
    return OperationEntry(
        Operation(main, tuple(gaps), carries),
        gaps,
        goal,
        _attach(keys["attach"]) if "attach" in keys else Preference(),
        read_grasp(keys.get("grasp"), node, parts[main].solid, poses[main]),
        _varies(keys["vary"], k) if "vary" in keys else (),
    )


def _items(node: JsonNode, name: str) -> tuple[JsonNode, ...]:
    """The entries of a list within an operation, with the operation in their key."""
    return tuple(JsonNode(each.value, each.file, f"{node.key}, {each.key}") for each in node.items(name))


def _movable(node: JsonNode, parts: Mapping[str, PartEntry]) -> str:
    name = node.text()
    if name not in parts:
        refuse_name(node, "part", name, parts)
    refuse_unless(
        not parts[name].fixed,
        node,
        f"'{name}' is fixed and cannot be moved; move another part, or take fixed = true away",
    )
    return name


def _attach(node: JsonNode) -> Preference:
    """What is stated of the line to the goal."""
    keys = node.fields((), ("along", "travel_mm"))
    direction = read_unit_axis(keys["along"]) if "along" in keys else None
    travel_m = 1e-3 * keys["travel_mm"].number(0.0, above=True) if "travel_mm" in keys else None
    keys.get("travel_mm", node).require(
        travel_m is None or travel_m <= 1e-3 * LARGEST_LENGTH_MM,
        f"a length of at most {LARGEST_LENGTH_MM:g} mm is needed",
    )
    return Preference(direction, travel_m)


def _varies(node: JsonNode, operation: int) -> tuple[Shift | Turn, ...]:
    many = node.items(node.key) if isinstance(node.value, list) else (node,)
    return tuple(_vary(each, operation) for each in many)


def _vary(node: JsonNode, operation: int) -> Shift | Turn:
    if isinstance(node.value, dict) and "about" in node.value:
        return _turn(node, operation)
    keys = node.fields(("along", "mm"))
    low, high = read_span(keys["mm"], -LARGEST_LENGTH_MM, LARGEST_LENGTH_MM)
    return Shift(operation, read_unit_axis(keys["along"]), 1e-3 * low, 1e-3 * high)


def _turn(node: JsonNode, operation: int) -> Turn:
    keys = node.fields(("about", "deg"), ("at_mm",))
    low, high = np.radians(read_span(keys["deg"], -360.0, 360.0))
    point = read_point(keys["at_mm"]) if "at_mm" in keys else np.zeros(3)
    return Turn(operation, read_unit_axis(keys["about"]), point, float(low), float(high))
