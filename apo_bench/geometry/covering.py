"""Overlap of two flat faces: the area where one, projected onto the plane of the other, covers it (Fig. 1)."""

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
"""Cosine between two normals below which one face is edge-on to the other and covers nothing."""
SLIVER_M2 = 1e-12
"""Pieces of overlap smaller than this, (0.001 mm)^2, are rounding, [m^2]."""


@final
@dataclass(frozen=True, eq=False)
class Overlap:
    """The common area of two faces, on the plane of the lower one, along whose normal the other one is projected."""

    corners: Array
    """The corners of all pieces of the overlap and of their holes, (k, 3), world, [m]; (0, 3) if nothing overlaps."""
    area: float
    """The area of the overlap, [m^2]."""
    shape: Any = None
    """The overlap as a shapely geometry in the frame of the lower face, so that overlaps on one face can be
    compared."""

    def __bool__(self) -> bool:
        return self.area > 0.0


NO_OVERLAP = Overlap(np.zeros((0, 3)), 0.0)
"""The overlap of faces that do not cover each other."""


class FacePair(NamedTuple):
    """Two posed faces, of which the first is projected onto the plane of the second."""

    face: Face
    """In the frame of its solid."""
    T_face: Array
    """World pose of that solid, (4, 4), [m]."""
    on: Face
    """The face on whose plane the overlap lies, in the frame of its solid."""
    T_on: Array
    """World pose of that solid, (4, 4), [m]."""


def compute_overlaps(pairs: Sequence[FacePair]) -> list[Overlap]:
    """Project faces along the normals of others onto their planes and intersect them there (Section 2.2, Fc of Fig. 1).

    Outlines may be concave, with holes; an overlap may consist of several pieces. The distance of the planes does not
    matter. One call for many pairs takes a tenth of the time of as many calls.

    Returns:
        The overlap of each pair; `NO_OVERLAP` if the faces only touch along an edge or one is edge-on to the other.
    """
    import shapely

    intersections = _intersect_pairs(pairs)
    # All rings of all pieces. shapely repeats the first point of a ring as its last, which is dropped here.
    rings, piece = shapely.get_rings(intersections.pieces, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    is_first = np.append(ring[1:] == ring[:-1], False)[: len(ring)]
    points, ring = points[is_first], ring[is_first]
    kept = find_corners(points, ring)
    points, pair_of_point = points[kept], intersections.pair_of_piece[piece[ring[kept]]]
    T = np.array([T_on @ make_plane_frame(on) for _, _, on, T_on in pairs]).reshape(-1, 4, 4)[pair_of_point]
    corners = (T[:, :3, :2] @ points[:, :, None])[:, :, 0] + T[:, :3, 3]
    corners.setflags(write=False)
    ends = np.searchsorted(pair_of_point, np.arange(len(pairs) + 1))
    return [
        Overlap(corners[ends[i] : ends[i + 1]], area, shape) if area > 0.0 else NO_OVERLAP
        for i, (area, shape) in enumerate(zip(intersections.areas.tolist(), intersections.shapes, strict=True))
    ]


def compute_overlap(face: Face, T_face: Array, on: Face, T_on: Array) -> Overlap:
    """The overlap of one pair of faces; the arguments are those of `FacePair`."""
    return compute_overlaps([FacePair(face, T_face, on, T_on)])[0]


def compute_overlap_area(face: Face, T_face: Array, on: Face, T_on: Array) -> float:
    """The area of `compute_overlap` alone, [m^2]."""
    return float(_intersect_pairs([FacePair(face, T_face, on, T_on)]).areas[0])


def compute_shares(reached: Sequence[Overlap], true: Sequence[Overlap]) -> Array:
    """The fraction of each true overlap that the reached overlap on the same lower face covers, (k,), 0 to 1.

    It is 1 where the true overlap is empty.

    Args:
        reached, true: k overlaps each, in the same order; both of a pair lie on one lower face.
    """
    import shapely

    true_area = np.array([of.area for of in true])
    shapes = (np.array([of.shape for of in each], dtype=object) for each in (reached, true))
    covered_area = np.nan_to_num(shapely.area(shapely.intersection(*shapes)))
    return np.divide(covered_area, true_area, out=np.ones(len(true_area)), where=true_area > 0.0)


def measure_lateral_gap(face: Face, T_face: Array, on: Face, T_on: Array) -> float:
    """The distance in the plane of `on` between that face and the projection of `face`, [m]; 0 if they overlap."""
    return float(
        _project_faces([face], (_transform_to_plane(on) @ pose.inverse(T_on) @ T_face)[None])[0].distance(
            flatten_face(on)
        )
    )


@lru_cache(maxsize=4096)
def measure_face_area(face: Face) -> float:
    """The area of a face without its holes, [m^2]."""
    return float(flatten_face(face).area)


class _Intersections(NamedTuple):
    """Intersections of k pairs of faces, in the planes of the lower ones."""

    shapes: NDArray[np.object_]
    """(k,) shapely geometries; None where one face is edge-on to the other."""
    areas: Array
    """(k,) areas without slivers, [m^2]."""
    pieces: NDArray[np.object_]
    """(p,) shapely polygons of all pairs, in the order of the pairs, without slivers."""
    pair_of_piece: NDArray[np.intp]
    """(p,) index of the pair that each piece belongs to."""


def _intersect_pairs(pairs: Sequence[FacePair]) -> _Intersections:
    """Intersect each pair of faces in the plane of the lower one."""
    import shapely

    # T takes each upper face to the plane frame of the lower one, z along its normal: dropping z projects the face.
    T_ons = np.array([pair.T_on for pair in pairs]).reshape(-1, 4, 4)
    T_faces = np.array([pair.T_face for pair in pairs]).reshape(-1, 4, 4)
    T = np.array([_transform_to_plane(pair.on) for pair in pairs]).reshape(-1, 4, 4) @ (pose.inverse(T_ons) @ T_faces)
    normals = np.array([pair.face.normal for pair in pairs]).reshape(-1, 3)
    # Row 2 of T times the normal is the cosine between the two normals.
    not_edge_on = (np.abs((T[:, 2, :3] * normals).sum(axis=1)) >= _EDGE_ON).nonzero()[0]
    shapes = np.full(len(pairs), None, dtype=object)
    lower = np.array([flatten_face(pairs[i].on) for i in not_edge_on], dtype=object)
    shapes[not_edge_on] = shapely.intersection(
        _project_faces([pairs[i].face for i in not_edge_on], T[not_edge_on]), lower
    )
    pieces, pair_of_piece = shapely.get_parts(shapes, return_index=True)
    areas = shapely.area(pieces)
    is_area = (shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON) & (areas > SLIVER_M2)
    areas_by_pair = np.bincount(pair_of_piece[is_area], areas[is_area], len(pairs)).astype(np.float64)
    return _Intersections(shapes, areas_by_pair, pieces[is_area], pair_of_piece[is_area])


def _project_faces(faces: Sequence[Face], T: Array) -> NDArray[np.object_]:
    """The faces as shapely polygons: posed by T, (k, 4, 4), and projected onto the plane z = 0."""
    import shapely

    rings = [_list_face_rings(face) for face in faces]
    points = np.concatenate([np.zeros((0, 3)), *(points for points, _ in rings)])
    face_of_point = np.repeat(np.arange(len(faces)), [len(points) for points, _ in rings])
    T = T[face_of_point]
    projected = (T[:, :2, :3] @ points[:, :, None])[:, :, 0] + T[:, :2, 3]
    # For shapely: the number of the ring of each point, and the number of the face of each ring.
    sizes = [sizes for _, sizes in rings]
    ring = np.repeat(np.arange(sum(map(len, sizes))), [size for ring_sizes in sizes for size in ring_sizes])
    face_of_ring = np.repeat(np.arange(len(faces)), [len(ring_sizes) for ring_sizes in sizes])
    return np.asarray(shapely.polygons(shapely.linearrings(projected, indices=ring), indices=face_of_ring))


@lru_cache(maxsize=4096)
def _list_face_rings(face: Face) -> tuple[Array, tuple[int, ...]]:
    """The corners of the outline and of all holes, ring after ring, (k, 3), and the number of corners of each ring."""
    rings = (face.outline, *face.holes)
    return np.concatenate(rings), tuple(map(len, rings))


@lru_cache(maxsize=4096)
def flatten_face(face: Face) -> Any:
    """The face as a shapely polygon in its own plane frame (`make_plane_frame`)."""
    return _project_faces([face], _transform_to_plane(face)[None])[0]


@lru_cache(maxsize=4096)
def _transform_to_plane(face: Face) -> Array:
    """The transform, (4, 4), from the frame of the solid to the plane frame of the face."""
    return pose.inverse(make_plane_frame(face))


@lru_cache(maxsize=4096)
def make_plane_frame(face: Face) -> Array:
    """The plane frame of a face, (4, 4), in the frame of its solid: z along the normal, x along the longest edge."""
    edges = np.roll(face.outline, -1, axis=0) - face.outline
    longest = edges[np.argmax(np.linalg.norm(edges, axis=1))]
    z = face.normal
    x = longest / np.linalg.norm(longest)
    return pose.rigid(np.column_stack([x, np.cross(z, x), z]), face.outline[0])
