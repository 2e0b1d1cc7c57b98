"""Make convex pieces geoms of MuJoCo.

Boxes and cylinders stay what they are; everything else becomes the mesh of its corners.

MuJoCo moves and turns a mesh into the frame of its own inertia, and the pose of the geom undoes that: corners in the
frame of the part are found there again, where the geom has no pose.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import mujoco
import numpy as np

from apo_bench.geometry import Array, Hull, Piece, Solid, all_boxes
from apo_bench.simulation.scene.contact_bits import Bits, is_lining

_ROLLING_CONDIM = 6
"""Of contacts of a cylinder: without friction of rolling, one that lies on a box begins to roll by itself."""
_GRIPPY = 0.8
"""A part of less sliding friction is smooth; the pads' friction is meant on one of so much."""
SMOOTH_PRIORITY = 2
"""Of a smooth part, over that of pads, 1: its own friction counts wherever it touches anything. Otherwise it would be
the pads', or the larger of the two."""
_PADS_CONDIM = 4
"""Of contacts with pads: torsional friction, too."""
_SURFACE = ("friction", "density", "rgba", "condim")
"""What a geom has but its shape."""


def add_pieces(spec: Any, body: Any, pieces: Iterable[Piece], surface: Mapping[str, Any], prefix: str = "") -> None:
    """Give a body a geom for each piece."""
    for piece in pieces:
        set_shape(spec, body.add_geom(name=prefix + piece.name, **surface), piece)


def set_shape(spec: Any, geom: Any, piece: Piece) -> None:
    """Give a geom the shape of a piece; the mesh of its corners, where it needs one, is called like the geom."""
    if not isinstance(piece, Hull):
        geom.type = mujoco.mjtGeom.mjGEOM_BOX
        geom.pos = piece.center
        geom.size = piece.half
    elif piece.cylinder is None:
        # corners are all that is known of a mesh, so its inertia is that of their hull
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
    """Give a body the mass of the nominal solid; one of boxes alone is its own mass.

    Args:
        density: [kg/m^3].
    """
    if solid.inertia is None or all_boxes(solid.pieces):
        return
    J: Array = density * solid.inertia
    body.ipos = solid.centroid
    body.mass = density * solid.volume
    body.fullinertia = np.concatenate([np.diag(J), J[[0, 0, 1], [1, 2, 2]]])
    body.explicitinertial = True


def dress(
    spec: Any, solid: Solid, pieces: Mapping[str, Iterable[Piece]], density: float, bits: Mapping[str, Bits]
) -> None:
    """Give the geoms of a part, as its file was read, the shapes of its pieces, and the part its mass.

    Walls of holes that not everything meets are a body of their own, fixed in the part: MuJoCo passes over it as one.

    Args:
        pieces: By the name of the geom in the part file, which is that of one of them, or goes; others become geoms
            like it.
        bits: By the name of a piece, what it meets.
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
