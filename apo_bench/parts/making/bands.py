"""Bands along walls that recede: one piece behind each of their sides, so that the whole wall recedes by the clearance.

A piece that only touches such a wall in a corner would stay where it is, and stand out of it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array
from apo_bench.parts.making.cells import is_convex

_WIDTHS_MM = (3.0, 2.0, 1.0, 0.6, 0.4)
"""The first one that there is room for."""
_SAME = 1e-9


def bands(area: Any, rings: list[tuple[Array, NDArray[np.bool_]]]) -> list[Array]:
    """Convex areas, (4, 2) each, behind the sides of rings that recede; none where there is no room for them.

    Args:
        area: All of the material.
        rings: Corners (k, 2), the material to their left, and whether the side that begins there recedes, (k,).
    """
    found: list[Array] = []
    for corners, fit in rings:
        if fit.any():
            found += _band(area, corners, fit)
    return found


def _band(area: Any, corners: Array, fit: NDArray[np.bool_]) -> list[Array]:
    from shapely import Polygon, unary_union

    for width in _WIDTHS_MM:
        inner = [_inner(corners, fit, i, width) for i in range(len(corners))]
        found = []
        for i in np.flatnonzero(fit):
            k = (int(i) + 1) % len(corners)
            found.append(np.array([corners[i], corners[k], inner[k][0], inner[int(i)][1]]))
        shapes = [Polygon(quad) for quad in found]
        whole = unary_union(shapes)
        fits = all(is_convex(quad) and shape.is_valid for quad, shape in zip(found, shapes, strict=True))
        apart = abs(sum(shape.area for shape in shapes) - whole.area) < _SAME * area.area
        if fits and apart and whole.difference(area.buffer(_SAME)).area < _SAME * area.area:
            return found
    return []


def _inner(corners: Array, fit: NDArray[np.bool_], i: int, width: float) -> tuple[Array, Array]:
    """The inner corners, at corner i, of the band of the side that ends there, and of that of the side that begins."""
    here = corners[i]
    into = here - corners[i - 1]
    out = corners[(i + 1) % len(corners)] - here
    into = into / np.linalg.norm(into)
    out = out / np.linalg.norm(out)
    left = np.array([-into[1], into[0]])
    right = np.array([-out[1], out[0]])
    turn = float(into[0] * out[1] - into[1] * out[0])
    if fit[i - 1] and fit[i]:
        both = here + width / (1.0 + float(left @ right)) * (left + right)
        return both, both
    if turn > _SAME:
        return here + width / turn * out, here - width / turn * into
    return here + width * left, here + width * right
