"""Check that the gripper of a grasp is clear of all parts: open where it closes and opens, closed along strokes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Poses
from apo_bench.geometry import Array, Solid, measure_intrusion_depths, measure_upright_bounds
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution.grasp_frame import known_half_width, make_tip_frame
from apo_bench.simulation.robot import Obstacle, list_gripper_boxes, make_obstacle

STAND_OFF_M = 0.012
"""Distance of each finger from the part before it closes or after it has opened."""
MARGINS_M = (0.004, 0.003, 0.002)
"""Room required around the gripper; the first value for which there is a grasp is used."""
GRID_M = 0.003
"""Spacing of candidate grasps along a part, and of the places checked along a stroke."""
_SOME = (0, 1, 9, 73, None)
"""Bounds of the batches in which candidates are checked: the first alone, since it is often clear."""


class RestingPart(NamedTuple):
    """The part at rest, and the parts around it."""

    T: Array
    """Pose of the part, (4, 4), world."""
    around: tuple[Obstacle, ...]


class Stroke(NamedTuple):
    """A straight motion of the part that ends at `T`."""

    T: Array
    """Pose of the part, (4, 4), world."""
    direction: Array
    """Unit vector, (3,), world."""
    travel: float
    """Length of the motion, [m]."""
    around: tuple[Obstacle, ...]


def list_obstacles(solids: Mapping[str, Solid], poses: Poses, without: Sequence[str]) -> tuple[Obstacle, ...]:
    """Return all parts except those in `without` as obstacles at the given poses."""
    return tuple(make_obstacle(solid.pieces, poses[part]) for part, solid in solids.items() if part not in without)


def find_clear_grasp(
    kinematics: Kinematics,
    solid: Solid,
    grasps: Sequence[Grasp],
    places: Sequence[RestingPart],
    strokes: Sequence[Stroke] = (),
) -> Grasp | None:
    """Return the first grasp with the largest possible margin, or None if none is clear.

    Args:
        places: Where the open gripper must be clear.
        strokes: Along which the closed gripper must be clear.
    """
    widest, *less = MARGINS_M
    first = next(list_clear_grasps(kinematics, solid, grasps, places, widest, strokes), None)
    # Grasps that are not clear with the least margin are not clear with a larger one.
    left = [] if first is not None else list(list_clear_grasps(kinematics, solid, grasps, places, less[-1], strokes))
    margins = less[:-1] if left else ()
    # The widest margin, else the ones between, else the least.
    return next(
        (g for m in margins for g in list_clear_grasps(kinematics, solid, left, places, m, strokes)),
        first or next(iter(left), None),
    )


def list_clear_grasps(
    kinematics: Kinematics,
    solid: Solid,
    grasps: Sequence[Grasp],
    places: Sequence[RestingPart],
    margin: float,
    strokes: Sequence[Stroke] = (),
) -> Iterator[Grasp]:
    """Yield the grasps that are clear: the open gripper at all places, and the closed one along all strokes.

    They are computed lazily in batches; within a batch, grasps of the same orientation and width are checked together.

    Args:
        margin: Room around the gripper, [m].
    """
    T = places[0].T

    def kind(grasp: Grasp) -> tuple[float, ...]:
        """Orientation and width of a grasp: equal for grasps that can be checked together."""
        ahead = () if grasp.ahead is None else map(float, grasp.ahead)
        return (*map(float, grasp.across), round(known_half_width(solid.pieces, grasp, T), 6), *ahead)

    for begin, end in pairwise(_SOME):
        some = grasps[begin:end]
        groups: dict[tuple[float, ...], list[int]] = {}
        for k, grasp in enumerate(some):
            groups.setdefault(kind(grasp), []).append(k)
        free = np.ones(len(some), dtype=np.bool_)
        for those in groups.values():
            free[those] = _is_clear(kinematics, solid, [some[k] for k in those], places, margin, strokes)
        yield from (grasp for grasp, is_free in zip(some, free, strict=True) if is_free)


def _is_clear(
    kinematics: Kinematics,
    solid: Solid,
    same: Sequence[Grasp],
    places: Sequence[RestingPart],
    margin: float,
    strokes: Sequence[Stroke],
) -> NDArray[np.bool_]:
    """Return which of k grasps of the same orientation and width are clear, (k,); see `list_clear_grasps`."""
    width = known_half_width(solid.pieces, same[0], places[0].T)
    opening = min(width + STAND_OFF_M, kinematics.arm.opening_m)
    points = np.array([grasp.point for grasp in same])
    free = np.ones(len(same), dtype=np.bool_)
    # All points at once: the tip has one orientation at a place.
    for place in places:
        R, at = _tips(same[0], points, place.T)
        free &= gripper_depth(kinematics, opening, R, at, place.around, margin) <= 0.0
    for stroke in strokes:
        able = np.flatnonzero(free)
        if len(able) and stroke.travel > 0.0:
            R, at = _tips(same[0], points[able], stroke.T)
            every = (at[:, None] - _distances_to_end(stroke)[:, None] * stroke.direction).reshape(-1, 3)
            depth = gripper_depth(kinematics, width, R, every, stroke.around, margin)
            free[able] = (depth.reshape(len(able), -1) <= 0.0).all(axis=1)
    return free


def _tips(grasp: Grasp, points: Array, T: Array) -> tuple[Array, Array]:
    """Return the tip's orientation, (3, 3), and its positions, (k, 3), world, for grasps at k points of a part.

    Args:
        grasp: Gives the orientation.
        points: In the frame of the part, (k, 3), [m].
        T: Pose of the part, (4, 4).
    """
    R = (T @ make_tip_frame(replace(grasp, point=np.zeros(3)), T))[:3, :3]
    return R, points @ T[:3, :3].T + T[:3, 3]


def measure_stop_distance(kinematics: Kinematics, solid: Solid, grasp: Grasp, stroke: Stroke, margin: float) -> float:
    """Return the distance to the end of a stroke at which the closed gripper stops, [m]; 0 if it arrives.

    This is the last checked place before the first collision.
    """
    distances = _distances_to_end(stroke)
    collides = closed_gripper_depth(kinematics, solid, grasp, stroke, distances, margin) > 0.0
    # argmax: index of the first place with a collision.
    return float(distances[max(0, int(np.argmax(collides)) - 1)]) if collides.any() else 0.0


def _distances_to_end(stroke: Stroke) -> Array:
    """Return the distances to the end of a stroke, descending, at which collisions are checked, (k,), [m]."""
    return np.linspace(stroke.travel, 0.0, max(2, round(stroke.travel / GRID_M) + 1))


def closed_gripper_depth(
    kinematics: Kinematics, solid: Solid, grasp: Grasp, stroke: Stroke, distances: Array, margin: float
) -> Array:
    """Return how deep the closed gripper intrudes into obstacles at k places of a stroke, (k,), [m].

    Args:
        distances: Distances of the places from the end of the stroke, (k,), [m].
        margin: Room around the gripper, [m].
    """
    width = known_half_width(solid.pieces, grasp, stroke.T)
    tip = stroke.T @ make_tip_frame(grasp, stroke.T)
    at = tip[:3, 3] - distances[:, None] * stroke.direction
    return gripper_depth(kinematics, width, tip[:3, :3], at, stroke.around, margin)


def gripper_depth(
    kinematics: Kinematics, opening: float, R: Array, at: Array, around: Sequence[Obstacle], margin: float
) -> Array:
    """Return how deep the gripper intrudes into obstacles at k places, (k,), [m]; negative where it is clear.

    Obstacles that do not meet the bounding box of all places are skipped; without any, the depth is -1.

    Args:
        opening: Of each finger, [m].
        R: Orientation of the tip, (3, 3), world.
        at: Positions of the tip, (k, 3), world.
        margin: Room around the gripper, [m].
    """
    boxes = list_gripper_boxes(kinematics, opening, margin)
    low, high = measure_upright_bounds(boxes, R, np.zeros(3))
    # The bounding box of the gripper at all places together.
    low = low + at.min(axis=0)
    high = high + at.max(axis=0)
    depth = np.full(len(at), -1.0)
    for each in around:
        if (low < each.high).all() and (high > each.low).all():
            depth = np.maximum(depth, measure_intrusion_depths(boxes, R, at, each.pieces, each.T, 0.0))
    return depth
