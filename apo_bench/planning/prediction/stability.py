"""Would a part stay where a plan puts it? Balance of weight by what lies below and above it.

On parts that are boxes vertical forces act, at level faces. Where a part is of other pieces, forces act along the
normals of its contacts, with friction where they carry weight: a wedge is held by a slope and
a wall, a shaft by both sides of a groove, a plug by its seat.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact, Meeting, Meetings, Operation, Poses, compute_placements
from apo_bench.geometry import Array, Face, Overlap, RoundFace, all_boxes, find_direction_across, pose

_LEVEL = float(np.cos(np.radians(30.0)))
"""A face whose normal is nearer to the vertical than this carries weight; a steeper one is a wall."""
_FRICTION = float(np.tan(np.radians(30.0)))
"""Of a face that carries weight: a floor that is tilted by 30 degrees holds what stands on it."""
_WALL = 0.3
"""A face whose normal has a smaller vertical component is a wall: it pushes, and has no friction to count on."""
_TURNS = 2.0 * np.pi * np.arange(8) / 8
BALANCED = 1e-7
"""What is left of the weight, and of its moments over 10 mm, where forces balance it."""
_UP = np.array([0.0, 0.0, 1.0])
_LEFT = float(np.sin(np.radians(30.0)))
"""Normals carry weight if forces along them leave no more than this of it: those of a floor tilted by 30 degrees do."""
_ARM_M = 0.01
"""Moments are compared with forces on this arm."""
_ASIDE = np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
_ASIDE.flags.writeable = False


def first_unstable(assembly: Assembly, start: Poses, goals: Array) -> int | None:
    """The first operation whose part, with what it carries, would not stand at its planned goal, counted from 0.

    Vertical forces act at the corners of the overlaps of its contacts: floors push up, ceilings push down, walls
    carry nothing (there is no friction to count on). If no such forces balance the weight and its moments, the part
    falls. Of an operation without a contact on a floor or a ceiling nothing is claimed; where pieces are no boxes, of
    one whose contacts could not carry the weight by their normals.

    Args:
        start: Poses before the first operation, world frame, [m].
        goals: (n, 4, 4), the planned goals, world frame, [m].

    Returns:
        The operation, or None if every part would stand.
    """
    every = zip(assembly.operations, compute_placements(assembly, start, goals), strict=True)
    known = Meetings(assembly)
    return next(
        (k for k, (operation, poses) in enumerate(every) if imbalance(known, operation, poses) > BALANCED), None
    )


def imbalance(known: Meetings, operation: Operation, poses: Poses, room_m: float = 0.0, ceilings: bool = True) -> float:
    """How much of the weight of what moves, and of its moments over 10 mm, nothing balances, as in `first_unstable`.

    Args:
        known: The contacts, with what is measured already.
        poses: Every part after the operation, world frame, [m].
        room_m: The centre of mass is also looked at this far off, level, in four directions; the largest counts.
        ceilings: Whether what lies above may push down; if not, nothing is claimed of an operation without any.
    """
    assembly = known.assembly
    centroid = _centroid(assembly, operation, poses)
    offs = _ASIDE * room_m if room_m else _ASIDE[:1]
    if not all(all_boxes(assembly.solids[of.part].pieces) for contact in operation.contacts for of in contact):
        return _of_normals(known, operation, poses, centroid + offs, ceilings)
    points, signs, ups = _forces(known, operation, poses)
    if not ups or not (ceilings or min(ups) < 0.0):
        return 0.0
    carrying = signs > (-np.inf if ceilings else 0.0)
    return max(_solve_balance(points[carrying], signs[carrying], centroid + off) for off in offs)


def _of_normals(known: Meetings, operation: Operation, poses: Poses, at: Array, ceilings: bool) -> float:
    """`imbalance` where pieces are no boxes: six equations, for each place of the centre of mass, (k, 3)."""
    from scipy.optimize import nnls

    lies = known.measure((contact, poses) for contact in operation.contacts)
    pushing = [pushes(known.assembly, *pair, poses) for pair in zip(operation.contacts, lies, strict=True)]
    normals = np.concatenate([np.zeros((0, 3)), *(each.normals for each in pushing)])
    if not len(normals) or nnls(normals.T, _UP)[1] > _LEFT or not (ceilings or normals[:, 2].min() < -_LEFT):
        return 0.0
    points, forces = with_friction(pushing)
    carrying = forces[:, 2] > (-np.inf if ceilings else -_LEFT)
    if not carrying.any():
        return 1.0
    points = points[carrying]
    forces = forces[carrying]
    # Six equations, sum f n = up and sum f (p - c) x n = 0 over 10 mm, with f >= 0.
    wrenches = [np.concatenate([forces, np.cross((points - c) / _ARM_M, forces)], axis=1).T for c in at]
    return max(float(nnls(wrench, np.array([*_UP, 0.0, 0.0, 0.0]))[1]) for wrench in wrenches)


def _forces(known: Meetings, operation: Operation, poses: Poses) -> tuple[Array, Array, list[float]]:
    """Where vertical forces may act, (k, 3), world, [m], and whether each pushes up (1) or down (-1), (k,).

    And the same of each contact that could carry weight, also of one that covers nothing.
    """
    heights = [float((poses[e.part][:3, :3] @ known.assembly.face(e).normal)[2]) for _, e in operation.contacts]
    level = [(c, up) for c, up in zip(operation.contacts, heights, strict=True) if abs(up) >= _LEVEL]
    common = known.measure_overlaps(((contact, poses) for contact, _ in level))
    ups = [float(np.sign(up)) for _, up in level]
    points = np.concatenate([np.zeros((0, 3)), *(each.corners for each in common)])
    return points, np.repeat(ups, [len(each.corners) for each in common]), ups


def _centroid(assembly: Assembly, operation: Operation, poses: Poses) -> Array:
    """Centre of mass of all that moves, (3,), world, [m]; parts are homogeneous and of one density."""
    volumes = np.array([assembly.solids[part].volume for part in operation.moves])
    centroids = [pose.apply(poses[part], assembly.solids[part].centroid[None])[0] for part in operation.moves]
    return np.asarray(volumes @ np.array(centroids) / volumes.sum())


def _solve_balance(points: Array, signs: Array, centroid: Array) -> float:
    """What forces >= 0 at the points leave of a unit weight at the centroid: three equations, least squares."""
    from scipy.optimize import nnls

    if not len(points):
        return 1.0
    arms = (points - centroid)[:, :2] / 0.01
    # Vertical forces f >= 0 at arms (x, y): sum f s = 1, sum f s x = 0, sum f s y = 0.
    return float(nnls(np.vstack([signs, signs * arms[:, 0], signs * arms[:, 1]]), np.array([1.0, 0.0, 0.0]))[1])


class Pushes(NamedTuple):
    """Forces of unit size, and where they act, (k, 3) each, world."""

    points: Array
    forces: Array
    normals: Array
    """Along which forces would act if the faces met: as `forces`, also where they miss each other, (n, 3)."""


def with_friction(pushing: Iterable[Pushes]) -> tuple[Array, Array]:
    """Points and forces, (k, 3) each: those along normals, and four edges of the cone of friction around each."""
    every = list(pushing)
    points, n = (np.concatenate([each[i] for each in every]) for i in (0, 1))
    carrying = np.abs(n[:, 2]) >= _WALL
    held = points[carrying]
    m = n[carrying]
    # The cone of friction by four edges m + mu t: t level, across the normal, and across both.
    level = np.column_stack([-m[:, 1], m[:, 0], np.zeros(len(m))])
    size = np.linalg.norm(level, axis=1)[:, None]
    level = np.where(size > 1e-9, level / np.maximum(size, 1e-9), np.array([1.0, 0.0, 0.0]))
    sides = [sign * _FRICTION * t for t in (level, np.cross(m, level)) for sign in (-1.0, 1.0)]
    return np.concatenate([points, *[held] * 4]), np.concatenate([n, *(m + side for side in sides)])


def pushes(assembly: Assembly, contact: Contact, lie: Meeting, poses: Poses) -> Pushes:
    """What the second part of a contact, which rests, can push the first one with.

    Args:
        lie: How the faces lie to each other, from `Meetings`.
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
        return _along(T_rests[:3, :3] @ rests.normal, at, -moved.radius)
    if isinstance(moved, Face):
        return _along(-T[:3, :3] @ moved.normal, at, rests.radius)
    assert isinstance(moved, RoundFace)
    around, forces = _around(rests, lie.axis, lie.sine)
    return Pushes(
        (at[:, None] + _radii(moved, T, rests, T_rests, at)[:, None, None] * around).reshape(-1, 3),
        np.tile(forces, (len(at), 1)),
        forces,
    )


def _along(n: Array, at: Array, out: float) -> Pushes:
    """One normal, off points of an axis by so much."""
    return Pushes(at + out * n, np.repeat(n[None], len(at), axis=0), n[None])


def _around(rests: RoundFace, axis: Array, sine: float) -> tuple[Array, Array]:
    """The directions from the axis to a round wall, and those in which it pushes there, (8, 3) each."""
    x = find_direction_across(axis)
    around = np.outer(np.cos(_TURNS), x) + np.outer(np.sin(_TURNS), np.cross(axis, x))
    sign = -1.0 if rests.hole else 1.0
    return around, sign * (np.sqrt(1.0 - sine**2) * around - sine * axis)


def _radii(moved: RoundFace, T: Array, rests: RoundFace, T_rests: Array, at: Array) -> Array:
    """How far the wall is from the axis at points of it, (k,), [m]."""
    if rests.kind == "rim" or moved.kind == "rim":
        return np.full(len(at), rests.radius if rests.kind == "rim" else moved.radius)
    heights = (at - pose.apply(T_rests, rests.point[None])) @ (T_rests[:3, :3] @ rests.axis)
    return np.asarray(rests.radii[0] + rests.slope * (heights - rests.span[0]))
