"""Surface mesh of a part: the union of its convex pieces as one closed mesh."""

from collections.abc import Iterable
from typing import Any

from apo_bench.geometry.solid import Box, Piece


def build_union_mesh(pieces: Iterable[Piece]) -> Any:
    """Return a `trimesh.Trimesh` of the union; where the surface touches itself, vertices are not merged."""
    import manifold3d
    import trimesh

    bodies = [
        manifold3d.Manifold.cube(2.0 * piece.half, center=True).translate(piece.center)
        if isinstance(piece, Box)
        else manifold3d.Manifold.hull_points(piece.corners)
        for piece in pieces
    ]
    mesh = manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add).to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)
