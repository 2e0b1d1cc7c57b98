"""Solids where an assembly has them: what comes near to each, in its place and on straight ways out, [mm]."""

from collections.abc import Iterator, Sequence
from typing import Any

import manifold3d
import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.cad.solids.bodies import body_of
from apo_bench.importers.cad.solids.mesh import Mesh
from apo_bench.importers.cad.solids.raw_solid import RawSolid

_STEP_MM = 1.0
"""Points of others are so far apart, and so are the places on their way."""
_MOST_POINTS = 60_000
_NEAR_MM = 1.5
_NONE = 1e-5
"""Solids that have less than this part of the smaller one in common do not overlap."""


def coming_near(raws: Sequence[RawSolid]) -> list[Array]:
    """Of each solid points on the surfaces of all others, (k, 3), in its frame, that come near to one of its places.

    Others come along the axes of the assembly too, as far as such a way is free.
    """
    bodies = [body_of(raw.mesh) for raw in raws]
    points = [surface_points(raw.mesh, _STEP_MM) for raw in raws]
    boxes = [np.array([raw.mesh.corners.min(axis=0), raw.mesh.corners.max(axis=0)]) for raw in raws]
    near: list[list[Array]] = [[np.zeros((0, 3))] for _ in raws]
    for i, own in enumerate(raws):
        for place in own.places:
            for k, other in enumerate(raws):
                for its in other.places:
                    if its is place:
                        continue
                    T = pose.inverse(place.T) @ its.T
                    moved = points[k] @ T[:3, :3].T + T[:3, 3]
                    low, high = boxes[i] + [[-_NEAR_MM], [_NEAR_MM]]
                    if (moved.max(axis=0) < low).any() or (moved.min(axis=0) > high).any():
                        continue
                    for shift in _shifts(bodies[i], bodies[k].transform(T[:3]), place.T):
                        inside = moved + shift
                        near[i].append(inside[((inside > low) & (inside < high)).all(axis=1)])
        # What passes a place again and again counts there once.
        near[i] = [_each_once(np.concatenate(near[i]))]
    return [each[0] for each in near]


def surface_points(mesh: Mesh, step: float) -> Array:
    """Corners of a closed mesh, and points on its sides between them, (k, 3).

    Args:
        step: How far apart neighbours are at most, farther on large parts, [mm].
    """
    area = float(np.linalg.norm(mesh.across, axis=1).sum()) / 2.0
    fine = body_of(mesh).refine_to_length(max(step, (2.0 * area / _MOST_POINTS) ** 0.5)).to_mesh64()
    return np.unique(np.asarray(fine.vert_properties)[:, :3].astype(np.float64), axis=0)


def mates_of(raws: Sequence[RawSolid]) -> list[Any]:
    """Of each solid all others at their places around one of its own, in its frame, as one body of manifold3d."""
    bodies = [body_of(raw.mesh) for raw in raws]
    others = []
    for own in raws:
        low, high = own.mesh.corners.min(axis=0), own.mesh.corners.max(axis=0)
        box = manifold3d.Manifold.cube(high - low + 2.0 * _NEAR_MM).translate(low - _NEAR_MM)
        pairs = (
            (place, body, its)
            for place in own.places
            for body, raw in zip(bodies, raws, strict=True)
            for its in raw.places
        )
        near = [
            box ^ body.transform((pose.inverse(place.T) @ its.T)[:3]) for place, body, its in pairs if its is not place
        ]
        others.append(manifold3d.Manifold.batch_boolean(near, manifold3d.OpType.Add))
    return others


def _each_once(points: Array) -> Array:
    """Points on a grid, in the order of their places, each once."""
    return np.unique(np.round(2.0 * points / _STEP_MM), axis=0) * _STEP_MM / 2.0


def _shifts(own: Any, other: Any, T: Array) -> Iterator[Array]:
    """No shift, then those along the axes of the assembly on which the other one gets away from this one freely."""
    yield np.zeros(3)
    for axis in np.concatenate([np.eye(3), -np.eye(3)]):
        way = T[:3, :3].T @ axis
        # So far until boxes along that way are apart.
        ends = [np.asarray(body.to_mesh64().vert_properties)[:, :3] @ way for body in (own, other)]
        far = float(ends[0].max() - ends[1].min())
        steps = np.arange(_STEP_MM, far, max(_STEP_MM, far / 60.0))
        looked = steps[np.unique(np.linspace(0, len(steps) - 1, 6).astype(int))] if len(steps) else steps
        if all(
            (own ^ other.translate(step * way)).volume() < _NONE * min(own.volume(), other.volume()) for step in looked
        ):
            yield from (step * way for step in steps)
