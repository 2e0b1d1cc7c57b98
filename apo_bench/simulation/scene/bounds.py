"""What a piece of a round part keeps to: a plane that a wall of a hole is behind, a cylinder that a shaft is inside of.

A shaft in its hole is near all of the walls around it, and touches few of them. One plane and one cylinder say of most
pairs that they are apart, long before a general measure of convex pieces does.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from apo_bench.geometry import Array, Hull, Piece, RoundFace, Solid, frozen, pose, remembered
from apo_bench.simulation.frames import frame, rotation
from apo_bench.simulation.scene.walls import simulated_pieces

_NO_PLANE = np.zeros(4)
_NO_CYLINDER = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0])
"""The normal of no plane has no length, the radius of no cylinder is negative."""
NO_BOUNDS = np.empty((0, 12))
"""Of a model in which they would not help."""
_NEAREST_M = 3e-5
"""Corners of a wall that are so much farther from the hole than its nearest ones are not on its inner side."""
_ROUNDED_M = 2e-8
"""MuJoCo keeps corners in single precision."""


def bounds_of(model: Any, solids: Mapping[str, Solid], clearance_m: float) -> Array:
    """Plane and cylinder of each geom of a model, in its own frame, (geoms, 12); `NO_BOUNDS` without round holes.

    The plane is (n, d): all of the piece has n . x >= d. The cylinder is its middle, its axis, radius and half length.
    """
    if not any(face.hole for solid in solids.values() for face in solid.rounds.values()):
        return NO_BOUNDS
    table = np.tile(np.concatenate([_NO_PLANE, _NO_CYLINDER]), (model.ngeom, 1))
    for part, solid in solids.items():
        if solid.rounds:
            for name, bounds in _of_pieces(solid, clearance_m).items():
                geom = model.geom(f"{part}/{name}")
                table[geom.id] = _seen_from(frame(rotation(geom.quat), geom.pos), bounds)
    return table


@remembered
def _of_pieces(solid: Solid, clearance_m: float) -> Mapping[str, Array]:
    """Name of a piece as it is simulated -> plane and cylinder, (12,), in the frame of the part."""
    sides = [face for face in solid.rounds.values() if face.kind != "rim"]
    holes = [face for face in sides if face.hole]
    shafts = [face for face in sides if not face.hole]
    pieces = [piece for several in simulated_pieces(solid, clearance_m).values() for piece in several]
    return {p.name: frozen(np.concatenate([_plane(p, holes), _cylinder(p, shafts)]), 12) for p in pieces}


def _plane(piece: Piece, holes: Iterable[RoundFace]) -> Array:
    """The plane on the inner side of a wall, towards the hole that it is nearest to."""
    closest = np.inf
    plane = _NO_PLANE
    for face in holes:
        along, across = _about(face, piece.corners)
        # A cone of slope k is at radius r + k z; what is behind it has a greater radius by
        beyond = np.linalg.norm(across, axis=1) - face.slope * along
        room = abs(float(beyond.min()) - (face.radii[0] - face.slope * face.span[0]))
        u = across[beyond < beyond.min() + _NEAREST_M].mean(axis=0)
        if room < closest and u.any():
            closest = room
            n = u / np.linalg.norm(u) - face.slope * face.axis
            n /= np.linalg.norm(n)
            plane = np.append(n, (piece.corners @ n).min() - _ROUNDED_M)
    return plane


def _cylinder(piece: Piece, shafts: Iterable[RoundFace]) -> Array:
    """The narrowest cylinder about the axis of a shaft that a piece is inside of, no wider than the shaft."""
    if isinstance(piece, Hull) and piece.cylinder is not None:
        center, axis, radius, half_length = piece.cylinder
        return np.array([*center, *axis, radius, half_length])
    cylinder = _NO_CYLINDER
    for face in shafts:
        along, across = _about(face, piece.corners)
        radius = float(np.linalg.norm(across, axis=1).max()) + _ROUNDED_M
        if radius < max(face.radii) + _NEAREST_M and not 0.0 < cylinder[6] <= radius:
            low = float(along.min())
            high = float(along.max())
            middle = face.point + (low + high) / 2 * face.axis
            cylinder = np.array([*middle, *face.axis, radius, (high - low) / 2 + _ROUNDED_M])
    return cylinder


def _about(face: RoundFace, points: Array) -> tuple[Array, Array]:
    """How far points are along the axis of a face, (k,), and where they are across it, (k, 3), [m]."""
    off = points - face.point
    along = off @ face.axis
    return along, off - along[:, None] * face.axis


def _seen_from(T_part_geom: Array, bounds: Array) -> Array:
    """Plane and cylinder of a part in the frame of one of its geoms, (12,)."""
    R = T_part_geom[:3, :3]
    n = bounds[:3] @ R
    d = bounds[3] - bounds[:3] @ T_part_geom[:3, 3]
    middle = pose.apply(pose.inverse(T_part_geom), bounds[None, 4:7])[0]
    return np.array([*n, d, *middle, *(bounds[7:10] @ R), *bounds[10:]])
