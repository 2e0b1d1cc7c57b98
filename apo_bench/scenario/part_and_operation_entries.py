"""Read parts and operations from the tables of a scenario file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Operation
from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Array, Solid, pose
from apo_bench.io import convert_typed
from apo_bench.planning.insertion.attach_line import Preference
from apo_bench.scenario.contacts import ContactGaps, check_kinds, read_contacts
from apo_bench.scenario.grasps import read_grasp
from apo_bench.scenario.parts import find_part_path, load_part
from apo_bench.scenario.parts.fit_faces import mark_fit_faces
from apo_bench.scenario.parts.limits import FACE_OR_PART_NAME
from apo_bench.scenario.scenario import Grasp, Shift, Turn
from apo_bench.scenario.tables import AttachTable, OperationTable, PartTable, VaryTable
from apo_bench.scenario.values import check_span, normalize_axis

_ARM = "arm"
"""Name of the robot in a scene, which no part may have."""


class PartEntry(NamedTuple):
    """One entry of [parts]."""

    table: PartTable
    path: Path
    """Its part file."""
    solid: Solid

    @property
    def start(self) -> Array:
        """Its start pose, (4, 4), [m]; the identity if none is stated."""
        return np.eye(4) if self.table.start is None else self.table.start.matrix


class OperationEntry(NamedTuple):
    """One entry of [[operations]]."""

    operation: Operation
    gaps: ContactGaps
    goal: Array
    """(4, 4), target pose of the main part, frame of the assembly, [m]."""
    attach: Preference
    """Stated direction and length of the insertion."""
    grasp: Grasp
    varies: tuple[Shift | Turn, ...]
    """Variations of the true pose that each trial draws."""


def read_parts(tables: Mapping[str, Any], file: Path, checked: bool = True) -> Mapping[str, PartEntry]:
    """Read all parts; a part file that several parts share is loaded once.

    Args:
        tables: Name -> table of the part.
        file: The scenario file; paths are relative to its folder.
        checked: As in `load_part`.
    """
    solids: dict[Path, Solid] = {}
    parts = {}
    for name, value in tables.items():
        place = f"{file}, parts, {name}"
        require(
            FACE_OR_PART_NAME.fullmatch(name) and name != _ARM,
            f"{place}: a part cannot be called '{name}'; use a letter, then letters, digits and underscores, and not "
            f"'{_ARM}', as the robot is called.",
        )
        table = convert_typed(value, PartTable, place)
        require(table.fixed or not table.follows_site, f"{place}, follows_site: only a fixed part can follow the site.")
        require(table.fixed or table.start, f"{place}: the key 'start' is missing; say where the part stands.")
        try:
            path = file.parent / find_part_path(table.file)
            if path not in solids:
                solids[path] = load_part(path, checked)
            solid = mark_fit_faces(solids[path], table.fit) if table.fit else solids[path]
            parts[name] = PartEntry(table, path, solid)
        except InputError as error:
            raise InputError(f"{place}: {error}") from error
    return parts


def read_operations(
    tables: Sequence[OperationTable], file: Path, parts: Mapping[str, PartEntry]
) -> tuple[OperationEntry, ...]:
    """Read all operations in order, with defaults filled in.

    Args:
        file: The scenario file, for messages.
    """
    # Poses and parts in place, updated after each operation.
    poses = {name: part.start for name, part in parts.items()}
    there = {name for name, part in parts.items() if part.table.fixed}
    entries: list[OperationEntry] = []
    for k, table in enumerate(tables):
        place = f"{file}, operation {k + 1}"
        entry = _read_operation(table, k, place, parts, poses, there)
        entries.append(entry)
        check_kinds(place, [earlier.gaps for earlier in entries])
        T = entry.goal @ pose.inverse(poses[entry.operation.main])
        poses |= {name: T @ poses[name] for name in entry.operation.carries} | {entry.operation.main: entry.goal}
        there |= set(entry.operation.moves)
    return tuple(entries)


def _read_operation(
    table: OperationTable,
    k: int,
    place: str,
    parts: Mapping[str, PartEntry],
    poses: Mapping[str, Array],
    there: set[str],
) -> OperationEntry:
    """Read operation k, counted from 0.

    Args:
        place: File and operation, for messages.
        poses: Part -> pose before the operation, (4, 4).
        there: Parts in place before the operation.
    """
    main = table.move
    _check_movable(main, f"{place}, move", parts)
    for name in table.carries:
        at = f"{place}, carries"
        _check_movable(name, at, parts)
        once = (main, *table.carries).count(name) == 1
        require(once, f"{at}: '{name}' is moved already; name every part once.")
        require(name in there, f"{at}: '{name}' is carried before any operation has moved it; move it first.")
    solids = {name: part.solid for name, part in parts.items()}
    gaps = read_contacts(table.contacts, place, (main, *table.carries), solids, there)
    varies = table.vary if isinstance(table.vary, tuple) else (table.vary,)
    return OperationEntry(
        operation=Operation(main, tuple(gaps), table.carries, table.clamp),
        gaps=gaps,
        goal=table.goal.matrix,
        attach=_read_attach(table.attach, f"{place}, attach"),
        grasp=read_grasp(table.grasp, f"{place}, grasp", main, solids[main], poses[main]),
        varies=tuple(_read_variation(each, k, f"{place}, vary") for each in varies),
    )


def _check_movable(name: str, place: str, parts: Mapping[str, PartEntry]) -> None:
    """Raise an `InputError` if a part is unknown or fixed."""
    require_known("part", name, parts, place=place)
    require(not parts[name].table.fixed, f"{place}: '{name}' is fixed and cannot be moved; move another part.")


def _read_attach(table: AttachTable, place: str) -> Preference:
    """The stated direction and length [m] of an insertion; None for each that is not stated."""
    direction = None if table.along is None else normalize_axis(table.along, f"{place}, along")
    return Preference(direction, None if table.travel_mm is None else 1e-3 * table.travel_mm)


def _read_variation(table: VaryTable, operation: int, place: str) -> Shift | Turn:
    """The shift or turn of a `vary` entry."""
    if table.along is not None and table.mm is not None and table.about is None and table.deg is None:
        low, high = check_span(table.mm, f"{place}, mm")
        return Shift(operation, normalize_axis(table.along, f"{place}, along"), 1e-3 * low, 1e-3 * high)
    if table.about is None or table.deg is None or table.along is not None or table.mm is not None:
        raise InputError(f"{place}: 'along' with 'mm', or 'about' with 'deg' and 'at_mm', are needed.")
    low, high = np.radians(check_span(table.deg, f"{place}, deg"))
    axis = normalize_axis(table.about, f"{place}, about")
    return Turn(operation, axis, 1e-3 * np.array(table.at_mm), float(low), float(high))
