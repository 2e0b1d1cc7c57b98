"""Convex pieces as they are made: their sides that lie on fit faces recede by the clearance."""

from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull, cylinder_hull
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Face, Solid

_ON_M = 1e-7
_PARALLEL = 1e-7
"""A side lies on a face if it is this near to its plane, [m], or touches its cylinder or cone so nearly."""
_SLIVER = 1e-6
"""A side that covers less than this part of itself of a flat face only borders on it."""
_THINNEST_M = 5e-5
"""What is left of a piece must contain a ball of this radius, [m]."""


def receded_hull(solid: Solid, hull: Hull, clearance_m: float) -> Hull:
    """A piece whose sides on fit faces moved inwards: a hole gets wider, a shaft thinner, both by the clearance.

    Raises:
        InputError: Nothing is left of the piece.
    """
    if hull.cylinder is not None:
        return _thinner(solid, hull, clearance_m)
    on = [i for i, side in enumerate(hull.planes) if _on_fit(solid, hull, side)]
    if not on:
        return hull
    planes = np.array(hull.planes)
    planes[on, 3] -= clearance_m
    inside = hull.corners.mean(axis=0)
    if (planes[:, 3] - planes[:, :3] @ inside).min() < _THINNEST_M:
        inside, radius = _middle(planes)
        if radius < _THINNEST_M:
            raise _swallowed(solid, hull, clearance_m)
    from scipy.spatial import HalfspaceIntersection

    corners = HalfspaceIntersection(planes * [1.0, 1.0, 1.0, -1.0], inside).intersections
    return Hull(hull.name, _each_once(corners))


def _thinner(solid: Solid, hull: Hull, clearance_m: float) -> Hull:
    """A cylinder whose wall, or whose ends, recede."""
    assert hull.cylinder is not None
    center, axis, radius, half = hull.cylinder
    if any(face.fit and _same_wall(face, hull) for face in solid.rounds.values()):
        radius -= clearance_m
    ends = []
    for sign in (-1.0, 1.0):
        n = sign * axis
        fit = _on_fit(solid, hull, np.append(n, n @ center + half))
        ends.append(sign * (half - clearance_m * fit))
    if radius < _THINNEST_M or ends[1] - ends[0] < 2.0 * _THINNEST_M:
        raise _swallowed(solid, hull, clearance_m)
    middle = center + (ends[0] + ends[1]) / 2 * axis
    changed = hull.cylinder._replace(center=middle, radius=radius, half_length=(ends[1] - ends[0]) / 2)
    return cylinder_hull(hull.name, changed)


def _swallowed(solid: Solid, hull: Hull, clearance_m: float) -> InputError:
    return InputError(
        f"a clearance of {1e3 * clearance_m:g} mm leaves less than {2e3 * _THINNEST_M:g} mm of piece '{hull.name}' of "
        f"part '{solid.name}'; give less."
    )


def _same_wall(face: RoundFace, hull: Hull) -> bool:
    assert hull.cylinder is not None
    center, axis, radius, _ = hull.cylinder
    off = center - face.point
    along = abs(face.axis @ axis) > 1.0 - _PARALLEL
    return bool(
        along
        and not face.hole
        and np.linalg.norm(off - (off @ face.axis) * face.axis) < _ON_M
        and abs(face.radius - radius) < _ON_M
    )


def _on_fit(solid: Solid, hull: Hull, side: Array) -> bool:
    """Whether a side, (n, d), lies on a fit face."""
    flat = any(face.fit and _on_flat(face, hull, side) for face in solid.faces.values())
    return flat or any(face.fit and _on_round(face, hull, side) for face in solid.rounds.values())


def _on_round(face: RoundFace, hull: Hull, side: Array) -> bool:
    """Whether a side touches the wall of a hole from outside, somewhere along its span."""
    if not face.hole or face.kind == "rim":
        return False
    w = 1.0 / np.sqrt(1.0 + face.slope**2)
    r = face.radii[0] - face.slope * face.span[0]
    n = side[:3]
    d = side[3]
    if abs(n @ face.axis - face.slope * w) > _PARALLEL or abs(n @ face.point - d - r * w) > _ON_M:
        return False
    at = (_corners_on(hull, side) - face.point) @ face.axis
    return bool(at.max() > face.span[0] + _ON_M and at.min() < face.span[1] - _ON_M)


def _on_flat(face: Face, hull: Hull, side: Array) -> bool:
    """Whether a side lies in the plane of a face and covers some of it."""
    n = side[:3]
    d = side[3]
    if n @ face.normal < 1.0 - _PARALLEL or abs(n @ face.outline[0] - d) > _ON_M:
        return False
    u = np.eye(3)[int(np.abs(n).argmin())]
    u = u - (u @ n) * n
    u /= np.sqrt(u @ u)
    plane = np.array([u, np.cross(n, u)])
    own = _polygon(_corners_on(hull, side) @ plane.T).convex_hull
    other = _polygon(face.outline @ plane.T, [hole @ plane.T for hole in face.holes])
    return bool(own.intersection(other).area > _SLIVER * own.area)


def _polygon(outline: Array, holes: list[Array] | None = None) -> Any:
    from shapely import MultiPoint, Polygon

    return MultiPoint(outline) if holes is None else Polygon(outline, holes)


def _corners_on(hull: Hull, side: Array) -> Array:
    """The corners of a side, (k, 3)."""
    return np.asarray(hull.corners[np.abs(hull.corners @ side[:3] - side[3]) < _ON_M])


def _middle(planes: Array) -> tuple[Array, float]:
    """The middle of the largest ball inside of all planes, (3,), and its radius, [m]."""
    from scipy.optimize import linprog

    A = np.column_stack([planes[:, :3], np.ones(len(planes))])
    found = linprog([0.0, 0.0, 0.0, -1.0], A, planes[:, 3], bounds=[(None, None)] * 3 + [(0.0, None)])
    return (found.x[:3], float(found.x[3])) if found.success else (np.zeros(3), 0.0)


def _each_once(corners: Array) -> Array:
    """Corners (k, 3) without those that are the same but for rounding."""
    _, first = np.unique(np.round(corners, 9), axis=0, return_index=True)
    return np.asarray(corners[np.sort(first)])
