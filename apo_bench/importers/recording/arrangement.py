"""Arrange a log: find the camera pose, the starts of parts and the order of operations, and how well they fit."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, Solid, find_nearest_equivalent_pose, find_symmetries, measure_extent, pose
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import CameraPose, find_cameras
from apo_bench.importers.recording.contact_fit import ContactFit, contact_fit
from apo_bench.importers.recording.identical_parts import list_matchings
from apo_bench.importers.recording.ordering import (
    Chosen,
    NoMatchingOrder,
    Stated,
    end_of_operation,
    find_order,
    list_settled,
    stated_order,
)
from apo_bench.importers.recording.rest_intervals import RestInterval, RestIntervals, find_rest_poses

_HIGH_M = 0.01  # largest difference of height between the start of a part and its plan
_OTHER_IMAGE_MM = 10.0
"""Another image of a placed part counts if its contacts fit better by this; a degree counts like a millimetre."""
_TILTED_DEG = 10.0  # largest difference of tilt
"""Beyond these limits, a part starts otherwise than planned: `otherwise` in `Arrangement.start_source`."""


class Arrangement(NamedTuple):
    """The camera pose, the starts and the order of operations that a log gives, and how well they fit."""

    camera: CameraPose
    order: Chosen
    """The rest interval that ends each operation."""
    start: Poses
    """Start of every part, world, [m]."""
    start_source: Mapping[str, str]
    """Part -> source of its start: `known`, `seen`, `scenario`, `otherwise`, `in the hand` (as in the scenario)."""
    fits: Mapping[int, ContactFit]
    """Observed operation, counted from 0 -> the misfit of its worst contact."""
    intervals: RestIntervals
    """Rest intervals of each part."""
    tracks: Mapping[str, str] = {}
    """Part -> part whose track is its own; another one only among identical parts."""

    @property
    def fit(self) -> ContactFit:
        """The worst misfit over all contacts."""
        return max(self.fits.values(), key=lambda fit: fit.wrong_mm, default=ContactFit(0.0, 0.0))

    @property
    def wrong_mm(self) -> float:
        """The worst misfit of contacts and known places, [mm]; a degree counts like a millimetre."""
        return max(self.fit.wrong_mm, self.camera.off_mm, self.camera.off_deg)


class Task(NamedTuple):
    """The scenario of a recording, and what the user states about it."""

    assembly: Assembly
    planned: Poses
    """Start of every part in the scenario, world, [m]."""
    goals: Array
    """(n, 4, 4), pose of the main part after each operation in the scenario, world, [m]."""
    camera: CameraFile
    stated: Stated
    identical: Sequence[Sequence[str]] = ()
    """Groups of parts whose tracks may belong to one another."""


def arrange(intervals: RestIntervals, task: Task) -> Arrangement:
    """Find the tracks of identical parts, the camera pose and the order of operations with which contacts fit best.

    Raises:
        NoMatchingOrder: The motions in the log do not match the operations.
        InputError: The camera file states no pose of the camera.
    """
    found: list[Arrangement] = []
    failed = NoMatchingOrder("the moves of the log are not the operations of the scenario.")
    for way in list_matchings(task.identical):
        own = {part: way.get(part, part) for part in intervals}
        changed = {part: tuple(replace(each, part=part) for each in intervals[other]) for part, other in own.items()}
        for solved in find_cameras(changed, task.camera, task.planned, task.assembly.fixed, task.assembly.solids):
            try:
                found.append(_arrange_seen(changed, solved, task)._replace(tracks=own))
            except NoMatchingOrder as error:
                failed = error
            if found and found[-1].wrong_mm < _OTHER_IMAGE_MM:
                break
    if not found:
        raise failed
    return min(found, key=lambda each: each.wrong_mm)


def _arrange_seen(intervals: RestIntervals, solved: CameraPose, task: Task) -> Arrangement:
    """Find the order of operations for a camera pose."""
    assembly, planned, goals, camera, stated, _ = task
    X = solved.T_world_camera
    expected = {**planned, **camera.places(planned)}
    intervals = {
        part: _image_as_planned(known, assembly.solids[part], pose.inverse(X) @ expected[part])
        for part, known in intervals.items()
    }
    if stated.ends:
        order = stated_order(assembly, intervals, stated.ends)
    else:
        order = find_order(assembly, intervals, expected, X, stated.unseen)
    intervals, order = _image_as_in_contact(assembly, intervals, order, expected, goals, X)
    start, source = find_starts(intervals, order, X, task)
    fits = {
        k: contact_fit(
            assembly,
            k,
            {**start, **_reached(assembly, intervals, order, k, X)},
            unknown_parts(order, assembly, k),
        )
        for k, interval in enumerate(order)
        if interval is not None
    }
    return Arrangement(solved, order, start, source, fits, intervals)


def _reached(assembly: Assembly, intervals: RestIntervals, chosen: Chosen, k: int, X: Array) -> Poses:
    """Return the pose of every tracked part when observed operation k ended, world, [m]."""
    t = end_of_operation(intervals, chosen, k)
    poses = find_rest_poses(intervals, t, chosen[: k + 1], chosen[k + 1 :], list_settled(assembly, k))
    return {part: X @ T for part, T in poses.items()}


def unknown_parts(order: Chosen, assembly: Assembly, k: int) -> set[str]:
    """Return the parts that were moved last, until operation k, by an operation that was not observed."""
    last = {part: j for j, operation in enumerate(assembly.operations[: k + 1]) for part in operation.moves}
    return {part for part, j in last.items() if order[j] is None}


def _image_as_planned(known: Sequence[RestInterval], solid: Solid, expected: Array) -> tuple[RestInterval, ...]:
    """Return the intervals of a part with the image at which its first rest is turned least from the plan.

    Args:
        expected: Start of the part in the scenario, (4, 4), camera from part.
    """
    first = known[0].rests[0].T
    g = pose.inverse(first) @ find_nearest_equivalent_pose(solid, first, expected)
    return tuple(interval.turn(g) for interval in known)


def _image_as_in_contact(
    assembly: Assembly, intervals: RestIntervals, order: Chosen, start: Poses, goals: Array, X: Array
) -> tuple[RestIntervals, Chosen]:
    """Return intervals with the images of placed parts that make contact, and their order.

    Between frames, or while it is hidden, a part may turn so far that another image is nearer than its own. Of images
    that fit alike, a part that was hidden has that which is turned least from the plan.
    """
    changed = dict(intervals)
    chosen = order
    for k, interval in enumerate(order):
        if interval is None:
            continue
        reached = {**start, **_reached(assembly, changed, chosen, k, X)}
        unknown = unknown_parts(order, assembly, k)
        # The part itself, and if it fits at none of its images, each part of its contacts.
        faces = {face.part for contact in assembly.operations[k].contacts for face in contact}
        for part in (interval.part, *sorted((faces & changed.keys()) - unknown - {interval.part})):
            T = reached[part]
            turns = find_symmetries(assembly.solids[part])
            if part == interval.part and interval.rests[0].hidden:
                planned = find_nearest_equivalent_pose(assembly.solids[part], T, goals[k])
                turns = pose.inverse(T) @ planned @ turns
            wrong = [contact_fit(assembly, k, {**reached, part: T @ g}, unknown).wrong_mm for g in turns]
            best = int(np.argmin(wrong)) if min(wrong) < wrong[0] - _OTHER_IMAGE_MM else 0
            if not np.allclose(turns[best], np.eye(4)):
                first = intervals[part].index(interval) if part == interval.part else 0
                turned = [each.turn(turns[best]) for each in changed[part][first:]]
                changed[part] = (*changed[part][:first], *turned)
                chosen = tuple(each and changed[each.part][intervals[each.part].index(each)] for each in order)
                reached = {**reached, part: T @ turns[best]}
            if min(wrong) < _OTHER_IMAGE_MM:
                break
    return changed, chosen


def find_starts(intervals: RestIntervals, chosen: Chosen, X: Array, task: Task) -> tuple[Poses, Mapping[str, str]]:
    """Return the start of every part, world, [m], and its source as in `Arrangement.start_source`.

    It is the first rest that is no higher than planned, as a part in the air is held by a hand.
    """
    start = dict(task.planned)
    source = dict.fromkeys(task.planned, "scenario")
    for part, known in intervals.items():
        ends = [i for i, each in enumerate(known) if each in chosen]
        pieces = task.assembly.solids[part].pieces
        poses = [X @ each.rests[0].T for each in known[: ends[0] if ends else None]]
        heights = [T[2, 3] + measure_extent(pieces, T[2, :3])[0] for T in (task.planned[part], *poses)]
        standing = [
            T
            for T, z in zip(poses, heights[1:], strict=True)
            if part in task.assembly.fixed or z <= heights[0] + _HIGH_M
        ]
        if standing:
            level = _level(task.planned[part], standing[0])
            start[part] = standing[0] if level is None else level
            source[part] = "otherwise" if level is None else "seen"
        elif poses:
            source[part] = "in the hand"
    known_places = task.camera.places(task.planned)  # take precedence
    return {**start, **known_places}, {**source, **dict.fromkeys(known_places, "known")}


def _level(planned: Array, observed: Array) -> Array | None:
    """Return the planned pose moved to the observed x, y and yaw, (4, 4); None if the height or the tilt differs."""
    # The rotation Rz about z nearest to R maximises trace(Rz^t R), which gives this angle.
    R = observed[:3, :3] @ planned[:3, :3].T
    turn = float(np.degrees(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))
    T = np.array(pose.at((0.0, 0.0, 0.0), (0.0, 0.0, turn)) @ planned)
    T[:3, 3] = (*observed[:2, 3], planned[2, 3])
    off = pose.log(pose.inverse(T) @ observed)  # body twist from the moved plan to the observed pose
    is_high = abs(observed[2, 3] - planned[2, 3]) > _HIGH_M
    return None if is_high or np.degrees(np.linalg.norm(off[3:])) > _TILTED_DEG else T
