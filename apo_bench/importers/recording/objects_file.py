"""Read OBJECTS.toml: the ids of each part in the log, and the pose of the part's frame in the tracker's model."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, final

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.importers.recording.camera_file import NamedEntries
from apo_bench.io import FileTable, convert_typed, read_typed
from apo_bench.scenario.values import AnyPose


class ObjectTable(FileTable, frozen=True, kw_only=True):
    """The table of one part; ids are texts, or whole numbers as in BOP files."""

    id: str | int | list[str | int]
    frame: AnyPose | None = None


class ObjectsTable(FileTable, frozen=True, kw_only=True):
    """The tables of an objects file."""

    schema: Literal["apo-bench/objects/1"]
    objects: NamedEntries
    ignore: tuple[str | int, ...] = ()


class TrackedPart(NamedTuple):
    """The ids of a part in the log, and its frame in the tracker's model."""

    ids: tuple[str, ...]
    T_model_part: Array
    """(4, 4), model of the first id from part, [m]."""
    others: Mapping[str, Array]
    """Other id -> its frame, as stated; the frames of the rest are solved."""


@final
@dataclass(frozen=True, eq=False)
class ObjectsFile:
    """The parts and ignored ids of an objects file."""

    file: str
    parts: Mapping[str, TrackedPart]
    ignored: frozenset[str]
    """Ids of the log that are no parts."""

    @property
    def models(self) -> Mapping[str, Array]:
        """Part -> pose of its frame in the tracker's model, (4, 4), [m]."""
        return {part: tracked.T_model_part for part, tracked in self.parts.items()}


def read_objects(path: str | Path) -> ObjectsFile:
    """Read an objects file.

    Raises:
        InputError: A key or value is wrong; the message names it.
    """
    top = read_typed(path, ObjectsTable, "objects file")
    parts = {part: _read_part(value, f"{path}, objects, {part}") for part, value in top.objects.items()}
    return ObjectsFile(str(path), parts, frozenset(map(str, top.ignore)))


def _read_part(value: Any, place: str) -> TrackedPart:
    """Read the table of a part."""
    stated = convert_typed(value, ObjectTable, place)
    ids = tuple(str(name) for name in (stated.id if isinstance(stated.id, list) else [stated.id]))
    require(ids and len(ids) == len({*ids}), f"{place}: an id of the log is needed, and each one once.")
    return TrackedPart(ids, np.eye(4) if stated.frame is None else stated.frame.matrix(f"{place}, frame"), {})


def merge_tags(objects: ObjectsFile, known: Collection[str]) -> ObjectsFile:
    """Return the objects in which an entry such as `stick_tag2` counts as another id of the part `stick`.

    Args:
        known: Parts of the scenario; other entries are of the part with whose name theirs begins.
    """
    parts = {part: tracked for part, tracked in objects.parts.items() if part in known}
    for name, tracked in objects.parts.items():
        of = [part for part in parts if name.startswith(f"{part}_")]
        if name in parts or not of:
            parts.setdefault(name, tracked)
            continue
        first = parts[max(of, key=len)]
        is_stated = not (tracked.T_model_part == np.eye(4)).all()
        stated = {tracked.ids[0]: tracked.T_model_part} if is_stated else {}
        others = {**first.others, **stated, **tracked.others}
        parts[max(of, key=len)] = TrackedPart((*first.ids, *tracked.ids), first.T_model_part, others)
    return ObjectsFile(objects.file, parts, objects.ignored)
