"""OBJECTS.toml: which id of a tracker is which part, and where the part's frame lies in the tracker's model."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, final

import numpy as np

from apo_bench.errors import InputError, one_line, unknown
from apo_bench.geometry import Array
from apo_bench.io.documents import JsonNode, read_toml
from apo_bench.recording.log import Log, PoseTrack
from apo_bench.scenario.keys import read_any_pose, refuse

_SCHEMA = "apo-bench/objects/1"
_MOST_IDS = 12
"""So many ids are named in a sentence."""


class TrackedPart(NamedTuple):
    """A part as a tracker knows it."""

    id: str
    T_model_part: Array
    """(4, 4), [m]."""


@final
@dataclass(frozen=True, eq=False)
class ObjectsFile:
    """What an objects file states."""

    file: str
    parts: Mapping[str, TrackedPart]
    ignored: frozenset[str]
    """Ids that are no parts."""

    @property
    def models(self) -> Mapping[str, Array]:
        """Part -> where its frame lies in the tracker's model, (4, 4), [m]."""
        return {part: tracked.T_model_part for part, tracked in self.parts.items()}


def read_objects(path: str | Path) -> ObjectsFile:
    """What an objects file states.

    Raises:
        InputError: Anything that is not as described, naming file and key.
    """
    top = read_toml(path, "objects file").fields_of(_SCHEMA, ("objects",), ("ignore",))
    if not isinstance(top["objects"].value, dict) or not top["objects"].value:
        top["objects"].fail('parts with ids are needed, such as castle1 = { id = "7" }')
    parts: dict[str, TrackedPart] = {}
    owners: dict[str, str] = {}
    for part, value in top["objects"].value.items():
        node = top["objects"].child(value, part)
        tracked = _tracked(node)
        if tracked.id in owners:
            refuse(node, f"the id '{tracked.id}' is that of '{owners[tracked.id]}' already; give each part its own")
        parts[part] = tracked
        owners[tracked.id] = part
    ignored = frozenset(_id(node) for node in top["ignore"].items("ignored id")) if "ignore" in top else frozenset()
    return ObjectsFile(str(path), parts, ignored)


def part_tracks(log: Log, objects: ObjectsFile) -> Mapping[str, PoseTrack]:
    """The tracks of parts, camera from part.

    Raises:
        InputError: An id of the log is no part, or a part is not in the log.
    """
    known = {tracked.id for tracked in objects.parts.values()} | objects.ignored
    strange = [name for name in log.tracks if name not in known]
    if strange:
        file = objects.file
        which = f"the id {_quoted(strange)}{_of_file(strange[0], log)} is no part; name its part in {file}, or add it"
        if len(strange) > 1:
            which = f"the ids {_quoted(strange)} are no parts; name their parts in {file}, or add them"
        raise InputError(f"{log.file}: {which} to its key `ignore`. Known: {', '.join(sorted(known))}.")
    tracks: dict[str, PoseTrack] = {}
    for part, tracked in objects.parts.items():
        if tracked.id not in log.tracks:
            sentence = unknown("id", tracked.id, log.tracks).replace("Known", "In the log")
            raise InputError(f"{objects.file}, {part}: {sentence}")
        track = log.tracks[tracked.id]
        tracks[part] = PoseTrack(track.t, track.T @ tracked.T_model_part)
    return tracks


def _quoted(names: list[str]) -> str:
    more = ", ..." if len(names) > _MOST_IDS else ""
    return ", ".join(f"'{one_line(name, 60)}'" for name in names[:_MOST_IDS]) + more


def _of_file(name: str, log: Log) -> str:
    return ", the name of the file because it has no column of ids," if name == Path(log.file).stem else ""


def _tracked(node: JsonNode) -> TrackedPart:
    keys = node.fields(("id",), ("frame",))
    return TrackedPart(_id(keys["id"]), read_any_pose(keys["frame"]) if "frame" in keys else np.eye(4))


def _id(node: JsonNode) -> str:
    """A text, or a whole number as in BOP files."""
    return str(node.value) if isinstance(node.value, int) and not isinstance(node.value, bool) else node.text()
