"""Solids cut into convex pieces: along the planes of reflex edges, then around round holes, [mm]."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.raw import Mesh, RawSolid, Region
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Cylinder, Hull, cylinder_hull, sides_of

_MOST_CUTS, _MOST_TRIANGLES, _FARTHEST = 400, 20_000, 60
_MOST_CORNERS, _MOST_SIDES, _MOST_DIRECTIONS = 600, 300, 200
"""Of a piece; of one that has more, the farthest corners are kept in so many directions."""
_TRIES, _HAIR = 6, 2e-6
_INSIDE_M = 5e-8
"""Corners so far inside of a piece are none of it."""
_SAME_MM = 2e-4
"""Corners of a piece nearer to each other than this are one."""
_THIN_MM = 0.02
"""Pieces thinner than this across are left out."""


class Cut(NamedTuple):
    """The convex pieces of a solid."""

    pieces: tuple[Hull, ...]
    """[m]."""
    grown: float
    """By how much pieces that stand for hollow ones are larger, [mm^3]."""
    hulls: int
    """How many do."""


def cut(raw: RawSolid) -> Cut:
    """The convex pieces of a solid: flat ones exact, round holes as wedges that touch the fitted wall."""
    whole = manifold_of(raw.mesh)
    bores = [r for r in raw.regions if r.is_round and r.hole and r.square]
    for bore in bores:
        whole = whole + _filled(raw.mesh, bore)
    if whole.num_tri() > _MOST_TRIANGLES:
        whole = whole.simplify(1e-3 * raw.mesh.extent)
    grown, hulls = 0.0, 0
    pieces: list[Array] = []
    shafts = [r for r in raw.regions if r.is_round and not r.hole and r.square]
    for part, hollow, planes in _at_shoulders(_convex(whole, raw.mesh.extent, _flats(raw)), shafts, raw.mesh.extent):
        corners = _once(_settled(_corners(part), planes, raw.mesh.extent))
        if len(corners) < 4 or not _is_thick(corners):
            continue
        corners = _extremes(corners)
        volume = _volume(corners)
        if hollow or abs(volume - part.volume()) > 1e-3 * part.volume():
            grown, hulls = grown + volume - part.volume(), hulls + 1
        pieces.append(corners)
    found: list[Hull] = []
    for corners in pieces:
        found += [Hull("", 1e-3 * each) for each in _bored(_rounded(corners, shafts), bores)]
    return Cut(tuple(_as_cylinders(found, shafts)), grown, hulls)


def manifold_of(mesh: Mesh) -> Any:
    """The mesh as manifold3d has it."""
    import manifold3d

    given = manifold3d.Mesh64(np.ascontiguousarray(mesh.corners), np.ascontiguousarray(mesh.triangles, dtype=np.uint64))
    found = manifold3d.Manifold(given)
    if found.status() != manifold3d.Error.NoError or found.is_empty():
        raise InputError("the mesh makes no solid; mend it where it was drawn, and save it again.")
    return found


def _filled(mesh: Mesh, bore: Region) -> Any:
    """What was taken away by a round hole, as the mesh has it."""
    import manifold3d

    return manifold3d.Manifold.hull_points(mesh.corners[np.unique(mesh.triangles[bore.triangles])])


def _flats(raw: RawSolid) -> Array:
    """The planes of the flat faces, (k, 4)."""
    found = [(*r.normal, r.normal @ r.point) for r in raw.regions if r.normal is not None and r.point is not None]
    return np.array(found).reshape(-1, 4)


def _convex(whole: Any, size: float, flats: Array) -> Iterator[tuple[Any, bool, Array]]:
    """Convex parts, parts that are still hollow when there were too many cuts; and the planes that each was cut along.

    Both halves keep a hair's breadth off the plane: on it, rounding would leave flaps of no thickness.
    """
    open_: list[tuple[Any, Array]] = [(whole, np.zeros((0, 4)))]
    cuts, least, hair = 0, 1e-7 * whole.volume(), _HAIR * size
    while open_:
        found, along = open_.pop()
        for part in found.decompose():
            if part.volume() < least:
                continue
            planes = _reflex_planes(part, size)
            halves = None
            if len(planes) and cuts < _MOST_CUTS:
                for plane in planes[:_TRIES]:
                    same = (np.abs(flats[:, :3] @ plane[:3]) > 1.0 - 1e-6) & (
                        np.abs(flats[:, 3] * np.sign(flats[:, :3] @ plane[:3]) - plane[3]) < hair
                    )
                    n, d = (flats[same][0, :3], flats[same][0, 3]) if same.any() else (plane[:3], plane[3])
                    one = part.trim_by_plane(n, float(d) + hair)
                    other = part.trim_by_plane(-n, -(float(d) - hair))
                    if min(one.volume(), other.volume()) > least:
                        used = np.concatenate([along, [[*n, d]]])
                        halves = [(one, used), (other, used)]
                        break
            if halves is None:
                yield part, bool(len(planes)), along
            else:
                cuts += 1
                open_ += halves


def _at_shoulders(
    parts: Iterator[tuple[Any, bool, Array]], shafts: Sequence[Region], size: float
) -> Iterator[tuple[Any, bool, Array]]:
    """Parts cut where one round wall goes over into another one: a cylinder and its chamfer are two pieces."""
    hair = _HAIR * size
    for part, hollow, planes in parts:
        mine = [s for s in shafts if _touches(_corners(part), s)]
        open_ = [(part, planes)]
        for shaft in mine if len(mine) > 1 else ():
            assert shaft.axis is not None
            assert shaft.point is not None
            for end in shaft.span:
                d = float(shaft.point @ shaft.axis) + end
                halves = []
                for each, along in open_:
                    height = _corners(each) @ shaft.axis - d
                    if height.min() > -10.0 * hair or height.max() < 10.0 * hair:
                        halves.append((each, along))
                        continue
                    used = np.concatenate([along, [[*shaft.axis, d]]])
                    halves.append((each.trim_by_plane(shaft.axis, d + hair), used))
                    halves.append((each.trim_by_plane(-shaft.axis, hair - d), used))
                open_ = halves
        yield from ((each, hollow, along) for each, along in open_)


def _touches(corners: Array, shaft: Region) -> bool:
    height, distance, _ = shaft.polar(corners)
    within = (height > shaft.span[0] - _SAME_MM) & (height < shaft.span[1] + _SAME_MM)
    return int((within & (np.abs(distance - shaft.radius_at(height)) < 1e-3)).sum()) >= 6


def _settled(corners: Array, planes: Array, size: float) -> Array:
    """Corners that are a hair's breadth off the planes of cuts, on them."""
    found = corners.copy()
    for _ in range(4):
        for n, d in zip(planes[:, :3], planes[:, 3], strict=True):
            off = found @ n - d
            off[np.abs(off) > 3.0 * _HAIR * size] = 0.0
            found -= np.outer(off, n)
    return found


def _reflex_planes(part: Any, size: float) -> Array:
    """Planes, (k, 4), of sides at reflex edges, those with the longest edges in them first."""
    raw = part.to_mesh64()
    mesh = Mesh(np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts).astype(np.int64))
    length = np.linalg.norm(mesh.across, axis=1)
    normals = mesh.across / np.maximum(length, 1e-300)[:, None]
    i, k = mesh.neighbours.T
    points = mesh.corners[mesh.triangles[k]] - mesh.corners[mesh.edges[:, 0]][:, None]
    above = (points * normals[i][:, None]).sum(axis=2).max(axis=1)
    sound = (length[i] > 1e-9 * size**2) & (length[k] > 1e-9 * size**2)
    reflex = sound & (above > max(1e-6 * size, 1e-4)) & ((normals[i] * normals[k]).sum(axis=1) < 1.0 - 1e-7)
    if not reflex.any():
        return np.zeros((0, 4))
    ends = mesh.corners[mesh.edges[reflex]]
    sides = np.concatenate([i[reflex], k[reflex]])
    n = normals[sides]
    d = (n * mesh.corners[mesh.triangles[sides, 0]]).sum(axis=1)
    planes = np.column_stack([n, d])
    keys = np.round(planes * [1e5, 1e5, 1e5, 1e5 / size])
    _, first = np.unique(keys, axis=0, return_index=True)
    planes = planes[np.sort(first)][:400]
    inside = (np.abs(ends @ planes[:, :3].T - planes[:, 3]) < 2e-6 * size).all(axis=1)
    score = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) @ inside
    aligned = np.abs(planes[:, :3]).max(axis=1) > 1.0 - 1e-9
    return np.asarray(planes[np.lexsort((~aligned, -np.round(score / size, 6)))])


def _corners(part: Any) -> Array:
    raw = part.to_mesh64()
    return np.asarray(raw.vert_properties)[np.unique(np.asarray(raw.tri_verts)), :3].astype(np.float64)


def _extremes(points: Array) -> Array:
    """The corners of the convex hull of points, each once; the farthest ones where there are too many."""
    from scipy.spatial import ConvexHull

    points = _once(points)
    corners = points[np.sort(ConvexHull(points).vertices)]
    hull = Hull("", 1e-3 * corners)
    for _ in range(4):
        inside = (hull.planes[:, 3] - hull.corners @ hull.planes[:, :3].T).min(axis=1) > _INSIDE_M
        if not inside.any():
            break
        corners = corners[~inside]
        hull = Hull("", 1e-3 * corners)
    if len(corners) <= _MOST_CORNERS and len(hull.planes) <= _MOST_SIDES and len(hull.edges) <= _MOST_DIRECTIONS:
        return np.asarray(corners)
    k = np.arange(_FARTHEST) + 0.5
    up, turn = 1.0 - 2.0 * k / _FARTHEST, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - up**2)
    way = np.concatenate([np.column_stack([np.cos(turn) * flat, np.sin(turn) * flat, up]), np.eye(3), -np.eye(3)])
    return np.asarray(corners[np.unique((corners @ way.T).argmax(axis=0))])


def _once(points: Array) -> Array:
    """Points without those that are near to an earlier one."""
    from scipy.spatial import cKDTree

    drop = {int(k) for _, k in sorted(cKDTree(points).query_pairs(_SAME_MM))}
    return points[[k for k in range(len(points)) if k not in drop]]


def _volume(corners: Array) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(corners).volume)


def _rounded(corners: Array, shafts: Sequence[Region]) -> Array:
    """A piece with as many corners on circles of a shaft as its wall needs: new ones on whole circles, more on others."""
    from scipy.spatial import ConvexHull

    added, dropped = [corners], np.zeros(len(corners), dtype=bool)
    for shaft in sorted(shafts, key=lambda shaft: -int(_on_wall(corners, shaft).sum())):
        height, _, angle = shaft.polar(corners)
        on = _on_wall(corners, shaft) & ~dropped
        if on.sum() < 3:
            continue
        count = sides_of(1e-3 * max(shaft.radii))
        for h in np.unique(np.round(height[on], 3)):
            mine = on & (np.abs(height - h) < 2e-3)
            a, whole = _around_axis(np.sort(angle[mine]), count)
            if whole:
                dropped |= mine
            if len(a):
                added.append(_ring(shaft, float(height[mine].mean()), a))
    if len(added) == 1:
        return corners
    added[0] = corners[~dropped]
    every = _once(np.concatenate(added))
    return np.asarray(every[np.sort(ConvexHull(every).vertices)])


def _on_wall(corners: Array, shaft: Region) -> Any:
    height, distance, _ = shaft.polar(corners)
    on = np.abs(distance - shaft.radius_at(height)) < max(1e-5 * max(shaft.radii), _SAME_MM)
    return on & (height > shaft.span[0] - _SAME_MM) & (height < shaft.span[1] + _SAME_MM) & (distance > _SAME_MM)


def _around_axis(ring: Array, count: int) -> tuple[Array, bool]:
    """Angles of corners that a wall of so many sides needs beside those of a ring; whether they stand for all of it."""
    if len(ring) < 3:
        return ring[:0], False
    gaps = np.diff(np.append(ring, ring[0] + 2.0 * np.pi))
    usual = float(np.median(gaps))
    if len(ring) >= 6 and gaps.max() < 1.6 * usual:
        return 2.0 * np.pi * (np.arange(count) + 0.5) / count, True
    step = 2.0 * np.pi / count
    fresh = [
        a + gap * np.arange(1, n) / n
        for a, gap in zip(ring, gaps, strict=True)
        if gap < 1.6 * usual and (n := int(np.ceil(gap / step - 1e-9))) > 1
    ]
    return np.concatenate([ring[:0], *fresh]), False


def _ring(shaft: Region, height: float, angles: Array) -> Array:
    assert shaft.point is not None
    assert shaft.axis is not None
    x, y = shaft.frame()
    out = np.outer(np.cos(angles), x) + np.outer(np.sin(angles), y)
    return np.asarray(shaft.point + height * shaft.axis + shaft.radius_at(height) * out)


def _as_cylinders(pieces: list[Hull], shafts: Sequence[Region]) -> Iterator[Hull]:
    """Pieces, as true cylinders where all of their corners are on the ends of one."""
    for piece in pieces:
        corners = 1e3 * piece.corners
        for shaft in shafts:
            if shaft.kind != "cylinder":
                continue
            height, distance, _ = shaft.polar(corners)
            low, high = float(height.min()), float(height.max())
            level = (np.minimum(height - low, high - height) < _SAME_MM).all()
            if (
                level
                and len(corners) >= 16
                and (np.abs(distance - shaft.radii[0]) < 1e-5 * shaft.radii[0] + 1e-5).all()
            ):
                assert shaft.point is not None
                assert shaft.axis is not None
                center = 1e-3 * (shaft.point + (low + high) / 2.0 * shaft.axis)
                piece = cylinder_hull("", Cylinder(center, shaft.axis, 1e-3 * shaft.radii[0], 5e-4 * (high - low)))
                break
        yield piece


def _bored(corners: Array, bores: Sequence[Region]) -> list[Array]:
    """A convex piece less round holes, as convex pieces."""
    import manifold3d

    parts = [manifold3d.Manifold.hull_points(corners)]
    for a, b in combinations(bores, 2):
        plane = _between(a, b)
        if plane is not None:
            parts = [
                half
                for part in parts
                for half in (
                    part.split_by_plane(plane[:3], float(plane[3])) if _meets(part, a) and _meets(part, b) else (part,)
                )
            ]
    for bore in bores:
        parts = [piece for part in parts for piece in (_around(part, bore) if _meets(part, bore) else (part,))]
    if len(parts) == 1 and not any(_meets(parts[0], bore) for bore in bores):
        return [corners]
    found = []
    for part in parts:
        if not part.is_empty() and (points := _once(_corners(part))).shape[0] >= 4 and _is_thick(points):
            found.append(_extremes(points))
    return found


def _is_thick(points: Array) -> bool:
    """Whether points span more than a sheet."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        planes = ConvexHull(points).equations
    except QhullError:
        return False
    depth = -(points @ planes[:, :3].T + planes[:, 3]).min(axis=0)
    return bool(depth.min() > _THIN_MM)


def _between(a: Region, b: Region) -> Array | None:
    """The plane between two holes side by side, (4,)."""
    assert a.axis is not None
    assert b.axis is not None
    assert a.point is not None
    assert b.point is not None
    across = np.cross(a.axis, b.axis)
    if np.linalg.norm(across) > 1e-6:
        return None
    off = b.point - a.point
    off = off - off @ a.axis * a.axis
    gap = float(np.linalg.norm(off))
    room = gap - max(a.radii) - max(b.radii)
    if room <= 0.0:
        return None
    n = off / gap
    return np.append(n, n @ a.point + max(a.radii) + room / 2.0)


def _meets(part: Any, bore: Region) -> bool:
    """Whether the box around a part, seen along the axis of a hole, comes near to the hole."""
    if part.is_empty():
        return False
    corners = _corners(part)
    height, _, _ = bore.polar(corners)
    if height.max() < bore.span[0] + _SAME_MM or height.min() > bore.span[1] - _SAME_MM:
        return False
    x, y = bore.frame()
    assert bore.point is not None
    from shapely import MultiPoint, Point

    flat = np.column_stack([(corners - bore.point) @ x, (corners - bore.point) @ y])
    return bool(MultiPoint(flat).convex_hull.distance(Point(0.0, 0.0)) < max(bore.radii) - _SAME_MM)


def _around(part: Any, bore: Region) -> Iterator[Any]:
    """A convex part less a round hole: what is below and above it, and wedges that touch its wall from outside."""
    assert bore.point is not None
    assert bore.axis is not None
    axis, x, y = bore.axis, *bore.frame()
    foot = float(bore.point @ axis)
    above, rest = part.split_by_plane(axis, foot + bore.span[1])
    slab, below = rest.split_by_plane(axis, foot + bore.span[0])
    yield from (each for each in (above, below) if not each.is_empty())
    n = sides_of(1e-3 * max(bore.radii))
    slope = bore.slope if bore.kind == "cone" else 0.0
    at = bore.point + bore.span[0] * axis
    for i in range(n):
        a, b, m = (2.0 * np.pi * (i + off) / n for off in (-0.5, 0.5, 0.0))
        right = -np.sin(a) * x + np.cos(a) * y
        left = np.sin(b) * x - np.cos(b) * y
        wall = np.cos(m) * x + np.sin(m) * y - slope * axis
        wedge = slab.trim_by_plane(right, float(right @ at)).trim_by_plane(left, float(left @ at))
        wedge = wedge.trim_by_plane(wall, float((wall @ at + bore.radii[0]) / np.linalg.norm(wall)))
        if not wedge.is_empty():
            yield wedge
