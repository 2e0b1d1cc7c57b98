"""Bands: parts of balls, rings and free surfaces that look like walls one by one, and are none.

A wall is straight from end to end, and ends at edges or goes over into planes. A band bends from end to end, or goes
over into others like it all around.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from apo_bench.cad.faces.facets import edges_of, widest_of
from apo_bench.cad.faces.patch import Patch, Plane, Rough, bend_along, normals_at, owner_of
from apo_bench.cad.solids.raw_solid import connected
from apo_bench.geometry import Array

_TANGENT_RAD = 0.03
"""Surfaces that meet at less go over into each other: a fillet and the plane beside it."""
_AROUND = 0.55
_BESIDE = 0.4
_TOUCHES = 0.2
"""So much of the border of a band goes over into others, and of what is beside a band."""
_LIKE = 3.0
"""Bands side by side differ by less than this in how wide they are."""
_ONE_END = 0.3
_CLEARLY = 2.0
_STRAIGHT = 0.3
"""A bend that is so much larger than what corners may be off is seen; a wall with so little of it has none."""
_LARGER = 3.0
"""A plane that is so much larger is no facet of a free surface."""


def without_bands(rough: Rough, patches: list[Patch], fewest: int) -> list[Patch]:
    """With bands as what is neither flat nor round."""
    owner = owner_of(rough, patches)
    own, other, length, _ = edges_of(rough.mesh)
    rows = np.flatnonzero(owner[own] != owner[other])
    own, other, length = own[rows], other[rows], length[rows]
    ends = rough.mesh.corners[np.tile(rough.mesh.edges, (2, 1))[rows]]
    here, beyond = owner[own], owner[other]
    n, m = (_normals(rough, patches, owner, each, ends.mean(axis=1)) for each in (own, other))
    # The edges of the second half are directed as in the triangle beyond.
    forth = np.where(rows < len(rough.mesh.edges), 1.0, -1.0)
    angle = np.arcsin(np.clip(np.linalg.norm(np.cross(n, m), axis=1), 0.0, 1.0))
    sign = forth * np.sign((np.cross(n, m) * (ends[:, 1] - ends[:, 0])).sum(axis=1))
    areas = np.bincount(owner, rough.areas, len(patches))
    border = np.bincount(here, length, len(patches))
    widths = 2.0 * areas / np.maximum(border, 1e-300)
    free = np.array([p.surface is None for p in patches])
    flat = np.array([isinstance(p.surface, Plane) for p in patches])
    wide = np.where(free[beyond], 2.0 * rough.areas[other] / np.maximum(length, 1e-300), widths[beyond])
    goes_on = (angle > _TANGENT_RAD) & (angle < widest_of(fewest)) & ((n * m).sum(axis=1) > 0.0)
    goes_on &= ~(flat[beyond] & (areas[beyond] > _LARGER * areas[here]))
    goes_on &= np.maximum(wide, widths[here]) < _LIKE * np.minimum(wide, widths[here])

    def share(which: Array) -> Array:
        """Of the border of each."""
        return np.bincount(here, length * which, len(patches)) / np.maximum(border, 1e-300)

    is_wall = ~free & ~flat
    # A taper between two cylinders bulges where it goes over into the one, and is hollow at the other one.
    pairs, which = np.unique(np.column_stack([here, beyond]), axis=0, return_inverse=True)
    ways = np.bincount(which.ravel(), length * sign * (goes_on & ~free[beyond])) / border[pairs[:, 0]]
    out, into = np.zeros((2, len(patches)))
    np.maximum.at(out, pairs[:, 0], ways)
    np.maximum.at(into, pairs[:, 0], -ways)
    bands = is_wall & (share(goes_on) > _AROUND) & (np.minimum(out, into) < _ONE_END)
    # Where corners are between its ends, a wall is straight that would bend by more to go on as its ends do.
    turn = np.bincount(here, length * angle * goes_on, len(patches)) / np.maximum(border * share(goes_on), 1e-300)
    for k in np.flatnonzero(bands & (widths * turn / 8.0 > _CLEARLY * rough.near)):
        bend, of_all = bend_along(patches[int(k)].surface, rough.points(patches[int(k)].triangles))
        bands[k] = of_all == 0.0 or bend > _STRAIGHT * widths[k] * turn[k] / 8.0
    more = bands
    while more.any():
        more = is_wall & ~bands & (share(goes_on & bands[beyond]) > _BESIDE)
        bands = bands | more
    free |= bands
    more = free
    while more.any():  # facets of free surfaces
        is_facet = (share(goes_on & (free | flat)[beyond]) > _BESIDE) & (share(goes_on & free[beyond]) > _TOUCHES)
        more = flat & ~free & is_facet
        free |= more
    rest = free[owner]
    _, group = connected(rough.mesh.neighbours[rest[rough.mesh.neighbours].all(axis=1)], len(owner))
    loose = (Patch(None, np.flatnonzero(rest & (group == g))) for g in np.unique(group[rest]))
    return [*(p for p, is_free in zip(patches, free, strict=True) if not is_free), *loose]


def _normals(rough: Rough, patches: Sequence[Patch], owner: Any, triangles: Any, points: Array) -> Array:
    """Outward ones, of the faces of triangles, or of the triangles themselves, at points beside them, (k, 3)."""
    normals = rough.normals[triangles].copy()
    faces = owner[triangles]
    for k in np.unique(faces):
        if (surface := patches[k].surface) is not None:
            mine = faces == k
            normals[mine] = (-1.0 if patches[k].hole else 1.0) * normals_at(surface, points[mine])
    return normals
