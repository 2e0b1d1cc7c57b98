"""Unions of boxes as the range finder meets them: how far points are from them, and where rays strike them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.solid import Piece


class Shape(NamedTuple):
    """A union of boxes: k boxes, each in a frame of its own, in the frame of the shape."""

    center: Array
    """(k, 3), [m]."""
    half: Array
    """(k, 3), [m]."""
    turn: Array
    """(k, 3, 3), rotations whose columns are the axes of the boxes."""


def shape_of(pieces: Iterable[Piece], T: Array | None = None) -> Shape:
    """The union of pieces, as the boxes around them, whose frame is at T, (4, 4), of the shape's (none: the same)."""
    kept = tuple(pieces)
    center, half = np.array([box.center for box in kept]), np.array([box.half for box in kept])
    T = np.eye(4) if T is None else T
    return Shape(center @ T[:3, :3].T + T[:3, 3], half, np.repeat(T[None, :3, :3], len(kept), axis=0))


def join_shapes(shapes: Iterable[Shape]) -> Shape:
    """One shape of several that have the same frame."""
    kept = tuple(shapes)
    return Shape(*(np.concatenate([shape[i] for shape in kept]) for i in range(3)))


def signed_distance(shape: Shape, points: Array) -> tuple[Array, Array]:
    """Distance of points (*, 3) from the surface, (*), and its gradient, (*, 3); frame of the shape, [m].

    Negative inside. Exact outside; inside it is the depth in the box that the point is deepest in.
    """
    local = np.einsum("...ki,kij->...kj", points[..., None, :] - shape.center, shape.turn)
    beyond = np.abs(local) - shape.half
    outside = np.maximum(beyond, 0.0)
    length = np.sqrt(np.einsum("...i,...i->...", outside, outside))
    deepest = beyond.max(axis=-1)
    each = length + np.minimum(deepest, 0.0)
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
    """How far rays from one point go until they strike the shape, (n,), and which box, (n,); infinite and -1 if none.

    Args:
        origin: (3,), frame of the shape, outside of it, [m].
        rays: (n, 3), unit vectors.
    """
    best, which = np.full(len(rays), np.inf), np.full(len(rays), -1, dtype=np.int64)
    for k, (center, half, turn) in enumerate(zip(*shape, strict=True)):
        near = _in_cone(center - origin, float(np.linalg.norm(half)), rays)
        start, way = (origin - center) @ turn, rays[near] @ turn
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (-half - start) / way, (half - start) / way
        enter, leave = np.fmin(a, b).max(axis=1), np.fmax(a, b).min(axis=1)
        hit = (enter <= leave) & (enter > 0.0) & (enter < best[near])
        best[near[hit]], which[near[hit]] = enter[hit], k
    return best, which


def _in_cone(to: Array, radius: float, rays: Array) -> NDArray[np.int64]:
    """The rays that may meet a ball at `to`, (3,), seen from where they begin."""
    far = float(np.linalg.norm(to))
    if far <= radius:
        return np.arange(len(rays))
    return np.flatnonzero(rays @ to >= np.sqrt(far * far - radius * radius) - 1e-12)
