"""The camera, the starts and the order of operations that the rests of a log give, and how well they fit."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, measure_extent, pose
from apo_bench.importers.recording.camera_file import CameraFile
from apo_bench.importers.recording.camera_pose import CameraPose, find_camera
from apo_bench.importers.recording.contact_fit import ContactFit, contact_fit
from apo_bench.importers.recording.ordering import Order, Stated, end_of_operation, find_order, stated_order
from apo_bench.importers.recording.rest_intervals import RestInterval, RestIntervals, find_rest_poses

_HIGH_M = 0.01
_TILTED_DEG = 10.0
"""A part observed higher or more tilted than planned by this stands otherwise."""


class Arrangement(NamedTuple):
    """A camera and an order, and how well they fit."""

    camera: CameraPose
    order: Order
    start: Poses
    """Of all parts, world, [m]."""
    start_source: Mapping[str, str]
    """Part -> where its start is from: `known`, `seen`, `scenario`, `otherwise`, `in the hand` (as in the scenario)."""
    fits: Mapping[int, ContactFit]
    """Operation that was observed, counted from 0 -> its worst contact."""
    intervals: RestIntervals
    """From where each part stood at the start."""

    @property
    def fit(self) -> ContactFit:
        """The worst contact of all."""
        return max(self.fits.values(), key=lambda fit: fit.wrong_mm, default=ContactFit(0.0, 0.0))

    @property
    def wrong_mm(self) -> float:
        return max(self.fit.wrong_mm, self.camera.off_mm, self.camera.off_deg)


Arrange = Callable[[RestIntervals], Arrangement]
"""Arranges a log under the same statements."""


def arrange(
    intervals: RestIntervals, camera: CameraFile, assembly: Assembly, planned: Poses, stated: Stated
) -> Arrangement:
    """Find the camera and the order that rest intervals give.

    Args:
        planned: Where the scenario starts every part, world, [m].

    Raises:
        NoMatchingOrder: The moves are not the operations.
        InputError: The camera file states no pose of the camera.
    """
    solved = find_camera(intervals, camera, planned, assembly.fixed)
    X = solved.T_world_camera
    standing = {part: _since_standing(known, assembly, planned[part], X) for part, known in intervals.items()}
    begun = {part: X @ known[0].rests[0].T for part, known in standing.items() if known}
    start, source = find_starts(begun, camera, planned)
    in_hand = {part: "in the hand" for part in standing if part not in begun and source[part] == "scenario"}
    intervals = {part: standing[part] or known for part, known in intervals.items()}
    if stated.ends:
        order = stated_order(assembly, intervals, stated.ends)
    else:
        order = find_order(assembly, intervals, start, X, stated.unseen)
    fits = {}
    for k, interval in enumerate(order.intervals):
        if interval is not None:
            t = end_of_operation(assembly, intervals, order.intervals, k)
            reached = {part: X @ T for part, T in find_rest_poses(intervals, t).items()}
            fits[k] = contact_fit(assembly, k, {**start, **reached})
    return Arrangement(solved, order, start, {**source, **in_hand}, fits, intervals)


def _since_standing(
    known: Sequence[RestInterval], assembly: Assembly, planned: Array, X: Array
) -> tuple[RestInterval, ...]:
    """The intervals of a part from its start on; none if a hand held it in the air until its last place.

    A first interval in the air is a pause of the hand, which then put the part down, as long as one interval follows
    for each operation that moves the part.

    Args:
        planned: Where the scenario starts it, world, [m].
        X: The camera.
    """
    part = known[0].part
    pieces = assembly.solids[part].pieces
    lowest = planned[2, 3] + measure_extent(pieces, planned[2, :3])[0]
    moves = sum(operation.main == part for operation in assembly.operations)
    for i in range(max(1, len(known) - moves)):
        T = X @ known[i].rests[0].T
        if part in assembly.fixed or T[2, 3] + measure_extent(pieces, T[2, :3])[0] <= lowest + _HIGH_M:
            return tuple(known[i:])
    return ()


def find_starts(observed: Poses, camera: CameraFile, planned: Poses) -> tuple[Poses, Mapping[str, str]]:
    """Return where every part starts, and from where that is known; see `Arrangement.start_source`.

    Args:
        observed: Of tracked parts, world, [m].
        planned: Of all parts.
    """
    start = dict(planned)
    source = dict.fromkeys(planned, "scenario")
    for part, T in observed.items():
        level = _level(planned[part], T)
        start[part] = T if level is None else level
        source[part] = "otherwise" if level is None else "seen"
    known = camera.places(planned)
    return {**start, **known}, {**source, **dict.fromkeys(known, "known")}


def _level(planned: Array, observed: Array) -> Array | None:
    """Place and turn on the table as observed, height and tilt as planned, (4, 4); None if the part stood otherwise."""
    # Of all turns about z the one nearest to R maximises trace(Rz^t R), which is at this angle.
    R = observed[:3, :3] @ planned[:3, :3].T
    turn = float(np.degrees(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))
    T = np.array(pose.at((0.0, 0.0, 0.0), (0.0, 0.0, turn)) @ planned)
    T[:3, 3] = (*observed[:2, 3], planned[2, 3])
    off = pose.log(pose.inverse(T) @ observed)
    is_high = abs(observed[2, 3] - planned[2, 3]) > _HIGH_M
    return None if is_high or np.degrees(np.linalg.norm(off[3:])) > _TILTED_DEG else T
