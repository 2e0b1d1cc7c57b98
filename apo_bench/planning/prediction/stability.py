"""Static stability: whether contact forces balance the weight of a part at its planned goal.

Between boxes, vertical forces act at level faces. For all other pieces, forces act along the contact normals, with
friction where they carry weight: a wedge held by a slope and a wall, a shaft in a groove, a plug in its seat.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactMeasurements,
    Operation,
    OverlapOrMate,
    Poses,
    compute_placements,
)
from apo_bench.geometry import Array, Face, Overlap, RoundFace, all_boxes, find_direction_across, pose

_LEVEL = float(np.cos(np.radians(30.0)))
"""A face between boxes carries weight if the |z| of its normal is at least this, else it is a wall."""
_FRICTION = float(np.tan(np.radians(30.0)))
"""Coefficient of friction of a face that carries weight: a part stays on a floor tilted by 30 degrees."""
_WALL = 0.3
"""A face with a smaller |z| of its normal is a wall: it pushes, and has no friction."""
_TURNS = 2.0 * np.pi * np.arange(8) / 8
"""Angles around the axis of a round face at which it pushes, [rad]."""
BALANCED = 1e-7
"""Largest imbalance of a part that stands (rounding of the solver)."""
_UP = np.array([0.0, 0.0, 1.0])
_RESIDUAL = float(np.sin(np.radians(30.0)))
"""Normals carry weight if forces along them leave at most this share of it, as on a floor tilted by 30 degrees."""
_ARM_M = 0.01
"""Lever arm by which moments are divided, so that they compare with forces."""
_CENTROID_SHIFTS = np.array(
    [[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]
)  # level shifts of the centre of mass
_CENTROID_SHIFTS.flags.writeable = False


def find_first_unstable(assembly: Assembly, start: Poses, goals: Array) -> int | None:
    """The first operation whose part, with what it carries, would not stand at its planned goal, counted from 0.

    Vertical forces act at the corners of the contact overlaps: floors push up, ceilings push down, walls carry nothing,
    since friction is not relied on. The part falls if no such forces balance the weight and its moments. An operation
    without a contact on a floor or ceiling counts as stable. If pieces are not boxes, so does one whose contact normals
    cannot carry the weight.

    Args:
        start: Poses before the first operation, world frame, [m].
        goals: (n, 4, 4), the planned goals, world frame, [m].

    Returns:
        The operation, or None if every part would stand.
    """
    every = zip(assembly.operations, compute_placements(assembly, start, goals), strict=True)
    known = ContactMeasurements(assembly)
    return next(
        (k for k, (operation, poses) in enumerate(every) if measure_imbalance(known, operation, poses) > BALANCED), None
    )


def measure_imbalance(
    known: ContactMeasurements, operation: Operation, poses: Poses, room_m: float = 0.0, ceilings: bool = True
) -> float:
    """The share of the moved parts' weight, and of its moments on a 10 mm arm, that contact forces cannot balance.

    Args:
        known: Cache of measured contacts.
        poses: Of every part after the operation, world frame, [m].
        room_m: The centre of mass is also shifted by this distance to four sides; the largest imbalance counts.
        ceilings: Whether faces above may push down. If not, the result is 0 for an operation without a ceiling.

    Returns:
        The share; 0 for a part that is clamped at its place.
    """
    assembly = known.assembly
    if operation.clamped:  # nothing need carry it
        return 0.0
    centroid = _compute_centroid(assembly, operation, poses)
    offs = _CENTROID_SHIFTS * room_m if room_m else _CENTROID_SHIFTS[:1]  # row 0: no shift
    if not all(all_boxes(assembly.solids[of.part].pieces) for contact in operation.contacts for of in contact):
        return _measure_general_imbalance(known, operation, poses, centroid + offs, ceilings)
    points, signs, ups = _list_vertical_forces(known, operation, poses)
    # No contact could carry weight, or there is no ceiling to leave out: nothing is claimed.
    if not ups or not (ceilings or min(ups) < 0.0):
        return 0.0
    # Without ceilings only forces upwards remain.
    carrying = signs > (-np.inf if ceilings else 0.0)
    return max(_solve_balance(points[carrying], signs[carrying], centroid + off) for off in offs)


def _measure_general_imbalance(
    known: ContactMeasurements, operation: Operation, poses: Poses, at: Array, ceilings: bool
) -> float:
    """`measure_imbalance` if some pieces are not boxes: six equations, the largest over centres of mass `at`, (k,
    3)."""
    from scipy.optimize import nnls

    lies = known.measure((contact, poses) for contact in operation.contacts)
    pushing = [list_pushes(known.assembly, *pair, poses) for pair in zip(operation.contacts, lies, strict=True)]
    normals = np.concatenate([np.zeros((0, 3)), *(each.normals for each in pushing)])
    # Normals that cannot carry the weight, or no ceiling to leave out: nothing is claimed.
    if not len(normals) or nnls(normals.T, _UP)[1] > _RESIDUAL or not (ceilings or normals[:, 2].min() < -_RESIDUAL):
        return 0.0
    points, forces = add_friction(pushing)
    # all forces, or without ceilings only those that do not push down
    carrying = forces[:, 2] > (-np.inf if ceilings else -_RESIDUAL)
    if not carrying.any():  # nothing supports the part: the whole weight is unbalanced
        return 1.0
    points = points[carrying]
    forces = forces[carrying]
    # Six equations, sum f n = up and sum f (p - c) x n = 0 over 10 mm, with f >= 0.
    wrenches = [np.concatenate([forces, np.cross((points - c) / _ARM_M, forces)], axis=1).T for c in at]
    return max(float(nnls(wrench, np.array([*_UP, 0.0, 0.0, 0.0]))[1]) for wrench in wrenches)


def _list_vertical_forces(
    known: ContactMeasurements, operation: Operation, poses: Poses
) -> tuple[Array, Array, list[float]]:
    """The points at which vertical forces may act, and their directions.

    Returns:
        (points, signs, ups): points, (k, 3), world frame, [m]; 1 for up or -1 for down per point, (k,); the same per
        level contact, also for contacts without overlap.
    """
    heights = [float((poses[e.part][:3, :3] @ known.assembly.face(e).normal)[2]) for _, e in operation.contacts]
    level = [(c, up) for c, up in zip(operation.contacts, heights, strict=True) if abs(up) >= _LEVEL]
    common = known.measure_overlaps(((contact, poses) for contact, _ in level))
    ups = [float(np.sign(up)) for _, up in level]
    points = np.concatenate([np.zeros((0, 3)), *(each.corners for each in common)])
    return points, np.repeat(ups, [len(each.corners) for each in common]), ups


def _compute_centroid(assembly: Assembly, operation: Operation, poses: Poses) -> Array:
    """Centre of mass of all moved parts, (3,), world frame, [m]; parts are homogeneous, with equal density."""
    volumes = np.array([assembly.solids[part].volume for part in operation.moves])
    centroids = [pose.apply(poses[part], assembly.solids[part].centroid[None])[0] for part in operation.moves]
    return np.asarray(volumes @ np.array(centroids) / volumes.sum())


def _solve_balance(points: Array, signs: Array, centroid: Array) -> float:
    """The residual of a unit weight at the centroid that forces >= 0 at the points leave (nonnegative least squares).

    The three equations are vertical force and two moments, on a 10 mm arm.

    Args:
        points: (k, 3), world frame, [m].
        signs: 1 for a force upwards, -1 for one downwards, (k,).
    """
    from scipy.optimize import nnls

    if not len(points):
        return 1.0
    arms = (points - centroid)[:, :2] / 0.01
    # Vertical forces f >= 0 at arms (x, y): sum f s = 1, sum f s x = 0, sum f s y = 0.
    return float(nnls(np.vstack([signs, signs * arms[:, 0], signs * arms[:, 1]]), np.array([1.0, 0.0, 0.0]))[1])


class Pushes(NamedTuple):
    """Unit forces of one contact, and the points at which they act, (k, 3) each, world frame."""

    points: Array
    forces: Array
    normals: Array
    """Directions of possible forces, (n, 3), also if the faces do not meet."""


def add_friction(pushing: Iterable[Pushes]) -> tuple[Array, Array]:
    """Points and forces, (k, 3) each: forces along normals, and four edges of the friction cone of each support."""
    every = list(pushing)
    points, n = (np.concatenate([each[i] for each in every]) for i in (0, 1))  # fields 0 and 1: points, forces
    carrying = np.abs(n[:, 2]) >= _WALL  # near enough to the vertical to have friction
    held = points[carrying]
    m = n[carrying]
    # The cone of friction by four edges m + mu t: t level, across the normal, and across both.
    level = np.column_stack([-m[:, 1], m[:, 0], np.zeros(len(m))])
    size = np.linalg.norm(level, axis=1)[:, None]
    level = np.where(size > 1e-9, level / np.maximum(size, 1e-9), np.array([1.0, 0.0, 0.0]))
    sides = [sign * _FRICTION * t for t in (level, np.cross(m, level)) for sign in (-1.0, 1.0)]
    return np.concatenate([points, *[held] * 4]), np.concatenate([n, *(m + side for side in sides)])


def list_pushes(assembly: Assembly, contact: Contact, lie: OverlapOrMate, poses: Poses) -> Pushes:
    """The forces with which the resting part of a contact can push the moved one.

    Args:
        lie: The contact as measured by `ContactMeasurements`.
    """
    m, e = contact
    nothing = np.zeros((0, 3))
    moved = assembly.face_of(m)
    rests = assembly.face_of(e)
    T = poses[m.part]
    T_rests = poses[e.part]
    if isinstance(lie, Overlap):
        assert isinstance(rests, Face)
        n = (T_rests[:3, :3] @ rests.normal)[None]
        return Pushes(lie.corners, np.repeat(n, len(lie.corners), axis=0), n)
    at = lie.points if lie.common else nothing
    if isinstance(rests, Face):
        assert isinstance(moved, RoundFace)
        # A shaft rests on a plane: the force acts on its surface, one radius below the axis.
        return _axial_forces(T_rests[:3, :3] @ rests.normal, at, -moved.radius)
    if isinstance(moved, Face):
        # A plane rests on a shaft: the force acts one radius above the axis.
        return _axial_forces(-T[:3, :3] @ moved.normal, at, rests.radius)
    assert isinstance(moved, RoundFace)
    around, forces = _radial_directions(rests, lie.axis, lie.sine)
    return Pushes(
        (at[:, None] + _wall_radii(moved, T, rests, T_rests, at)[:, None, None] * around).reshape(-1, 3),
        np.tile(forces, (len(at), 1)),
        forces,
    )


def _axial_forces(n: Array, at: Array, out: float) -> Pushes:
    """Unit forces along n, (3,), at points of an axis, (k, 3), moved by `out` [m] along n."""
    return Pushes(at + out * n, np.repeat(n[None], len(at), axis=0), n[None])


def _radial_directions(rests: RoundFace, axis: Array, sine: float) -> tuple[Array, Array]:
    """Directions from the axis to a round wall at 8 angles, and the directions in which the wall pushes, (8, 3) each.

    Args:
        axis: Unit vector of the axis, (3,), world frame.
        sine: Sine of the angle between wall and axis; 0 for a cylinder.
    """
    x = find_direction_across(axis)
    around = np.outer(np.cos(_TURNS), x) + np.outer(np.sin(_TURNS), np.cross(axis, x))
    sign = -1.0 if rests.hole else 1.0  # a hole pushes inwards, a shaft outwards
    return around, sign * (np.sqrt(1.0 - sine**2) * around - sine * axis)


def _wall_radii(moved: RoundFace, T: Array, rests: RoundFace, T_rests: Array, at: Array) -> Array:
    """The radius of the wall at points `at` of its axis, (k,), [m]."""
    if rests.kind == "rim" or moved.kind == "rim":
        return np.full(len(at), rests.radius if rests.kind == "rim" else moved.radius)
    heights = (at - pose.apply(T_rests, rests.point[None])) @ (T_rests[:3, :3] @ rests.axis)
    return np.asarray(rests.radii[0] + rests.slope * (heights - rests.span[0]))
