"""How much of one face covers another, and where: the corners at which a contact is measured (Fig. 1)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.polygon import find_corners
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

    def __bool__(self) -> bool:
        return self.area > 0.0


NO_OVERLAP = Overlap(np.zeros((0, 3)), 0.0)


class FacePair(NamedTuple):
    """A face that is laid on another one."""

    face: Face
    """In the frame of its solid."""
    T_face: Array
    """World pose of that solid, (4, 4), [m]."""
    on: Face
    """The face on whose plane the overlap lies, in the frame of its solid."""
    T_on: Array
    """World pose of that solid, (4, 4), [m]."""


def compute_overlaps(laid: Sequence[FacePair]) -> list[Overlap]:
    """Project faces along the normals of others onto their planes and clip them there (Section 2.2, Fc of Fig. 1).

    Concave outlines, holes and several pieces are allowed. How far the planes are apart does not matter. One call for
    many pairs of faces takes a tenth of the time of as many calls.

    Returns:
        For each pair the overlap; nothing, if the faces only touch along an edge or the upper one is observed edge-on.
    """
    import shapely

    common = _intersect(laid)
    # Every ring of every piece, in turn: the last point of a ring is the first one once more.
    rings, piece = shapely.get_rings(common.pieces, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    once = np.append(ring[1:] == ring[:-1], False)[: len(ring)]
    points, ring = points[once], ring[once]
    kept = find_corners(points, ring)
    points, owner = points[kept], common.owners[piece[ring[kept]]]
    T = np.array([T_on @ make_plane_frame(on) for _, _, on, T_on in laid]).reshape(-1, 4, 4)[owner]
    corners = (T[:, :3, :2] @ points[:, :, None])[:, :, 0] + T[:, :3, 3]
    corners.setflags(write=False)
    ends = np.searchsorted(owner, np.arange(len(laid) + 1))
    return [
        Overlap(corners[ends[i] : ends[i + 1]], area, shape) if area > 0.0 else NO_OVERLAP
        for i, (area, shape) in enumerate(zip(common.areas.tolist(), common.shapes, strict=True))
    ]


def compute_overlap(face: Face, T_face: Array, on: Face, T_on: Array) -> Overlap:
    """The overlap of one pair of faces; the arguments are those of `FacePair`."""
    return compute_overlaps([FacePair(face, T_face, on, T_on)])[0]


def compute_overlap_area(face: Face, T_face: Array, on: Face, T_on: Array) -> float:
    """The area of `overlap` alone, [m^2]."""
    return float(_intersect([FacePair(face, T_face, on, T_on)]).areas[0])


def compute_shares(reached: Sequence[Overlap], true: Sequence[Overlap]) -> Array:
    """How much of each true overlap is covered by the one that was reached on the same lower face, (k,), 0 to 1.

    1 where the true one is empty.
    """
    import shapely

    whole = np.array([of.area for of in true])
    shapes = (np.array([of.shape for of in each], dtype=object) for each in (reached, true))
    covered = np.nan_to_num(shapely.area(shapely.intersection(*shapes)))
    return np.divide(covered, whole, out=np.ones(len(whole)), where=whole > 0.0)


def measure_lateral_gap(face: Face, T_face: Array, on: Face, T_on: Array) -> float:
    """How far `face`, projected onto the plane of `on`, lies off it, [m]; 0 if one covers some of the other."""
    return float(_project([face], (_into_plane(on) @ pose.inverse(T_on) @ T_face)[None])[0].distance(flatten_face(on)))


@lru_cache(maxsize=4096)
def measure_face_area(face: Face) -> float:
    """The area of a face without its holes, [m^2]."""
    return float(flatten_face(face).area)


class _Common(NamedTuple):
    """What pairs of faces cover of each other, in the planes of the lower ones."""

    shapes: NDArray[np.object_]
    """(k,) shapely geometries; None of faces observed edge-on."""
    areas: Array
    """(k,), without slivers, [m^2]."""
    pieces: NDArray[np.object_]
    """(p,) shapely polygons, all but slivers, in the order of the pairs."""
    owners: NDArray[np.intp]
    """(p,), the pair that each piece belongs to."""


def _intersect(laid: Sequence[FacePair]) -> _Common:
    import shapely

    # Everything in the plane of `on`, z along its normal: there dropping heights projects along the normal.
    T_ons = np.array([each.T_on for each in laid]).reshape(-1, 4, 4)
    T_faces = np.array([each.T_face for each in laid]).reshape(-1, 4, 4)
    T = np.array([_into_plane(each.on) for each in laid]).reshape(-1, 4, 4) @ (pose.inverse(T_ons) @ T_faces)
    normals = np.array([each.face.normal for each in laid]).reshape(-1, 3)
    seen = (np.abs((T[:, 2, :3] * normals).sum(axis=1)) >= _EDGE_ON).nonzero()[0]
    shapes = np.full(len(laid), None, dtype=object)
    lower = np.array([flatten_face(laid[i].on) for i in seen], dtype=object)
    shapes[seen] = shapely.intersection(_project([laid[i].face for i in seen], T[seen]), lower)
    pieces, owners = shapely.get_parts(shapes, return_index=True)
    areas = shapely.area(pieces)
    whole = (shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON) & (areas > SLIVER_M2)
    sums = np.bincount(owners[whole], areas[whole], len(laid)).astype(np.float64)
    return _Common(shapes, sums, pieces[whole], owners[whole])


def _project(faces: Sequence[Face], T: Array) -> NDArray[np.object_]:
    """Faces, as shapely polygons, in the plane z = 0 after poses T, (k, 4, 4): heights are dropped."""
    import shapely

    rings = [_rings(face) for face in faces]
    points = np.concatenate([np.zeros((0, 3)), *(points for points, _ in rings)])
    owner = np.repeat(np.arange(len(faces)), [len(points) for points, _ in rings])
    T = T[owner]
    flat = (T[:, :2, :3] @ points[:, :, None])[:, :, 0] + T[:, :2, 3]
    sizes = [sizes for _, sizes in rings]
    ring = np.repeat(np.arange(sum(map(len, sizes))), [size for of in sizes for size in of])
    of_face = np.repeat(np.arange(len(faces)), [len(of) for of in sizes])
    return np.asarray(shapely.polygons(shapely.linearrings(flat, indices=ring), indices=of_face))


@lru_cache(maxsize=4096)
def _rings(face: Face) -> tuple[Array, tuple[int, ...]]:
    """The corners of the outline and of each hole, one after the other, (k, 3), and how many each has."""
    rings = (face.outline, *face.holes)
    return np.concatenate(rings), tuple(map(len, rings))


@lru_cache(maxsize=4096)
def flatten_face(face: Face) -> Any:
    """The face in its own plane, a shapely polygon."""
    return _project([face], _into_plane(face)[None])[0]


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
