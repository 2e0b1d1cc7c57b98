"""Planes that keep the pieces beyond the ends of a fit round wall, such as chamfers, out of the play of the wall."""

from collections.abc import Iterator

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Solid

_ON_RING_M = 1e-7
"""Corners this near to the end of a wall lie on it."""
_FEWEST_ON_RING = 6
"""A piece with fewer corners on the end of a shaft is no continuation of the shaft."""
_WIDER = 1.0 / np.cos(np.pi / 12)
"""Corners of pieces around a hole of at least twelve sides lie outside its wall by up to this factor."""


def list_shoulder_planes(solid: Solid, hull: Hull, clearance_m: float) -> list[Array]:
    """Return planes (n, d), n . x <= d, that trim a piece to where the fit walls next to it recede, (4,) each.

    Without them the wide end of a chamfer stays as wide as the nominal shaft, and the narrow end of a countersink as
    narrow as the nominal hole.

    Args:
        clearance_m: How far fit faces recede, [m].
    """
    walls = [wall for wall in solid.rounds.values() if wall.fit and wall.kind == "cylinder"]
    return [plane for wall in walls for plane in _list_planes_at_ends(wall, hull, clearance_m)]


def _list_planes_at_ends(wall: RoundFace, hull: Hull, clearance_m: float) -> Iterator[Array]:
    """Yield the planes that trim a piece beyond one end of a wall."""
    offset = hull.corners - wall.point
    height = offset @ wall.axis
    out = offset - np.outer(height, wall.axis)
    distance = np.linalg.norm(out, axis=1)
    for end, sign in zip(wall.span, (-1.0, 1.0), strict=True):
        if (sign * (height - end)).min() < -_ON_RING_M:
            continue  # the piece is no continuation: it lies along the wall
        most = wall.radius * (_WIDER if wall.hole else 1.0)
        on_ring = (np.abs(height - end) < _ON_RING_M) & (distance > wall.radius - _ON_RING_M)
        ring = out[on_ring & (distance < most + _ON_RING_M)]
        if wall.hole and len(ring) == 2:
            yield _make_plane(wall, -ring.sum(axis=0), -(wall.radius + clearance_m))
        elif not wall.hole and len(ring) >= _FEWEST_ON_RING:
            # Sides of a polygon whose corners are on the circle of the receded wall.
            inside = (wall.radius - clearance_m) * np.cos(_measure_step(wall, ring) / 2)
            yield from (_make_plane(wall, each, inside) for each in ring)


def _measure_step(wall: RoundFace, ring: Array) -> float:
    """Return the usual angle between neighbouring corners of a ring, (k, 3) from the axis, [rad]."""
    x, y = wall.frame[:3, :2].T
    angles = np.sort(np.arctan2(ring @ y, ring @ x))
    return float(np.median(np.diff(angles)))


def _make_plane(wall: RoundFace, out: Array, distance: float) -> Array:
    """Return the plane across a direction from the axis of a wall, at a distance from the axis."""
    n = out / np.linalg.norm(out)
    return np.append(n, n @ wall.point + distance)
