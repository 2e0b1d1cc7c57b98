"""Closed outlines of straight sides and arcs, [mm]: their construction, their polygons and their moments."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.geometry import Array, count_sides
from apo_bench.scenario.parts.making.moments import Moments, compute_polygon_moments, compute_segment_moments

COARSE_SIDES = 12
"""Sides of a full circle for a round wall without a name, which no contact uses."""
_SAME_MM = 1e-6
"""Lengths that differ by less are equal."""


@final
@dataclass(frozen=True)
class Edge:
    """A side of an outline, from `start` to the start of the next side."""

    start: tuple[float, float]
    """[mm]."""
    name: str = ""
    """Name of the face that it becomes; "": named later."""
    fit: bool = False
    """The face recedes by the clearance."""
    center: tuple[float, float] | None = None
    """Centre of an arc, [mm]; None for a straight side."""
    clockwise: bool = False
    """Direction of an arc."""
    sides: int | None = None
    """Sides of the polygon of a full circle; None: as a contact needs if the arc has a name, else few."""


Outline = Sequence[Edge]
"""The sides of a closed outline, counter-clockwise, also if it is that of a hole."""


class OutlineArc(NamedTuple):
    """An arc of an outline."""

    center: Array
    """(2,), [mm]."""
    radius: float
    first: float
    """Angle at its start, [rad]."""
    turn: float
    """Angle from its start to its end, [rad]; negative is clockwise."""

    def at(self, angle: Any, radius: float | None = None) -> Array:
        """The point (2,) at an angle, or points (k, 2) at angles, on its circle or on one of another radius."""
        r = self.radius if radius is None else radius
        return np.asarray(self.center + r * np.stack([np.cos(angle), np.sin(angle)], axis=-1))

    @property
    def middle(self) -> float:
        """Angle of its middle, [rad]."""
        return self.first + self.turn / 2.0


@check_arguments
def make_polygon(
    *corners: tuple[float, float], names: Mapping[int, str] | Sequence[str] = (), fit: Sequence[str] = ()
) -> Outline:
    """Make a polygon; side i leads from corner i to the next corner.

    Args:
        names: Names of the sides; a side without one, or with "", is named later.
        fit: Names of the sides that recede by the clearance.
    """
    named = dict(names) if isinstance(names, Mapping) else dict(enumerate(names))
    return [Edge(at, named.get(i, ""), named.get(i, "") in fit and i in named) for i, at in enumerate(corners)]


@check_arguments
def make_rectangle(
    width: float, depth: float, at: tuple[float, float] = (0.0, 0.0), names: Sequence[str] = (), fit: Sequence[str] = ()
) -> Outline:
    """Make a rectangle with its centre at `at`; its sides are, in this order, at -y, +x, +y, -x."""
    x, y = at
    a = width / 2.0
    b = depth / 2.0
    return make_polygon((x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b), names=names, fit=fit)


@check_arguments
def make_circle(
    radius: float, at: tuple[float, float] = (0.0, 0.0), name: str = "", fit: bool = False, sides: int | None = None
) -> Outline:
    """Make a circle, of two arcs that become one face."""
    return [Edge((at[0] + sign * radius, at[1]), name, fit, at, sides=sides) for sign in (1.0, -1.0)]


@check_arguments
def make_slot(
    length: float,
    width: float,
    at: tuple[float, float] = (0.0, 0.0),
    names: Sequence[str] = ("", "", "", ""),
    fit: bool = False,
) -> Outline:
    """Make a slot along x with round ends, of a total `length`; its sides are, in this order, at -y, +x, +y, -x."""
    x, y = at
    a = (length - width) / 2.0
    r = width / 2.0
    corners = [(x - a, y - r), (x + a, y - r), (x + a, y + r), (x - a, y + r)]
    middles = [None, (x + a, y), None, (x - a, y)]
    return [Edge(*each[:2], fit, each[2]) for each in zip(corners, names, middles, strict=True)]


@check_arguments
def round_corners(outline: Outline, radius: float, sides: int | None = None) -> Outline:
    """Round the corners of an outline of straight sides."""
    edges: list[Edge] = []
    points = np.array([edge.start for edge in outline])
    for i, edge in enumerate(outline):
        into = points[i] - points[i - 1]
        out = points[(i + 1) % len(points)] - points[i]
        into = into / np.linalg.norm(into)
        out = out / np.linalg.norm(out)
        # The exterior angle at the corner, and the distance of the tangent points from it.
        turn = float(np.arctan2(into[0] * out[1] - into[1] * out[0], into @ out))
        back = radius * abs(np.tan(turn / 2.0))
        a = points[i] - back * into
        b = points[i] + back * out
        center = a + np.sign(turn) * radius * np.array([-into[1], into[0]])
        edges.append(Edge(_read_pair(a), center=_read_pair(center), clockwise=turn < 0.0, sides=sides))
        edges.append(replace(edge, start=_read_pair(b)))
    return edges


def find_arc(outline: Outline, i: int) -> OutlineArc | None:
    """The arc of side i; None if the side is straight. Ends at different distances raise a `ValueError`."""
    edge = outline[i]
    after = outline[(i + 1) % len(outline)]
    if edge.center is None:
        return None
    a = np.array(edge.start) - edge.center
    b = np.array(after.start) - edge.center
    r = float(np.linalg.norm(a))
    if abs(np.linalg.norm(b) - r) > _SAME_MM * max(1.0, r) or r < _SAME_MM:
        raise ValueError(f"side {i + 1} of an outline is no arc: its ends are not as far from its centre as each other")
    first = float(np.arctan2(a[1], a[0]))
    turn = (float(np.arctan2(b[1], b[0])) - first) % (2.0 * np.pi)
    return OutlineArc(np.array(edge.center), r, first, turn - 2.0 * np.pi if edge.clockwise else turn)


def trace_outline(outline: Outline, hole: bool = False) -> Array:
    """The polygon of an outline, (k, 2), [mm].

    An arc that bulges out of the material has its corners on the circle. The polygon of one that bulges into the
    material is tangent to the circle from outside, so that the space inside the circle stays free.

    Args:
        hole: True if the outline is that of a hole.
    """
    return np.array([corner for i in range(len(outline)) for corner in _list_corners(outline, i, hole)])


def find_receding_edges(outline: Outline, hole: bool = False) -> NDArray[np.bool_]:
    """(k,), True for each side of the polygon of `trace_outline` that recedes by the clearance."""
    return np.array(
        [edge.fit for i, edge in enumerate(outline) for _ in _list_corners(outline, i, hole)], dtype=np.bool_
    )


def _list_corners(outline: Outline, i: int, hole: bool) -> Iterator[Array]:
    """Yield the corners (2,) of the polygon of side i, without its end."""
    edge = outline[i]
    arc = find_arc(outline, i)
    start = np.array(edge.start, dtype=np.float64)
    if arc is None:
        yield start
        return
    share = abs(arc.turn) / (2.0 * np.pi)
    n = max(2, int(np.ceil(share * count_needed_sides(edge.sides, edge.name, arc.radius) - 1e-9)))
    if hole != edge.clockwise:  # bulges into the material
        step = arc.turn / n
        if not continues_arc(find_arc(outline, i - 1), arc):
            yield start
        k = np.arange(n) + 0.5
        yield from arc.at(arc.first + step * k, arc.radius / np.cos(step / 2.0))
    else:
        yield from arc.at(arc.first + arc.turn * np.arange(n) / n)


def continues_arc(before: OutlineArc | None, arc: OutlineArc) -> bool:
    """True if an arc continues the one before on the same circle, in the same direction."""
    return (
        before is not None
        and bool(np.abs(before.center - arc.center).max() < _SAME_MM)
        and abs(before.radius - arc.radius) < _SAME_MM
        and before.turn * arc.turn > 0.0
    )


def count_needed_sides(stated: int | None, name: str, radius_mm: float) -> int:
    """Sides of the polygon of a full circle: as stated, else as a contact needs if it has a name, else few."""
    return stated or (count_sides(1e-3 * radius_mm) if name else COARSE_SIDES)


def compute_outline_moments(outline: Outline) -> Moments:
    """The moments of the exact area inside an outline, arcs included, [mm]."""
    moments = compute_polygon_moments(np.array([edge.start for edge in outline], dtype=np.float64))
    for i in range(len(outline)):
        arc = find_arc(outline, i)
        if arc is not None:
            segment = compute_segment_moments(arc.center, arc.radius, arc.middle, abs(arc.turn))
            moments = moments.plus(segment, float(np.sign(arc.turn)))
    return moments


def _read_pair(point: Array) -> tuple[float, float]:
    """An array (2,) as a tuple of floats."""
    return float(point[0]), float(point[1])
