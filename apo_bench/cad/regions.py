"""The faces of a mesh: flat pieces that meet smoothly are tried as cylinders and cones, and what is left as planes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.facets import FLAT, Facets, facets_of
from apo_bench.cad.fitting import Round, axis_of, circle_through, on_it, refined
from apo_bench.cad.raw import Kind, Mesh, Region
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.round_face import WHOLE_TURN

TOLERANCE = 1e-5
"""Of the size of a part: corners of a round face are this near to it."""
_FEWEST = 3
_MOST_WORK, _MOST_FAILED, _MOST_SEED = 3_000_000, 100, 100
"""How many flat pieces are asked, over all trials, in one part; trials in vain, one after the other, in one smooth part
of its surface; flat pieces that a trial begins with."""
_SAME_BEND = 0.15
_BAND = 3.0
"""Bands of one free surface differ by less than this in how wide they are and how they bend."""
_LARGER = 8.0
"""A flat piece so much larger than its neighbours on a free surface is a plane beside it."""
_GAP = 1.8
"""A turn is whole if no gap in it is this much wider than a strip."""
_SNAP_RAD = 2e-6


class _Found(NamedTuple):
    """A round surface and the flat pieces on it."""

    surface: Round
    members: Any
    hole: bool
    spans: Array


def regions_of(mesh: Mesh) -> tuple[tuple[Region, ...], Any]:
    """The faces of a closed mesh in an order that its triangles give, and the flat piece of each triangle."""
    facets = facets_of(mesh)
    count = len(facets.areas)
    rounds = _without_bands(mesh, facets, _rounds(mesh, facets), count)
    of_round = np.full(count, -1)
    for k, each in enumerate(rounds):
        of_round[each.members] = k
    found = [_round_region(mesh, facets, each) for each in rounds]
    free = _free(facets, of_round)
    for f in np.flatnonzero((of_round < 0) & ~free):
        found.append(_plane(mesh, np.flatnonzero(facets.of == f)))
    for group in _groups(facets, np.flatnonzero(free)):
        found.append(Region("other", np.flatnonzero(np.isin(facets.of, group))))
    found.sort(key=lambda region: int(region.triangles[0]))
    return tuple(found), facets.of


def _rounds(mesh: Mesh, facets: Facets) -> list[_Found]:
    """Cylinders and cones, in each smooth part of the surface: first all of it, then from edges in it."""
    found: list[_Found] = []
    work = _MOST_WORK
    tolerance = TOLERANCE * mesh.extent
    for group in _groups(facets, np.unique(facets.smooth)):
        if len(group) < _FEWEST:
            continue
        inside = np.isin(facets.smooth[:, 0], group)
        whole = _grown(mesh, facets, group, inside, _start(mesh, facets, group, inside), tolerance)
        work -= 2 * len(group)
        if whole is not None and len(whole.members) == len(group):
            found.append(whole)
            continue
        work = _from_edges(mesh, facets, group, inside, tolerance, found, work)
    return found


def _from_edges(
    mesh: Mesh, facets: Facets, group: Any, inside: Any, tolerance: float, found: list[_Found], work: int
) -> int:
    """Look for round surfaces in part of a smooth surface; returns what work is left."""
    taken = np.zeros(len(facets.areas), dtype=bool)
    rows = np.flatnonzero(inside)
    around = _around(facets, rows)
    ends = mesh.corners[facets.along[rows]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    failed = 0
    for row in rows[np.argsort(-length, kind="stable")]:
        i, k = facets.smooth[row].tolist()
        if taken[i] or taken[k]:
            continue
        if work < 0 or failed > _MOST_FAILED:
            break
        best = None
        for cone in (False, True):
            start, near = (_seed_cone if cone else _seed_cylinder)(mesh, facets, row, around, taken)
            if start is None or len(on_it(mesh, facets, near, start, 3.0 * tolerance)[0]) < _FEWEST:
                continue
            left, open_ = group[~taken[group]], inside & ~taken[facets.smooth].any(axis=1)
            best = _grown(mesh, facets, left, open_, [(start, cone)], tolerance, i)
            work -= 4 * len(left)
            if best is not None:
                break
        failed += 1
        if best is not None:
            failed = 0
            found.append(best)
            taken[best.members] = True
    return work


def _around(facets: Facets, rows: Any) -> dict[int, list[int]]:
    """The smooth edges of each flat piece."""
    found: dict[int, list[int]] = {}
    for row, (i, k) in zip(rows.tolist(), facets.smooth[rows].tolist(), strict=True):
        found.setdefault(i, []).append(row)
        found.setdefault(k, []).append(row)
    return found


def _start(mesh: Mesh, facets: Facets, group: Any, inside: Any) -> list[tuple[Round, bool]]:
    """What all of a smooth surface may be: a cylinder, a cone."""
    points = mesh.corners[np.unique(facets.along[inside])]
    found = []
    for cone in (False, True):
        first = circle_through(points, axis_of(facets.normals[group], cone))
        if first is not None:
            found.append((first, cone))
    return found


def _seed_cylinder(
    mesh: Mesh, facets: Facets, row: int, around: dict[int, list[int]], taken: Any
) -> tuple[Round | None, Any]:
    """The cylinder along an edge, through the edges beside it; and the flat pieces there."""
    a, b = mesh.corners[facets.along[row]]
    length = np.linalg.norm(b - a)
    rows = np.array([r for f in facets.smooth[row].tolist() for r in around[f] if not taken[facets.smooth[r]].any()])
    near = np.unique(facets.smooth[rows])
    if length < 1e-9 * mesh.extent:
        return None, near
    axis = (b - a) / length
    ends = mesh.corners[facets.along[rows]]
    along = ends[:, 1] - ends[:, 0]
    straight = np.linalg.norm(np.cross(along, axis), axis=1) < 0.02 * np.linalg.norm(along, axis=1)
    if straight.sum() < 2:
        return None, near
    return circle_through(ends[straight].reshape(-1, 3), axis), near


def _seed_cone(
    mesh: Mesh, facets: Facets, row: int, around: dict[int, list[int]], taken: Any
) -> tuple[Round | None, Any]:
    """The cone of the pieces that meet at one angle, one after the other; and these pieces."""
    angle = facets.angle[row]
    members, rows, open_ = {int(facets.smooth[row, 0])}, set(), [int(facets.smooth[row, 0])]
    while open_ and len(members) < _MOST_SEED:
        for r in around[open_.pop()]:
            if abs(facets.angle[r] - angle) < _SAME_BEND * abs(angle) and not taken[facets.smooth[r]].any():
                rows.add(r)
                more = set(facets.smooth[r].tolist()) - members
                members |= more
                open_ += sorted(more)
    near = np.array(sorted(members))
    if len(members) < 5:
        return None, near
    points = mesh.corners[np.unique(facets.along[sorted(rows)])]
    first = circle_through(points, axis_of(facets.normals[near], True))
    return (None if first is None else refined(first, points, True)), near


def _grown(
    mesh: Mesh,
    facets: Facets,
    among: Any,
    inside: Any,
    starts: list[tuple[Round, bool]],
    tolerance: float,
    seed: int | None = None,
) -> _Found | None:
    """The flat pieces on a surface, connected with a seed or all of them, and the surface fitted to them."""
    for start, cone in starts:
        surface: Round | None = start
        if seed is None:
            surface = refined(start, mesh.corners[np.unique(facets.along[inside])], cone)
        count, loose, best = 0, 3.0, None
        for _ in range(8):
            if surface is None or not surface.radius < 50.0 * mesh.extent:
                break
            members, hole, spans = on_it(mesh, facets, among, surface, loose * tolerance)
            if seed is not None:
                members, spans = _connected(facets, inside, members, spans, seed)
            if len(members) < _FEWEST:
                best = None
                break
            best = _Found(surface, members, hole, spans)
            if len(members) == count and loose == 1.0:
                break
            count, loose = len(members), 1.0
            both = inside & np.isin(facets.smooth, members).all(axis=1)
            points = mesh.corners[np.unique(facets.along[both])]
            surface = refined(surface, points, cone) if len(points) >= 6 else None
        if best is not None and (not cone or abs(best.surface.slope) > 1e-3):
            return best
    return None


def _connected(facets: Facets, inside: Any, members: Any, spans: Array, seed: int) -> tuple[Any, Array]:
    """Those that hang together with a seed; none if it is not among them."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    at = int(np.searchsorted(members, seed))
    if at == len(members) or members[at] != seed:
        return members[:0], spans[:0]
    pairs = facets.smooth[inside]
    pairs = np.searchsorted(members, pairs[np.isin(pairs, members).all(axis=1)])
    count = len(members)
    _, owner = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), (count, count)), directed=False)
    same = owner == owner[at]
    return members[same], spans[same]


class _End(NamedTuple):
    """What a round surface goes over into smoothly at one of its ends."""

    beyond: frozenset[int]
    """Other round surfaces; -1 is anything else."""
    angle: float
    width: float
    """Of what is beyond it, across."""


def _without_bands(mesh: Mesh, facets: Facets, rounds: list[_Found], count: int) -> list[_Found]:
    """Without bands of tori, spheres and free surfaces, which go over into others like them at both ends."""
    of = np.full(count, -1)
    for k, each in enumerate(rounds):
        of[each.members] = k
    dropped: set[int] = set()
    ends: list[list[_End]] = []
    widths: list[float] = []
    for k, each in enumerate(rounds):
        height, distance, _ = each.surface.polar(mesh.corners[_corners(facets, each.members)])
        widths.append(float(np.ptp(height)) * float(np.hypot(1.0, each.surface.slope)))
        ends.append(_ends(mesh, facets, of, k, each, float(height.min() + height.max()) / 2.0))
        turn = _turn(facets, each)
        if (turn < WHOLE_TURN and ends[k] and widths[k] < turn * float(distance.mean())) or (
            len(ends[k]) == 2 and all(_alike(end, ends[k][0].angle, widths[k]) for end in ends[k])
        ):
            dropped.add(k)
    more = True
    while more:
        more = False
        for k, found in enumerate(ends):
            if k not in dropped and any(end.beyond & dropped and _alike(end, end.angle, widths[k]) for end in found):
                dropped.add(k)
                more = True
    return [each for k, each in enumerate(rounds) if k not in dropped]


def _ends(mesh: Mesh, facets: Facets, of: Any, k: int, each: _Found, middle: float) -> list[_End]:
    """The ends of a round surface that are smooth."""
    mine = of[facets.smooth] == k
    rows = np.flatnonzero(mine.sum(axis=1) == 1)
    points = mesh.corners[facets.along[rows]]
    along = points[:, 1] - points[:, 0]
    across = np.abs(along @ each.surface.axis) < 0.5 * np.linalg.norm(along, axis=1)
    rows, at = rows[across], points[across].mean(axis=1)
    beyond = np.where(mine[rows, 0], facets.smooth[rows, 1], facets.smooth[rows, 0])
    width = 2.0 * np.linalg.norm(facets.centers[beyond] - at, axis=1)
    low = each.surface.polar(at)[0] < middle
    return [
        _End(frozenset(of[beyond[side]].tolist()), float(np.median(facets.angle[rows[side]])), np.median(width[side]))
        for side in (low, ~low)
        if side.any()
    ]


def _alike(end: _End, angle: float, width: float) -> bool:
    """Whether what is beyond an end bends as much, the same way, and is as wide."""
    return (
        end.angle * angle > 0.0
        and max(abs(end.angle), abs(angle)) < _BAND * min(abs(end.angle), abs(angle))
        and max(end.width, width) < _BAND * min(end.width, width)
    )


def _corners(facets: Facets, members: Any) -> Any:
    return np.unique(facets.corner[np.isin(facets.owner, members)])


def _groups(facets: Facets, members: Any) -> list[Any]:
    """Flat pieces that hang together smoothly, over those of the list alone."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    if not len(members):
        return []
    pairs = facets.smooth[np.isin(facets.smooth, members).all(axis=1)]
    pairs = np.searchsorted(members, pairs)
    count = len(members)
    number, owner = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), (count, count)), directed=False)
    order = np.argsort(owner, kind="stable")
    return np.split(members[order], np.cumsum(np.bincount(owner, minlength=number))[:-1])


def _free(facets: Facets, of_round: Any) -> Any:
    """Which flat pieces belong to surfaces that are neither flat nor round."""
    left = of_round < 0
    pairs = facets.smooth[left[facets.smooth].all(axis=1)]
    free = np.zeros(len(left), dtype=bool)
    free[pairs] = True
    around: dict[int, list[float]] = {}
    for i, k in pairs.tolist():
        around.setdefault(i, []).append(facets.areas[k])
        around.setdefault(k, []).append(facets.areas[i])
    for f, areas in around.items():
        free[f] = facets.areas[f] < _LARGER * float(np.median(areas))
    return free


def _plane(mesh: Mesh, triangles: Any) -> Region:
    points = mesh.corners[np.unique(mesh.triangles[triangles])]
    n = mesh.across[triangles].sum(axis=0)
    n = _snapped(n / np.linalg.norm(n))
    middle = mesh.corners[mesh.triangles[triangles]].mean(axis=1)
    weight = np.linalg.norm(mesh.across[triangles], axis=1)
    d = float(weight @ (middle @ n) / weight.sum())
    return Region("plane", triangles, float(np.abs(points @ n - d).max()), normal=n, point=d * n)


def _snapped(n: Array) -> Array:
    """A direction along an axis of the frame, if it is so within rounding."""
    axis = int(np.abs(n).argmax())
    exact = np.sign(n[axis]) * np.eye(3)[axis]
    return exact if np.linalg.norm(n - exact) < _SNAP_RAD else n


def _round_region(mesh: Mesh, facets: Facets, found: _Found) -> Region:
    surface = found.surface
    axis = surface.axis * np.sign(surface.axis[int(np.abs(surface.axis).argmax())])
    slope = surface.slope * float(np.sign(axis @ surface.axis))
    axis = _snapped(axis)
    point = surface.point - surface.point @ axis * axis
    foot = float(surface.point @ axis)
    triangles = np.flatnonzero(np.isin(facets.of, found.members))
    points = mesh.corners[np.unique(mesh.triangles[triangles])]
    kind: Kind = "cone" if slope else "cylinder"
    first = Region(kind, triangles, axis=axis, point=point, span=(foot, foot + 1.0), hole=found.hole)
    height, distance, _ = first.polar(points)
    low, high = float(height.min()), float(height.max())
    radii = [max(surface.radius + slope * (h - foot), 0.0) for h in (low, high)]
    if slope:
        radii = [0.0 if r < TOLERANCE * mesh.extent else r for r in radii]
    turn = _turn(facets, found)
    border = _border(mesh, triangles)
    ends = np.minimum(height - low, high - height)[np.isin(np.unique(mesh.triangles[triangles]), border)]
    off = (distance - radii[0] - slope * (height - low)) / np.hypot(1.0, slope)
    on = off > -TOLERANCE * mesh.extent
    return Region(
        kind,
        triangles,
        float(np.abs(off[on]).max(initial=0.0)),
        axis=axis,
        point=point,
        span=(low, high),
        radii=(radii[0], radii[1]),
        hole=found.hole,
        turn=turn,
        square=turn == WHOLE_TURN and bool(ends.max(initial=0.0) < 2.0 * FLAT * mesh.extent + 1e-9 and on.all()),
    )


def _border(mesh: Mesh, triangles: Any) -> Any:
    """Corners on the border of a region."""
    inside = np.zeros(len(mesh.triangles), dtype=bool)
    inside[triangles] = True
    return np.unique(mesh.edges[inside[mesh.neighbours].sum(axis=1) == 1])


def _turn(facets: Facets, found: _Found) -> float:
    """How far around its axis a round face reaches."""
    axis = found.surface.axis
    x = np.eye(3)[int(np.abs(axis).argmin())]
    x = x - (x @ axis) * axis
    _, _, out = found.surface.polar(facets.centers[found.members])
    middle = np.arctan2(out @ np.cross(axis, x), out @ x)
    order = np.argsort(middle)
    gaps = np.diff(np.append(middle[order], middle[order[0]] + WHOLE_TURN))
    widest = float(gaps.max())
    step = float(found.spans.max())
    return WHOLE_TURN if widest < _GAP * step else WHOLE_TURN - widest + step
