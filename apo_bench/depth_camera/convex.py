"""One convex piece that is no box as the range finder meets it, in the frame of the middle of the box around it."""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, Cylinder, Hull

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
        moved = hull.cylinder._replace(center=hull.cylinder.center - hull.center)
        return Convex(planes, np.zeros((0, 2, 3)), moved)
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
    nearest = (off * off).sum(axis=-1).argmin(axis=1)
    return np.asarray(at[np.arange(len(points)), nearest])


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
    deepest = beyond.argmax(axis=1)
    weights = np.where(length[:, None] > 0.0, outside / np.maximum(length, 1e-15)[:, None], np.eye(2)[deepest])
    return length + np.minimum(beyond.max(axis=1), 0.0), np.einsum("nk,nki->ni", weights, ways)
