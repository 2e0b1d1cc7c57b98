"""Cut flat areas into convex ones."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import Point, Polygon, box, unary_union

from apo_bench.geometry import Array, list_polygons, list_rings, straighten

_SAME_MM = 1e-6
_ON_MM = 1e-9
_SLIVER_MM2 = 1e-9
_WIDTHS_MM = (3.0, 2.0, 1.0, 0.6, 0.4)
"""The first one that there is room for."""
_SAME = 1e-9
_REACHES = (2.0, 1.6, 1.35, 1.2, 1.1, 1.05, 1.02)
"""How far the cell of a bore reaches, in radii; the first one that there is room for."""


def cut_convex(area: Any) -> list[Array]:
    """The convex areas, (k, 2) each, counter-clockwise, that a shapely area is cut into.

    Triangles are joined across their common sides while what they make stays convex (Hertel and Mehlhorn), so that
    there are at most four times as many as need be.
    """
    return [cell for polygon in list_polygons(area) if polygon.area > _SLIVER_MM2 for cell in _cut(polygon)]


def _cut(polygon: Any) -> list[Array]:
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
        joined = _joined(cells[i], cells[k], a, b)
        if i != k and is_convex(points[joined]):
            cells[i] = joined
            for edge in zip(joined, [*joined[1:], joined[0]], strict=True):
                owner[edge] = i
            del cells[k]
    return [straighten(points[cell]) for cell in cells.values() if _is_wide(points[cell])]


def _is_wide(ring: Array) -> bool:
    """Whether an area is more than a line: three corners of different rings may lie on one."""
    x, y = (ring - ring[0]).T
    around = float(np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1).sum())
    return bool(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > _SAME_MM * around)


def _joined(first: list[int], second: list[int], a: int, b: int) -> list[int]:
    """Two cells as one, without their common side, which goes from a to b in the first one."""
    i = first.index(b)
    k = second.index(a)
    return [*first[i:], *first[:i], *(second[k:] + second[:k])[1:-1]]


def is_convex(ring: Array) -> bool:
    """Whether no corner of a ring, counter-clockwise, turns to the right."""
    into = ring - np.roll(ring, 1, axis=0)
    out = np.roll(ring, -1, axis=0) - ring
    across = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
    return bool((across > -_SAME_MM * np.linalg.norm(into, axis=1)).all())


def find_bore_cell(free: Any, at: Array, radius: float, others: list[tuple[Array, float]]) -> Array | None:
    """A convex area around a bore inside of the free one, counter-clockwise; None if there is no room for one.

    Args:
        radius: Of the corners of its widest polygon.
        others: Middles and radii of the other bores: between two bores each has its side.
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
    """What of a convex area has n . x <= d; (0, 2) if nothing has."""
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
    """A convex area around a point cut into sectors: the middle direction of each, (2,), and its area, (k, 2)."""
    sectors = []
    for i in range(sides):
        a, b, m = (2.0 * np.pi * (i + off) / sides for off in (-0.5, 0.5, 0.0))
        right = np.array([np.sin(a), -np.cos(a)])
        left = np.array([-np.sin(b), np.cos(b)])
        area = clip(clip(cell, right, float(right @ at)), left, float(left @ at))
        sectors.append((np.array([np.cos(m), np.sin(m)]), area))
    return sectors


def cut_bands(area: Any, rings: list[tuple[Array, NDArray[np.bool_]]]) -> list[Array]:
    """Convex areas, (4, 2) each, behind the sides of rings that recede; none where there is no room for them.

    Args:
        area: All of the material.
        rings: Corners (k, 2), the material to their left, and whether the side that begins there recedes, (k,).
    """
    return [quad for corners, fit in rings if fit.any() for quad in _band(area, corners, fit)]


def _band(area: Any, corners: Array, fit: NDArray[np.bool_]) -> list[Array]:
    for width in _WIDTHS_MM:
        inner = [_inner(corners, fit, i, width) for i in range(len(corners))]
        sides = [(int(i), (int(i) + 1) % len(corners)) for i in np.flatnonzero(fit)]
        quads = [np.array([corners[i], corners[k], inner[k][0], inner[i][1]]) for i, k in sides]
        shapes = [Polygon(quad) for quad in quads]
        whole = unary_union(shapes)
        fits = all(is_convex(quad) and shape.is_valid for quad, shape in zip(quads, shapes, strict=True))
        apart = abs(sum(shape.area for shape in shapes) - whole.area) < _SAME * area.area
        if fits and apart and whole.difference(area.buffer(_SAME)).area < _SAME * area.area:
            return quads
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
