"""Volume, centroid and inertia of a solid whose round faces are as fitted, not as tessellated."""

import numpy as np

from apo_bench.cad.pieces.corners import mesh_of
from apo_bench.cad.pieces.cutting import Cut
from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, Region
from apo_bench.geometry import Array
from apo_bench.parts.making.moments import Moments


def solid_moments(raw: RawSolid, cut: Cut) -> Moments:
    """[m]: of the mesh and what lies between its strips and walls that pieces are rebuilt for.

    Where pieces stand for free shapes, of the pieces; where there are other curved faces, as the file has it. It is not
    asked of flat and round solids: a kernel integrates faces that are trimmed badly up to a hundredth wrong.
    """
    if cut.hulls:
        moments = _mesh_moments(_union(cut))
    elif raw.moments is not None and not all(r.kind == "plane" or r.square for r in raw.regions):
        moments = raw.moments
    else:
        moments = _mesh_moments(raw.mesh)
        for region in raw.regions:
            if region.square:
                moments = moments.plus(_behind_strips(raw, region))
    return Moments(1e-9 * moments.size, 1e-12 * moments.first, 1e-15 * moments.second)


def _union(cut: Cut) -> Mesh:
    """The pieces as one mesh, [mm]."""
    import manifold3d

    pieces = [manifold3d.Manifold.hull_points(1e3 * piece.corners) for piece in cut.pieces]
    return mesh_of(manifold3d.Manifold.batch_boolean(pieces, manifold3d.OpType.Add))


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
    high = np.zeros(len(strips))
    low = np.zeros(len(strips))
    np.maximum.at(high, np.repeat(of, 3), off)
    np.minimum.at(low, np.repeat(of, 3), off)
    span = high - low
    # Behind a strip lies a segment of a circle, r^2 (span - sin span) / 2, times its length along the axis.
    r = region.radius_at(height)
    chord = np.maximum(2.0 * r * np.sin(span / 2.0), 1e-300)
    tall = areas / chord / np.sqrt(1.0 + region.slope**2)
    sizes = (-1.0 if region.hole else 1.0) * tall * r**2 / 2.0 * (span - np.sin(span))
    # The centroid of a thin segment of height h is 0.4 h from its chord c. It is put at 0.6 h: so x x^T about the axis
    # has the spread across the strip, too, as 2 r 0.2 h = c^2 / 20 with c^2 = 8 r h. On a whole turn x adds up to 0.
    out = centers - region.point - height[:, None] * region.direction
    at: Array = centers + out * ((0.4 * distance + 0.6 * r) / np.maximum(distance, 1e-300) - 1.0)[:, None]
    along = (tall**2 / 12.0) @ sizes * np.outer(region.direction, region.direction)
    return Moments(float(sizes.sum()), sizes @ at, np.einsum("s,sa,sb->ab", sizes, at, at) + along)
