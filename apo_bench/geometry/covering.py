"""How much of one face covers another, and where: the corners at which a contact is measured (Fig. 1)."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, final

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, freeze
from apo_bench.geometry.polygon import list_polygons, list_rings, straighten
from apo_bench.geometry.solid import Face

_EDGE_ON = 1e-6
"""Cosine between the normals below which a face is observed edge-on and covers nothing."""
SLIVER_M2 = 1e-12
"""Pieces smaller than this, (0.001 mm)^2, are rounding, not overlap."""


@final
@dataclass(frozen=True, eq=False)
class Overlap:
    """What is left of a face when another one is laid on it along the normal."""

    corners: Array
    """Every corner of every piece, of holes too, (k, 3), world, [m], on the plane of the lower face; (0, 3) if none."""
    area: float
    """[m^2]."""
    shape: Any = None
    """The overlap as a shapely geometry in the frame of the lower face, so that overlaps on one face compare."""

    def __post_init__(self) -> None:
        freeze(self, corners=(None, 3))

    def share(self, of: "Overlap") -> float:
        """How much of another overlap on the same lower face this one covers, 0 to 1; 1 if that one is empty."""
        if not of:
            return 1.0
        return float(self.shape.intersection(of.shape).area / of.area) if self else 0.0

    def __bool__(self) -> bool:
        return self.area > 0.0


NO_OVERLAP = Overlap(np.zeros((0, 3)), 0.0)


def compute_overlap(face: Face, T_face: Array, on: Face, T_on: Array) -> Overlap:
    """Project `face` along the normal of `on` onto the plane of `on` and clip it there (Section 2.2, Fc of Fig. 1).

    Concave outlines, holes and several pieces are allowed. How far the planes are apart does not matter.

    Args:
        face: The face that is projected, in the frame of its solid.
        T_face: World pose of that solid, (4, 4), [m].
        on: The face on whose plane the overlap lies, in the frame of its solid.
        T_on: World pose of that solid, (4, 4), [m].

    Returns:
        The overlap; nothing, if the faces only touch along an edge or `face` is observed edge-on.
    """
    common, pieces = _common(face, T_face, on, T_on)
    if not pieces:
        return NO_OVERLAP
    flat = np.concatenate([straighten(ring) for piece in pieces for ring in list_rings(piece)])
    corners = pose.apply(T_on @ make_plane_frame(on), np.column_stack([flat, np.zeros(len(flat))]))
    return Overlap(corners, float(sum(piece.area for piece in pieces)), common)


def compute_overlap_area(face: Face, T_face: Array, on: Face, T_on: Array) -> float:
    """The area of `compute_overlap` alone, [m^2]."""
    return float(sum(piece.area for piece in _common(face, T_face, on, T_on)[1]))


def measure_lateral_gap(face: Face, T_face: Array, on: Face, T_on: Array) -> float:
    """How far `face`, projected onto the plane of `on`, lies off it, [m]; 0 if one covers some of the other."""
    return float(face_shape(face, _into_plane(on) @ pose.inverse(T_on) @ T_face).distance(flatten_face(on)))


@lru_cache(maxsize=4096)
def measure_face_area(face: Face) -> float:
    """The area of a face without its holes, [m^2]."""
    return float(flatten_face(face).area)


def _common(face: Face, T_face: Array, on: Face, T_on: Array) -> tuple[Any, list[Any]]:
    """What two faces cover of each other, in the plane of `on`, and its pieces without slivers."""
    # Everything in the plane of `on`, z along its normal: there dropping heights projects along the normal.
    T_on_face = pose.inverse(T_on) @ T_face
    if abs(on.normal @ T_on_face[:3, :3] @ face.normal) < _EDGE_ON:
        return None, []
    common = face_shape(face, _into_plane(on) @ T_on_face).intersection(flatten_face(on))
    return common, [piece for piece in list_polygons(common) if piece.area > SLIVER_M2]


@lru_cache(maxsize=4096)
def flatten_face(face: Face) -> Any:
    """The face in its own plane."""
    return face_shape(face, _into_plane(face))


@lru_cache(maxsize=4096)
def _into_plane(face: Face) -> Array:
    return pose.inverse(make_plane_frame(face))


@lru_cache(maxsize=4096)
def make_plane_frame(face: Face) -> Array:
    """A frame on the plane of the face, z along its normal, (4, 4), in the frame of its solid."""
    edges = np.roll(face.outline, -1, axis=0) - face.outline
    longest = edges[np.argmax(np.linalg.norm(edges, axis=1))]
    z = face.normal
    x = longest / np.linalg.norm(longest)
    return pose.rigid(np.column_stack([x, np.cross(z, x), z]), face.outline[0])


def face_shape(face: Face, T: Array) -> Any:
    """The face, as a shapely polygon, in the plane z = 0 after `T`: heights are dropped, a projection along z."""
    from shapely import linearrings, polygons

    holes = [linearrings(pose.apply(T, hole)[:, :2]) for hole in face.holes]
    return polygons(pose.apply(T, face.outline)[:, :2], holes or None)
