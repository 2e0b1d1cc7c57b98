"""Points of other solids that come near to a solid in an assembly, in its place and on straight ways out, [mm]."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.cad.solids import Mesh, RawSolid, convert_to_manifold

_STEP_MM = 1.0
"""The distance of points, and of the positions on a way."""
_MOST_POINTS = 60_000
_NEAR_MM = 1.5
_NONE = 1e-5
"""Solids that have less than this part of the smaller one in common do not overlap."""


def coming_near(raws: Sequence[RawSolid]) -> list[Array]:
    """Return for each solid the points on other surfaces, (k, 3), in its frame, that come near to one of its places.

    Others also move along the axes of the assembly, as far as such a way is free.
    """
    bodies = [convert_to_manifold(raw.mesh) for raw in raws]
    points = [surface_points(raw.mesh, _STEP_MM) for raw in raws]
    return [
        # A point that comes by again and again counts once.
        _once(np.concatenate([np.zeros((0, 3)), *_near_points(i, raws, bodies, points)]))
        for i in range(len(raws))
    ]


def _near_points(i: int, raws: Sequence[RawSolid], bodies: Sequence[Any], points: Sequence[Array]) -> Iterator[Array]:
    low = raws[i].mesh.corners.min(axis=0) - _NEAR_MM
    high = raws[i].mesh.corners.max(axis=0) + _NEAR_MM
    for place in raws[i].places:
        for k, other in enumerate(raws):
            for its in other.places:
                T = pose.inverse(place.T) @ its.T
                moved = points[k] @ T[:3, :3].T + T[:3, 3]
                if its is place or (moved.max(axis=0) < low).any() or (moved.min(axis=0) > high).any():
                    continue
                for shift in _shifts(bodies[i], bodies[k].transform(T[:3]), place.T):
                    shifted = moved + shift
                    yield shifted[((shifted > low) & (shifted < high)).all(axis=1)]


def surface_points(mesh: Mesh, step: float) -> Array:
    """Return the corners of a closed mesh, and points on its sides between them, (k, 3).

    Args:
        step: The largest distance of neighbours, [mm]; large parts have a larger one.
    """
    area = float(np.linalg.norm(mesh.across, axis=1).sum()) / 2.0
    fine = convert_to_manifold(mesh).refine_to_length(max(step, (2.0 * area / _MOST_POINTS) ** 0.5)).to_mesh64()
    return np.unique(np.asarray(fine.vert_properties)[:, :3].astype(np.float64), axis=0)


def _once(points: Array) -> Array:
    """Points on a grid, each once."""
    return np.unique(np.round(2.0 * points / _STEP_MM), axis=0) * _STEP_MM / 2.0


def _shifts(own: Any, other: Any, T: Array) -> Iterator[Array]:
    """No shift, then those along the axes of the assembly on which the other solid leaves this one freely."""
    yield np.zeros(3)
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        way = T[:3, :3].T @ axis
        # The distance at which boxes along that way are apart.
        ends = [np.asarray(body.to_mesh64().vert_properties)[:, :3] @ way for body in (own, other)]
        far = float(ends[0].max() - ends[1].min())
        steps = np.arange(_STEP_MM, far, max(_STEP_MM, far / 60.0))
        sample = steps[np.unique(np.linspace(0, max(len(steps) - 1, 0), 6).astype(int))[: len(steps)]]
        common = [(own ^ other.translate(step * way)).volume() for step in sample]
        if max(common, default=0.0) < _NONE * min(own.volume(), other.volume()):
            yield from (step * way for step in steps)
