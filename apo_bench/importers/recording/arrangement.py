"""Arrange a log: find the camera pose, the starts of parts and the order of operations, and how well they fit."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, Solid, find_nearest_equivalent_pose, find_symmetries, measure_extent, pose
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import CameraPose, find_cameras
from apo_bench.importers.recording.contact_fit import ContactFit, contact_fit
from apo_bench.importers.recording.ordering import (
    NoMatchingOrder,
    Order,
    Stated,
    end_of_operation,
    find_order,
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
    order: Order
    start: Poses
    """Start of every part, world, [m]."""
    start_source: Mapping[str, str]
    """Part -> source of its start: `known`, `seen`, `scenario`, `otherwise`, `in the hand` (as in the scenario)."""
    fits: Mapping[int, ContactFit]
    """Observed operation, counted from 0 -> the misfit of its worst contact."""
    intervals: RestIntervals
    """Rest intervals of each part from its start on, without pauses of a hand before it."""

    @property
    def fit(self) -> ContactFit:
        """The worst misfit over all contacts."""
        return max(self.fits.values(), key=lambda fit: fit.wrong_mm, default=ContactFit(0.0, 0.0))

    @property
    def wrong_mm(self) -> float:
        """The worst misfit of contacts and known places, [mm]; a degree counts like a millimetre."""
        return max(self.fit.wrong_mm, self.camera.off_mm, self.camera.off_deg)


def arrange(
    intervals: RestIntervals, camera: CameraFile, assembly: Assembly, planned: Poses, stated: Stated
) -> Arrangement:
    """Find the camera pose and the order of operations for rest intervals.

    Args:
        planned: Start of every part in the scenario, world, [m].
        stated: Ends of operations and unobserved operations, as the user states them.

    Raises:
        NoMatchingOrder: The motions in the log do not match the operations.
        InputError: The camera file states no pose of the camera.
    """
    found: list[Arrangement] = []
    failed: NoMatchingOrder | None = None
    for solved in find_cameras(intervals, camera, planned, assembly.fixed, assembly.solids):
        try:
            found.append(_arrange_seen(intervals, solved, camera, assembly, planned, stated))
        except NoMatchingOrder as error:
            failed = failed or error
        if found and found[-1].wrong_mm < _OTHER_IMAGE_MM:
            break
    if not found:
        raise failed or NoMatchingOrder("no camera pose is found.")
    return min(found, key=lambda each: each.wrong_mm)


def _arrange_seen(
    intervals: RestIntervals, solved: CameraPose, camera: CameraFile, assembly: Assembly, planned: Poses, stated: Stated
) -> Arrangement:
    """Find the order of operations for a camera pose; arguments as in `arrange`."""
    X = solved.T_world_camera
    expected = {**planned, **camera.places(planned)}
    intervals = {
        part: _image_as_planned(known, assembly.solids[part], pose.inverse(X) @ expected[part])
        for part, known in intervals.items()
    }
    standing = {part: _since_standing(known, assembly, planned[part], X) for part, known in intervals.items()}
    begun = {part: X @ known[0].rests[0].T for part, known in standing.items() if known}
    start, source = find_starts(begun, camera, planned)
    in_hand = {part: "in the hand" for part in standing if part not in begun and source[part] == "scenario"}
    intervals = {part: standing[part] or known for part, known in intervals.items()}

    def order_all(intervals: RestIntervals) -> Order:
        # Parts that a hand held all the time take their start from the scenario.
        if stated.ends:
            return stated_order(assembly, intervals, stated.ends)
        return find_order(assembly, intervals, start, X, stated.unseen)

    order = order_all(intervals)
    imaged = _image_as_in_contact(assembly, intervals, order, start, X)
    if imaged is not intervals:
        intervals = imaged
        order = order_all(intervals)
    fits = {}
    for k, interval in enumerate(order.intervals):
        if interval is not None:
            t = end_of_operation(assembly, intervals, order.intervals, k)
            reached = {part: X @ T for part, T in find_rest_poses(intervals, t).items()}
            fits[k] = contact_fit(assembly, k, {**start, **reached})
    return Arrangement(solved, order, start, {**source, **in_hand}, fits, intervals)


def _image_as_planned(known: Sequence[RestInterval], solid: Solid, expected: Array) -> tuple[RestInterval, ...]:
    """Return the intervals of a part with the image at which its first rest is turned least from the plan.

    Args:
        expected: Start of the part in the scenario, (4, 4), camera from part.
    """
    first = known[0].rests[0].T
    g = pose.inverse(first) @ find_nearest_equivalent_pose(solid, first, expected)
    return tuple(interval.turn(g) for interval in known)


def _image_as_in_contact(
    assembly: Assembly, intervals: RestIntervals, order: Order, start: Poses, X: Array
) -> RestIntervals:
    """Return the intervals with the images of placed parts that make contact, the same intervals if all do.

    Between frames, or while it is hidden, a part may turn so far that another image is nearer than its own.
    """
    changed = dict(intervals)
    for k, interval in enumerate(order.intervals):
        if interval is None:
            continue
        part = interval.part
        known = intervals[part]
        begins = known.index(interval)
        t = end_of_operation(assembly, intervals, order.intervals, k)
        reached = {**start, **{other: X @ T for other, T in find_rest_poses(changed, t).items()}}
        # The part itself, and if it fits at none of its images, each part that it touches.
        beside = sorted({contact.environment.part for contact in assembly.operations[k].contacts} & changed.keys())
        for other in (part, *beside):
            turns = find_symmetries(assembly.solids[other])
            wrong = [contact_fit(assembly, k, {**reached, other: reached[other] @ g}).wrong_mm for g in turns]
            best = int(np.argmin(wrong))
            if wrong[best] < wrong[0] - _OTHER_IMAGE_MM:
                first = begins if other == part else 0
                turned = [each.turn(turns[best]) for each in changed[other][first:]]
                changed[other] = (*changed[other][:first], *turned)
                reached = {**reached, other: reached[other] @ turns[best]}
            if min(wrong) < _OTHER_IMAGE_MM:
                break
    return intervals if changed == dict(intervals) else changed


def _since_standing(
    known: Sequence[RestInterval], assembly: Assembly, planned: Array, X: Array
) -> tuple[RestInterval, ...]:
    """Return the rest intervals of a part from its start on; none if a hand held it in the air until its last place.

    A first interval in the air is a pause of the hand. Such intervals are dropped while at least one interval remains
    for each operation that moves the part.

    Args:
        known: The intervals of the part, in order of time.
        planned: Start of the part in the scenario, world, [m].
        X: (4, 4), pose of the camera in the world.
    """
    part = known[0].part
    pieces = assembly.solids[part].pieces
    lowest = planned[2, 3] + measure_extent(pieces, planned[2, :3])[0]
    moves = sum(operation.main == part for operation in assembly.operations)
    for i in range(max(1, len(known) - moves)):  # keeps the first interval and one for each operation, at least
        T = X @ known[i].rests[0].T
        if part in assembly.fixed or T[2, 3] + measure_extent(pieces, T[2, :3])[0] <= lowest + _HIGH_M:
            return tuple(known[i:])
    return ()


def find_starts(observed: Poses, camera: CameraFile, planned: Poses) -> tuple[Poses, Mapping[str, str]]:
    """Return the start of every part, world, and its source as in `Arrangement.start_source`.

    Args:
        observed: First rest of tracked parts, world, [m].
        planned: Start of all parts in the scenario, world, [m].
    """
    start = dict(planned)
    source = dict.fromkeys(planned, "scenario")
    for part, T in observed.items():
        level = _level(planned[part], T)
        start[part] = T if level is None else level
        source[part] = "otherwise" if level is None else "seen"
    known = camera.places(planned)
    return {**start, **known}, {**source, **dict.fromkeys(known, "known")}  # places of the camera file take precedence


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
