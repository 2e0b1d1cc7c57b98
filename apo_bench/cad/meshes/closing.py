"""Meshes become closed ones: corners joined, doubled triangles dropped, cracks filled, solids that touch told apart."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from apo_bench.cad.solids.bodies import body_of, mesh_of
from apo_bench.cad.solids.raw_solid import Mesh, connected
from apo_bench.geometry import Array

_SAME_CORNER = 1e-7
"""Corners are one within this part of the size."""
_CRACKS = (1e-5, 1e-4, 1e-3)
"""Corners at open edges are joined, and holes filled that are no wider, within the least of these that closes all."""


def closed(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """A mesh with corners in one place as one, each edge beside two triangles if that can be mended; and what was."""
    corners, index = np.unique(mesh.corners, axis=0, return_inverse=True)
    exact = _without_slivers(corners, index.ravel()[mesh.triangles])
    if exact.is_closed:
        return exact, ()
    grid = max(_SAME_CORNER * mesh.extent, 1e-9)
    rounded, index = np.unique(np.round(mesh.corners / grid), axis=0, return_inverse=True)
    near = _without_slivers(rounded * grid, index.ravel()[mesh.triangles])
    if near.is_closed:
        return near, (f"corners within {grid:.1g} mm were joined",)
    single = _without_doubles(exact)
    doubled = f"{len(exact.triangles) - len(single.triangles):,} doubled triangles were dropped"
    tries = [(exact, ()), (single, (doubled,))]
    for share in _CRACKS:
        width = share * mesh.extent
        tries.append((_with_cracks_closed(single, width), (f"corners and cracks within {width:.2g} mm were closed",)))
    for each, said in tries:
        parted = _touching_apart(each)
        if parted is not None and parted.is_closed:
            touch = "solids that touch along edges were told apart"
            return parted, (*said, *([touch] if len(parted.corners) > len(each.corners) else []))
    return single, ()


def _without_slivers(corners: Array, triangles: Any) -> Mesh:
    """A mesh without triangles that have one corner twice."""
    return Mesh(corners, triangles[has_three(triangles)])


def has_three(triangles: Any) -> Any:
    """Which triangles, (t, 3), have three different corners."""
    a, b, c = triangles.T
    return (a != b) & (b != c) & (c != a)


def triangles_of_edges(mesh: Mesh) -> Any:
    """How many triangles each edge has."""
    return np.unique(np.sort(mesh.sides, axis=1), axis=0, return_counts=True)[1]


def _without_doubles(mesh: Mesh) -> Mesh:
    """Of triangles with the same three corners that look one way one is left, of two that look both ways none."""
    first = mesh.triangles.argmin(axis=1)
    turned = np.take_along_axis(mesh.triangles, (first[:, None] + np.arange(3)) % 3, axis=1)
    ways = np.sign(turned[:, 2] - turned[:, 1])
    _, at, index = np.unique(np.sort(turned, axis=1), axis=0, return_index=True, return_inverse=True)
    forth, back = (np.bincount(index.ravel(), ways == way, len(at)) for way in (1, -1))
    # As many that look forth as back bound nothing between them.
    kept = np.flatnonzero(forth != back)
    which = np.full(len(at), -1)
    for way, more in ((1, forth > back), (-1, back > forth)):
        mine = np.flatnonzero((ways == way) & more[index.ravel()])
        which[index.ravel()[mine[::-1]]] = mine[::-1]
    return Mesh(mesh.corners, mesh.triangles[np.sort(which[kept])])


def _without_needles(mesh: Mesh, width: float) -> Mesh:
    """Without triangles that are no wider, if the mesh is closed: those that fill cracks look anywhere."""
    if not mesh.is_closed:
        return mesh
    body = body_of(mesh)
    return mesh_of(body.simplify(2.0 * width)) if body.num_tri() == len(mesh.triangles) else mesh


def _are_open(mesh: Mesh) -> Any:
    """Which of its directed sides, (3 t,), no triangle has the other way round."""
    count = len(mesh.corners)
    forth, back = (mesh.sides @ np.array(key) for key in ((count, 1), (1, count)))
    return ~np.isin(forth, back)


def _with_cracks_closed(mesh: Mesh, width: float) -> Mesh:
    """With corners at open edges that are near to each other as one, and what is still open no wider filled."""
    from scipy.spatial import cKDTree

    rim = np.unique(mesh.sides[_are_open(mesh)])
    if not len(rim):
        return mesh
    _, group = connected(cKDTree(mesh.corners[rim]).query_pairs(width, output_type="ndarray"), len(rim))
    to = np.arange(len(mesh.corners))
    to[rim] = rim[np.unique(group, return_index=True)[1]][group]
    joined = _cut_at_corners(_without_doubles(_without_slivers(mesh.corners, to[mesh.triangles])), width)
    added = [t for loop in _loops(joined) for t in _filled(joined, loop, width)]
    filled = np.concatenate([joined.triangles, np.array(added, dtype=np.int64).reshape(-1, 3)])
    return _without_needles(Mesh(joined.corners, filled), width)


def _cut_at_corners(mesh: Mesh, width: float) -> Mesh:
    """With triangles cut where corners of other open edges lie on an open edge of theirs: fewer needles are added."""
    for k in range(3):
        is_open = _are_open(mesh)
        rim = np.unique(mesh.sides[is_open])
        beside = is_open.reshape(3, -1)[k]
        fans = [mesh.triangles[~beside]]
        for a, b, c in np.roll(mesh.triangles[beside], -k, axis=1):
            line = mesh.corners[b] - mesh.corners[a]
            length = np.linalg.norm(line)
            to = mesh.corners[rim] - mesh.corners[a]
            at = to @ line / length
            off = np.linalg.norm(to - np.outer(at, line / length), axis=1)
            on = (off <= width) & (at > width) & (at < length - width) & (rim != c)
            ends = [a, *rim[on][at[on].argsort()], b]
            fans.append(np.roll([[p, q, c] for p, q in pairwise(ends)], k, axis=1))
        mesh = Mesh(mesh.corners, np.concatenate(fans))
    return mesh


def _loops(mesh: Mesh) -> Iterator[list[int]]:
    """Rings of corners along open edges; where they meet, each turns back as far as it can, since cracks are narrow."""
    after: dict[int, list[int]] = {}
    for a, b in mesh.sides[_are_open(mesh)].tolist():
        after.setdefault(a, []).append(b)
    while after:
        ring = [min(after)]
        while ring[-1] in after and ring[-1] not in ring[:-1]:
            here, ways = ring[-1], after[ring[-1]]
            out = mesh.corners[ways] - mesh.corners[here]
            back = mesh.corners[ring[-2] if len(ring) > 1 else here] - mesh.corners[here]
            ring.append(ways.pop(int((out @ back / np.linalg.norm(out, axis=1)).argmax())))
            if not ways:
                del after[here]
        if ring[-1] in ring[:-1]:
            yield ring[ring.index(ring[-1]) : -1]


def _filled(mesh: Mesh, loop: list[int], width: float) -> list[list[int]]:
    """Triangles over a ring of open edges, each the one that is least wide; none if one is wider than allowed."""
    loop = [*loop]
    triangles = []
    while len(loop) > 2:
        points = mesh.corners[loop]
        before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
        sides = np.stack([points - before, after - points, before - after])
        wide = np.linalg.norm(np.cross(sides[0], sides[1]), axis=1) / np.linalg.norm(sides, axis=2).max(axis=0)
        k = int(wide.argmin())
        if wide[k] > width:
            return []
        triangles.append([loop[k], loop[k - 1], loop[(k + 1) % len(loop)]])
        del loop[k]
    return triangles


def _touching_apart(mesh: Mesh) -> Mesh | None:
    """With own corners for each of the solids that touch along edges; None if an edge has an odd number of triangles.

    Around an edge each triangle that looks one way is paired with the next one that looks the other way, beyond what is
    inside of both.
    """
    sides = np.sort(mesh.sides, axis=1)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    starts = np.flatnonzero(np.append(True, (np.diff(sides[order], axis=0) != 0).any(axis=1)))
    counts = np.diff(np.append(starts, len(order)))
    if (counts % 2).any():
        return None
    if (counts == 2).all():
        return mesh
    count = len(mesh.triangles)
    pairs = [order[starts[counts == 2][:, None] + np.arange(2)]]
    for start, many in zip(starts[counts > 2], counts[counts > 2], strict=True):
        rows = order[start : start + many]
        paired = _paired_around(mesh, rows, sides[rows[0]])
        if paired is None:
            return None
        pairs.append(paired)
    # The corners of two paired triangles at their edge are one; all others are the corners of their own.
    joined = np.concatenate(pairs)
    ends = []
    for corner in range(2):
        at = [np.where(mesh.triangles[row % count] == sides[joined[:, 0], corner, None], 1, 0) for row in joined.T]
        ends.append(
            np.column_stack([3 * (row % count) + hit.argmax(axis=1) for row, hit in zip(joined.T, at, strict=True)])
        )
    groups, group = connected(np.concatenate(ends), 3 * count)
    first = np.full(groups, -1)
    first[group[::-1]] = mesh.triangles.ravel()[::-1]
    return Mesh(mesh.corners[first], group.reshape(-1, 3))


def _paired_around(mesh: Mesh, rows: Any, edge: Any) -> Any:
    """Rows of `sides` at one edge as pairs, (p, 2); None if as many do not look either way."""
    a, b = mesh.corners[edge]
    third = mesh.triangles[rows % len(mesh.triangles), (rows // len(mesh.triangles) + 2) % 3]
    forth = mesh.sides[rows, 0] == edge[0]
    if 2 * forth.sum() != len(rows):
        return None
    along = (b - a) / np.linalg.norm(b - a)
    out = mesh.corners[third] - a
    out -= np.outer(out @ along, along)
    x = out[0] / np.linalg.norm(out[0])
    angle = np.round(np.arctan2(out @ np.cross(along, x), out @ x) % (2.0 * np.pi), 6) % round(2.0 * np.pi, 6)
    # Where the edge points to the eye, the inside of a triangle that goes along it is at smaller angles. Of two in one
    # place it comes first, so that solids which touch in a face stay two.
    order = np.lexsort((~forth, angle))
    order = np.roll(order, -int((~forth[order]).argmax()))
    return rows[order].reshape(-1, 2) if (~forth[order[::2]] & forth[order[1::2]]).all() else None
