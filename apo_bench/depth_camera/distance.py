"""Unions of convex pieces as the range finder meets them: how far points are from them, where rays strike them.

A piece that is no box is met in the frame of the middle of the box around it.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, Cylinder, Hull, Piece, passage

_ON_M = 1e-9


class Convex(NamedTuple):
    """The sides and edges of a piece."""

    planes: Array
    """(s, 4): n . x <= d inside, [m]."""
    edges: Array
    """(e, 2, 3), ends of each, [m]."""
    cylinder: Cylinder | None
    """What it stands for, if it does."""


def convex_of(hull: Hull) -> Convex:
    """The piece in the frame of the middle of the box around it."""
    planes = np.array(hull.planes)
    planes[:, 3] -= planes[:, :3] @ hull.center
    if hull.cylinder is not None:
        return Convex(planes, np.zeros((0, 2, 3)), hull.cylinder._replace(center=hull.cylinder.center - hull.center))
    # Two corners are the ends of an edge if at least two planes go through both.
    corners = hull.corners - hull.center
    on = np.abs(corners @ planes[:, :3].T - planes[:, 3]) < 100 * _ON_M
    shared = on.astype(np.int64) @ on.T.astype(np.int64)
    return Convex(planes, corners[np.argwhere(np.triu(shared >= 2, k=1))], None)


def alike(a: Convex | None, b: Convex | None) -> bool:
    """Whether two pieces are the same, or both boxes."""
    if a is None or b is None:
        return a is b
    return a.planes.shape == b.planes.shape and np.allclose(a.planes, b.planes)


def least_distance(convex: Convex, points: Array) -> Array:
    """How far points, (n, 3), are at least, (n,), [m]: exact inside and over a side, too little beyond an edge."""
    if convex.cylinder is not None:
        return _cylinder_distance(convex.cylinder, points)[0]
    return np.asarray((points @ convex.planes[:, :3].T - convex.planes[:, 3]).max(axis=1))


def convex_distance(convex: Convex, points: Array) -> tuple[Array, Array]:
    """Distance of points, (n, 3), from the surface, (n,), negative inside, and its gradient, (n, 3), [m]."""
    if convex.cylinder is not None:
        return _cylinder_distance(convex.cylinder, points)
    n = convex.planes[:, :3]
    d = convex.planes[:, 3]
    # Over a side the farthest plane says the distance; where its foot is beyond another plane, the nearest edge does.
    room = points @ n.T - d
    first = room.argmax(axis=1)
    distance = room[np.arange(len(points)), first]
    gradient = n[first]
    foot = points - distance[:, None] * gradient
    beyond = np.flatnonzero((distance > 0.0) & ((foot @ n.T - d).max(axis=1) > _ON_M))
    if len(beyond):
        off = points[beyond] - _nearest_on_edges(convex.edges, points[beyond])
        distance[beyond] = length = np.linalg.norm(off, axis=1)
        gradient[beyond] = off / np.maximum(length, 1e-15)[:, None]
    return distance, gradient


def _nearest_on_edges(edges: Array, points: Array) -> Array:
    """The nearest points of edges, (n, 3).

    The nearest point of a convex piece lies on an edge, or over the side whose plane is the farthest, which is looked
    at before.
    """
    start = edges[:, 0]
    along = edges[:, 1] - edges[:, 0]
    part = np.clip(((points[:, None] - start) * along).sum(axis=-1) / (along * along).sum(axis=-1), 0.0, 1.0)
    at = start + part[..., None] * along
    off = points[:, None] - at
    return np.asarray(at[np.arange(len(points)), (off * off).sum(axis=-1).argmin(axis=1)])


def _cylinder_distance(cylinder: Cylinder, points: Array) -> tuple[Array, Array]:
    # Along the axis and across it: beyond the mantle, beyond an end, or beyond both, then from the rim.
    off = points - cylinder.center
    z = off @ cylinder.axis
    across = off - z[:, None] * cylinder.axis
    r = np.linalg.norm(across, axis=1)
    ways = np.stack([across / np.maximum(r, 1e-15)[:, None], np.sign(z)[:, None] * cylinder.axis], axis=1)
    beyond = np.stack([r - cylinder.radius, np.abs(z) - cylinder.half_length], axis=1)
    outside = np.maximum(beyond, 0.0)
    length = np.linalg.norm(outside, axis=1)
    weights = np.where(
        length[:, None] > 0.0, outside / np.maximum(length, 1e-15)[:, None], np.eye(2)[beyond.argmax(axis=1)]
    )
    return length + np.minimum(beyond.max(axis=1), 0.0), np.einsum("nk,nki->ni", weights, ways)


class Shape(NamedTuple):
    """A union of k convex pieces, each in a frame of its own, in the frame of the shape."""

    center: Array
    """(k, 3), of the box around the piece, [m]."""
    half: Array
    """(k, 3), of that box, [m]."""
    turn: Array
    """(k, 3, 3), rotations whose columns are the axes of that box."""
    inside: tuple[Convex | None, ...] = ()
    """What is in each box, in the frame of its middle; None: all of it. Empty of boxes alone."""

    def only(self, kept: NDArray[np.intp]) -> "Shape":
        """Some of the pieces, by number."""
        inside = tuple(self.inside[k] for k in kept) if self.inside else ()
        return Shape(self.center[kept], self.half[kept], self.turn[kept], inside)


def shape_of(pieces: Iterable[Piece], T: Array | None = None) -> Shape:
    """The union of pieces whose frame is at T, (4, 4), of the shape's (none: the same)."""
    kept = tuple(pieces)
    center = np.array([box.center for box in kept])
    half = np.array([box.half for box in kept])
    T = np.eye(4) if T is None else T
    inside = tuple(convex_of(piece) if isinstance(piece, Hull) else None for piece in kept)
    inside = inside if any(inside) else ()
    return Shape(center @ T[:3, :3].T + T[:3, 3], half, np.repeat(T[None, :3, :3], len(kept), axis=0), inside)


def join_shapes(shapes: Iterable[Shape]) -> Shape:
    """One shape of several that have the same frame."""
    kept = tuple(shapes)
    center, half, turn = (np.concatenate([shape[i] for shape in kept]) for i in range(3))
    inside = [each for shape in kept for each in shape.inside or (None,) * len(shape.center)]
    return Shape(center, half, turn, tuple(inside) if any(inside) else ())


def signed_distance(shape: Shape, points: Array) -> tuple[Array, Array]:
    """Distance of points (*, 3) from the surface, (*), and its gradient, (*, 3); frame of the shape, [m].

    Negative inside. Exact outside; inside it is the depth in the piece that the point is deepest in.
    """
    if not shape.inside:
        return _box_distance(shape, points)
    boxes = np.array([k for k, each in enumerate(shape.inside) if each is None], dtype=np.intp)
    hulls = [(k, each) for k, each in enumerate(shape.inside) if each is not None]
    flat = np.ascontiguousarray(points.reshape(-1, 3))
    d = np.full(len(flat), np.inf)
    gradient = np.zeros_like(flat)
    if len(boxes):
        d, gradient = _box_distance(shape.only(boxes), flat)
    least = np.array([least_distance(each, (flat - shape.center[k]) @ shape.turn[k]) for k, each in hulls])
    for i in _first_of_all(least):
        k, each = hulls[i]
        near = np.flatnonzero(least[i] < d)
        own, way = convex_distance(each, (flat[near] - shape.center[k]) @ shape.turn[k])
        closer = own < d[near]
        d[near[closer]] = own[closer]
        gradient[near[closer]] = way[closer] @ shape.turn[k].T
    return d.reshape(points.shape[:-1]), gradient.reshape(points.shape)


def _first_of_all(least: Array) -> list[int]:
    """The numbers of pieces, (k, n) the least distances of points from them: first those that most are nearest to."""
    nearest = np.bincount(least.argmin(axis=0), minlength=len(least)) if least.shape[1] else np.zeros(len(least))
    return [int(i) for i in np.argsort(-nearest, kind="stable")]


def _box_distance(shape: Shape, points: Array) -> tuple[Array, Array]:
    """`signed_distance` of boxes alone."""
    # In the axes of each box, (*, k, 3): outside, the distance is the length of what is beyond its sides; inside, the
    # depth under the nearest side.
    local = np.einsum("...ki,kij->...kj", points[..., None, :] - shape.center, shape.turn)
    beyond = np.abs(local) - shape.half
    outside = np.maximum(beyond, 0.0)
    length = np.sqrt(np.einsum("...i,...i->...", outside, outside))
    each = length + np.minimum(beyond.max(axis=-1), 0.0)
    nearest = each.argmin(axis=-1)[..., None]
    pick = nearest[..., None]
    beyond, local = (np.take_along_axis(a, pick, axis=-2)[..., 0, :] for a in (beyond, local))
    outside = np.maximum(beyond, 0.0)
    far = np.take_along_axis(length, nearest, axis=-1)
    axis = beyond == beyond.max(axis=-1, keepdims=True)
    way = np.where(far > 0.0, outside / np.where(far > 0.0, far, 1.0), axis / axis.sum(axis=-1, keepdims=True))
    gradient = np.einsum("...ij,...j->...i", shape.turn[nearest[..., 0]], np.where(local < 0.0, -way, way))
    return np.take_along_axis(each, nearest, axis=-1)[..., 0], gradient


def strike_distances(shape: Shape, origin: Array, rays: Array) -> tuple[Array, NDArray[np.int64]]:
    """How far rays from one point go until they strike the shape, (n,), and which piece, (n,); infinite, -1 if none.

    Args:
        origin: (3,), frame of the shape, outside of it, [m].
        rays: (n, 3), unit vectors.
    """
    # A ray o + t w is in a box where |o + t w| <= half along all axes: from the last entry to the first exit (slabs).
    best = np.full(len(rays), np.inf)
    which = np.full(len(rays), -1, dtype=np.int64)
    for k, (center, half, turn) in enumerate(zip(*shape[:3], strict=True)):
        inside = shape.inside[k] if shape.inside else None
        near = _in_cone(center - origin, float(np.linalg.norm(half)), rays)
        start = (origin - center) @ turn
        way = rays[near] @ turn
        if inside is None:
            with np.errstate(divide="ignore", invalid="ignore"):
                a = (-half - start) / way
                b = (half - start) / way
            enter = np.fmin(a, b).max(axis=1)
            leave = np.fmax(a, b).min(axis=1)
        else:
            enter, leave = passage(inside.planes, start, way)
        hit = (enter <= leave) & (enter > 0.0) & (enter < best[near])
        best[near[hit]] = enter[hit]
        which[near[hit]] = k
    return best, which


def _in_cone(to: Array, radius: float, rays: Array) -> NDArray[np.int64]:
    """The rays that may meet a ball at `to`, (3,), seen from where they begin."""
    # The tangents from here meet the ball at a distance sqrt(far^2 - radius^2), which is far times their cosine.
    far = float(np.linalg.norm(to))
    if far <= radius:
        return np.arange(len(rays))
    return np.flatnonzero(rays @ to >= np.sqrt(far * far - radius * radius) - 1e-12)
