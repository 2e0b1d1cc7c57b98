"""Flat outlines of lines and arcs, [mm]."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.geometry import Array, count_sides
from apo_bench.scenario.parts.making.moments import Moments, polygon_moments, segment_moments

COARSE_SIDES = 12
"""Of a whole turn of a round wall without a name, which no contact uses."""
_SAME_MM = 1e-6


@final
@dataclass(frozen=True)
class Edge:
    """A side of an outline, from `start` to where the next one starts."""

    start: tuple[float, float]
    """[mm]."""
    name: str = ""
    """Of the face that it becomes; else one is found."""
    fit: bool = False
    center: tuple[float, float] | None = None
    """Of an arc, [mm]."""
    clockwise: bool = False
    """The way of the arc."""
    sides: int | None = None
    """Into how many a whole turn is cut; else as a contact needs if the arc has a name, and few if not."""


Outline = Sequence[Edge]
"""A closed one, counter-clockwise; of a hole too."""


class OutlineArc(NamedTuple):
    """An arc of an outline."""

    center: Array
    radius: float
    first: float
    """Angle at its start, [rad]."""
    turn: float
    """To its end, [rad]; negative is clockwise."""

    def at(self, angle: Any, radius: float | None = None) -> Array:
        """The point at an angle, (2,), or points at angles, (k, 2), on the arc or on a circle about its centre."""
        r = self.radius if radius is None else radius
        return np.asarray(self.center + r * np.stack([np.cos(angle), np.sin(angle)], axis=-1))

    @property
    def middle(self) -> float:
        return self.first + self.turn / 2.0


@check_arguments
def make_polygon(
    *corners: tuple[float, float], names: Mapping[int, str] | Sequence[str] = (), fit: Sequence[str] = ()
) -> Outline:
    """Straight sides; side i leads from corner i to the next one.

    Args:
        names: Of the sides; those without one, or "", are named later.
        fit: Which named sides recede by the clearance.
    """
    named = dict(names) if isinstance(names, Mapping) else dict(enumerate(names))
    return [Edge(at, named.get(i, ""), named.get(i, "") in fit and i in named) for i, at in enumerate(corners)]


@check_arguments
def make_rectangle(
    width: float, depth: float, at: tuple[float, float] = (0.0, 0.0), names: Sequence[str] = (), fit: Sequence[str] = ()
) -> Outline:
    """A rectangle about its middle; its sides are, in this order, at -y, +x, +y, -x."""
    x, y = at
    a = width / 2.0
    b = depth / 2.0
    return make_polygon((x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b), names=names, fit=fit)


@check_arguments
def make_circle(
    radius: float, at: tuple[float, float] = (0.0, 0.0), name: str = "", fit: bool = False, sides: int | None = None
) -> Outline:
    """A whole turn, as two arcs that become one face."""
    return [Edge((at[0] + sign * radius, at[1]), name, fit, at, sides=sides) for sign in (1.0, -1.0)]


@check_arguments
def make_slot(
    length: float,
    width: float,
    at: tuple[float, float] = (0.0, 0.0),
    names: Sequence[str] = ("", "", "", ""),
    fit: bool = False,
) -> Outline:
    """A slot along x with round ends, as long over all; its sides are, in this order, at -y, +x, +y, -x."""
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
        turn = float(np.arctan2(into[0] * out[1] - into[1] * out[0], into @ out))
        back = radius * abs(np.tan(turn / 2.0))
        a = points[i] - back * into
        b = points[i] + back * out
        center = a + np.sign(turn) * radius * np.array([-into[1], into[0]])
        edges.append(Edge(_pair(a), center=_pair(center), clockwise=turn < 0.0, sides=sides))
        edges.append(replace(edge, start=_pair(b)))
    return edges


def arc_of(outline: Outline, i: int) -> OutlineArc | None:
    """The arc of side i; None if it is straight."""
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
    """The corners of an outline, (k, 2), [mm].

    Arcs that bulge out of the material have their corners on the circle; those that bulge into it are tangent to it
    from outside, so that what is free inside of them stays free.
    """
    return np.array([corner for i in range(len(outline)) for corner in _corners(outline, i, hole)])


def receding(outline: Outline, hole: bool = False) -> NDArray[np.bool_]:
    """Whether the sides of a ring recede by the clearance: each that begins at a corner of `trace_outline`, (k,)."""
    return np.array([edge.fit for i, edge in enumerate(outline) for _ in _corners(outline, i, hole)], dtype=np.bool_)


def _corners(outline: Outline, i: int, hole: bool) -> Iterator[Array]:
    edge = outline[i]
    arc = arc_of(outline, i)
    start = np.array(edge.start, dtype=np.float64)
    if arc is None:
        yield start
        return
    share = abs(arc.turn) / (2.0 * np.pi)
    n = max(2, int(np.ceil(share * needed_sides(edge.sides, edge.name, arc.radius) - 1e-9)))
    if hole != edge.clockwise:
        step = arc.turn / n
        if not goes_on(arc_of(outline, i - 1), arc):
            yield start
        k = np.arange(n) + 0.5
        yield from arc.at(arc.first + step * k, arc.radius / np.cos(step / 2.0))
    else:
        yield from arc.at(arc.first + arc.turn * np.arange(n) / n)


def goes_on(before: OutlineArc | None, arc: OutlineArc) -> bool:
    """Whether an arc continues another one on its circle."""
    return (
        before is not None
        and bool(np.abs(before.center - arc.center).max() < _SAME_MM)
        and abs(before.radius - arc.radius) < _SAME_MM
        and before.turn * arc.turn > 0.0
    )


def needed_sides(stated: int | None, name: str, radius_mm: float) -> int:
    """Into how many sides a whole turn of a wall is cut: as stated, as a contact needs if it has a name, or few."""
    return stated or (count_sides(1e-3 * radius_mm) if name else COARSE_SIDES)


def outline_moments(outline: Outline) -> Moments:
    """Of the exact area inside, arcs included, [mm]."""
    moments = polygon_moments(np.array([edge.start for edge in outline], dtype=np.float64))
    for i in range(len(outline)):
        arc = arc_of(outline, i)
        if arc is not None:
            segment = segment_moments(arc.center, arc.radius, arc.middle, abs(arc.turn))
            moments = moments.plus(segment, float(np.sign(arc.turn)))
    return moments


def _pair(point: Array) -> tuple[float, float]:
    return float(point[0]), float(point[1])
