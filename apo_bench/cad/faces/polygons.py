"""Round faces that are seen as the sides of a polygon: their radius is that of its corners, [mm]."""

from collections.abc import Sequence

import numpy as np

from apo_bench.cad.faces.facets import widest_of
from apo_bench.cad.faces.fitting import NEAR_MM, Round, axis_of, circle_through
from apo_bench.cad.faces.patch import Patch, Plane, Rough
from apo_bench.cad.solids.raw_solid import connected, square_to
from apo_bench.geometry import WHOLE_TURN, Array

_MOST_SIDES = 96
_PHASES = 32
_CLEARLY = 0.6
"""Sides are seen if a polygon leaves less than this part of what a circle leaves."""


def with_rings(rough: Rough, patches: Sequence[Patch], fewest: int) -> list[Patch]:
    """With flat faces that are a whole turn of sides, so many or more, as round faces."""
    owner = np.zeros(len(rough.areas), dtype=np.int64)
    for k, patch in enumerate(patches):
        owner[patch.triangles] = k
    normals = np.array([p.surface.normal if isinstance(p.surface, Plane) else np.zeros(3) for p in patches])
    pairs = np.unique(owner[rough.mesh.neighbours], axis=0)
    alike = (normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) > np.cos(widest_of(fewest))
    count, group = connected(pairs[alike], len(patches))
    rings = []
    for g in np.flatnonzero(np.bincount(group, minlength=count) >= fewest):
        mine = [patches[k] for k in np.flatnonzero(group == g).tolist()]
        wall = _around([p.surface for p in mine if isinstance(p.surface, Plane)])
        if wall is None:
            continue
        triangles = np.sort(np.concatenate([p.triangles for p in mine]))
        out = wall.polar(rough.middles[triangles])[2]
        hole = bool((rough.normals[triangles] * out).sum() < 0.0)
        rings.append(Patch(wall, triangles, hole, len(mine)))
        group[group == g] = -1
    return [*(p for p, g in zip(patches, group, strict=True) if g >= 0), *rings]


def _around(sides: Sequence[Plane]) -> Round | None:
    """The cylinder through the corners of sides that are a whole turn; None if they do not lie on one."""
    axis = axis_of(np.array([side.normal for side in sides]), False)
    flat = np.array(square_to(axis)).T
    across = np.array([side.normal for side in sides]) @ flat
    order = np.argsort(np.arctan2(across[:, 1], across[:, 0]))
    both = np.stack([across[order], across[np.roll(order, -1)]], axis=1)
    if np.abs(np.linalg.det(both)).min() < 1e-6:
        return None
    offsets = np.array([side.offset for side in sides])
    corners = np.linalg.solve(both, np.stack([offsets[order], offsets[np.roll(order, -1)]], axis=1)[..., None])[..., 0]
    wall = circle_through(corners @ flat.T, axis)
    return wall if wall is not None and np.abs(wall.off(corners @ flat.T)).max() < NEAR_MM else None


def seen_from_corners(rough: Rough, patches: Sequence[Patch]) -> list[Patch]:
    """With the radius of round faces at the corners of their sides, where corners of triangles lie on the sides."""
    return [
        _at_corners(patch, patch.surface, rough.points(patch.triangles)) if isinstance(patch.surface, Round) else patch
        for patch in patches
    ]


def _at_corners(patch: Patch, wall: Round, points: Array) -> Patch:
    height, distance, out = wall.polar(points)
    x, y = square_to(wall.axis)
    angle = np.arctan2(out @ y, out @ x)
    wide = wall.radius + wall.slope * height
    least = _CLEARLY * float(np.linalg.norm(distance - wide))
    sides, scale = patch.sides, 1.0
    for n in range(3, _MOST_SIDES + 1):
        # A regular polygon with corners at the radius 1 is cos(pi/n) / cos(a) from its middle, a from that of a side.
        phases = WHOLE_TURN / n * np.arange(_PHASES)[:, None] / _PHASES
        profile = wide * np.cos(np.pi / n) / np.cos((angle - phases) % (WHOLE_TURN / n) - np.pi / n)
        scales = (profile @ distance) / (profile**2).sum(axis=1)
        off = np.linalg.norm(distance - scales[:, None] * profile, axis=1)
        if off.min() < least:
            least = float(off.min())
            sides, scale = n, float(scales[off.argmin()])
    sides = sides or _corners_around(angle)
    return patch._replace(surface=wall._replace(radius=scale * wall.radius, slope=scale * wall.slope), sides=sides)


def _corners_around(angle: Array) -> int:
    """At how many places around the axis corners are, if these are evenly spread; else 0."""
    around = np.sort(angle)
    gaps = np.diff(around, append=around[0] + WHOLE_TURN)
    wide = gaps[gaps > 0.5 * gaps.max()]
    return len(wide) if wide.sum() > 0.8 * WHOLE_TURN and wide.min() > 0.7 * wide.max() and len(wide) > 2 else 0
