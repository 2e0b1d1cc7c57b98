"""From the log of a tracker to an observation: frames, rests, the order of operations, and what stays unclear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly.goals import Observation, Poses
from apo_bench.assembly.shared_error import SharedError
from apo_bench.errors import InputError, unknown
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.models.isotropic import floored, with_shared
from apo_bench.observation.models.outliers import UNSEEN_DEVIATION, last_seen
from apo_bench.recording.averaging import Mean
from apo_bench.recording.camera_file import CameraFile
from apo_bench.recording.camera_pose import CameraPose, solve_camera
from apo_bench.recording.contact_fit import ContactFit, contact_fit
from apo_bench.recording.doubts import Arrangement, check_arrangement, check_direction
from apo_bench.recording.log import Track
from apo_bench.recording.ordering import (
    NoOrder,
    Order,
    moves_text,
    order_of,
    stated_order,
    taken,
    world_poses,
)
from apo_bench.recording.paths import Path, path_of
from apo_bench.recording.rests import Rest, rests_of
from apo_bench.recording.standing import standing
from apo_bench.recording.stays import Stay, poses_at, stays_of
from apo_bench.scenario.layout import layout_at
from apo_bench.scenario.scenario import Scenario


class Stated(NamedTuple):
    """What a person states because the log does not say it."""

    ends: tuple[float, ...] = ()
    """Times at which the operations ended, [s]."""
    unseen: tuple[int, ...] = ()
    """Operations that the log does not show, counted from 0."""


@final
@dataclass(frozen=True, eq=False)
class Seen:
    """One operation as the log shows it."""

    stay: Stay | None
    """Where its main part stayed; None if it was not seen."""
    rest: Rest | None
    """The rest of it that is the goal: that at which the next operation began."""
    path: Path | None
    """Of the main part, from its stay before to this one, world."""
    carried: Mapping[str, Array]
    """Carried part -> the body twist by which it moved in the hand, (6,), [m, rad]."""
    adjusted: Mapping[str, Array]
    """Part that the operation does not move -> the body twist by which it was moved all the same, (6,)."""


@final
@dataclass(frozen=True, eq=False)
class Imported:
    """A recording, understood."""

    scenario: Scenario
    observation: Observation
    camera: CameraPose
    stays: Mapping[str, tuple[Stay, ...]]
    operations: tuple[Seen, ...]
    stood: Mapping[str, str]
    """Part -> where its start is from: `known`, `seen`, `scenario`, `otherwise`."""
    fit: ContactFit
    """The worst contact as seen."""
    stays_stated: bool
    """Whether the error that stays while a part rests was stated."""
    unclear: tuple[str, ...]


def import_recording(
    tracks: Mapping[str, Track], camera: CameraFile, scenario: Scenario, stated: Stated, file: str
) -> Imported:
    """The observation that a log of one demonstration gives.

    Args:
        tracks: Of parts, camera from part.
        file: The log, for messages.

    Raises:
        InputError: A part is not of the scenario or is missing, the moves are not its operations, or no contact fits.
    """
    check_parts(tracks, scenario, file)
    stays = {part: stays_of(part, rests_of(track)) for part, track in tracks.items()}
    for part, found in stays.items():
        if not found:
            raise InputError(f"{file}: '{part}' never rests, so nothing is known of it; give a longer log.")
    planned = layout_at(scenario, 0.0, 0.0, 0.0, clearance_mm=scenario.clearance_mm).start
    try:
        arranged = arrange(stays, camera, scenario, planned, stated)
    except NoOrder as error:
        check_direction(lambda other: arrange(other, camera, scenario, planned, stated), stays, file)
        raise InputError(f"{file}: {error}") from error
    check_arrangement(arranged, lambda other: arrange(other, camera, scenario, planned, stated), stays, file)
    assert arranged.order is not None
    return _made(tracks, stays, arranged.camera, arranged.order, camera, scenario, planned, arranged.fit)


def check_parts(tracks: Mapping[str, Track], scenario: Scenario, file: str) -> None:
    """Refuse parts that the scenario does not have, and operations of parts that were not tracked."""
    for part in tracks:
        if part not in scenario.assembly.solids:
            raise InputError(f"{file}: {unknown('part', part, scenario.assembly.solids)}")
    for k, operation in enumerate(scenario.assembly.operations):
        if operation.main not in tracks:
            raise InputError(
                f"{file}: '{operation.main}', which operation {k + 1} moves, is not tracked; name its id in the "
                "objects file."
            )


def arrange(
    stays: Mapping[str, tuple[Stay, ...]], camera: CameraFile, scenario: Scenario, planned: Poses, stated: Stated
) -> Arrangement:
    """The camera's pose and the order that these stays give, and how well all fits."""
    found = _camera_pose(stays, camera, planned)
    start = _standing(stays, found, camera, planned)[0]
    order = (
        stated_order(scenario.assembly, stays, stated.ends)
        if stated.ends
        else order_of(scenario.assembly, stays, start, found.T_world_camera, stated.unseen)
    )
    fits = [
        contact_fit(
            scenario.assembly,
            k,
            world_poses(stays, _quiet(scenario, stays, order.stays, k), start, found.T_world_camera),
        )
        for k, stay in enumerate(order.stays)
        if stay is not None
    ]
    worst = max(fits, key=lambda fit: fit.wrong_mm, default=ContactFit(0.0, 0.0))
    return Arrangement(found, order, worst)


def _camera_pose(stays: Mapping[str, tuple[Stay, ...]], camera: CameraFile, planned: Poses) -> CameraPose:
    if camera.T_world_camera is not None:
        return CameraPose(camera.T_world_camera)
    if not camera.known:
        raise InputError(
            "the camera file states neither where the camera stands nor a part on a known place; add a table [pose], "
            'or [known] with parts such as castle1 = "start".'
        )
    for part in camera.known:
        if part not in stays:
            raise InputError(f"the camera file, known: {unknown('tracked part', part, stays)}")
    known = {part: planned[part] if T is None else T for part, T in camera.known.items()}
    return solve_camera(
        known,
        {part: _first(stays[part]).mean for part in known},
        _staying(camera, _first(stays[next(iter(known))]).mean),
    )


def _first(stays: Sequence[Stay]) -> Rest:
    return stays[0].rests[0]


def _staying(camera: CameraFile, mean: Mean) -> Array:
    """The covariance of an error that stays while a part rests, (6, 6); as large as that of one frame if not stated."""
    return mean.scatter if camera.stays is None else np.diag(np.repeat(camera.stays, 3) ** 2)


def _standing(
    stays: Mapping[str, tuple[Stay, ...]], found: CameraPose, camera: CameraFile, planned: Poses
) -> tuple[Poses, Mapping[str, str]]:
    start, whence = dict(planned), dict.fromkeys(planned, "scenario")
    for part, known in stays.items():
        if part in camera.known:
            T = camera.known[part]
            start[part], whence[part] = planned[part] if T is None else T, "known"
            continue
        seen = found.T_world_camera @ _first(known).T
        stands = standing(planned[part], seen)
        start[part], whence[part] = (seen, "otherwise") if stands is None else (stands, "seen")
    return start, whence


def _quiet(scenario: Scenario, stays: Mapping[str, tuple[Stay, ...]], chosen: Sequence[Stay | None], k: int) -> float:
    """When operation k was over: when the next one took its part, else the end of its stay."""
    stay = chosen[k]
    assert stay is not None
    for j, one in enumerate(chosen):
        if j > k and one is not None:
            return float(np.clip(taken(scenario.assembly, stays, chosen[:j], one), stay.begins, stay.ends))
    return stay.ends


def _made(
    tracks: Mapping[str, Track],
    stays: Mapping[str, tuple[Stay, ...]],
    found: CameraPose,
    order: Order,
    camera: CameraFile,
    scenario: Scenario,
    planned: Poses,
    fit: ContactFit,
) -> Imported:
    assembly, X = scenario.assembly, found.T_world_camera
    start, whence = _standing(stays, found, camera, planned)
    operations = tuple(_seen(tracks, stays, order.stays, scenario, X, k) for k in range(len(assembly)))
    seen = np.array([one.rest is not None for one in operations])
    goals = np.array([np.eye(4) if one.rest is None else X @ one.rest.T for one in operations])
    covariance = np.array([_covariance(one, camera) for one in operations])
    for k, one in enumerate(operations):
        for part, moved in one.adjusted.items():
            placed = [j for j in range(k) if assembly.operations[j].main == part]
            if placed:
                covariance[placed[-1]] += np.outer(moved, moved)
    observation = Observation(
        assembly=assembly,
        start=start,
        goals=last_seen(assembly, start, goals, seen),
        covariance=floored(covariance),
        seen=seen,
        gap_m=scenario.gap_mm * 1e-3,
        play_m=scenario.clearance_mm * 1e-3,
    )
    if found.covariance is not None and seen.any():
        shown = tuple(int(k) for k in np.flatnonzero(seen))
        observation = with_shared(observation, SharedError("camera", shown, found.covariance, found.T_world_camera))
    return Imported(
        scenario=scenario,
        observation=observation,
        camera=found,
        stays=stays,
        operations=operations,
        stood=whence,
        fit=fit,
        stays_stated=camera.stays is not None,
        unclear=tuple(_unclear(stays, order, operations, scenario, whence)),
    )


def _covariance(one: Seen, camera: CameraFile) -> Array:
    if one.rest is None:
        return np.diag(UNSEEN_DEVIATION**2)
    return one.rest.mean.covariance + _staying(camera, one.rest.mean)


def _seen(
    tracks: Mapping[str, Track],
    stays: Mapping[str, tuple[Stay, ...]],
    chosen: Sequence[Stay | None],
    scenario: Scenario,
    X: Array,
    k: int,
) -> Seen:
    operation, stay = scenario.assembly.operations[k], chosen[k]
    if stay is None:
        return Seen(None, None, None, {}, {})
    quiet = _quiet(scenario, stays, chosen, k)
    rest = stay.at(quiet)
    begins = taken(scenario.assembly, stays, chosen[:k], stay)
    path = path_of(tracks[operation.main], begins, rest.begins, X)
    before, after = poses_at(stays, begins), poses_at(stays, quiet)
    moved = pose.inverse(before[operation.main]) @ after[operation.main]
    carried, adjusted = {}, {}
    for part in stays:
        if part == operation.main:
            continue
        own = pose.inverse(before[part]) @ after[part]
        if part in operation.carries:
            together = before[operation.main] @ moved @ pose.inverse(before[operation.main]) @ before[part]
            carried[part] = pose.log(pose.inverse(together) @ after[part])
        elif np.abs(pose.log(own)).max() > 0.0:
            adjusted[part] = pose.log(own)
    return Seen(stay, rest, path, carried, adjusted)


def _unclear(
    stays: Mapping[str, tuple[Stay, ...]],
    order: Order,
    operations: Sequence[Seen],
    scenario: Scenario,
    whence: Mapping[str, str],
) -> list[str]:
    said = []
    if order.rival is not None:
        for k, (mine, other) in enumerate(zip(order.stays, order.rival, strict=True)):
            if mine is not None and other is not None and mine is not other:
                said.append(
                    f"operation {k + 1} ({mine.part}) ended at {mine.begins:.2f} s, or at {other.begins:.2f} s: both "
                    "are about as likely; state the right ones by --ends"
                )
    used = {id(stay) for stay in order.stays}
    for k, one in enumerate(operations):
        for part, moved in one.adjusted.items():
            far = float(np.linalg.norm(moved[:3])) * 1e3
            if far > 10.0:
                said.append(
                    f"operation {k + 1}: '{part}' moved too, by {far:.0f} mm, which the scenario does not say; "
                    f"moves in the log: {moves_text(stays)}"
                )
    for part, found in stays.items():
        if whence[part] == "otherwise":
            said.append(f"'{part}' stood otherwise at the start than in the scenario; its start is as it was seen")
        mains = {operation.main for operation in scenario.assembly.operations}
        moving = {p for operation in scenario.assembly.operations for p in operation.moves}
        if part in mains:
            pauses = [stay for stay in found[1:] if id(stay) not in used]
            carried = any(part in operation.carries for operation in scenario.assembly.operations)
            if pauses and not carried:
                at = ", ".join(f"{stay.begins:.2f} s" for stay in pauses)
                said.append(
                    f"'{part}' also rested at {at}, on its way: taken as a pause; state --ends if it was put down"
                )
        elif part not in moving and len(found) > 1:
            said.append(f"'{part}' moved at {found[1].begins:.2f} s, although no operation of the scenario moves it")
    return said
