"""Make bodies of revolution, such as shafts and rings, from steps along the z axis; lengths in mm."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from shapely import Polygon

from apo_bench.arguments import check_arguments
from apo_bench.geometry import Array, Cylinder, Face, Hull, list_polygons, list_rings, make_cylinder_hull
from apo_bench.scenario.parts.making.body import Body
from apo_bench.scenario.parts.making.cells import clip, cut_wedges
from apo_bench.scenario.parts.making.extrude import flat_face
from apo_bench.scenario.parts.making.frustums import (
    Frustum,
    add_chamfers,
    circumscribe_polygon,
    find_steps_at_height,
    inscribe_polygon,
    list_heights,
    raise_to_height,
    subtract_steps,
)
from apo_bench.scenario.parts.making.moments import sum_moments

_SAME_MM = 1e-6
"""Radii that differ by less are equal; a smaller radius is a point."""
_NARROW_MM = 6e-3
"""Narrower rings are slivers between two polygons of one circle, and no faces."""


@check_arguments
def revolve(
    outer: Sequence[Frustum],
    inner: Sequence[Frustum] = (),
    *,
    flats: Mapping[float, str] | None = None,
) -> Body:
    """A body of revolution about z, [mm].

    A solid step is an exact cylinder, or a cone with corners on its end circles. A step with a bore consists of wedges,
    tangent to the bore from outside, with corners on the outer wall.

    Args:
        outer: Steps of the outer wall, one after the other.
        inner: Steps of its bore, inside the outer wall.
        flats: Height -> name of the flat face there: ends, shoulders, the bottom of a blind bore.
    """
    heights = list_heights((*outer, *inner))
    moments = sum_moments(outer[0].moments(), (step.moments() for step in outer[1:]))
    pieces = [p for a, b in pairwise(heights) for p in _revolve_step(outer, inner, a, b)]
    rounds = [step.wall((0.0, 0.0), hole) for steps, hole in ((outer, False), (inner, True)) for step in steps]
    return Body(
        tuple(pieces),
        tuple(face for z in heights for face in _make_flat_rings(outer, inner, z, (flats or {}).get(z, ""))),
        tuple(rounds),
        subtract_steps(moments, inner).in_metres,
    )


@check_arguments
def make_shaft(
    radius: float,
    low: float,
    high: float,
    name: str,
    *,
    chamfer_low: float = 0.0,
    chamfer_high: float = 0.0,
    bottom: str = "",
    top: str = "",
) -> Body:
    """A cylinder along z with chamfers of 45 degrees, [mm].

    The chamfers of `name` are called `name_chamfer_low` and `name_chamfer_high`.

    Args:
        name: Name of the cylindrical wall.
        chamfer_low: Length of the chamfer at the lower end; 0: none.
        chamfer_high: Length of the chamfer at the upper end; 0: none.
        bottom: Name of the lower face; "": named later.
        top: Name of the upper face; "": named later.
    """
    steps = add_chamfers(Frustum(low, high, radius, name=name), chamfer_low, chamfer_high, -1.0)
    return revolve(steps, flats={low: bottom, high: top})


def _revolve_step(outer: Sequence[Frustum], inner: Sequence[Frustum], a: float, b: float) -> Iterator[Hull]:
    """The pieces between heights a and b, between which no step begins or ends."""
    around = next((s for s in outer if s.covers(a, b)), None)
    bore = next((s for s in inner if s.covers(a, b)), None)
    if around is None:
        raise ValueError(f"no outer step reaches from {a:g} to {b:g} mm")
    low = around.at(a)
    high = around.at(b)
    if bore is None and abs(low - high) < _SAME_MM:
        center = np.array([0.0, 0.0, 5e-4 * (a + b)])
        yield make_cylinder_hull("", Cylinder(center, np.array([0.0, 0.0, 1.0]), 1e-3 * low, 5e-4 * (b - a)))
    elif bore is None:
        yield Hull(
            "",
            1e-3
            * np.concatenate([_list_ring_corners(low, around.count, a), _list_ring_corners(high, around.count, b)]),
        )
    else:
        n = max(around.count, bore.count)
        # Wedges of the lower and the upper polygon of the outer wall, cut off where the bore begins.
        for (u, first), (_, last) in zip(
            *[cut_wedges(inscribe_polygon((0.0, 0.0), r, n), np.zeros(2), n) for r in (low, high)], strict=True
        ):
            ends = [(clip(first, -u, -bore.at(a)), a), (clip(last, -u, -bore.at(b)), b)]
            yield Hull("", 1e-3 * np.concatenate([raise_to_height(*end) for end in ends]))


def _list_ring_corners(radius: float, sides: int, z: float) -> Array:
    """The corners (k, 3) of a horizontal polygon on a circle; one point (1, 3) if the radius is 0."""
    if radius < _SAME_MM:
        return np.array([[0.0, 0.0, z]])
    return raise_to_height(inscribe_polygon((0.0, 0.0), radius, sides), z)


def _make_flat_rings(outer: Sequence[Frustum], inner: Sequence[Frustum], z: float, name: str) -> Iterator[Face]:
    """The horizontal faces at height z: solid below and free above (looks up), or the reverse (looks down)."""
    areas = []
    for above in (False, True):
        # R, n: radius and sides of the outer wall; r, k: those of the bore; both get the larger number of sides.
        R, n = find_steps_at_height(outer, z, above)
        r, k = find_steps_at_height(inner, z, above)
        n, k = (max(n, k), max(n, k)) if n and k else (n, k)
        disc = Polygon(inscribe_polygon((0.0, 0.0), R, n)) if R else Polygon()
        areas.append(disc.difference(Polygon(circumscribe_polygon((0.0, 0.0), r, k))) if r else disc)
    below, over = areas
    for rest, up in ((below.difference(over), True), (over.difference(below), False)):
        for polygon in list_polygons(rest):
            if not polygon.buffer(-_NARROW_MM / 2).is_empty:
                outline, *holes = list_rings(polygon, 1.0)
                yield flat_face(name, outline, [hole[::-1] for hole in holes], z, up)
