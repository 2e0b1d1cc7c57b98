"""CAMERA.toml and OBJECTS.toml: how a log is written, where its camera stands, and which of its ids is which part.

What a tracker wrote: one track per id, poses of its model in the frame of the camera.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, one_line, require, unknown
from apo_bench.geometry import Array
from apo_bench.io import JsonNode, read_toml
from apo_bench.scenario.values import read_any_pose

MOST_POSES = 1_000_000
LARGEST_LOG_BYTES = 200_000_000
_NEAR_M = 0.02
_FAR_M = 20.0
"""Models whose median distance to the camera is less or more were given in another unit."""
_FAST_S = 2e-4
_SLOW_S = 2.0
"""Frames whose median distance in time is less or more have times in another unit."""


class PoseTrack(NamedTuple):
    """One model over time."""

    t: Array
    """(n,), [s], from the first pose of the log, increasing."""
    T: Array
    """(n, 4, 4), camera from model, [m]."""


@final
@dataclass(frozen=True, eq=False)
class Log:
    """A whole log."""

    file: str
    tracks: Mapping[str, PoseTrack]
    notes: tuple[str, ...]
    """How its numbers were read: units, order of the quaternion, direction."""


class LogRows(NamedTuple):
    """Poses as they stand in a file, in its order."""

    ids: Sequence[str]
    t: Array
    """(n,), [s]."""
    T: Array
    """(n, 4, 4), [m]."""
    places: Sequence[str]
    """Where each stands: `file, line 3`."""
    notes: Sequence[str]
    """How they were read."""


def checked_log(file: str, rows: LogRows) -> Log:
    """The tracks of a log, each with increasing times.

    Raises:
        InputError: Nothing stands in it, a time stands twice or runs backwards, or a unit is another one.
    """
    require(len(rows.t), f"{file}: no pose stands in the file; give a log with one row per pose.")
    names, which = np.unique(np.array(rows.ids, dtype=object).astype(str), return_inverse=True)
    tracks = {}
    # Trackers write the identity for a frame in which they lost a model. A track of nothing else is a model that stays.
    identity = (np.eye(4) == rows.T).all(axis=(1, 2))
    lost = 0
    for i, name in enumerate(names.tolist()):
        at = np.flatnonzero(which == i)
        _check_times(rows, name, at)
        if not identity[at].all():
            lost += int(identity[at].sum())
            at = at[~identity[at]]
        tracks[name] = PoseTrack(rows.t[at] - rows.t.min(), rows.T[at])
    # Metres are not to be read as millimetres, nor milliseconds as seconds, nor the other way round.
    distance = float(np.median(np.linalg.norm(rows.T[~identity if lost else slice(None), :3, 3], axis=1)))
    if not _NEAR_M <= distance <= _FAR_M:
        fault = "metres that were read as mm" if distance < _NEAR_M else "mm that were read as metres"
        raise InputError(
            f"{file}: the median distance to the camera is {distance * 1e3:.3g} mm, so these seem to be {fault}; "
            "state the unit: columns such as x_mm or x_m, or `length` in the camera file."
        )
    steps = np.concatenate([np.diff(track.t) for track in tracks.values()])
    require(
        not len(steps) or _FAST_S <= np.median(steps) <= _SLOW_S,
        f"{file}: the median time between two frames of a track is {np.median(steps):.3g} s, so its times seem "
        "to be in another unit; state it: a column such as t_ms or t_s, or `time` in the camera file.",
    )
    left_out = [f"{lost} poses that are the identity left out as lost frames"] if lost else []
    return Log(file, MappingProxyType(tracks), (*rows.notes, *left_out))


def _check_times(rows: LogRows, name: str, at: NDArray[np.intp]) -> None:
    steps = np.diff(rows.t[at])
    wrong = np.flatnonzero(steps <= 0.0)
    if not len(wrong):
        return
    k = int(wrong[0])
    fault = "stands twice" if steps[k] == 0.0 else f"is {-steps[k]:.6g} s before the one above it"
    sentence = f"a time of '{one_line(name, 60)}' {fault}; give one pose for each time, sorted"
    if (steps < 0.0).all():
        sentence = (
            f"the times of '{one_line(name, 60)}' run backwards from the first row to the last; give the log in the "
            "order in which it was recorded"
        )
    raise InputError(f"{rows.places[at[k + 1]]}: {sentence}.")


_CAMERA = "apo-bench/camera/1"
_OBJECTS = "apo-bench/objects/1"
_MOST_IDS = 12
"""So many ids are named in a sentence."""
LENGTH_UNITS = MappingProxyType({"mm": 1e-3, "cm": 1e-2, "m": 1.0})
ANGLE_UNITS = MappingProxyType({"deg": np.pi / 180.0, "rad": 1.0})
TIME_UNITS = MappingProxyType({"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9})


@final
@dataclass(frozen=True)
class Conventions:
    """How a log is written, where its columns do not say it."""

    length: str | None = None
    angle: str | None = None
    time: str = "s"
    quaternion: str | None = None
    """Order of four numbers without names: `wxyz` or `xyzw`."""
    euler: str | None = None
    """Axes as SciPy spells them: `xyz` about fixed axes, `XYZ` about moving ones."""
    rate_hz: float | None = None
    """Of images that have no time."""
    scene: int | None = None
    """Of BOP results, which may hold several."""
    inverted: bool = False
    """Whether poses are of the camera in the model."""
    mirror: Literal["", "x", "y", "z"] = ""
    """The axis along which a left-handed tracker counts the other way."""
    columns: Mapping[str, str] = field(default_factory=dict)
    """Column of the file -> what it is here."""


@final
@dataclass(frozen=True, eq=False)
class CameraFile:
    """What a camera file states."""

    conventions: Conventions
    T_world_camera: Array | None
    """(4, 4), [m]; None: to be solved."""
    known: Mapping[str, Array | None]
    """Part -> where it stands in the world, (4, 4); None: where the scenario starts it."""
    stays: Array | None
    """(2,), standard deviation of the error that stays while a part rests, per axis, [m, rad]; None: not stated."""

    def places(self, planned: Mapping[str, Array]) -> Mapping[str, Array]:
        """Where known parts stand in the world, (4, 4), [m].

        Args:
            planned: Where the scenario starts them.
        """
        return {part: planned[part] if T is None else T for part, T in self.known.items()}


def read_camera(path: str | Path) -> CameraFile:
    """What a camera file states.

    Raises:
        InputError: Anything that is not as described, naming file and key.
    """
    top = read_toml(path, "camera file").fields_of(_CAMERA, (), ("log", "pose", "known", "noise"))
    return CameraFile(
        conventions=_conventions(top["log"]) if "log" in top else Conventions(),
        T_world_camera=read_any_pose(top["pose"]) if "pose" in top else None,
        known=_known(top["known"]) if "known" in top else {},
        stays=_stays(top["noise"]) if "noise" in top else None,
    )


def _conventions(node: JsonNode) -> Conventions:
    readers: Mapping[str, Callable[[JsonNode], Any]] = {
        "length": partial(_one_of, allowed=LENGTH_UNITS),
        "angle": partial(_one_of, allowed=ANGLE_UNITS),
        "time": partial(_one_of, allowed=TIME_UNITS),
        "quaternion": partial(_one_of, allowed=("wxyz", "xyzw")),
        "mirror": partial(_one_of, allowed=("x", "y", "z")),
        "euler": _euler,
        "rate_hz": lambda rate: rate.number(0.0, 1e6, above=True),
        "scene": JsonNode.integer,
        "inverted": JsonNode.flag,
        "columns": _columns,
    }
    return Conventions(**{key: readers[key](value) for key, value in node.fields((), readers).items()})


def _one_of(node: JsonNode, allowed: Collection[str]) -> str:
    if node.text() not in allowed:
        node.fail(f"{' or '.join(allowed)} is needed")
    return node.text()


def _columns(node: JsonNode) -> Mapping[str, str]:
    if not isinstance(node.value, dict):
        node.fail('a table is needed, such as { id = "body" }')
    return {node.child(theirs, ours).text().lower(): ours for ours, theirs in node.value.items()}


def _euler(node: JsonNode) -> str:
    text = node.text()
    one_frame = set(text) <= set("xyz") or set(text) <= set("XYZ")
    if len(text) != 3 or not one_frame or text[0] == text[1] or text[1] == text[2]:
        node.fail("three axes are needed: small letters about fixed axes, such as xyz, capitals about moving ones")
    return text


def _known(node: JsonNode) -> Mapping[str, Array | None]:
    entries = _entries(node, 'parts that stand still are needed, such as castle1 = "start"')
    return {part: _place(each) for part, each in entries.items()}


def _entries(node: JsonNode, wanted: str) -> Mapping[str, JsonNode]:
    """The entries of a table, which must not be empty."""
    if not isinstance(node.value, dict) or not node.value:
        node.fail(wanted)
    return {key: node.child(value, key) for key, value in node.value.items()}


def _place(node: JsonNode) -> Array | None:
    if not isinstance(node.value, str):
        return read_any_pose(node)
    if node.value != "start":
        node.fail(unknown("place", node.value, ("start",)).rstrip(".") + '; "start" or a pose is needed')
    return None


def _stays(node: JsonNode) -> Array:
    keys = node.fields(("stays_mm", "stays_deg"))
    return np.array([keys["stays_mm"].number(0.0, 100.0) * 1e-3, np.radians(keys["stays_deg"].number(0.0, 90.0))])


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
    top = read_toml(path, "objects file").fields_of(_OBJECTS, ("objects",), ("ignore",))
    parts: dict[str, TrackedPart] = {}
    owners: dict[str, str] = {}
    for part, node in _entries(top["objects"], 'parts with ids are needed, such as castle1 = { id = "7" }').items():
        keys = node.fields(("id",), ("frame",))
        tracked = TrackedPart(_id(keys["id"]), read_any_pose(keys["frame"]) if "frame" in keys else np.eye(4))
        if tracked.id in owners:
            raise InputError(f"{node.place}: the id '{tracked.id}' is that of '{owners[tracked.id]}' already.")
        parts[part] = tracked
        owners[tracked.id] = part
    ignored = frozenset(_id(node) for node in top["ignore"].items("ignored id")) if "ignore" in top else frozenset()
    return ObjectsFile(str(path), parts, ignored)


def part_tracks(log: Log, objects: ObjectsFile, hands: Collection[str] = ()) -> Mapping[str, PoseTrack]:
    """The tracks of parts, camera from part.

    Args:
        hands: Ids of hands and grippers, which are no parts.

    Raises:
        InputError: An id of the log is no part, or a part is not in the log.
    """
    known = {tracked.id for tracked in objects.parts.values()} | objects.ignored
    strange = [name for name in log.tracks if name not in known and name not in hands]
    if strange:
        quoted = ", ".join(f"'{one_line(name, 60)}'" for name in strange[:_MOST_IDS])
        quoted += ", ..." if len(strange) > _MOST_IDS else ""
        file = ", the name of the file because it has no column of ids," if strange[0] == Path(log.file).stem else ""
        which = f"the id {quoted}{file} is no part; name its part in {objects.file}, or add it"
        if len(strange) > 1:
            which = f"the ids {quoted} are no parts; name their parts in {objects.file}, or add them"
        raise InputError(f"{log.file}: {which} to its key `ignore`. Known: {', '.join(sorted(known))}.")
    tracks: dict[str, PoseTrack] = {}
    for part, tracked in objects.parts.items():
        if tracked.id not in log.tracks:
            sentence = unknown("id", tracked.id, log.tracks).replace("Known", "In the log")
            raise InputError(f"{objects.file}, {part}: {sentence}")
        t, T = log.tracks[tracked.id]
        tracks[part] = PoseTrack(t, T @ tracked.T_model_part)
    return tracks


def _id(node: JsonNode) -> str:
    """A text, or a whole number as in BOP files."""
    return str(node.value) if isinstance(node.value, int) and not isinstance(node.value, bool) else node.text()
