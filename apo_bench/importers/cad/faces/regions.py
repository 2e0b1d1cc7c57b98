"""Find the faces of a mesh: cylinders and cones, then planes; facets of free-form surfaces become unnamed regions."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import WHOLE_TURN
from apo_bench.importers.cad.faces.facets import FEWEST_SIDES, FLAT, SMOOTH_RAD, Facets, find_facets
from apo_bench.importers.cad.faces.region_growing import FoundWall, find_walls, group_by_smooth_edges
from apo_bench.importers.cad.faces.surface_fitting import fit_plane, make_round_region
from apo_bench.importers.cad.solids import Mesh, Region, find_square_axes

_LARGER = 8.0
"""A facet larger than the upper quartile of its smooth neighbours by this factor is a plane, not free-form."""
_BAND = 3.0
"""Bands of one free-form surface differ by less than this factor in width and in the angle between them."""
_GAP = 1.8
"""A wall goes all the way round if no gap is wider than this many facets."""


class _SmoothEnd(NamedTuple):
    """The smooth transition at one end of a round surface to what lies beyond."""

    beyond: frozenset[int]
    """Round surfaces beyond the end; -1 stands for anything else."""
    angle: float  # median angle of the transition, [rad]
    width: float
    """Median width of the facets beyond the end, [mm]."""

    def is_like(self, angle: float, width: float) -> bool:
        """Whether the transition bends in the same direction with a similar angle, and the width is similar."""
        return (
            self.angle * angle > 0.0
            and max(abs(self.angle), abs(angle)) < _BAND * min(abs(self.angle), abs(angle))
            and max(self.width, width) < _BAND * min(self.width, width)
        )


def find_regions(mesh: Mesh, fewest: int = FEWEST_SIDES) -> tuple[Region, ...]:
    """Return the faces of a closed mesh, ordered by their first triangle.

    Args:
        fewest: Smallest number of facets of a round face around a full turn; walls with fewer become flat faces.
    """
    facets = find_facets(mesh, fewest)
    every = _drop_bands(mesh, facets, find_walls(mesh, facets))
    walls = [wall for wall in every if wall.sides >= fewest]
    triangles = [np.flatnonzero(np.isin(facets.of, wall.members)) for wall in walls]
    regions = [
        make_round_region(mesh, mine, wall.surface, wall.hole, _measure_covered_angle(facets, wall), wall.sides)
        for wall, mine in zip(walls, triangles, strict=True)
    ]
    left = _assign_walls(facets, walls) < 0  # facets on no wall
    thin = facets.areas < (FLAT * mesh.extent) ** 2  # slivers
    free = _find_free_form_facets(facets, left) & (_assign_walls(facets, every) < 0) | (thin & left)
    regions += [fit_plane(mesh, np.flatnonzero(facets.of == f)) for f in np.flatnonzero(left & ~free)]
    groups = group_by_smooth_edges(facets, np.flatnonzero(free))
    regions += [Region("other", np.flatnonzero(np.isin(facets.of, group))) for group in groups]
    return tuple(sorted(regions, key=lambda region: int(region.triangles[0])))


def _assign_walls(facets: Facets, walls: list[FoundWall]) -> Any:
    """Return the index of the wall of each facet, (f,); -1 for none."""
    of = np.full(len(facets.areas), -1)
    for k, wall in enumerate(walls):
        of[wall.members] = k
    return of


def _find_free_form_facets(facets: Facets, left: Any) -> Any:
    """Return which facets belong to free-form surfaces, (f,): those with smooth edges that are not far larger.

    Args:
        left: Which facets are on no wall, (f,).
    """
    pairs = facets.smooth[left[facets.smooth].all(axis=1) & (np.abs(facets.angle) < SMOOTH_RAD)]
    free = np.zeros(len(left), dtype=bool)
    free[pairs] = True
    # Areas of the neighbours of each facet, ascending; the index below picks their upper quartile.
    owner, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    order = np.lexsort((facets.areas[other], owner))
    pieces, first, count = np.unique(owner[order], return_index=True, return_counts=True)
    free[pieces] = facets.areas[pieces] < _LARGER * facets.areas[other[order]][first + 3 * count // 4]
    return free


def _drop_bands(mesh: Mesh, facets: Facets, walls: list[FoundWall]) -> list[FoundWall]:
    """Remove walls that are only bands of a torus, a sphere or another free-form surface.

    The mesh approximates such a surface by bands, each of which continues smoothly in the next at both ends.
    """
    of = _assign_walls(facets, walls)
    bands: set[int] = set()
    ends: list[list[_SmoothEnd]] = []
    widths: list[float] = []
    for k, wall in enumerate(walls):
        corners = mesh.corners[np.unique(facets.corner[np.isin(facets.owner, wall.members)])]
        height, distance, _ = wall.surface.polar(corners)
        width = float(np.ptp(height)) * float(np.hypot(1.0, wall.surface.slope))
        mine = _find_smooth_ends(mesh, facets, of, k, wall, float(height.min() + height.max()) / 2.0)
        # A fillet of a curved edge is narrower than its arc is long, and smooth at one end at least. A band between two
        # others bends by the same angle at both ends.
        turn = _measure_covered_angle(facets, wall)
        is_short = turn < WHOLE_TURN and bool(mine) and width < turn * float(distance.mean())
        if is_short or (len(mine) == 2 and all(end.is_like(mine[0].angle, width) for end in mine)):
            bands.add(k)
        widths.append(width)
        ends.append(mine)
    # What continues into a band with similar angle and width is a band too; repeat until nothing changes.
    before = -1
    while len(bands) > before:
        before = len(bands)
        for k, mine in enumerate(ends):
            if any(end.beyond & bands and end.is_like(end.angle, widths[k]) for end in mine):
                bands.add(k)
    return [wall for k, wall in enumerate(walls) if k not in bands]


def _find_smooth_ends(mesh: Mesh, facets: Facets, of: Any, k: int, wall: FoundWall, middle: float) -> list[_SmoothEnd]:
    """Return the ends of round surface k that continue smoothly, at most two.

    Args:
        wall: Round surface number k.
        of: Round surface of each facet, (f,); -1 for none.
        middle: Height of the middle of the surface along its axis, which separates the two ends.
    """
    # Edges with one facet on the surface that run around the axis, not along it.
    mine = of[facets.smooth] == k
    rows = np.flatnonzero(mine.sum(axis=1) == 1)
    points = mesh.corners[facets.along[rows]]
    along = points[:, 1] - points[:, 0]
    across = np.abs(along @ wall.surface.axis) < 0.5 * np.linalg.norm(along, axis=1)
    rows = rows[across]
    at = points[across].mean(axis=1)
    beyond = np.where(mine[rows, 0], facets.smooth[rows, 1], facets.smooth[rows, 0])
    # A facet is twice as wide as its centre is far from the edge.
    width = 2.0 * np.linalg.norm(facets.centers[beyond] - at, axis=1)
    low = wall.surface.polar(at)[0] < middle
    return [
        _SmoothEnd(
            frozenset(of[beyond[side]].tolist()), float(np.median(facets.angle[rows[side]])), np.median(width[side])
        )
        for side in (low, ~low)
        if side.any()
    ]


def _measure_covered_angle(facets: Facets, wall: FoundWall) -> float:
    """Return the angle that the facets of a round face cover about its axis, [rad]."""
    x, y = find_square_axes(wall.surface.axis)
    _, _, out = wall.surface.polar(facets.centers[wall.members])
    middle = np.sort(np.arctan2(out @ y, out @ x))
    widest = float(np.diff(middle, append=middle[0] + WHOLE_TURN).max())
    strip = float(wall.spans.max())
    return WHOLE_TURN if widest < _GAP * strip else WHOLE_TURN - widest + strip
