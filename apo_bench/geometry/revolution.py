"""Parts of revolution: the same after any turn about their axis, and some of them end for end."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.exact_turns import carries_faces, fills_the_same
from apo_bench.geometry.polygon import across_axis
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Solid

_SAME_M = 1e-5
_SAME = 1e-10
"""Lines that are nearer are one line, [m]; cosines nearer to 1 are of one direction."""
_FEWEST = 8
"""Sides of a polygon that may stand for a circle; coarse walls, that no contact needs, have so many."""
_COARSE = 1.0 / np.cos(np.pi / _FEWEST) - 1.0
"""So much of its radius is then in doubt of a wall."""
_TURNS = (0.41, 1.37, 2.71)
"""Turns that carry no polygon of few sides onto itself, [rad]."""
_EVEN = 1e-3
"""Moments of inertia about axes across are the same within this part of their sum."""


class Revolution(NamedTuple):
    """The axis of a part of revolution, in its frame."""

    point: Array
    """(3,), [m]: its centre of volume."""
    axis: Array
    """(3,), unit vector."""
    reversible: bool
    """Whether it is the same end for end, too."""


@lru_cache(maxsize=256)
def revolution(solid: Solid) -> Revolution | None:
    """The axis about which a part may be turned by anything; None if it has none.

    All round faces are whole and about this axis, flat ones lie across it and are round themselves, and what the pieces
    fill, and the inertia if it is stated, stay as they are. Round walls are flat ones of pieces, so what these fill is
    known within 8 % of the largest radius.
    """
    rounds = list(solid.rounds.values())
    if not rounds or not all(_about(wall, solid.centroid, rounds[0].axis) for wall in rounds):
        return None
    about = Revolution(solid.centroid, rounds[0].axis, reversible=False)
    for face in solid.faces.values():
        across = abs(face.normal @ about.axis) > 1.0 - _SAME
        if not across or not all(_is_circle(about, loop) for loop in (face.outline, *face.holes)):
            return None
    turns = [turn_about(about.point, about.axis, angle) for angle in _TURNS]
    J = solid.inertia
    R = turns[0][:3, :3]
    if J is not None and np.abs(R @ J @ R.T - J).max() > _EVEN * np.trace(J):
        return None
    coarse = _COARSE * max(max(wall.radii) for wall in rounds)
    if not all(fills_the_same(solid, g, coarse) for g in turns):
        return None
    over = turn_about(about.point, across_axis(about.axis), np.pi)
    return about._replace(reversible=carries_faces(solid, over))


def turn_about(point: Array, axis: Array, angle_rad: float) -> Array:
    """The displacement by a turn about an axis through a point, (4, 4)."""
    spin = np.concatenate([np.zeros(3), axis * angle_rad])
    return np.asarray(pose.at(point) @ pose.exp(spin) @ pose.at(-point))


def turned_alike(solid: Solid, T: Array, true: Array) -> Array:
    """The pose, (4, 4), at which a part of revolution looks as it does at T, turned the least from another pose.

    Of that one the rotation (3, 3) is enough. Any other part stays as it is.
    """
    about = revolution(solid)
    if about is None:
        return T
    # What is left between the two, M, is to turn the least: of both ways round, the turn about the axis with the
    # greatest trace. The centre of volume stays where it is seen.
    M = true[:3, :3].T @ T[:3, :3]
    a = about.axis
    across = across_axis(a)
    flips = [np.eye(3), 2.0 * np.outer(across, across) - np.eye(3)] if about.reversible else [np.eye(3)]
    turns = [flip @ _least_turn(M @ flip, a) for flip in flips]
    best = max(turns, key=lambda g: float(np.trace(M @ g)))
    out = np.array(T)
    out[:3, :3] = T[:3, :3] @ best
    out[:3, 3] += T[:3, :3] @ (about.point - best @ about.point)
    return out


def _least_turn(M: Array, axis: Array) -> Array:
    """The rotation about an axis, (3, 3), for which M times it turns the least: the greatest trace."""
    # trace(M R(t)) = c + (trace(M) - a . M a) cos t + trace(M K) sin t, which is greatest at this t.
    K = pose.hat(axis)
    angle = np.arctan2(np.trace(M @ K), np.trace(M) - axis @ M @ axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def _about(face: RoundFace, point: Array, axis: Array) -> bool:
    """Whether a face goes all around an axis through a point."""
    off = np.cross(face.point - point, axis)
    return bool(face.toward is None and abs(face.axis @ axis) > 1.0 - _SAME and np.sqrt(off @ off) < _SAME_M)


def _is_circle(about: Revolution, loop: Array) -> bool:
    """Whether corners, (k, 3), lie on a circle about the axis, and are as many as a coarse wall has at least."""
    far = np.linalg.norm(np.cross(loop - about.point, about.axis), axis=1)
    return len(loop) >= _FEWEST and float(np.ptp(far)) <= _SAME_M
