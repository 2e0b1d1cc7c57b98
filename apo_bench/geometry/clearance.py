"""The physical part: fit faces recede by the clearance, nothing else moves."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.convex import all_boxes, piece_corners
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.overlap import SLIVER_M2
from apo_bench.geometry.receding import receded_hull
from apo_bench.geometry.remembered import remembered
from apo_bench.geometry.solid import Box, Face, Piece, Solid

_IN_PLANE_M = 1e-9
"""A face and a side of a box this near to each other lie in one plane."""
_THINNEST_M = 5e-5
"""Half of what a box is thick at least, [m]; what is thinner, MuJoCo takes for nothing."""


def physical_pieces(solid: Solid, clearance_m: float) -> tuple[Piece, ...]:
    """The pieces of the part as it is made, same names and order.

    Every side of a piece that carries a fit face, or a piece of one, moves into it by the clearance; so a round hole
    gets wider. The nominal
    part has none: walls and stick of one size touch. With clearance c a stick of 20 mm is 20 - 2c thick, a pocket of
    50 mm is 50 + 2c wide.

    Args:
        clearance_m: How far each fit face recedes, >= 0, [m].

    Raises:
        InputError: The clearance is negative or not finite, swallows a piece, or a side of a box carries both a fit
            face and another one.
    """
    if not np.isfinite(clearance_m) or clearance_m < 0:
        raise InputError(
            f"a clearance of {1e3 * clearance_m:g} mm was given for part '{solid.name}'; "
            "give a finite length per side that is not negative."
        )
    if not solid.fits:
        return solid.pieces
    if not all_boxes(solid.pieces):
        return _receded_hulls(solid, clearance_m)
    sides = [_Side(face.name, face.fit, *_plane(face), _flat(face)) for face in solid.faces.values()]
    return tuple(_receded(solid, box, sides, clearance_m) for box in solid.pieces if isinstance(box, Box))


@remembered
def _receded_hulls(solid: Solid, clearance_m: float) -> tuple[Piece, ...]:
    """`physical_pieces` of a part that has pieces other than boxes, each of which is taken as one of them."""
    hulls = [p if isinstance(p, Hull) else Hull(p.name, piece_corners(p)) for p in solid.pieces]
    return tuple(receded_hull(solid, hull, clearance_m) for hull in hulls)


class _Side(NamedTuple):
    """A face as a polygon on an axis-aligned plane."""

    name: str
    fit: bool
    axis: int
    sign: int
    height: float
    shape: Any


def _plane(face: Face) -> tuple[int, int, float]:
    """Axis along which the face looks, sign, coordinate [m]."""
    n = face.normal
    axis = int(np.abs(n).argmax())
    return axis, int(np.sign(n[axis])), float(face.outline[0, axis])


def _flat(face: Face) -> Any:
    """The face in the two coordinates that follow its axis cyclically."""
    from shapely import Polygon

    axis = _plane(face)[0]
    plane = [(axis + 1) % 3, (axis + 2) % 3]
    return Polygon(face.outline[:, plane], [hole[:, plane] for hole in face.holes])


def _receded(solid: Solid, box: Box, sides: Sequence[_Side], clearance_m: float) -> Box:
    carries = [[_carries_fit(solid, box, sides, axis, sign) for sign in (-1, 1)] for axis in range(3)]
    recede = clearance_m * np.array(carries, dtype=np.float64)
    half = box.half - recede.sum(axis=1) / 2
    if (half < _THINNEST_M).any():
        raise InputError(
            f"a clearance of {1e3 * clearance_m:g} mm leaves less than {2e3 * _THINNEST_M:g} mm of box '{box.name}' "
            f"of part '{solid.name}'; give less."
        )
    return Box(box.name, box.center + (recede[:, 0] - recede[:, 1]) / 2, half)


def _carries_fit(solid: Solid, box: Box, sides: Sequence[_Side], axis: int, sign: int) -> bool:
    """Whether a side of the box carries a fit face, or a piece of one; it must then carry no other."""
    height = box.center[axis] + sign * box.half[axis]
    near = [s for s in sides if (s.axis, s.sign) == (axis, sign) and abs(s.height - height) < _IN_PLANE_M]
    if not any(side.fit for side in near):
        return False
    on = [side for side in near if side.shape.intersection(_rectangle(box, axis)).area > SLIVER_M2]
    fit = [side.name for side in on if side.fit]
    other = [side.name for side in on if not side.fit]
    if fit and other:
        raise InputError(
            f"box '{box.name}' of part '{solid.name}' has the fit face '{fit[0]}' and the face '{other[0]}' on one "
            "side, which cannot recede for one of them only; cut the box in two, or mark both faces or none."
        )
    return bool(fit)


def _rectangle(box: Box, axis: int) -> Any:
    """The shadow of the box along an axis."""
    import shapely

    plane = [(axis + 1) % 3, (axis + 2) % 3]
    return shapely.box(*(box.center - box.half)[plane], *(box.center + box.half)[plane])
