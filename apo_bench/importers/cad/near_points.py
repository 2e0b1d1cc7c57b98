"""Sample where the other solids of an assembly come near a solid, at their poses and on free paths of removal, [mm]."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.cad.solids import Mesh, RawSolid, convert_to_manifold

_STEP_MM = 1.0
"""Distance of the sampled points, and of the positions along a path."""
_MOST_POINTS = 60_000  # from one solid; large solids get a coarser sampling
_NEAR_MM = 1.5  # points farther from the solid's box do not count
_NONE = 1e-5
"""Solids overlap if their common volume exceeds this share of the smaller one's."""


def find_near_points(raws: Sequence[RawSolid]) -> list[Array]:
    """Return for each solid the points of other solids that come near one of its copies, (k, 3), in its own frame.

    Others are sampled at their places, and while they move along the axes of the assembly where nothing blocks them.
    """
    bodies = [convert_to_manifold(raw.mesh) for raw in raws]
    points = [sample_surface_points(raw.mesh, _STEP_MM) for raw in raws]
    return [
        # Points are rounded to a grid, so that a point that passes several times counts once.
        _round_to_grid(np.concatenate([np.zeros((0, 3)), *_list_near_points(i, raws, bodies, points)]))
        for i in range(len(raws))
    ]


def _list_near_points(
    i: int, raws: Sequence[RawSolid], bodies: Sequence[Any], points: Sequence[Array]
) -> Iterator[Array]:
    """Yield the points of other solids near solid i, (k, 3), one array for each pair of copies and shift.

    Args:
        bodies, points: Of each solid of `raws`: the manifold3d body and the sampled points, both in its own frame.
    """
    low = raws[i].mesh.corners.min(axis=0) - _NEAR_MM
    high = raws[i].mesh.corners.max(axis=0) + _NEAR_MM
    for place in raws[i].places:
        for k, other in enumerate(raws):
            for its in other.places:
                T = pose.inverse(place.T) @ its.T  # pose of the other copy in the frame of solid i
                moved = points[k] @ T[:3, :3].T + T[:3, 3]
                if its is place or (moved.max(axis=0) < low).any() or (moved.min(axis=0) > high).any():
                    continue
                for shift in _list_free_shifts(bodies[i], bodies[k].transform(T[:3]), place.T):
                    shifted = moved + shift
                    yield shifted[((shifted > low) & (shifted < high)).all(axis=1)]


def sample_surface_points(mesh: Mesh, step: float) -> Array:
    """Return the corners of a closed mesh, and points on its sides between them, (k, 3).

    Args:
        step: The largest distance of neighbours, [mm]; large parts have a larger one.
    """
    area = float(np.linalg.norm(mesh.across, axis=1).sum()) / 2.0
    fine = convert_to_manifold(mesh).refine_to_length(max(step, (2.0 * area / _MOST_POINTS) ** 0.5)).to_mesh64()
    return np.unique(np.asarray(fine.vert_properties)[:, :3].astype(np.float64), axis=0)


def _round_to_grid(points: Array) -> Array:
    """Return points rounded to a grid of half a step, each grid point once."""
    if not len(points):
        return points
    cells = np.round(2.0 * points / _STEP_MM).astype(np.int64)
    low = cells.min(axis=0)
    shape = np.ptp(cells, axis=0) + 1
    numbers = np.unique(np.ravel_multi_index(tuple((cells - low).T), tuple(shape)))
    return (np.column_stack(np.unravel_index(numbers, tuple(shape))) + low) * _STEP_MM / 2.0


def _list_free_shifts(own: Any, other: Any, T: Array) -> Iterator[Array]:
    """Yield the zero shift, then the shifts along axes of the assembly on which the other solid leaves without overlap.

    Args:
        own, other: manifold3d bodies, both in the frame of the first.
        T: (4, 4), pose of the first solid in the assembly.
    """
    yield np.zeros(3)
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        way = T[:3, :3].T @ axis  # the axis of the assembly in the frame of the solid
        # The distance at which boxes along that way are apart.
        ends = [np.asarray(body.to_mesh64().vert_properties)[:, :3] @ way for body in (own, other)]
        far = float(ends[0].max() - ends[1].min())
        # Test the overlap at six positions only, spread over the path.
        steps = np.arange(_STEP_MM, far, max(_STEP_MM, far / 60.0))
        sample = steps[np.unique(np.linspace(0, max(len(steps) - 1, 0), 6).astype(int))[: len(steps)]]
        common = [(own ^ other.translate(step * way)).volume() for step in sample]
        if max(common, default=0.0) < _NONE * min(own.volume(), other.volume()):
            yield from (step * way for step in steps)
