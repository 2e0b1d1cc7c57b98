"""What a contact can push a part with: where, along which normals, and with how much friction."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.mate import mate
from apo_bench.geometry.overlap import overlap
from apo_bench.geometry.pose import apply
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Face

_FRICTION = float(np.tan(np.radians(30.0)))
"""Of a face that carries weight: a floor that is tilted by 30 degrees holds what stands on it."""
_WALL = 0.3
"""A face whose normal has a smaller vertical component is a wall: it pushes, and has no friction to count on."""
_TURNS = 2.0 * np.pi * np.arange(8) / 8


class Pushes(NamedTuple):
    """Forces of unit size, and where they act, (k, 3) each, world."""

    points: Array
    forces: Array
    normals: Array
    """Along which forces would act if the faces met: as `forces`, also where they miss each other, (n, 3)."""


def with_friction(found: Iterable[Pushes]) -> tuple[Array, Array]:
    """Points and forces, (k, 3) each: those along normals, and four edges of the cone of friction around each."""
    every = list(found)
    points, n = (np.concatenate([each[i] for each in every]) for i in (0, 1))
    carrying = np.abs(n[:, 2]) >= _WALL
    held = points[carrying]
    m = n[carrying]
    level = np.column_stack([-m[:, 1], m[:, 0], np.zeros(len(m))])
    size = np.linalg.norm(level, axis=1)[:, None]
    level = np.where(size > 1e-9, level / np.maximum(size, 1e-9), np.array([1.0, 0.0, 0.0]))
    sides = [sign * _FRICTION * t for t in (level, np.cross(m, level)) for sign in (-1.0, 1.0)]
    return np.concatenate([points, *[held] * 4]), np.concatenate([n, *(m + side for side in sides)])


def pushes(assembly: Assembly, contact: Contact, poses: Poses) -> Pushes:
    """What the second part of a contact, which rests, can push the first one with."""
    m, e = contact
    nothing = np.zeros((0, 3))
    moved = assembly.face_of(m)
    rests = assembly.face_of(e)
    T = poses[m.part]
    T_rests = poses[e.part]
    if isinstance(moved, Face) and isinstance(rests, Face):
        n = (T_rests[:3, :3] @ rests.normal)[None]
        points = overlap(moved, T, rests, T_rests).corners
        return Pushes(points, np.repeat(n, len(points), axis=0), n)
    between = mate(moved, T, rests, T_rests)
    at = between.points if between.common else nothing
    if isinstance(rests, Face):
        assert isinstance(moved, RoundFace)
        return _along(T_rests[:3, :3] @ rests.normal, at, -moved.radius)
    if isinstance(moved, Face):
        return _along(-T[:3, :3] @ moved.normal, at, rests.radius)
    around, forces = _around(rests, between.axis, between.sine)
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
    x = np.eye(3)[int(np.abs(axis).argmin())]
    x = x - (x @ axis) * axis
    x /= np.sqrt(x @ x)
    around = np.outer(np.cos(_TURNS), x) + np.outer(np.sin(_TURNS), np.cross(axis, x))
    sign = -1.0 if rests.hole else 1.0
    return around, sign * (np.sqrt(1.0 - sine**2) * around - sine * axis)


def _radii(moved: RoundFace, T: Array, rests: RoundFace, T_rests: Array, at: Array) -> Array:
    """How far the wall is from the axis at points of it, (k,), [m]."""
    if rests.kind == "rim" or moved.kind == "rim":
        return np.full(len(at), rests.radius if rests.kind == "rim" else moved.radius)
    heights = (at - apply(T_rests, rests.point[None])) @ (T_rests[:3, :3] @ rests.axis)
    return np.asarray(rests.radii[0] + rests.slope * (heights - rests.span[0]))
