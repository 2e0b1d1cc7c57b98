"""Parts of revolution: the same after any turn about their axis, and some of them end for end."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.convex import piece_corners
from apo_bench.geometry.hull import FEWEST_SIDES, Hull
from apo_bench.geometry.solid import Solid

_SAME_M = 1e-6
"""Corners that are nearer to each other than this are one."""


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

    Its round faces lie about the axis, and so do cylinders among its pieces; each corner of other pieces that is not on
    the axis is one of at least 16 that lie evenly around it: so fine are the flat sides that stand for a round wall
    (`sides_of`).
    """
    axis = next((face.axis for face in solid.rounds.values()), None)
    if axis is None or not all(_about(f.point, f.axis, solid.centroid, axis) for f in solid.rounds.values()):
        return None
    corners = np.concatenate([piece_corners(piece) for piece in solid.pieces]) - solid.centroid
    heights = corners @ axis
    rings = np.column_stack([np.linalg.norm(corners - np.outer(heights, axis), axis=1), heights])
    known = [isinstance(p, Hull) and _is_about(p, solid.centroid, axis) for p in solid.pieces]
    asked = ~np.repeat(known, [len(piece_corners(piece)) for piece in solid.pieces])
    if not _all_round(corners[asked], rings[asked], axis):
        return None
    return Revolution(solid.centroid, axis, _same(rings, rings * (1.0, -1.0)) and _fits_alike(solid, axis))


def turned_alike(solid: Solid, T: Array, true: Array) -> Array:
    """The pose, (4, 4), at which a part of revolution looks as it does at T, turned the least from another pose.

    Any other part stays as it is.
    """
    found = revolution(solid)
    if found is None:
        return T
    M, a = true[:3, :3].T @ T[:3, :3], found.axis
    across = np.eye(3)[int(np.abs(a).argmin())]
    across = across - (across @ a) * a
    across /= np.sqrt(across @ across)
    flips = [np.eye(3), 2.0 * np.outer(across, across) - np.eye(3)] if found.reversible else [np.eye(3)]
    turns = [flip @ _least_turn(M @ flip, a) for flip in flips]
    best = max(turns, key=lambda g: float(np.trace(M @ g)))
    out = np.array(T)
    out[:3, :3] = T[:3, :3] @ best
    out[:3, 3] += T[:3, :3] @ (found.point - best @ found.point)
    return out


def _least_turn(M: Array, axis: Array) -> Array:
    """The rotation about an axis, (3, 3), for which M times it turns the least: the greatest trace."""
    K = pose.hat(axis)
    angle = np.arctan2(np.trace(M @ K), np.trace(M) - axis @ M @ axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def _all_round(corners: Array, rings: Array, axis: Array) -> bool:
    """Whether corners, about a point of the axis, lie in full rings around it."""
    u = np.eye(3)[int(np.abs(axis).argmin())]
    u = u - (u @ axis) * axis
    x, y = corners @ u / np.sqrt(u @ u), corners @ np.cross(axis, u / np.sqrt(u @ u))
    left = np.ones(len(corners), dtype=np.bool_)
    while left.any():
        i = int(left.argmax())
        ring = left & (np.abs(rings - rings[i]) < _SAME_M).all(axis=1)
        left &= ~ring
        if rings[i, 0] > _SAME_M and not _even(np.arctan2(y[ring], x[ring]), rings[i, 0]):
            return False
    return True


def _even(angles: Array, radius: float) -> bool:
    """Whether at least 16 angles, some of which may be the same, divide a whole turn evenly."""
    ordered = np.sort(angles)
    steps = np.diff(np.append(ordered, ordered[0] + 2.0 * np.pi))
    steps = steps[steps > _SAME_M / radius]
    return len(steps) >= FEWEST_SIDES and bool(np.ptp(steps) < 2.0 * _SAME_M / radius)


def _is_about(hull: Hull, point: Array, axis: Array) -> bool:
    """Whether a piece is a cylinder about an axis through a point."""
    return hull.cylinder is not None and _about(hull.cylinder.center, hull.cylinder.axis, point, axis)


def _about(a: Array, along: Array, b: Array, axis: Array) -> bool:
    """Whether two lines, each by a point and a unit vector, are one."""
    off = b - a
    return bool(abs(along @ axis) > 1.0 - 1e-9 and np.linalg.norm(off - (off @ axis) * axis) < _SAME_M)


def _fits_alike(solid: Solid, axis: Array) -> bool:
    """Whether every fit face lies on a fit face when the part is turned end for end."""
    walls = [
        (radius, float((end - solid.centroid) @ axis), float(face.hole))
        for face in solid.rounds.values()
        if face.fit
        for radius, end in zip(face.radii, face.ends, strict=True)
    ]
    flats = [(-1.0, float((f.outline[0] - solid.centroid) @ axis), 0.0) for f in solid.faces.values() if f.fit]
    found = np.array(walls + flats).reshape(-1, 3)
    return _same(found, found * (1.0, -1.0, 1.0))


def _same(a: Array, b: Array) -> bool:
    """Whether two sets of rows, (n, k) each, are the same."""
    far = np.abs(a[:, None] - b[None]).max(axis=-1) if len(a) else np.zeros((0, 0))
    return bool(not len(a) or ((far.min(axis=0) < _SAME_M).all() and (far.min(axis=1) < _SAME_M).all()))
