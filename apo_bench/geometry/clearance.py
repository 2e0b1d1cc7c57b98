"""The physical part: fit faces recede by the clearance, nothing else moves."""

from __future__ import annotations

from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.overlap import SLIVER_M2
from apo_bench.geometry.solid import Box, Face, Solid

IN_PLANE_M = 1e-9
"""A face and a side of a box this near to each other lie in one plane."""


def physical_boxes(solid: Solid, clearance_m: float) -> tuple[Box, ...]:
    """The boxes of the part as it is made, same names and order.

    Every side of a box that carries a fit face, or a piece of one, moves into the box by the clearance. The nominal
    part has none: walls and stick of one size touch. With clearance c a stick of 20 mm is 20 - 2c thick, a pocket of
    50 mm is 50 + 2c wide.

    Args:
        clearance_m: How far each fit face recedes, >= 0, [m].

    Raises:
        InputError: The clearance is negative or not finite, swallows a box, or a side carries both a fit face and
            another one.
    """
    if not np.isfinite(clearance_m) or clearance_m < 0:
        raise InputError(
            f"a clearance of {1e3 * clearance_m:g} mm was given for part '{solid.name}'; "
            "give a finite length per side that is not negative."
        )
    return tuple(_receded(solid, box, clearance_m) for box in solid.boxes)


def _receded(solid: Solid, box: Box, clearance_m: float) -> Box:
    recede = clearance_m * np.array(
        [[_carries_fit(solid, box, axis, sign) for sign in (-1, 1)] for axis in range(3)], dtype=np.float64
    )
    half = box.half - recede.sum(axis=1) / 2
    if (half <= 0).any():
        raise InputError(
            f"a clearance of {1e3 * clearance_m:g} mm leaves nothing of box '{box.name}' of part '{solid.name}'; "
            f"give less than {1e3 * box.half.min():g} mm."
        )
    return Box(box.name, box.center + (recede[:, 0] - recede[:, 1]) / 2, half)


def _carries_fit(solid: Solid, box: Box, axis: int, sign: int) -> bool:
    """Whether a side of the box carries a fit face; it must then carry no other."""
    found = [face for face in solid.faces.values() if _lies_on(face, box, axis, sign)]
    fit, other = [f.name for f in found if f.fit], [f.name for f in found if not f.fit]
    if fit and other:
        raise InputError(
            f"box '{box.name}' of part '{solid.name}' has the fit face '{fit[0]}' and the face '{other[0]}' on one "
            "side, which cannot recede for one of them only; cut the box in two, or mark both faces or none."
        )
    return bool(fit)


def _lies_on(face: Face, box: Box, axis: int, sign: int) -> bool:
    """Whether a piece of the face lies on the side of the box."""
    if face.normal[axis] * sign < 0.5:
        return False
    if np.abs(face.outline[:, axis] - (box.center[axis] + sign * box.half[axis])).max() > IN_PLANE_M:
        return False
    plane = [(axis + 1) % 3, (axis + 2) % 3]
    side = _rectangle(box.center[plane] - box.half[plane], box.center[plane] + box.half[plane])
    return bool(side.intersection(_flat(face, plane)).area > SLIVER_M2)


def _rectangle(low: Array, high: Array) -> Any:
    from shapely import box

    return box(*low, *high)


def _flat(face: Face, plane: list[int]) -> Any:
    from shapely import Polygon

    return Polygon(face.outline[:, plane], [hole[:, plane] for hole in face.holes])
