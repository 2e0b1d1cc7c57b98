"""Convert convex pieces of parts to MuJoCo geoms.

Boxes and cylinders keep their type; all other pieces become meshes of their corners. MuJoCo moves a mesh into the frame
of its own inertia, and the pose of the geom undoes that. So corners in the part frame stay there if the geom has no
pose.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import mujoco
import numpy as np

from apo_bench.geometry import Array, Hull, Piece, Solid, all_boxes
from apo_bench.simulation.scene.contact_bits import Bits, is_lining

_ROLLING_CONDIM = 6
"""For cylinders: without rolling friction, one that lies on a box starts to roll by itself."""
_GRIPPY = 0.8
"""Sliding friction below which a part is smooth; the friction of pads is stated against a part with this value."""
SMOOTH_PRIORITY = 2
"""Geom priority of a smooth part, above that of pads (1).

Its own friction then counts in all contacts, rather than the pads' or the larger of both.
"""
_PADS_CONDIM = 4
"""For contacts with pads: sliding and torsional friction."""
_SURFACE = ("friction", "density", "rgba", "condim")
"""Attributes of a geom that do not depend on its shape."""


def add_pieces(spec: Any, body: Any, pieces: Iterable[Piece], surface: Mapping[str, Any], prefix: str = "") -> None:
    """Add a geom to a body for each piece.

    Args:
        surface: Attributes of the geoms, such as friction.
        prefix: Of the names of the geoms.
    """
    for piece in pieces:
        set_shape(spec, body.add_geom(name=prefix + piece.name, **surface), piece)


def set_shape(spec: Any, geom: Any, piece: Piece) -> None:
    """Give a geom the shape of a piece; if that needs a mesh of the corners, the mesh is named like the geom."""
    if not isinstance(piece, Hull):
        geom.type = mujoco.mjtGeom.mjGEOM_BOX
        geom.pos = piece.center
        geom.size = piece.half
    elif piece.cylinder is None:
        # A mesh has corners only, so its inertia is that of their convex hull.
        convex = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        spec.add_mesh(name=geom.name, uservert=piece.corners.ravel(), inertia=convex)
        geom.type = mujoco.mjtGeom.mjGEOM_MESH
        geom.meshname = geom.name
        geom.pos = np.zeros(3)
        geom.size = np.zeros(3)
    else:
        center, axis, radius, half_length = piece.cylinder
        geom.type = mujoco.mjtGeom.mjGEOM_CYLINDER
        geom.pos = center
        geom.size = (radius, half_length, 0.0)
        geom.alt.type = mujoco.mjtOrientation.mjORIENTATION_ZAXIS
        geom.alt.zaxis = axis
        geom.condim = _ROLLING_CONDIM


def set_mass(body: Any, solid: Solid, density: float) -> None:
    """Give a body mass and inertia of the nominal solid; a solid of boxes keeps those of its geoms.

    Args:
        density: [kg/m^3].
    """
    if solid.inertia is None or all_boxes(solid.pieces):
        return
    J: Array = density * solid.inertia
    body.ipos = solid.centroid
    body.mass = density * solid.volume
    body.fullinertia = np.concatenate([np.diag(J), J[[0, 0, 1], [1, 2, 2]]])  # order: xx, yy, zz, xy, xz, yz
    body.explicitinertial = True


def dress(
    spec: Any, solid: Solid, pieces: Mapping[str, Iterable[Piece]], density: float, bits: Mapping[str, Bits]
) -> None:
    """Give the geoms of a part file the shapes of the simulated pieces, and the part its mass.

    Walls that some pieces do not collide with go to a child body fixed in the part, which MuJoCo's broad phase skips as
    one.

    Args:
        pieces: Name of a geom in the part file -> the pieces that replace it. The piece of the same name takes the
            geom; others become new geoms like it; without such a piece the geom is deleted.
        bits: Contact bits by the name of a piece.
    """
    body = spec.worldbody.bodies[0]
    lining = body.add_body(name=f"{body.name}_lining") if any(map(is_lining, bits.values())) else body
    pictures = {geom.meshname for geom in spec.geoms if geom.name not in pieces}
    for mesh in spec.meshes:
        if mesh.name not in pictures:
            spec.delete(mesh)
    for name, several in pieces.items():
        geom = spec.geom(name)
        surface = {key: np.array(getattr(geom, key)) for key in _SURFACE} | {"group": geom.group}
        own = [piece for piece in several if piece.name == name and not is_lining(bits[name])]
        for piece in own:
            set_shape(spec, geom, piece)
        if not own:
            spec.delete(geom)
        others = [piece for piece in several if piece not in own]
        add_pieces(spec, body, [piece for piece in others if not is_lining(bits[piece.name])], surface)
        add_pieces(spec, lining, [piece for piece in others if is_lining(bits[piece.name])], surface | {"mass": 0.0})
    set_mass(body, solid, density)
    for geom in dict.fromkeys((*body.geoms, *lining.geoms)):
        if geom.name in bits:
            geom.contype, geom.conaffinity = bits[geom.name]
        if geom.friction[0] < _GRIPPY:
            geom.priority = SMOOTH_PRIORITY
            geom.condim = max(geom.condim, _PADS_CONDIM)
