"""Volume, centroid and inertia of a solid whose round faces are as fitted, not as tessellated."""

import numpy as np

from apo_bench.cad.cutting import Cut
from apo_bench.cad.raw import Mesh, RawSolid, Region
from apo_bench.geometry.arrays import Array
from apo_bench.parts.making.moments import Moments


def matter(raw: RawSolid, cut: Cut) -> Moments:
    """[m]: of the mesh and what lies between its strips and walls that pieces are rebuilt for.

    Where pieces stand for free shapes, of the pieces; where there are other curved faces, as the file has it. It is not
    asked of flat and round solids: a kernel integrates faces that are trimmed badly up to a hundredth wrong.
    """
    if cut.hulls:
        found = mesh_moments(_union(cut))
    elif raw.moments is not None and not all(r.kind == "plane" or r.square for r in raw.regions):
        found = raw.moments
    else:
        found = mesh_moments(raw.mesh)
        for region in raw.regions:
            if region.square:
                found = found.plus(_behind_strips(raw, region))
    return Moments(1e-9 * found.size, 1e-12 * found.first, 1e-15 * found.second)


def _union(cut: Cut) -> Mesh:
    """The pieces as one mesh, [mm]."""
    import manifold3d

    pieces = [manifold3d.Manifold.hull_points(1e3 * piece.corners) for piece in cut.pieces]
    raw = manifold3d.Manifold.batch_boolean(pieces, manifold3d.OpType.Add).to_mesh64()
    return Mesh(np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts).astype(np.int64))


def mesh_moments(mesh: Mesh) -> Moments:
    """[mm]."""
    middle = mesh.corners.mean(axis=0)
    points = mesh.corners[mesh.triangles] - middle
    sizes = (points[:, 0] * np.cross(points[:, 1], points[:, 2])).sum(axis=1) / 6.0
    total = points.sum(axis=1)
    first = sizes @ total / 4.0
    second = (np.einsum("t,tia,tib->ab", sizes, points, points) + np.einsum("t,ta,tb->ab", sizes, total, total)) / 20.0
    return Moments(float(sizes.sum()), first, second).moved(np.eye(3), middle)


def _behind_strips(raw: RawSolid, region: Region) -> Moments:
    """Between chords and arcs of one round face; negative for a hole."""
    assert region.axis is not None
    assert region.point is not None
    mesh = raw.mesh
    weight = np.linalg.norm(mesh.across[region.triangles], axis=1) / 2.0
    strips, of = np.unique(raw.facets[region.triangles], return_inverse=True)
    areas = np.bincount(of, weight)
    centers = np.stack(
        [
            np.bincount(of, weight * mesh.corners[mesh.triangles[region.triangles]].mean(axis=1)[:, k]) / areas
            for k in range(3)
        ],
        axis=1,
    )
    height, distance, middle = region.polar(centers)
    _, far, angle = region.polar(mesh.corners[mesh.triangles[region.triangles]].reshape(-1, 3))
    off = (angle - middle[np.repeat(of, 3)] + np.pi) % (2.0 * np.pi) - np.pi
    off = np.where(far < 1e-9 + 1e-6 * max(region.radii), 0.0, off)
    span = np.zeros(len(strips))
    low = np.zeros(len(strips))
    np.maximum.at(span, np.repeat(of, 3), off)
    np.minimum.at(low, np.repeat(of, 3), off)
    span = span - low
    r = region.radius_at(height)
    chord = np.maximum(2.0 * r * np.sin(span / 2.0), 1e-300)
    tall = areas / chord / np.sqrt(1.0 + region.slope**2)
    sizes = (-1.0 if region.hole else 1.0) * tall * r**2 / 2.0 * (span - np.sin(span))
    out = centers - region.point - height[:, None] * region.axis
    at: Array = centers + out * ((0.4 * distance + 0.6 * r) / np.maximum(distance, 1e-300) - 1.0)[:, None]
    along = (tall**2 / 12.0) @ sizes * np.outer(region.axis, region.axis)
    return Moments(float(sizes.sum()), sizes @ at, np.einsum("s,sa,sb->ab", sizes, at, at) + along)
