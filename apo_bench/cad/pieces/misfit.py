"""How far convex pieces stick out of the solid that they stand for, and how much of it they leave out, [mm]."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.cad.solids.bodies import body_of
from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.geometry import Array, Hull

_STEP_MM = 0.5
_MOST_POINTS = 60_000
FARTHEST_MM = 1.0
"""What is farther off every piece counts as this far."""
_AT_ONCE = 2_000_000


class Misfit(NamedTuple):
    """Of pieces and their solid, [mm]."""

    out: float
    """How deep the surface of the solid lies inside of a piece at most: by so much pieces stick out."""
    left: float
    """How far off every piece it lies at most, up to 1 mm."""


def surface_points(mesh: Mesh, step: float = _STEP_MM) -> Array:
    """Corners of a closed mesh, and points on its sides between them, (k, 3).

    Args:
        step: How far apart neighbours are at most, farther on large parts, [mm].
    """
    area = float(np.linalg.norm(mesh.across, axis=1).sum()) / 2.0
    fine = body_of(mesh).refine_to_length(max(step, (2.0 * area / _MOST_POINTS) ** 0.5)).to_mesh64()
    return np.unique(np.asarray(fine.vert_properties)[:, :3].astype(np.float64), axis=0)


def misfit(points: Array, pieces: Sequence[Hull]) -> Misfit:
    """Hold pieces, [m], against points on the surface of their solid, (k, 3), [mm]."""
    if not len(points):
        return Misfit(0.0, 0.0)
    deepest = np.full(len(points), -FARTHEST_MM)
    for piece in pieces:
        low = 1e3 * piece.corners.min(axis=0) - FARTHEST_MM
        high = 1e3 * piece.corners.max(axis=0) + FARTHEST_MM
        near = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
        deepest[near] = np.maximum(deepest[near], depths(points[near], piece.planes * [1.0, 1.0, 1.0, 1e3]))
    return Misfit(max(float(deepest.max()), 0.0), max(float(-deepest.min()), 0.0))


def depths(points: Array, planes: Array) -> Array:
    """How deep points, (k, 3), are below the nearest of the planes n . x = d of a convex piece, (p, 4); negative above
    one of them."""
    many = max(1, _AT_ONCE // max(len(planes), 1))
    chunks = [points[i : i + many] for i in range(0, len(points), many)]
    return np.concatenate([np.zeros(0), *((planes[:, 3] - each @ planes[:, :3].T).min(axis=1) for each in chunks)])
