"""Shapes with clearance: the pieces of a nominal solid after every fit face has receded by the clearance."""

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry.arrays import Array, remember
from apo_bench.geometry.hull import Hull, make_cylinder_hull
from apo_bench.geometry.polygon import find_plane_across, make_flat_area
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.shoulders import list_shoulder_planes
from apo_bench.geometry.solid import Box, Face, Piece, Solid, all_boxes

_ON_SURFACE_M = 1e-7
"""Distance from the plane, cylinder or cone of a face up to which a side lies on it, [m]."""
_PARALLEL = 1e-7
"""Difference of a cosine from that of aligned directions, up to which a side is parallel to a face."""
_SLIVER = 1e-6
"""A side that shares less than this fraction of its area with a flat face only borders on the face."""
_VANISHING_SHARE = 0.01
"""Pieces that vanish by the clearance are left out up to this fraction of the volume of the part."""
_THINNEST_M = 5e-5
"""Half the least thickness of a piece, [m], since MuJoCo ignores thinner boxes; other pieces must contain a ball of
this radius."""


def shrink_pieces(solid: Solid, clearance_m: float) -> tuple[Piece, ...]:
    """The pieces of a physical part with clearance: same names and order, fit faces moved inwards.

    Every side of a piece that carries a fit face, or a part of one, moves inwards by the clearance; so a round hole
    gets wider. The nominal part has no clearance: walls and stick of one size touch. With clearance c a stick of 20 mm
    is 20 - 2c thick, a pocket of 50 mm is 50 + 2c wide. Pieces of which nothing remains are left out, if they are
    hardly any of the part.

    Args:
        clearance_m: How far each fit face recedes, >= 0, [m].

    Raises:
        InputError: The clearance is negative or not finite, swallows a piece, or a side of a box carries both a fit
            face and another one.
    """
    require(
        np.isfinite(clearance_m) and clearance_m >= 0,
        f"a clearance of {1e3 * clearance_m:g} mm was given for part '{solid.name}'; "
        "give a finite length per side that is not negative.",
    )
    return recede_pieces(solid, clearance_m) if solid.fits else solid.pieces


@remember
def recede_pieces(solid: Solid, clearance_m: float) -> tuple[Piece, ...]:
    """`shrink_pieces` without the check of the clearance; a negative clearance moves the fit faces outwards.

    If any piece is not a box, boxes are treated as general convex pieces too.
    """
    from scipy.spatial import ConvexHull

    if all_boxes(solid.pieces):
        return tuple(_recede_box(solid, box, clearance_m) for box in solid.pieces if isinstance(box, Box))
    hulls = [piece if isinstance(piece, Hull) else Hull(piece.name, piece.corners) for piece in solid.pieces]
    kept = list[Piece]()
    vanished_m3 = 0.0
    for hull in hulls:
        try:
            kept.append(_recede_hull(solid, hull, clearance_m))
        except InputError:
            # What lies behind a fit face and is thinner than the clearance goes with it, if it is hardly anything.
            vanished_m3 += float(ConvexHull(hull.corners).volume)
            if vanished_m3 > _VANISHING_SHARE * solid.volume:
                raise
    return tuple(kept)


def _recede_box(solid: Solid, box: Box, clearance_m: float) -> Box:
    """The box after each side that carries a fit face has moved inwards by the clearance."""
    # `planes` lists the sides +x, +y, +z, then -x, -y, -z. A half size loses half of what both sides lose; the centre
    # moves away from the side that loses more.
    high, low = clearance_m * np.array([_carries_fit(solid, box, side) for side in box.planes]).reshape(2, 3)
    half = box.half - (low + high) / 2
    require(
        (half >= _THINNEST_M).all(),
        f"a clearance of {1e3 * clearance_m:g} mm leaves less than {2e3 * _THINNEST_M:g} mm of box '{box.name}' "
        f"of part '{solid.name}'; give less.",
    )
    return Box(box.name, box.center + (low - high) / 2, half)


def _carries_fit(solid: Solid, box: Box, side: Array) -> bool:
    """Whether a side of the box, (n, d), carries a fit face or a part of one.

    Raises:
        InputError: It carries a face that is not fit as well.
    """
    on = [face for face in solid.faces.values() if _covers_flat_face(face, box, side)]
    fit = [face.name for face in on if face.fit]
    other = [face.name for face in on if not face.fit]
    if fit and other:
        raise InputError(
            f"box '{box.name}' of part '{solid.name}' has the fit face '{fit[0]}' and the face '{other[0]}' on one "
            "side, which cannot recede for one of them only; cut the box in two, or mark both faces or none."
        )
    return bool(fit)


def _recede_hull(solid: Solid, hull: Hull, clearance_m: float) -> Hull:
    """A convex piece after its sides on fit faces have moved inwards by the clearance.

    Raises:
        InputError: Nothing is left of the piece.
    """
    if hull.cylinder is not None:
        return _recede_cylinder(solid, hull, clearance_m)
    on = [i for i, side in enumerate(hull.planes) if _lies_on_fit_face(solid, hull, side)]
    beyond = list_shoulder_planes(solid, hull, clearance_m)
    if not on and not beyond:
        return hull
    planes = np.array(hull.planes)
    planes[on, 3] -= clearance_m
    planes = np.array([*planes, *beyond])
    # Intersecting half spaces needs an interior point: the mean of the corners, else the centre of the largest ball.
    inside = hull.corners.mean(axis=0)
    if (planes[:, 3] - planes[:, :3] @ inside).min() < _THINNEST_M:
        inside, radius = _largest_inscribed_ball(planes)
        if radius < _THINNEST_M:
            raise _too_thin_error(solid, hull, clearance_m)
    from scipy.spatial import HalfspaceIntersection

    # scipy states half spaces as n . x + b <= 0, hence b = -d.
    corners = HalfspaceIntersection(planes * [1.0, 1.0, 1.0, -1.0], inside).intersections
    return Hull(hull.name, _drop_duplicates(corners))


def _recede_cylinder(solid: Solid, hull: Hull, clearance_m: float) -> Hull:
    """A cylinder after its wall, its ends, or both have receded by the clearance, as far as these are fit.

    Raises:
        InputError: Nothing is left of the cylinder.
    """
    assert hull.cylinder is not None
    center, axis, radius, half = hull.cylinder
    if any(face.fit and _is_wall_of_cylinder(face, hull) for face in solid.rounds.values()):
        radius -= clearance_m
    # The two ends as planes (n, d), and their positions along the axis from the centre after receding.
    sides = {sign: np.append(sign * axis, sign * axis @ center + half) for sign in (-1.0, 1.0)}
    ends = [sign * (half - clearance_m * _lies_on_fit_face(solid, hull, side)) for sign, side in sides.items()]
    if radius < _THINNEST_M or ends[1] - ends[0] < 2.0 * _THINNEST_M:
        raise _too_thin_error(solid, hull, clearance_m)
    middle = center + (ends[0] + ends[1]) / 2 * axis
    changed = hull.cylinder._replace(center=middle, radius=radius, half_length=(ends[1] - ends[0]) / 2)
    return make_cylinder_hull(hull.name, changed)


def _too_thin_error(solid: Solid, hull: Hull, clearance_m: float) -> InputError:
    """The error of a piece that the clearance leaves too thin."""
    return InputError(
        f"a clearance of {1e3 * clearance_m:g} mm leaves less than {2e3 * _THINNEST_M:g} mm of piece '{hull.name}' of "
        f"part '{solid.name}'; give less."
    )


def _is_wall_of_cylinder(face: RoundFace, hull: Hull) -> bool:
    """Whether a round face is the outer wall of a cylinder piece: same axis, same radius, not a hole."""
    assert hull.cylinder is not None
    center, axis, radius, _ = hull.cylinder
    offset = center - face.point
    is_parallel = abs(face.axis @ axis) > 1.0 - _PARALLEL
    return bool(
        is_parallel
        and not face.hole
        and np.linalg.norm(offset - (offset @ face.axis) * face.axis) < _ON_SURFACE_M
        and abs(face.radius - radius) < _ON_SURFACE_M
    )


def _lies_on_fit_face(solid: Solid, hull: Hull, side: Array) -> bool:
    """Whether a side, (n, d), lies on a fit face, flat or round."""
    flat = any(face.fit and _covers_flat_face(face, hull, side) for face in solid.faces.values())
    return flat or any(face.fit and _is_tangent_to_hole(face, hull, side) for face in solid.rounds.values())


def _is_tangent_to_hole(face: RoundFace, hull: Hull, side: Array) -> bool:
    """Whether a side, (n, d), is tangent to the wall of a hole from outside, somewhere along its span.

    The pieces around a hole approximate its wall by such sides; walls of shafts and rims never match.
    """
    if not face.hole or face.kind == "rim":
        return False
    # A side is tangent to the cone r(s) = r0 + slope s about the axis if its normal makes sine slope * w with the axis
    # and it passes it at the distance r0 * w.
    cosine = 1.0 / np.sqrt(1.0 + face.slope**2)
    radius = face.radii[0] - face.slope * face.span[0]
    normal = side[:3]
    if (
        abs(normal @ face.axis - face.slope * cosine) > _PARALLEL
        or abs(normal @ face.point - side[3] - radius * cosine) > _ON_SURFACE_M
    ):
        return False
    along = (_find_corners_on_side(hull, side) - face.point) @ face.axis
    return bool(along.max() > face.span[0] + _ON_SURFACE_M and along.min() < face.span[1] - _ON_SURFACE_M)


def _covers_flat_face(face: Face, piece: Piece, side: Array) -> bool:
    """Whether a side, (n, d), lies in the plane of a face and covers some of it."""
    from shapely import MultiPoint

    normal = side[:3]
    if normal @ face.normal < 1.0 - _PARALLEL or abs(normal @ face.outline[0] - side[3]) > _ON_SURFACE_M:
        return False
    to_plane = find_plane_across(normal)
    area = MultiPoint(_find_corners_on_side(piece, side) @ to_plane).convex_hull
    return bool(area.intersection(make_flat_area(face.outline, face.holes, to_plane)).area > _SLIVER * area.area)


def _find_corners_on_side(piece: Piece, side: Array) -> Array:
    """The corners of a piece that lie on one of its sides, (n, d): (k, 3), [m]."""
    return np.asarray(piece.corners[np.abs(piece.corners @ side[:3] - side[3]) < _ON_SURFACE_M])


def _largest_inscribed_ball(planes: Array) -> tuple[Array, float]:
    """Centre, (3,), and radius of the largest ball inside all planes (n, d), (s, 4), [m]; radius 0 if there is none."""
    from scipy.optimize import linprog

    # maximise r so that n . x + r <= d for every plane: the largest ball, by its middle x and radius r.
    A = np.column_stack([planes[:, :3], np.ones(len(planes))])
    optimum = linprog([0.0, 0.0, 0.0, -1.0], A, planes[:, 3], bounds=[(None, None)] * 3 + [(0.0, None)])
    return (optimum.x[:3], float(optimum.x[3])) if optimum.success else (np.zeros(3), 0.0)


def _drop_duplicates(corners: Array) -> Array:
    """Corners, (k, 3), without duplicates up to rounding, in their order."""
    _, first = np.unique(np.round(corners, 9), axis=0, return_index=True)
    return np.asarray(corners[np.sort(first)])
