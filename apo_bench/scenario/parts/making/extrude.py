"""Extrude outlines with holes and bores into bodies made of convex pieces; lengths in mm."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any, final

import numpy as np
from shapely import Polygon, unary_union

from apo_bench.arguments import check_arguments
from apo_bench.geometry import WHOLE_TURN, Array, Face, Hull, RoundFace, straighten
from apo_bench.scenario.parts.making.body import Body
from apo_bench.scenario.parts.making.cells import clip, cut_bands, cut_convex, cut_wedges, find_bore_cell
from apo_bench.scenario.parts.making.frustums import (
    Frustum,
    add_chamfers,
    circumscribe_polygon,
    find_steps_at_height,
    list_heights,
    make_prism,
    raise_to_height,
    subtract_steps,
)
from apo_bench.scenario.parts.making.moments import extrude_moments, sum_moments
from apo_bench.scenario.parts.making.outline import (
    Outline,
    compute_outline_moments,
    continues_arc,
    find_arc,
    find_receding_edges,
    make_circle,
    trace_outline,
)

_NARROW_MM = 6e-3
"""A narrower ring between two steps of a bore is no face."""


@final
@dataclass(frozen=True)
class Bore:
    """A round hole along the direction of extrusion; its steps do not overlap, and need not cover the whole length."""

    at: tuple[float, float]
    """Its axis, [mm]."""
    steps: tuple[Frustum, ...]
    flats: Mapping[float, str] | None = None
    """Height -> name of the flat face there: the bottom of a blind bore, the ledge of a wider one."""

    @property
    def widest(self) -> float:
        """Distance of the corners of its widest polygon from its axis, [mm]."""
        return max(max(step.radii) / np.cos(np.pi / step.count) for step in self.steps)


@check_arguments
def bore(
    at: tuple[float, float],
    radius: float,
    low: float,
    high: float,
    name: str = "",
    *,
    fit: bool = False,
    chamfer_low: float = 0.0,
    chamfer_high: float = 0.0,
    sides: int | None = None,
) -> Bore:
    """A cylindrical bore between two heights, with chamfers of 45 degrees, [mm].

    The chamfers of `name` are called `name_chamfer_low` and `name_chamfer_high`.

    Args:
        at: Its axis.
        fit: The wall recedes by the clearance.
        chamfer_low: Length of the chamfer at the lower end; 0: none.
        chamfer_high: Length of the chamfer at the upper end; 0: none.
        sides: Number of sides of its polygon. Default: as a contact needs if it has a name, else few.
    """
    wall = Frustum(low, high, radius, name=name, fit=fit, sides=sides)
    return Bore(at, tuple(add_chamfers(wall, chamfer_low, chamfer_high, 1.0)))


@check_arguments
def extrude(
    outline: Outline,
    low: float,
    high: float,
    *,
    holes: Sequence[Outline] = (),
    bores: Sequence[Bore] = (),
    bottom: str = "",
    top: str = "",
    fit: Sequence[str] = (),
) -> Body:
    """A prism along z between two heights, [mm].

    Args:
        holes: Outlines of through holes, counter-clockwise too.
        bores: Round holes; the material around each is cut into wedges tangent to it. A cylindrical through bore
            without room for wedges becomes a hole like the others.
        bottom: Name of the lower face; "": named later.
        top: Name of the upper face; "": named later.
        fit: Names of the end faces that recede by the clearance.

    Raises:
        ValueError: Holes or bores meet each other or the outline, or a stepped bore has no room for wedges.
    """
    area = Polygon(trace_outline(outline), [trace_outline(hole, hole=True) for hole in holes])
    discs = [Polygon(circumscribe_polygon(b.at, b.widest * np.cos(np.pi / 64), 64)) for b in bores]
    apart = all(not a.intersects(b) for a, b in combinations(discs, 2))
    if not area.is_valid or area.area <= 0.0 or not apart or not all(area.contains(disc) for disc in discs):
        raise ValueError("an outline with holes and bores inside of it, none of which meet, is needed")
    beside = _list_bands(area, outline, holes)
    rest = area.difference(unary_union([Polygon(band) for band in beside]))
    cells = _cut_cells(rest, bores)
    # The first bore without room for a cell becomes a hole, and the extrusion starts over.
    if len(cells) < len(bores):
        hole = _outline_of_bore(bores[len(cells)], low, high)
        others = [*bores[: len(cells)], *bores[len(cells) + 1 :]]
        return extrude(outline, low, high, holes=[*holes, hole], bores=others, bottom=bottom, top=top, fit=fit)
    for cell in cells:
        rest = rest.difference(Polygon(cell))
    prisms = [make_prism(cell, low, high) for cell in (*beside, *cut_convex(rest))]
    moments = extrude_moments(
        sum_moments(compute_outline_moments(outline), map(compute_outline_moments, holes), -1.0), low, high
    )
    for each in bores:
        moments = subtract_steps(moments, each.steps, each.at)
    pieces = [
        *prisms,
        *(piece for b, cell in zip(bores, cells, strict=True) for piece in _bore_cell(b, cell, low, high)),
    ]
    sides = [_make_side_faces(outline, low, high, False), *(_make_side_faces(hole, low, high, True) for hole in holes)]
    flats = [flat for own, _ in sides for flat in own]
    rounds = [wall for _, own in sides for wall in own]
    rounds += [step.wall(each.at, hole=True) for each in bores for step in each.steps]
    flats += _make_end_faces(outline, holes, bores, low, high, bottom, top, fit)
    flats += [face for each in bores for face in _make_ledges(each, low, high)]
    return Body(
        tuple(Hull("", 1e-3 * piece) for piece in pieces),
        tuple(flats),
        tuple(rounds),
        moments.in_metres,
    )


def _list_bands(area: Any, outline: Outline, holes: Sequence[Outline]) -> list[Array]:
    """Quadrilaterals, (4, 2) each, behind the receding sides of those outlines that have a receding arc."""
    rings = [] if not _has_round_fit_edge(outline) else [(trace_outline(outline), find_receding_edges(outline))]
    for hole in filter(_has_round_fit_edge, holes):
        fit = find_receding_edges(hole, hole=True)
        # Reversed, so that the material is to the left; the mask moves with the sides.
        rings.append((trace_outline(hole, hole=True)[::-1], np.roll(fit[::-1], -1)))
    return cut_bands(area, rings)


def _has_round_fit_edge(outline: Outline) -> bool:
    """True if an arc of the outline recedes by the clearance."""
    return any(edge.fit and edge.center is not None for edge in outline)


def _outline_of_bore(each: Bore, low: float, high: float) -> Outline:
    """The outline of a cylindrical through bore; any other bore raises a `ValueError`."""
    step = each.steps[0]
    through = abs(step.low - low) < 1e-6 and abs(step.high - high) < 1e-6 and step.radii[0] == step.radii[1]
    if len(each.steps) > 1 or not through:
        raise ValueError(f"there is no convex area around the bore at {each.at} mm; cut the part in two beside it")
    return make_circle(step.radius, each.at, step.name, step.fit, step.sides)


def _cut_cells(area: Any, bores: Sequence[Bore]) -> list[Array]:
    """Disjoint convex rings around the bores, in their order; fewer than the bores if one has no room for a ring."""
    cells: list[Array] = []
    for i, each in enumerate(bores):
        others = [(np.array(b.at), b.widest) for k, b in enumerate(bores) if k != i]
        cell = find_bore_cell(area, np.array(each.at), each.widest, others)
        if cell is None:
            break
        area = area.difference(Polygon(cell))
        cells.append(cell)
    return cells


def _bore_cell(each: Bore, cell: Array, low: float, high: float) -> Iterator[Array]:
    """The convex pieces of a cell around a bore, between its steps; corners (k, 3) each, [mm]."""
    heights = list_heights(each.steps, low, high)
    at = np.array(each.at)
    for a, b in pairwise(heights):
        step = next((s for s in each.steps if s.covers(a, b)), None)
        if step is None:
            yield make_prism(cell, a, b)
            continue
        r_a = step.at(a)
        r_b = step.at(b)
        for n, area in cut_wedges(cell, at, step.count):
            ends = [clip(area, -n, -float(n @ at) - r) for r in (r_a, r_b)]
            yield np.concatenate(
                [raise_to_height(_drop_duplicates(end), z) for end, z in zip(ends, (a, b), strict=True)]
            )


def _drop_duplicates(flat: Array) -> Array:
    """The ring (k, 2) without repeated corners."""
    return flat[np.linalg.norm(flat - np.roll(flat, 1, axis=0), axis=1) > 1e-6]


def _make_side_faces(outline: Outline, low: float, high: float, hole: bool) -> tuple[list[Face], list[RoundFace]]:
    """The side faces of an extruded outline: flat faces of straight sides, and round walls of arcs.

    Consecutive arcs of one circle and name become one wall.

    Args:
        hole: True if the outline is that of a hole.
    """
    flats: list[Face] = []
    rounds: list[RoundFace] = []
    arcs = [find_arc(outline, i) for i in range(len(outline))]
    for i, (edge, arc) in enumerate(zip(outline, arcs, strict=True)):
        if arc is None:
            b = outline[(i + 1) % len(outline)].start
            corners = np.array([(*edge.start, low), (*b, low), (*b, high), (*edge.start, high)])
            flats.append(Face(edge.name, 1e-3 * (corners[::-1] if hole else corners), fit=edge.fit))
            continue
        # An arc that continues the one before is part of its wall.
        if continues_arc(arcs[i - 1], arc) and outline[i - 1].name == edge.name and i > 0:
            continue
        extent = abs(arc.turn)
        for k in range(i + 1, len(outline)):
            after = arcs[k]
            if after is None or not continues_arc(arcs[k - 1], after) or outline[k].name != edge.name:
                break
            extent += abs(after.turn)
        middle = arc.first + np.sign(arc.turn) * extent / 2.0
        whole = extent > WHOLE_TURN - 1e-9
        rounds.append(
            RoundFace(
                name=edge.name,
                point=1e-3 * np.array([*arc.center, 0.0]),
                axis=np.array([0.0, 0.0, 1.0]),
                span=(1e-3 * low, 1e-3 * high),
                radii=(1e-3 * arc.radius, 1e-3 * arc.radius),
                hole=hole != edge.clockwise,
                fit=edge.fit,
                extent_rad=WHOLE_TURN if whole else extent,
                toward=None if whole else np.array([np.cos(middle), np.sin(middle), 0.0]),
            )
        )
    return flats, rounds


def _make_end_faces(
    outline: Outline,
    holes: Sequence[Outline],
    bores: Sequence[Bore],
    low: float,
    high: float,
    bottom: str,
    top: str,
    fit: Sequence[str],
) -> Iterator[Face]:
    """The lower and the upper face, with openings for holes and bores."""
    # `above`: the bore just inside of the material, above the lower end and below the upper one.
    for z, name, above in ((low, bottom, True), (high, top, False)):
        openings = [
            circumscribe_polygon(b.at, *opening)
            for b in bores
            if (opening := find_steps_at_height(b.steps, z, above))[1]
        ]
        inner = [*(trace_outline(hole, hole=True) for hole in holes), *openings]
        yield flat_face(name, trace_outline(outline), inner, z, up=not above, fit=name in fit and bool(name))


def _make_ledges(each: Bore, low: float, high: float) -> Iterator[Face]:
    """The flat faces inside a bore: ledges between steps of different radius, and the bottom of a blind bore."""
    for z in list_heights(each.steps):
        if z - low < 1e-6 or high - z < 1e-6:
            continue
        below = find_steps_at_height(each.steps, z, False)
        above = find_steps_at_height(each.steps, z, True)
        name = (each.flats or {}).get(z, "")
        wide, slim = (above, below) if above[0] > below[0] else (below, above)
        if wide[0] - slim[0] > _NARROW_MM:
            hole = [circumscribe_polygon(each.at, *slim)] if slim[1] else []
            yield flat_face(name, circumscribe_polygon(each.at, *wide), hole, z, up=above[0] > below[0])


def flat_face(name: str, outline: Array, holes: Sequence[Array], z: float, up: bool, fit: bool = False) -> Face:
    """A horizontal face at height z.

    Args:
        outline: (k, 2), counter-clockwise, [mm]; like the holes.
        up: True if the face looks up, False if it looks down.
    """
    turned = [1e-3 * raise_to_height(straighten(each), z) for each in (outline, *holes)]
    outside, *inside = turned if up else [each[::-1] for each in turned]
    return Face(name, outside, tuple(hole[::-1] for hole in inside), fit)
