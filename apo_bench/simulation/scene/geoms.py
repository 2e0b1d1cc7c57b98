"""Convex pieces as geoms of MuJoCo: boxes and cylinders as what they are, everything else as the mesh of its corners.

MuJoCo moves and turns a mesh into the frame of its own inertia, and a geom's pose undoes that: corners that are given
in the frame of the part are found there again, where the geom has no pose of its own.

Which pieces can meet: a wall of a hole, and what is narrow enough to come in there.

What is wider than a hole without its walls does not go in, and what is behind the walls holds it up: it need not be
measured against them one by one. It may dig in with an edge, by the thickness of the walls deeper than it would. All
that could go in, the arm, and walls that have nothing behind them meet as ever; walls do not meet walls.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.geometry import Array, Box, Hull, Piece, Solid, all_boxes
from apo_bench.simulation.scene.walls import linings, simulated_pieces

_ARM = 1
"""The bit by which an arm meets everything."""
OF_PARTS = (1 << 31) - 1 - _ARM
"""All other bits: what parts meet by."""
_PARTS = 1 << 30
"""The bit by which parts meet each other; those below it are of holes, the narrowest has the highest."""
_MOST = 16
"""So many widths of holes are told apart; wider ones count as one."""
_SURELY_M = 1e-4
"""What is wider than the hole without its walls by this stays out."""


class Bits(NamedTuple):
    """Two geoms meet if the `contype` of one and the `conaffinity` of the other have a bit in common."""

    contype: int
    conaffinity: int


def meetings(solids: Mapping[str, Solid], clearance_m: float) -> Mapping[str, Mapping[str, Bits]]:
    """Part -> name of a piece as it is simulated -> its bits."""
    lined = {part: linings(solid, clearance_m) for part, solid in solids.items()}
    widths = sorted({_rounded(width) for walls in lined.values() for width in walls.values()})
    return {
        part: {
            piece.name: _of_wall(lined[part][piece.name], widths) if piece.name in lined[part] else _of(piece, widths)
            for pieces in simulated_pieces(solid, clearance_m).values()
            for piece in pieces
        }
        for part, solid in solids.items()
    }


def is_lining(bits: Bits) -> bool:
    """Whether these are the bits of a wall that not all meets."""
    return not bits.contype & (_ARM | _PARTS)


def _of_wall(width: float, widths: list[float]) -> Bits:
    return Bits(_hole(widths.index(_rounded(width))), _ARM)


def _of(piece: Piece, widths: list[float]) -> Bits:
    if not widths:
        return Bits(_ARM, _ARM)
    narrow = widest_disc(piece)
    met = _ARM | _PARTS
    for i, width in enumerate(widths):
        if narrow <= width + _SURELY_M:
            met |= _hole(i)
    return Bits(_PARTS, met)


def _hole(i: int) -> int:
    return _PARTS >> (1 + min(i, _MOST - 1))


def _rounded(width: float) -> float:
    return round(width, 6)


def widest_disc(piece: Piece) -> float:
    """The radius of a flat disc inside of a piece, [m]: the piece does not go through a narrower hole.

    Of boxes and cylinders it is the widest, of other pieces the widest about their middle that is parallel to a side.
    """
    if isinstance(piece, Box):
        return float(np.sort(piece.half)[1])
    if piece.cylinder is not None:
        return piece.cylinder.radius
    # From the middle, along a plane of normal m, a side of normal n is at its distance / |n x m|.
    n = piece.planes[:, :3]
    far = piece.planes[:, 3] - n @ piece.corners.mean(axis=0)
    return float((far / np.sqrt(np.maximum(1.0 - (n @ n.T) ** 2, 1e-12))).min(axis=1).max())


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
"""What a geom has besides its shape."""


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
        # corners are all that is said of a mesh, so its inertia is that of their hull
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
