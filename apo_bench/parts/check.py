"""A second opinion on a solid: the mesh that manifold3d makes of its boxes, measured by trimesh."""

from __future__ import annotations

from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.overlap import face_area
from apo_bench.geometry.solid import Solid

_APART_M = 1e-8
"""The largest distance between the surfaces of the two; planes of boxes are one within a tenth of it."""


def check_solid(solid: Solid, file: str) -> None:
    """Raise an `InputError` unless the boxes make a closed mesh that the faces enclose, with this volume and centroid.

    Both packages are slow to import and are so only here.
    """
    mesh = _mesh(solid)
    if not mesh.is_watertight:
        raise InputError(
            f"{file}: the boxes make no closed solid; move apart, or into each other, what nearly touches."
        )
    room = _APART_M * float(mesh.area)
    reach = float(np.linalg.norm(np.diff(solid.bounds, axis=0)))
    enclosed = sum(face_area(face) * float(face.normal @ face.outline[0]) for face in solid.faces.values()) / 3.0
    for name, volume in (("of its cells", solid.volume), ("that its faces enclose", enclosed)):
        if abs(volume - mesh.volume) > room:
            raise InputError(
                f"{file}: the volume {name} is {1e9 * volume:.6g} mm^3, that of a mesh of the same boxes "
                f"{1e9 * mesh.volume:.6g}; move apart, or into each other, what nearly touches."
            )
    off = float(np.linalg.norm(mesh.center_mass - solid.centroid))
    if off * solid.volume > room * reach:
        raise InputError(f"{file}: the centroid is {1e3 * off:.3g} mm from that of a mesh of the same boxes.")


def _mesh(solid: Solid) -> Any:
    """The union of the boxes as a mesh; vertices stay apart where the surface touches itself."""
    import manifold3d
    import trimesh

    boxes = [manifold3d.Manifold.cube(2.0 * box.half, center=True).translate(box.center) for box in solid.pieces]
    mesh = manifold3d.Manifold.batch_boolean(boxes, manifold3d.OpType.Add).to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)
