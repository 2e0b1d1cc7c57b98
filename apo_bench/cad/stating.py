"""Regions become the faces that a part file states, [m]."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from apo_bench.cad.raw import RawSolid, Region
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import sides_of
from apo_bench.geometry.polygon import straightened
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Face
from apo_bench.parts.making.outline import COARSE_SIDES

_THINNEST_MM = 0.05


def round_face(region: Region) -> RoundFace | None:
    """The wall of a region that goes all the way round; None if it is too thin to be stated."""
    assert region.point is not None
    assert region.axis is not None
    if max(region.radii) < _THINNEST_MM:
        return None
    low, high = region.span
    radii = (1e-3 * region.radii[0], 1e-3 * region.radii[1])
    return RoundFace(region.name, 1e-3 * region.point, region.axis, (1e-3 * low, 1e-3 * high), radii, region.hole)


def flat_face(raw: RawSolid, region: Region) -> Face | None:
    """A flat region with its holes; its ends of round walls are polygons inside of it, within 0.005 mm.

    None if it has no single outline.
    """
    assert region.normal is not None
    assert region.point is not None
    n = region.normal
    u = np.eye(3)[int(np.abs(n).argmin())]
    u = u - (u @ n) * n
    u /= np.linalg.norm(u)
    flat = np.array([u, np.cross(n, u)])
    d = float(n @ region.point)
    outlines: list[Array] = []
    holes: list[Array] = []
    for corners, beside in _loops(raw, region):
        area = _area(raw.mesh.corners[corners] @ flat.T)
        ring = _circle(raw, region, beside, area < 0.0)
        points = 1e-3 * (raw.mesh.corners[corners] if ring is None else ring)
        kept = straightened(points @ flat.T)
        if area * _area(kept) < 0.0:
            kept = kept[::-1]
        if len(kept) >= 3:
            (outlines if area > 0.0 else holes).append(kept @ flat + 1e-3 * d * n)
    return Face(region.name, outlines[0], tuple(holes)) if len(outlines) == 1 else None


def _area(ring: Array) -> float:
    x, y = (ring - ring[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def _loops(raw: RawSolid, region: Region) -> Iterator[tuple[Any, set[int]]]:
    """The borders of a region: corners in their order, and the regions on the other side."""
    mesh = raw.mesh
    of = np.full(len(mesh.triangles), -1)
    for k, each in enumerate(raw.regions):
        of[each.triangles] = k
    mine = np.zeros(len(mesh.triangles), dtype=bool)
    mine[region.triangles] = True
    i, k = mesh.neighbours.T
    forth = mine[i] & ~mine[k]
    back = mine[k] & ~mine[i]
    edges = np.concatenate([mesh.edges[forth], mesh.edges[back][:, ::-1]]).tolist()
    others = np.concatenate([of[k[forth]], of[i[back]]]).tolist()
    after: dict[int, list[tuple[int, int]]] = {}
    for (a, b), other in zip(edges, others, strict=True):
        after.setdefault(a, []).append((b, other))
    while after:
        start = at = min(after)
        corners = []
        beside = set()
        while True:
            b, other = after[at].pop()
            if not after[at]:
                del after[at]
            corners.append(at)
            beside.add(other)
            at = b
            if at == start or at not in after:
                break
        yield np.array(corners), beside


def _circle(raw: RawSolid, region: Region, beside: set[int], hole: bool) -> Array | None:
    """A border that is the whole end of a round wall, as a finer polygon than the mesh has, [mm]."""
    if len(beside) != 1:
        return None
    wall = raw.regions[beside.pop()]
    if not wall.square or wall.axis is None or wall.point is None or region.normal is None or region.point is None:
        return None
    height = float((region.point - wall.point) @ region.normal / (wall.axis @ region.normal))
    r = float(wall.radius_at(height))
    n = max(sides_of(1e-3 * max(wall.radii)), COARSE_SIDES)
    angle = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    x, y = wall.across
    reach = r / np.cos(np.pi / n) if hole else r
    ring = wall.point + height * wall.axis + reach * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), y))
    return np.asarray(ring)
