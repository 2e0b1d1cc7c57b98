"""Decompose flat areas into convex ones: cells around bores, wedges of these, bands behind receding sides; in mm."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Point, Polygon, box, unary_union

from apo_bench.geometry import Array, list_polygons, list_rings, straighten

_SAME_MM = 1e-6
"""Tolerance of lengths."""
_ON_MM = 1e-9
"""A corner this near to a clipping line lies on it."""
_SLIVER_MM2 = 1e-9
"""Smaller areas are dropped."""
_WIDTHS_MM = (3.0, 2.0, 1.0, 0.6, 0.4)
"""Widths of bands behind receding sides; the first that fits is taken."""
_SAME = 1e-9
"""Relative tolerance of areas and directions."""
_REACHES = (2.0, 1.6, 1.35, 1.2, 1.1, 1.05, 1.02)
"""Half sides of the square cell around a bore, in radii of the bore; the first that fits is taken."""


def cut_convex(area: Any) -> list[Array]:
    """Cut a shapely area into convex rings, (k, 2) each, counter-clockwise.

    Triangles are joined across common sides while the result stays convex (Hertel and Mehlhorn), which gives at most
    four times the least number of rings.
    """
    return [cell for polygon in list_polygons(area) if polygon.area > _SLIVER_MM2 for cell in _triangulate(polygon)]


def _triangulate(polygon: Any) -> list[Array]:
    """Cut one polygon, possibly with holes, into convex rings; the longest diagonals are removed first."""
    from manifold3d import triangulate

    rings = [straighten(ring) for ring in list_rings(polygon, 1.0)]
    if len(rings) == 1 and is_convex(rings[0]):
        return rings
    points = np.concatenate(rings)
    cells = {i: [int(k) for k in triangle] for i, triangle in enumerate(np.asarray(triangulate(rings)))}
    owner = {(a, b): i for i, cell in cells.items() for a, b in zip(cell, [*cell[1:], cell[0]], strict=True)}
    diagonals = {(a, b) for a, b in owner if a < b and (b, a) in owner}
    for a, b in sorted(diagonals, key=lambda side: -float(np.linalg.norm(points[side[0]] - points[side[1]]))):
        i = owner[a, b]
        k = owner[b, a]
        joined = _join_at_edge(cells[i], cells[k], a, b)
        if i != k and is_convex(points[joined]):
            cells[i] = joined
            for edge in zip(joined, [*joined[1:], joined[0]], strict=True):
                owner[edge] = i
            del cells[k]
    return [straighten(points[cell]) for cell in cells.values() if _is_wide(points[cell])]


def _is_wide(ring: Array) -> bool:
    """True if a ring (k, 2) encloses more than a line, since corners of different rings may be collinear."""
    x, y = (ring - ring[0]).T
    around = float(np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).sum())
    return bool(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > _SAME_MM * around)


def _join_at_edge(first: list[int], second: list[int], a: int, b: int) -> list[int]:
    """Join two rings of corner indices across their common side, which leads from a to b in the first ring."""
    i = first.index(b)
    k = second.index(a)
    return [*first[i:], *first[:i], *(second[k:] + second[:k])[1:-1]]


def is_convex(ring: Array) -> bool:
    """True if no corner of a counter-clockwise ring (k, 2) turns to the right."""
    into = ring - np.roll(ring, 1, axis=0)
    out = np.roll(ring, -1, axis=0) - ring
    across = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
    return bool((across > -_SAME_MM * np.linalg.norm(into, axis=1)).all())


def find_bore_cell(free: Any, at: Array, radius: float, others: list[tuple[Array, float]]) -> Array | None:
    """Find a convex ring around a bore inside a free area, counter-clockwise; None if there is no room for one.

    Args:
        free: Shapely area.
        at: (2,), centre of the bore.
        radius: Distance of the corners of the bore's widest polygon from its centre.
        others: Centres and radii of the other bores; a line between two bores separates their cells.
    """
    for reach in (radius * share for share in _REACHES):
        square = list_rings(box(*(at - reach), *(at + reach)), 1.0)[0]
        for middle, r in others:
            gap = np.linalg.norm(middle - at)
            n = (middle - at) / gap
            square = clip(square, n, float(n @ at + (gap + radius - r) / 2.0))
        cell = Polygon(square).intersection(free)
        if cell.geom_type != "Polygon" or cell.interiors:
            continue
        corners = straighten(list_rings(cell, 1.0)[0])
        if is_convex(corners) and cell.contains(Point(at)) and cell.exterior.distance(Point(at)) > radius + _SAME_MM:
            return corners
    return None


def clip(ring: Array, n: Array, d: float) -> Array:
    """Clip a convex ring (k, 2) to the half plane n . x <= d; (0, 2) if nothing is left."""
    kept: list[tuple[float, float]] = []
    heights = (ring @ n - d).tolist()
    corners = ring.tolist()
    for i, (x, y) in enumerate(corners):
        h = heights[i - 1]
        after = heights[i]
        after = 0.0 if abs(after) < _ON_MM else after
        if abs(h) > _ON_MM and h * after < 0.0:
            u, v = corners[i - 1]
            share = h / (h - after)
            kept.append((u + share * (x - u), v + share * (y - v)))
        if after <= 0.0:
            kept.append((x, y))
    return np.array(kept, dtype=np.float64).reshape(-1, 2)


def cut_wedges(cell: Array, at: Array, sides: int) -> list[tuple[Array, Array]]:
    """Cut a convex ring around a point into equal sectors; return the middle direction (2,) and ring (k, 2) of each."""
    sectors = []
    for i in range(sides):
        a, b, m = (2.0 * np.pi * (i + off) / sides for off in (-0.5, 0.5, 0.0))
        right = np.array([np.sin(a), -np.cos(a)])
        left = np.array([-np.sin(b), np.cos(b)])
        area = clip(clip(cell, right, float(right @ at)), left, float(left @ at))
        sectors.append((np.array([np.cos(m), np.sin(m)]), area))
    return sectors


def cut_bands(area: Any, rings: list[tuple[Array, NDArray[np.bool_]]]) -> list[Array]:
    """Convex quadrilaterals, (4, 2) each, in the material behind receding sides; none for a ring without room for them.

    Args:
        area: All of the material, a shapely area.
        rings: Corners (k, 2), with the material to their left; and a mask (k,), True if the side that begins at the
            corner recedes.
    """
    return [quad for corners, fit in rings if fit.any() for quad in _cut_band(area, corners, fit)]


def _cut_band(area: Any, corners: Array, fit: NDArray[np.bool_]) -> list[Array]:
    """The quadrilaterals of one ring, with the largest width at which they are convex, disjoint and inside the area."""
    for width in _WIDTHS_MM:
        inner = [_offset_inwards(corners, fit, i, width) for i in range(len(corners))]
        sides = [(int(i), (int(i) + 1) % len(corners)) for i in np.flatnonzero(fit)]
        quads = [np.array([corners[i], corners[k], inner[k][0], inner[i][1]]) for i, k in sides]
        shapes = [Polygon(quad) for quad in quads]
        whole = unary_union(shapes)
        fits = all(is_convex(quad) and shape.is_valid for quad, shape in zip(quads, shapes, strict=True))
        apart = abs(sum(shape.area for shape in shapes) - whole.area) < _SAME * area.area
        if fits and apart and whole.difference(area.buffer(_SAME)).area < _SAME * area.area:
            return quads
    return []


def _offset_inwards(corners: Array, fit: NDArray[np.bool_], i: int, width: float) -> tuple[Array, Array]:
    """The inner corners of the bands at corner i: of the side that ends there, then of the side that begins there.

    They are equal where both sides recede.
    """
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
