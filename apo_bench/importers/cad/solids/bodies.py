"""Convert meshes to manifold3d bodies and back."""

from typing import Any

import manifold3d
import numpy as np

from apo_bench.importers.cad.solids.mesh import Mesh

_FLAT = 1e-6
"""Corners within this distance of a flat face are left out inside it, as a share of the size."""


def convert_to_manifold(mesh: Mesh) -> Any:
    """Return a mesh as a body of manifold3d."""
    # Copies, as manifold3d takes no read-only arrays.
    corners = np.array(mesh.corners, order="C")
    return manifold3d.Manifold(manifold3d.Mesh64(corners, np.array(mesh.triangles, dtype=np.uint64, order="C")))


def convert_to_mesh(body: Any) -> Mesh:
    """Return a body of manifold3d as a mesh."""
    raw = body.to_mesh64()
    return Mesh(np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts).astype(np.int64))


def simplify_body(mesh: Mesh) -> Mesh:
    """Return a closed mesh without needless corners in its flat faces."""
    return convert_to_mesh(convert_to_manifold(mesh).simplify(_FLAT * mesh.extent))
