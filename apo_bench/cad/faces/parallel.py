"""Faces that are parallel, and walls with one axis, within what corners are off, are so exactly, [mm]."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from apo_bench.cad.faces.fitting import Round, circle_through
from apo_bench.cad.faces.patch import Patch, Plane, Rough
from apo_bench.geometry import Array


def regular(rough: Rough, patches: Sequence[Patch]) -> list[Patch]:
    """Faces that are parallel within what corners are off are so exactly, and walls with one axis have one."""
    order = np.argsort(
        [-rough.areas[p.triangles].sum() + 1e9 * isinstance(p.surface, Round) for p in patches], kind="stable"
    )
    directions: list[Array] = []
    axes: list[Round] = []
    new = [*patches]
    for k in order.tolist():
        patch = patches[k]
        if patch.surface is None:
            continue
        points = rough.points(patch.triangles)
        length = float(np.ptp(points, axis=0).max())
        within = min(3.0 * rough.near / max(length, 1e-9), 0.02)
        is_flat = isinstance(patch.surface, Plane)
        own = patch.surface.normal if isinstance(patch.surface, Plane) else patch.surface.axis
        known = [*directions, *np.eye(3)]
        turned = [float(np.linalg.norm(np.cross(own, each))) for each in known]
        best = int(np.argmin(turned))
        n = known[best] * np.sign(known[best] @ own) if turned[best] < within else own
        if turned[best] >= within or best >= len(directions):
            directions.append(n)
        if is_flat:
            new[k] = patch._replace(surface=Plane(n, float((points @ n).mean())))
            continue
        surface = _along(patch.surface, n, points, axes, rough.near)
        axes.append(surface)
        new[k] = patch._replace(surface=surface)
    return new


def _along(surface: Any, axis: Array, points: Array, axes: Sequence[Round], near: float) -> Round:
    """A wall about another axis: one that is known and beside it, if there is one."""
    height, distance, _ = surface.polar(points)
    at = surface.point + float(height.mean()) * surface.axis
    beside = [a for a in axes if abs(a.axis @ axis) > 1.0 - 1e-12 and float(a.polar(at[None])[1][0]) < near]
    start = Round(at if not beside else beside[0].point, axis, surface.radius, surface.slope)
    if surface.slope:
        height, distance, _ = start.polar(points)
        slope, radius = np.polyfit(height, distance, 1)
        return start._replace(radius=float(radius), slope=float(slope))
    free = circle_through(points, axis)
    if not beside:
        return free if free is not None else start
    return start._replace(radius=float(start.polar(points)[1].mean()))
