"""Convex pieces as geoms of MuJoCo: boxes and cylinders as what they are, everything else as the mesh of its corners.

MuJoCo moves and turns a mesh into the frame of its own inertia, and a geom's pose undoes that: corners that are given
in the frame of the part are found there again, where the geom has no pose of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.convex import all_boxes
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.solid import Piece, Solid

ROLLING_CONDIM = 6
"""Of contacts of a cylinder: without friction of rolling, one that lies on a box begins to roll by itself."""
_GRIPPY = 0.8
"""A part of less sliding friction is smooth; the pads' friction is meant on one of so much."""
SMOOTH_PRIORITY = 2
"""Of a smooth part, over that of pads, 1: its own friction counts wherever it touches anything. Otherwise it would be
the pads', or the larger of the two."""
_PADS_CONDIM = 4
"""Of contacts with pads: torsional friction, too."""
MESH_INERTIA = "convex"
"""Corners are all that is said of a mesh."""
_SHAPE = ("name", "type", "pos", "size", "zaxis", "mesh")


def geom_attributes(piece: Piece, prefix: str = "") -> Mapping[str, Any]:
    """What MJCF says of the geom of a piece; a mesh has the name of the piece behind the prefix."""
    if not isinstance(piece, Hull):
        return {"pos": piece.center, "size": piece.half}
    if piece.cylinder is None:
        return {"type": "mesh", "mesh": prefix + piece.name}
    center, axis, radius, half_length = piece.cylinder
    size = np.array([radius, half_length])
    return {"type": "cylinder", "pos": center, "size": size, "zaxis": axis, "condim": ROLLING_CONDIM}


def mesh_pieces(pieces: Iterable[Piece]) -> tuple[Hull, ...]:
    """The pieces that become meshes."""
    return tuple(piece for piece in pieces if isinstance(piece, Hull) and piece.cylinder is None)


def inertial_attributes(solid: Solid, density: float) -> Mapping[str, Any]:
    """What MJCF says of the mass of a part: that of the nominal solid; of boxes alone nothing, they are their own mass.

    Args:
        density: [kg/m^3].
    """
    if solid.inertia is None or all_boxes(solid.pieces):
        return {}
    J: Array = density * solid.inertia
    moments = np.concatenate([np.diag(J), J[[0, 0, 1], [1, 2, 2]]])
    return {"pos": solid.centroid, "mass": density * solid.volume, "fullinertia": moments}


def dress(model: Any, solid: Solid, pieces: Mapping[str, Iterable[Piece]], density: float) -> None:
    """Give the geoms of a part, in PyMJCF, the shapes of its pieces, and the part its mass.

    Args:
        pieces: By the name of the geom in the part file. The first of them is that geom, others become geoms like it.
    """
    geoms = {name: model.find("geom", name) for name in pieces}
    for mesh in {id(geom.mesh): geom.mesh for geom in geoms.values() if geom.mesh is not None}.values():
        mesh.remove()
    for hull in mesh_pieces(piece for several in pieces.values() for piece in several):
        model.asset.add("mesh", name=hull.name, vertex=hull.corners.ravel(), inertia=MESH_INERTIA)
    body = model.worldbody.body[0]
    for name, (first, *others) in pieces.items():
        geom = geoms[name]
        said = {key: value for key, value in geom.get_attributes().items() if key not in _SHAPE}
        for piece in others:
            body.add("geom", **{**said, "name": piece.name, **geom_attributes(piece)})
        if isinstance(first, Hull):
            geom.pos = geom.size = geom.zaxis = None
        for key, value in geom_attributes(first).items():
            setattr(geom, key, value)
    if inertial := inertial_attributes(solid, density):
        body.add("inertial", **inertial)
    _let_slide(model)


def _let_slide(model: Any) -> None:
    """Give geoms of a smooth part priority, so that their own friction counts."""
    usual = model.default.geom.friction
    for geom in model.find_all("geom"):
        friction = usual if geom.friction is None else geom.friction
        if friction is not None and friction[0] < _GRIPPY:
            geom.priority = SMOOTH_PRIORITY
            geom.condim = geom.condim or _PADS_CONDIM
