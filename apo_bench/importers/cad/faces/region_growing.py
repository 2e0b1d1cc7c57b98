"""Find cylinders and cones in a mesh by region growing: from whole smooth groups of facets, then from single edges."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import WHOLE_TURN, Array
from apo_bench.importers.cad.faces.facets import Facets
from apo_bench.importers.cad.faces.surface_fitting import (
    ON_WALL,
    RoundSurface,
    find_facets_on,
    fit_axis,
    fit_circle,
    refine_round,
)
from apo_bench.importers.cad.solids import Mesh, find_connected_groups

_FEWEST = 3
"""Smallest number of facets of a round face."""
_MOST_WORK = 3_000_000
"""Limit on the facets that are measured in one part, over all attempts."""
_MOST_FAILED = 100
"""Failed attempts in a row after which the search in one smooth group ends."""
_MOST_SEED = 100
"""Largest number of facets from which an attempt starts."""
_SAME_BEND = 0.15
"""Edges of one cone have equal angles, within this share."""


class FoundWall(NamedTuple):
    """A cylinder or cone and the facets on it."""

    surface: RoundSurface
    members: Any  # the facets, ascending
    hole: bool
    spans: Array  # angle that each facet spans about the axis, (len(members),), [rad]

    @property
    def sides(self) -> int:
        """The number of facets around a full turn."""
        return round(WHOLE_TURN / float(np.median(self.spans)))


def find_walls(mesh: Mesh, facets: Facets) -> list[FoundWall]:
    """Return the cylinders and cones of each smooth group of facets, fitted to all of it or grown from edges."""
    walls: list[FoundWall] = []
    work = _MOST_WORK
    for group in group_by_smooth_edges(facets, np.unique(facets.smooth)):
        if len(group) < _FEWEST:
            continue
        inside = np.isin(facets.smooth[:, 0], group)
        # Most smooth groups are one wall, such as a hole: then a single fit to the whole group suffices.
        points = mesh.corners[np.unique(facets.along[inside])]
        axes = ((fit_axis(facets.normals[group], cone), cone) for cone in (False, True))
        starts = ((refine_round(fit_circle(points, axis), points, cone), cone) for axis, cone in axes)
        whole = _grow_surface(mesh, facets, group, inside, starts)
        work -= 2 * len(group)
        if whole is not None and len(whole.members) == len(group):
            walls.append(whole)
        else:
            found, work = _grow_from_edges(mesh, facets, group, inside, work)
            walls += _merge_walls(mesh, facets, group, inside, found)
    return walls


def _merge_walls(mesh: Mesh, facets: Facets, group: Any, inside: Any, found: list[FoundWall]) -> list[FoundWall]:
    """Resolve overlaps of the walls of one smooth group: larger walls first, each regrown over facets that others took.

    A few facets lie on many walls, of which only one is true.

    Args:
        group: The facets of the group, ascending.
        inside: Which smooth edges belong to the group, (s,).
    """
    walls: list[FoundWall] = []
    left = group  # facets of no wall yet
    for wall in sorted(found, key=lambda wall: -len(wall.members)) if len(found) > 1 else found:
        mine = np.isin(wall.members, left)
        rest = wall._replace(members=wall.members[mine], spans=wall.spans[mine])
        if len(rest.members) < _FEWEST:
            continue
        near, _, _ = find_facets_on(mesh, facets, left, wall.surface, ON_WALL * mesh.extent)
        if len(near) > len(rest.members):
            untaken = inside & np.isin(facets.smooth, left).all(axis=1)
            start = (wall.surface, wall.surface.slope != 0.0)
            more = _grow_surface(mesh, facets, left, untaken, [start], int(rest.members[0]))
            rest = more if more is not None and len(more.members) > len(rest.members) else rest
        walls.append(rest)
        left = np.setdiff1d(left, rest.members)
    return walls


def _grow_from_edges(mesh: Mesh, facets: Facets, group: Any, inside: Any, work: int) -> tuple[list[FoundWall], int]:
    """Grow walls from the edges of a smooth group, longest edges first.

    Args:
        group: The facets of the group, ascending.
        inside: Which smooth edges belong to the group, (s,).
        work: Facets that may still be measured.

    Returns:
        The walls, and the work that is left.
    """
    walls = list[FoundWall]()
    taken = np.zeros(len(facets.areas), dtype=bool)
    rows = np.flatnonzero(inside)
    edges_around: dict[int, list[int]] = {}  # the smooth edges of each flat piece
    for row, pieces in zip(rows.tolist(), facets.smooth[rows].tolist(), strict=True):
        for piece in pieces:
            edges_around.setdefault(piece, []).append(row)
    ends = mesh.corners[facets.along[rows]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    failed = 0
    for row in rows[np.argsort(-length, kind="stable")]:
        if taken[facets.smooth[row]].any():
            continue
        if work < 0 or failed > _MOST_FAILED:
            break
        failed += 1
        # Try a cylinder first, as a cone fits every cylinder too. A start that does not even hold its own facets is not
        # worth a fit.
        for cone in (False, True):
            start, near = (_start_cone if cone else _start_cylinder)(mesh, facets, row, edges_around, taken)
            if (
                start is None
                or len(find_facets_on(mesh, facets, near, start, 3.0 * (ON_WALL * mesh.extent))[0]) < _FEWEST
            ):
                continue
            left = group[~taken[group]]
            untaken = inside & ~taken[facets.smooth].any(axis=1)
            wall = _grow_surface(mesh, facets, left, untaken, [(start, cone)], int(facets.smooth[row, 0]))
            work -= 4 * len(left)
            if wall is not None:
                failed = 0
                walls.append(wall)
                taken[wall.members] = True
                break
    return walls, work


def _start_cylinder(
    mesh: Mesh, facets: Facets, row: int, edges_around: dict[int, list[int]], taken: Any
) -> tuple[RoundSurface | None, Any]:
    """Return a start for a cylinder from edge `row`, and the facets around that edge.

    The axis is the edge, the circle goes through the ends of parallel edges nearby. None if there are too few.

    Args:
        row: Row of the smooth edge in `facets.smooth`.
        edges_around: Facet -> rows of its smooth edges.
        taken: Which facets belong to earlier walls, (f,).
    """
    a, b = mesh.corners[facets.along[row]]
    length = np.linalg.norm(b - a)
    edges = (r for piece in facets.smooth[row].tolist() for r in edges_around[piece])
    rows = np.array([r for r in edges if not taken[facets.smooth[r]].any()])
    near = np.unique(facets.smooth[rows])
    # Edges of a cylinder's strips are parallel to its axis, so all ends of the neighbours lie on the cylinder.
    axis = (b - a) / max(length, 1e-300)
    ends = mesh.corners[facets.along[rows]]
    along = ends[:, 1] - ends[:, 0]
    straight = np.linalg.norm(np.cross(along, axis), axis=1) < 0.02 * np.linalg.norm(along, axis=1)
    are_enough = length >= 1e-9 * mesh.extent and straight.sum() >= 2
    return fit_circle(ends[straight].reshape(-1, 3), axis) if are_enough else None, near


def _start_cone(
    mesh: Mesh, facets: Facets, row: int, edges_around: dict[int, list[int]], taken: Any
) -> tuple[RoundSurface | None, Any]:
    """Return a start for a cone from edge `row`, and the facets it was fitted to; None if there are too few.

    Args:
        row, edges_around, taken: As in `_start_cylinder`.
    """
    # Facets of one cone meet at equal angles: collect them outwards from the first facet over edges of that angle.
    angle = facets.angle[row]
    members = {int(facets.smooth[row, 0])}
    rows = set()
    to_visit = list(members)
    while to_visit and len(members) < _MOST_SEED:
        for r in edges_around[to_visit.pop()]:
            if abs(facets.angle[r] - angle) < _SAME_BEND * abs(angle) and not taken[facets.smooth[r]].any():
                rows.add(r)
                more = set(facets.smooth[r].tolist()) - members
                members |= more
                to_visit += sorted(more)
    near = np.array(sorted(members))
    if len(members) < 5:
        return None, near
    points = mesh.corners[np.unique(facets.along[sorted(rows)])]
    return refine_round(fit_circle(points, fit_axis(facets.normals[near], True)), points, True), near


def _grow_surface(
    mesh: Mesh,
    facets: Facets,
    among: Any,
    inside: Any,
    starts: Iterable[tuple[RoundSurface | None, bool]],
    seed: int | None = None,
) -> FoundWall | None:
    """Alternate between finding the facets on a surface and refitting the surface, until both are stable.

    Args:
        among: Facets that may be used, ascending.
        inside: Which smooth edges may be used, (s,).
        starts: Surfaces to start from, and whether each is a cone; the first that converges counts.
        seed: The result holds the facets connected with this one; None: all facets on the surface.

    Returns:
        The wall; None if no start holds enough facets.
    """
    for surface, cone in starts:
        # The first pass has three times the tolerance, as the start is only roughly right.
        count = 0
        loose = 3.0
        best = None
        for _ in range(8):
            if surface is None or not surface.radius < 50.0 * mesh.extent:
                break
            members, hole, spans = find_facets_on(mesh, facets, among, surface, loose * (ON_WALL * mesh.extent))
            if seed is not None:
                is_connected = _is_connected(facets.smooth[inside], members, seed)
                members, spans = members[is_connected], spans[is_connected]
            if len(members) < _FEWEST:
                best = None
                break
            best = FoundWall(surface, members, hole, spans)
            if len(members) == count and loose == 1.0:
                break
            count = len(members)
            loose = 1.0
            # Fit only to edges between two member facets: corners of the border may belong to a chamfer or a fillet.
            both = inside & np.isin(facets.smooth, members).all(axis=1)
            points = mesh.corners[np.unique(facets.along[both])]
            surface = refine_round(surface, points, cone) if len(points) >= 6 else None
        if best is not None and (not cone or abs(best.surface.slope) > 1e-3):
            return best
    return None


def _is_connected(smooth: Any, members: Any, seed: int) -> Any:
    """Return which members, ascending, are connected with a seed by smooth edges; none if the seed is no member."""
    if seed not in members:
        return np.zeros(len(members), dtype=bool)
    _, group = _label_smooth_groups(smooth, members)
    return group == group[np.searchsorted(members, seed)]


def group_by_smooth_edges(facets: Facets, members: Any) -> list[Any]:
    """Return the groups of `members`, ascending, that are connected by smooth edges between members."""
    if not len(members):
        return []
    count, group = _label_smooth_groups(facets.smooth, members)
    order = np.argsort(group, kind="stable")
    return np.split(members[order], np.cumsum(np.bincount(group, minlength=count))[:-1])


def _label_smooth_groups(smooth: Any, members: Any) -> tuple[int, Any]:
    """Return the number of groups that smooth edges between members make, and the group of each member."""
    return find_connected_groups(np.searchsorted(members, smooth[np.isin(smooth, members).all(axis=1)]), len(members))
