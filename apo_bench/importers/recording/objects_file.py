"""Read OBJECTS.toml: the id of each part in the log, and the pose of the part's frame in the tracker's model."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, final

from apo_bench.errors import one_line, require, require_known
from apo_bench.geometry import Array
from apo_bench.importers.recording.camera_file import NamedEntries
from apo_bench.importers.recording.tracks import Log, PoseTrack
from apo_bench.io import FileTable, convert_typed, read_typed
from apo_bench.scenario.values import AnyPose

_MOST_IDS = 12
"""Largest number of ids that an error names."""


class ObjectTable(FileTable, frozen=True, kw_only=True):
    """The table of one part; ids are texts, or whole numbers as in BOP files."""

    id: str | int
    frame: AnyPose = AnyPose(at_mm=(0.0, 0.0, 0.0))


class ObjectsTable(FileTable, frozen=True, kw_only=True):
    """The tables of an objects file."""

    schema: Literal["apo-bench/objects/1"]
    objects: NamedEntries
    ignore: tuple[str | int, ...] = ()


class TrackedPart(NamedTuple):
    """The id of a part in the log, and its frame in the tracker's model."""

    id: str
    T_model_part: Array
    """(4, 4), model from part, [m]."""


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
    parts: dict[str, TrackedPart] = {}
    for part, value in top.objects.items():
        place = f"{path}, objects, {part}"
        stated = convert_typed(value, ObjectTable, place)
        require(
            all(tracked.id != str(stated.id) for tracked in parts.values()),
            f"{place}: the id '{stated.id}' is that of another part already.",
        )
        parts[part] = TrackedPart(str(stated.id), stated.frame.matrix(f"{place}, frame"))
    return ObjectsFile(str(path), parts, frozenset(map(str, top.ignore)))


def name_tracks(log: Log, objects: ObjectsFile) -> Mapping[str, PoseTrack]:
    """Return the track of each part, camera from part.

    Raises:
        InputError: An id of the log is no part, or a part is not in the log.
    """
    known = {tracked.id for tracked in objects.parts.values()} | objects.ignored
    strange = [f"'{one_line(name, 60)}'" for name in log.tracks if name not in known]
    require(
        not strange,
        f"{log.file}: the id {', '.join(strange[:_MOST_IDS])} is no part; name its part in {objects.file}, or add it "
        f"to its key `ignore`. Known: {', '.join(sorted(known))}.",
    )
    tracks: dict[str, PoseTrack] = {}
    for part, tracked in objects.parts.items():
        require_known("id", tracked.id, log.tracks, place=f"{objects.file}, {part}")
        t, T = log.tracks[tracked.id]
        tracks[part] = PoseTrack(t, T @ tracked.T_model_part)
    return tracks
