"""Regions become what a part file states: faces that can make contacts, and moments, [m]."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from apo_bench.cad.pieces.cutting import Cut
from apo_bench.cad.solids.bodies import mesh_of
from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, Region, square_to
from apo_bench.geometry import Array, Face, Hull, RoundFace, sides_of, straightened
from apo_bench.parts.making.moments import Moments
from apo_bench.parts.making.outline import COARSE_SIDES

_THINNEST_MM = 0.05


def contact_faces(raw: RawSolid) -> tuple[list[Face], list[RoundFace], dict[str, str]]:
    """Flat and round faces of the regions that have names; those that cannot be stated, with the reason."""
    flats: list[Face] = []
    rounds: list[RoundFace] = []
    refused: dict[str, str] = {}
    for region in raw.regions:
        if not region.name:
            continue
        if region.is_round and max(region.radii) < _THINNEST_MM:
            refused[region.name] = "it is too thin"
        elif region.is_round:
            span, radii = (1e-3 * np.array([region.span, region.radii])).tolist()
            point = 1e-3 * region.point
            rounds.append(RoundFace(region.name, point, region.direction, tuple(span), tuple(radii), region.hole))
        elif (face := _flat_face(raw, region)) is not None:
            flats.append(face)
        else:
            refused[region.name] = "it has more than one outline"
    return flats, rounds, refused


def _flat_face(raw: RawSolid, region: Region) -> Face | None:
    """A flat region with its holes; its ends of round walls are polygons inside of it, within 0.005 mm.

    None if it has no single outline.
    """
    n = region.direction
    flat = np.array(square_to(n))
    offset = 1e-3 * float(n @ region.point) * n
    outlines: list[Array] = []
    holes: list[Array] = []
    for corners, beside in _loops(raw, region):
        # The material is left of a border: outlines run counter-clockwise seen against n, holes the other way.
        area = _area(raw.mesh.corners[corners] @ flat.T)
        ring = _circle(raw, region, beside, area < 0.0)
        points = 1e-3 * (raw.mesh.corners[corners] if ring is None else ring)
        kept = straightened(points @ flat.T)
        if area * _area(kept) < 0.0:
            kept = kept[::-1]
        if len(kept) >= 3:
            (outlines if area > 0.0 else holes).append(kept @ flat + offset)
    return Face(region.name, outlines[0], tuple(holes)) if len(outlines) == 1 else None


def _area(ring: Array) -> float:
    """Of a polygon (k, 2), negative if it is clockwise."""
    x, y = (ring - ring[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def _loops(raw: RawSolid, region: Region) -> Iterator[tuple[Any, set[int]]]:
    """The borders of a region: corners in their order, and the regions on the other side."""
    mesh = raw.mesh
    of = np.full(len(mesh.triangles), -1)
    for k, each in enumerate(raw.regions):
        of[each.triangles] = k
    mine = np.isin(np.arange(len(mesh.triangles)), region.triangles)
    # Border edges as the triangle inside has them; an edge is directed as in the first of its two neighbours.
    i, k = mesh.neighbours.T
    forth = mine[i] & ~mine[k]
    back = mine[k] & ~mine[i]
    edges = np.concatenate([mesh.edges[forth], mesh.edges[back][:, ::-1]]).tolist()
    others = np.concatenate([of[k[forth]], of[i[back]]]).tolist()
    # From each corner to the next one, until a loop closes; a corner in which two loops touch has two ways on.
    after: dict[int, list[tuple[int, int]]] = {}
    for (a, b), other in zip(edges, others, strict=True):
        after.setdefault(a, []).append((b, other))
    while after:
        at = min(after)
        corners: list[int] = []
        beside = set()
        while at in after and at not in corners[:1]:
            corners.append(at)
            at, other = after[at].pop()
            beside.add(other)
            if not after[corners[-1]]:
                del after[corners[-1]]
        yield np.array(corners), beside


def _circle(raw: RawSolid, region: Region, beside: set[int], hole: bool) -> Array | None:
    """A border that is the whole end of a round wall, as a finer polygon than the mesh has, [mm]."""
    wall = raw.regions[beside.pop()]
    if beside or not wall.square:
        return None
    # Where the axis meets the plane; corners between those of the wall's pieces, for a hole on a circle around it.
    height = float((region.point - wall.point) @ region.direction / (wall.direction @ region.direction))
    r = float(wall.radius_at(height))
    n = max(sides_of(1e-3 * max(wall.radii)), COARSE_SIDES)
    angle = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    return wall.around(height, r / np.cos(np.pi / n) if hole else r, angle)


def solid_moments(raw: RawSolid, cut: Cut) -> Moments:
    """[m]: of the mesh and what lies between its strips and walls that pieces are rebuilt for.

    Of the pieces where these stand for free shapes, or fill holes; where there are other curved faces, as the file has
    it. It is not asked of flat and round solids: a kernel integrates faces that are trimmed badly up to a hundredth
    wrong.
    """
    if cut.hulls or cut.filled:
        return moments_of_pieces(cut.pieces)
    if raw.moments is not None and not all(r.kind == "plane" or r.square for r in raw.regions):
        moments = raw.moments
    else:
        moments = _mesh_moments(raw.mesh)
        for region in raw.regions:
            if region.square:
                moments = moments.plus(_behind_strips(raw, region))
    return moments.in_metres


def moments_of_pieces(pieces: Iterable[Hull]) -> Moments:
    """[m]: of what the pieces fill."""
    import manifold3d

    hulls = [manifold3d.Manifold.hull_points(1e3 * piece.corners) for piece in pieces]
    return _mesh_moments(mesh_of(manifold3d.Manifold.batch_boolean(hulls, manifold3d.OpType.Add))).in_metres


def _mesh_moments(mesh: Mesh) -> Moments:
    """[mm]: the sum of the tetrahedra from the middle to every triangle.

    Of a tetrahedron with one corner at the origin and the others a, b, c the volume is V = a . (b x c) / 6, the
    integral of x is V s / 4 and that of x x^T is V (a a^T + b b^T + c c^T + s s^T) / 20, with s = a + b + c.
    """
    middle = mesh.corners.mean(axis=0)
    points = mesh.corners[mesh.triangles] - middle
    sizes = (points[:, 0] * np.cross(points[:, 1], points[:, 2])).sum(axis=1) / 6.0
    total = points.sum(axis=1)
    first = sizes @ total / 4.0
    second = (np.einsum("t,tia,tib->ab", sizes, points, points) + np.einsum("t,ta,tb->ab", sizes, total, total)) / 20.0
    return Moments(float(sizes.sum()), first, second).moved(np.eye(3), middle)


def _behind_strips(raw: RawSolid, region: Region) -> Moments:
    """Between chords and arcs of one round face; negative for a hole."""
    corners = raw.mesh.corners[raw.mesh.triangles[region.triangles]]
    weight = np.linalg.norm(raw.mesh.across[region.triangles], axis=1) / 2.0
    strips, of = np.unique(raw.facets[region.triangles], return_inverse=True)
    areas = np.bincount(of, weight)
    middles = corners.mean(axis=1)
    centers = np.stack([np.bincount(of, weight * middles[:, k]) / areas for k in range(3)], axis=1)
    # The angle about the axis that each strip spans; a corner on the axis, the tip of a cone, has none.
    height, distance, middle = region.polar(centers)
    _, far, angle = region.polar(corners.reshape(-1, 3))
    off = (angle - middle[np.repeat(of, 3)] + np.pi) % (2.0 * np.pi) - np.pi
    off = np.where(far < 1e-9 + 1e-6 * max(region.radii), 0.0, off)
    reach = np.zeros((len(strips), 2))
    np.maximum.at(reach, np.repeat(of, 3), np.column_stack([off, -off]))
    span = reach.sum(axis=1)
    # Behind a strip lies a segment of a circle, r^2 (span - sin span) / 2, times its length along the axis.
    r = region.radius_at(height)
    tall = areas / np.maximum(2.0 * r * np.sin(span / 2.0), 1e-300) / np.sqrt(1.0 + region.slope**2)
    sizes = (-1.0 if region.hole else 1.0) * tall * r**2 / 2.0 * (span - np.sin(span))
    # The centroid of a thin segment of height h is 0.4 h from its chord c. It is put at 0.6 h: so x x^T about the axis
    # has the spread across the strip, too, as 2 r 0.2 h = c^2 / 20 with c^2 = 8 r h. On a whole turn x adds up to 0.
    out = centers - region.point - height[:, None] * region.direction
    at: Array = centers + out * ((0.4 * distance + 0.6 * r) / np.maximum(distance, 1e-300) - 1.0)[:, None]
    along = (tall**2 / 12.0) @ sizes * np.outer(region.direction, region.direction)
    return Moments(float(sizes.sum()), sizes @ at, np.einsum("s,sa,sb->ab", sizes, at, at) + along)
