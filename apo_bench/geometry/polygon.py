"""Plane polygons: directions in a plane, conversion to and from shapely, and corners without straight-edge points."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array

_STRAIGHT_M = 1e-9
"""A point closer than this to the line through its neighbours is no corner, [m]."""


def find_direction_across(axis: Array, toward: Array | None = None) -> Array:
    """A unit vector perpendicular to a unit axis, (3,).

    Args:
        toward: The direction whose perpendicular component is taken; None: the frame axis most nearly perpendicular.
    """
    x = np.eye(3)[int(np.abs(axis).argmin())] if toward is None else toward
    x = x - (x @ axis) * axis
    return np.asarray(x / np.sqrt(x @ x))


def find_plane_across(n: Array) -> Array:
    """Two unit vectors perpendicular to a normal, (3,), as columns, (3, 2); with it they make a right-handed frame."""
    u = find_direction_across(n)
    return np.column_stack([u, np.cross(n, u)])


def make_flat_area(outline: Array, holes: Sequence[Array], to_plane: Array) -> Any:
    """Project rings of corners, (k, 3) each, onto the two directions of a plane, (3, 2), as a shapely polygon with
    holes.
    """
    from shapely import Polygon

    return Polygon(outline @ to_plane, [hole @ to_plane for hole in holes])


def list_polygons(shape: Any) -> Iterator[Any]:
    """The polygons in a shapely geometry, nested ones too; points and lines are left out."""
    if shape.geom_type == "Polygon":
        yield shape
    for part in getattr(shape, "geoms", ()):
        yield from list_polygons(part)


def list_rings(polygon: Any, turned: float | None = None) -> list[Array]:
    """The outline of a shapely polygon, then its holes, (k, 2) each, every corner once.

    Args:
        turned: 1: the outline is counter-clockwise, holes are clockwise; -1: the other way round; None: as they are.
    """
    from shapely.geometry.polygon import orient

    shape = polygon if turned is None else orient(polygon, turned)
    return [np.asarray(ring.coords)[:-1, :2] for ring in (shape.exterior, *shape.interiors)]


def straighten(ring: Array) -> Array:
    """The corners of a closed ring (k, 2), each once, [m]: points in the middle of straight edges are dropped.

    A sliver, such as a disc seen nearly edge-on, keeps its points where no three corners would be left.
    """
    return ring[find_corners(ring, np.zeros(len(ring), dtype=np.intp))]


def find_corners(points: Array, ring: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which points of closed rings are corners, (k,): not points in the middle of straight edges. See `straighten`.

    Args:
        points: (k, 2), ring by ring, each point once, [m].
        ring: (k,), the number of the ring of each point, ascending.
    """
    # The neighbours of a point are the rows before and after it, except that the last point of a ring meets its first.
    last = np.append(ring[1:] != ring[:-1], True)[: len(ring)]
    ends = last.nonzero()[0]
    begins = np.append(0, ends + 1)[: len(ends)]
    previous = np.arange(-1, len(ring) - 1)
    following = np.arange(1, len(ring) + 1)
    previous[begins], following[ends] = ends, begins
    before = points - points[previous]
    after = points[following] - points
    # before x after is twice the area of the triangle of three neighbours; over the chord, the height of the middle one
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    chord = np.maximum(np.hypot(*(before + after).T), _STRAIGHT_M)
    corners = np.abs(across) > _STRAIGHT_M * chord
    # A ring with fewer than three corners is a sliver and keeps all its points.
    return corners | (np.bincount(ring, corners, minlength=1) <= 2)[ring]
