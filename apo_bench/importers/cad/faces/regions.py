"""Find the faces of a mesh: cylinders and cones that no free surface contains as bands, then planes."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import WHOLE_TURN
from apo_bench.importers.cad.faces.facets import FEWEST_SIDES, FLAT, SMOOTH_RAD, Facets, find_facets
from apo_bench.importers.cad.faces.fitting import fit_plane, round_region
from apo_bench.importers.cad.faces.growing import FoundWall, find_walls, smooth_groups
from apo_bench.importers.cad.solids import Mesh, Region, find_square_axes

_LARGER = 8.0
"""A flat piece that is larger by this factor than most of its neighbours on a free surface is a plane next to it."""
_BAND = 3.0
"""Bands of one free surface differ by less than this in how wide they are and how they bend."""
_GAP = 1.8
"""A turn is whole if no gap in it is this much wider than a strip."""


class _End(NamedTuple):
    """What a round surface goes over into smoothly at one of its ends."""

    beyond: frozenset[int]
    """Other round surfaces; -1 is anything else."""
    angle: float
    width: float
    """Of what is beyond it, across."""

    def is_like(self, angle: float, width: float) -> bool:
        """Whether what is beyond bends as much, the same way, and is as wide."""
        return (
            self.angle * angle > 0.0
            and max(abs(self.angle), abs(angle)) < _BAND * min(abs(self.angle), abs(angle))
            and max(self.width, width) < _BAND * min(self.width, width)
        )


def find_regions(mesh: Mesh, fewest: int = FEWEST_SIDES) -> tuple[Region, ...]:
    """Return the faces of a closed mesh, in an order that its triangles give.

    Args:
        fewest: Sides of a whole turn of a round face; a wall with fewer sides is flat faces.
    """
    facets = find_facets(mesh, fewest)
    every = _drop_bands(mesh, facets, find_walls(mesh, facets))
    walls = [wall for wall in every if wall.sides >= fewest]
    triangles = [np.flatnonzero(np.isin(facets.of, wall.members)) for wall in walls]
    regions = [
        round_region(mesh, mine, wall.surface, wall.hole, _turn(facets, wall), wall.sides)
        for wall, mine in zip(walls, triangles, strict=True)
    ]
    left = _wall_of_pieces(facets, walls) < 0
    thin = facets.areas < (FLAT * mesh.extent) ** 2
    free = _find_free(facets, left) & (_wall_of_pieces(facets, every) < 0) | (thin & left)
    regions += [fit_plane(mesh, np.flatnonzero(facets.of == f)) for f in np.flatnonzero(left & ~free)]
    groups = smooth_groups(facets, np.flatnonzero(free))
    regions += [Region("other", np.flatnonzero(np.isin(facets.of, group))) for group in groups]
    return tuple(sorted(regions, key=lambda region: int(region.triangles[0])))


def _wall_of_pieces(facets: Facets, walls: list[FoundWall]) -> Any:
    """Which round surface each flat piece belongs to, (f,); -1: none."""
    of = np.full(len(facets.areas), -1)
    for k, wall in enumerate(walls):
        of[wall.members] = k
    return of


def _find_free(facets: Facets, left: Any) -> Any:
    """Which flat pieces belong to surfaces that are neither flat nor round."""
    pairs = facets.smooth[left[facets.smooth].all(axis=1) & (np.abs(facets.angle) < SMOOTH_RAD)]
    free = np.zeros(len(left), dtype=bool)
    free[pairs] = True
    # Of each piece the areas of its neighbours, ascending: a piece far larger than their upper quartile is a plane.
    owner, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    order = np.lexsort((facets.areas[other], owner))
    pieces, first, count = np.unique(owner[order], return_index=True, return_counts=True)
    free[pieces] = facets.areas[pieces] < _LARGER * facets.areas[other[order]][first + 3 * count // 4]
    return free


def _drop_bands(mesh: Mesh, facets: Facets, walls: list[FoundWall]) -> list[FoundWall]:
    """Remove walls that are only strips of a torus, a sphere or a free surface.

    The mesh approximates such a surface by strips (bands), each of which continues smoothly in the next at both ends.
    """
    of = _wall_of_pieces(facets, walls)
    bands: set[int] = set()
    ends: list[list[_End]] = []
    widths: list[float] = []
    for k, wall in enumerate(walls):
        corners = mesh.corners[np.unique(facets.corner[np.isin(facets.owner, wall.members)])]
        height, distance, _ = wall.surface.polar(corners)
        width = float(np.ptp(height)) * float(np.hypot(1.0, wall.surface.slope))
        mine = _ends(mesh, facets, of, k, wall, float(height.min() + height.max()) / 2.0)
        # A fillet of a curved edge is shorter than its arc is long, and smooth at an end; a band between two others
        # bends there as they do.
        turn = _turn(facets, wall)
        is_short = turn < WHOLE_TURN and bool(mine) and width < turn * float(distance.mean())
        if is_short or (len(mine) == 2 and all(end.is_like(mine[0].angle, width) for end in mine)):
            bands.add(k)
        widths.append(width)
        ends.append(mine)
    # What goes over into a band and is like it is one, too, until nothing more is.
    before = -1
    while len(bands) > before:
        before = len(bands)
        for k, mine in enumerate(ends):
            if any(end.beyond & bands and end.is_like(end.angle, widths[k]) for end in mine):
                bands.add(k)
    return [wall for k, wall in enumerate(walls) if k not in bands]


def _ends(mesh: Mesh, facets: Facets, of: Any, k: int, wall: FoundWall, middle: float) -> list[_End]:
    """The ends of round surface k that are smooth.

    Args:
        of: Round surface of each flat piece.
        middle: Height of the middle of the surface.
    """
    # Edges that only one side of is on the surface, and that go around its axis rather than along it.
    mine = of[facets.smooth] == k
    rows = np.flatnonzero(mine.sum(axis=1) == 1)
    points = mesh.corners[facets.along[rows]]
    along = points[:, 1] - points[:, 0]
    across = np.abs(along @ wall.surface.axis) < 0.5 * np.linalg.norm(along, axis=1)
    rows = rows[across]
    at = points[across].mean(axis=1)
    beyond = np.where(mine[rows, 0], facets.smooth[rows, 1], facets.smooth[rows, 0])
    width = 2.0 * np.linalg.norm(facets.centers[beyond] - at, axis=1)
    low = wall.surface.polar(at)[0] < middle
    return [
        _End(frozenset(of[beyond[side]].tolist()), float(np.median(facets.angle[rows[side]])), np.median(width[side]))
        for side in (low, ~low)
        if side.any()
    ]


def _turn(facets: Facets, wall: FoundWall) -> float:
    """How far around its axis a round face reaches."""
    x, y = find_square_axes(wall.surface.axis)
    _, _, out = wall.surface.polar(facets.centers[wall.members])
    middle = np.sort(np.arctan2(out @ y, out @ x))
    widest = float(np.diff(middle, append=middle[0] + WHOLE_TURN).max())
    strip = float(wall.spans.max())
    return WHOLE_TURN if widest < _GAP * strip else WHOLE_TURN - widest + strip
