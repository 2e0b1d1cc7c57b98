"""Bodies of revolution."""

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
    at_height,
    chamfer,
    circumscribe_polygon,
    heights_of,
    inscribe_polygon,
    raise_to,
    subtract_steps,
)
from apo_bench.scenario.parts.making.moments import sum_moments

_SAME_MM = 1e-6
_NARROW_MM = 6e-3


@check_arguments
def revolve(
    outer: Sequence[Frustum],
    inner: Sequence[Frustum] = (),
    *,
    flats: Mapping[float, str] | None = None,
) -> Body:
    """A body of revolution about z, [mm].

    Lengths without a bore are true cylinders, or cones with corners on their edges; those with one are wedges, tangent
    to the bore from outside, with corners on the outer wall.

    Args:
        outer: Its lengths, one after the other.
        inner: Those of its bore, inside of the outer ones.
        flats: Height -> name of the flat face there: ends, shoulders, the bottom of a blind bore.
    """
    heights = heights_of((*outer, *inner))
    moments = sum_moments(outer[0].moments(), (step.moments() for step in outer[1:]))
    pieces = [p for a, b in pairwise(heights) for p in _length(outer, inner, a, b)]
    rounds = [step.wall((0.0, 0.0), hole) for steps, hole in ((outer, False), (inner, True)) for step in steps]
    return Body(
        tuple(pieces),
        tuple(face for z in heights for face in _flats(outer, inner, z, (flats or {}).get(z, ""))),
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
    """A cylinder along z with chamfers of 45 degrees, [mm]; those of `name` are `name_chamfer_low` and `..._high`."""
    steps = chamfer(Frustum(low, high, radius, name=name), chamfer_low, chamfer_high, -1.0)
    return revolve(steps, flats={low: bottom, high: top})


def _length(outer: Sequence[Frustum], inner: Sequence[Frustum], a: float, b: float) -> Iterator[Hull]:
    """The pieces between two heights between which nothing changes."""
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
        yield Hull("", 1e-3 * np.concatenate([_ring(low, around.count, a), _ring(high, around.count, b)]))
    else:
        n = max(around.count, bore.count)
        for (u, first), (_, last) in zip(
            *[cut_wedges(inscribe_polygon((0.0, 0.0), r, n), np.zeros(2), n) for r in (low, high)], strict=True
        ):
            ends = [(clip(first, -u, -bore.at(a)), a), (clip(last, -u, -bore.at(b)), b)]
            yield Hull("", 1e-3 * np.concatenate([raise_to(*end) for end in ends]))


def _ring(radius: float, sides: int, z: float) -> Array:
    """The corners of a level polygon on a circle; its middle, if it is a point."""
    if radius < _SAME_MM:
        return np.array([[0.0, 0.0, z]])
    return raise_to(inscribe_polygon((0.0, 0.0), radius, sides), z)


def _flats(outer: Sequence[Frustum], inner: Sequence[Frustum], z: float, name: str) -> Iterator[Face]:
    """The rings that look up or down at a height: what is full below and not above, or above and not below."""
    areas = []
    for above in (False, True):
        R, n = at_height(outer, z, above)
        r, k = at_height(inner, z, above)
        n, k = (max(n, k), max(n, k)) if n and k else (n, k)
        disc = Polygon(inscribe_polygon((0.0, 0.0), R, n)) if R else Polygon()
        areas.append(disc.difference(Polygon(circumscribe_polygon((0.0, 0.0), r, k))) if r else disc)
    below, over = areas
    for rest, up in ((below.difference(over), True), (over.difference(below), False)):
        for polygon in list_polygons(rest):
            if not polygon.buffer(-_NARROW_MM / 2).is_empty:
                outline, *holes = list_rings(polygon, 1.0)
                yield flat_face(name, outline, [hole[::-1] for hole in holes], z, up)
