"""Match the ids of a log to the parts of a scenario."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.errors import one_line, require
from apo_bench.geometry import Solid
from apo_bench.importers.recording.identical_parts import follow_parts, group_identical, undo_swaps
from apo_bench.importers.recording.objects_file import ObjectsFile
from apo_bench.importers.recording.tags import TagOffset, join_tags
from apo_bench.importers.recording.tracks import Log, PoseTrack, best_poses

_MOST_IDS = 12  # ids that an error names


class MatchedTracks(NamedTuple):
    """The track of each part, with what was done to find it."""

    tracks: Mapping[str, PoseTrack]
    """Camera from part."""
    identical: Sequence[Sequence[str]]
    """Groups of parts with one id, whose tracks may belong to one another."""
    lost: Mapping[str, int]
    """Kind of lost frame -> number of frames that were left out."""
    offsets: Mapping[str, Sequence[TagOffset]]
    """Part -> its tags but the first."""
    notes: Sequence[str]
    doubts: Sequence[str]
    """What may be wrong, one sentence each."""


def match_tracks(log: Log, objects: ObjectsFile, solids: Mapping[str, Solid]) -> MatchedTracks:
    """Return the track of each part, camera from part.

    Args:
        solids: Shapes of parts by name, for their symmetries; a part that is missing has none.

    Raises:
        InputError: No id of a part is in the log.
    """
    by_ids, doubts = _find_ids(log, objects)
    notes: list[str] = []
    tracks: dict[str, PoseTrack] = {}
    offsets: dict[str, Sequence[TagOffset]] = {}
    for ids, parts in by_ids.items():
        if len(parts) > 1:
            require(len(ids) == 1, f"{objects.file}: parts that share an id have that id alone.")
            tracks |= _separate(log, ids[0], parts, objects, solids)
            notes.append(f"id {ids[0]} followed as {len(parts)} parts ({', '.join(parts)})")
            continue
        part = parts[0]
        tags = [(name, best_poses(log.candidates[name])) for name in ids]
        tracks[part], solved = join_tags(tags, objects.parts[part], solids.get(part))
        offsets[part] = [offset for _, offset in solved]
        for name, offset in solved:
            (doubts if offset.is_doubtful else notes).append(f"id {name} is another tag of {part}, {offset.source}")
    identical = [parts for parts in by_ids.values() if len(parts) > 1]
    alone = [parts[0] for parts in by_ids.values() if len(parts) == 1]
    notes += undo_swaps(tracks, group_identical(alone, objects.models, solids), solids)
    lost: dict[str, int] = {}
    for name in {name for ids in by_ids for name in ids}:
        for kind, n in log.candidates[name].lost.items():
            lost[kind] = lost.get(kind, 0) + n
    return MatchedTracks(tracks, identical, lost, offsets, notes, doubts)


def _find_ids(log: Log, objects: ObjectsFile) -> tuple[Mapping[tuple[str, ...], list[str]], list[str]]:
    """Return the ids of the log that are of parts -> these parts, and doubts about the other ones."""
    doubts = []
    by_ids: dict[tuple[str, ...], list[str]] = {}
    for part, tracked in objects.parts.items():
        found = {name: _find_id(name, log) for name in tracked.ids}
        missing = [name for name, known in found.items() if known is None]
        if missing:
            doubts.append(f"the id {', '.join(missing)} of '{part}' is not in the log")
        if known_ids := tuple(known for known in found.values() if known is not None):
            by_ids.setdefault(known_ids, []).append(part)
    names = ", ".join(f"'{one_line(name, 60)}'" for name in [*log.candidates][:_MOST_IDS])
    require(by_ids, f"{log.file}: no id of {objects.file} is in the log; its ids are {names}.")
    for name in log.candidates.keys() - {name for ids in by_ids for name in ids}:
        if name not in objects.ignored and name.rpartition("/")[2] not in objects.ignored:
            poses = log.candidates[name]
            doubts.append(
                f"the id '{one_line(name, 60)}' is no part, so its {len(poses.t)} poses from {poses.t[0]:.2f} s on are "
                "left out; name its part, or list it under `ignore`, in the objects file"
            )
    return by_ids, doubts


def _find_id(name: str, log: Log) -> str | None:
    """Return the id of the log that an id of the objects file means: itself, or the only one with it in its path."""
    if name in log.candidates:
        return name
    among = [known for known in log.candidates if name.strip("/") in (known, *known.split("/"))]
    among = among or [known for known in log.candidates if known.lower() == name.lower()]
    return among[0] if len(among) == 1 else None


def _separate(
    log: Log, name: str, parts: Sequence[str], objects: ObjectsFile, solids: Mapping[str, Solid]
) -> dict[str, PoseTrack]:
    """Return the tracks of parts that share an id."""
    models = [objects.parts[part].T_model_part for part in parts]
    poses = log.candidates[name]
    nameless = np.full(len(poses.t), -1)
    own = follow_parts(poses.t, poses.T @ models[0], nameless, len(parts), solids.get(parts[0]))
    there = len({*own.tolist()} - {-1})
    require(there == len(parts), f"{log.file}: the id '{name}' is that of {len(parts)} parts, and {there} are there.")
    return {part: PoseTrack(poses.t[own == i], poses.T[own == i] @ models[i]) for i, part in enumerate(parts)}
