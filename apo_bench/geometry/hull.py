"""Convex pieces that are no boxes: their corners, the sides between them, and cylinders among them."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np

from apo_bench.geometry.arrays import Array, copy_frozen, freeze, make_copyable
from apo_bench.geometry.polygon import find_direction_across

SAGITTA_M = 5e-6
"""A round wall is stood for by flat ones that are nowhere farther from it."""
FEWEST_SIDES = 16
_FLAT = 1e-7
"""Normals of triangles, and directions of edges, are the same within this."""


def count_sides(radius_m: float) -> int:
    """Into how many sides, an even number, a round wall is cut: r (1 / cos(pi / N) - 1) is at most `SAGITTA_M`."""
    return max(FEWEST_SIDES, 2 * int(np.ceil(np.pi / np.arccos(radius_m / (radius_m + SAGITTA_M)) / 2.0)))


class Cylinder(NamedTuple):
    """A cylinder in the frame of its solid."""

    center: Array
    """(3,), [m]."""
    axis: Array
    """Unit vector, (3,)."""
    radius: float
    half_length: float


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Hull:
    """The smallest convex piece that contains its corners, in the frame of its solid."""

    name: str
    corners: Array
    """(k, 3), each a corner of the piece, [m]."""
    cylinder: Cylinder | None = None
    """The cylinder that it stands for; its corners lie on the edges of that one."""

    def __post_init__(self) -> None:
        freeze(self, corners=(None, 3))

    @cached_property
    def center(self) -> Array:
        """The middle of the box around it, (3,), [m]."""
        return copy_frozen((self.corners.min(axis=0) + self.corners.max(axis=0)) / 2, 3)

    @cached_property
    def half(self) -> Array:
        """Half the size of the box around it, (3,), [m]."""
        return copy_frozen((self.corners.max(axis=0) - self.corners.min(axis=0)) / 2, 3)

    @cached_property
    def planes(self) -> Array:
        """Its sides, (s, 4): outward unit normal n and d, so that n . x <= d inside, [m]."""
        from scipy.spatial import ConvexHull

        planes = ConvexHull(self.corners).equations * [1.0, 1.0, 1.0, -1.0]
        return copy_frozen(planes[find_distinct_directions(planes[:, :3], signed=True)], None, 4)

    @cached_property
    def normals(self) -> Array:
        """Directions across its sides, (s, 3), each once up to its sign."""
        return copy_frozen(self.planes[find_distinct_directions(self.planes[:, :3]), :3], None, 3)

    @cached_property
    def edges(self) -> Array:
        """Directions of its edges, (e, 3), each once up to its sign."""
        n = self.planes[:, :3]
        d = self.planes[:, 3]
        # Two sides meet in an edge if they share two corners; the edge lies along the cross product of their normals.
        on = np.abs(n @ self.corners.T - d[:, None]) < 1e-7 * (1.0 + np.abs(d[:, None]))
        both = on.astype(np.int64) @ on.T.astype(np.int64)
        pairs = np.argwhere(np.triu(both >= 2, k=1))
        along = np.cross(n[pairs[:, 0]], n[pairs[:, 1]])
        along /= np.linalg.norm(along, axis=1)[:, None]
        return copy_frozen(along[find_distinct_directions(along)], None, 3)


def make_cylinder_hull(name: str, cylinder: Cylinder) -> Hull:
    """A cylinder as a piece: a prism whose corners lie on its edges."""
    n = count_sides(cylinder.radius)
    z = cylinder.axis
    x = find_direction_across(z)
    # The corners of both ends: a ring of n points about the axis.
    angle = 2.0 * np.pi * np.arange(n) / n
    ring = cylinder.radius * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), np.cross(z, x)))
    ends = [cylinder.center + sign * cylinder.half_length * z + ring for sign in (-1.0, 1.0)]
    return Hull(name, np.concatenate(ends), cylinder)


def find_distinct_directions(directions: Array, signed: bool = False) -> Array:
    """Row numbers of unit vectors, (k, 3), none of which is another one of them, or its opposite."""
    cosine = directions @ directions.T
    alike = (cosine if signed else np.abs(cosine)) > 1.0 - _FLAT
    kept: list[int] = []
    known = np.zeros(len(directions), dtype=np.bool_)
    for i, like in enumerate(alike):
        if not known[i]:
            kept.append(i)
            known |= like
    return np.array(kept, dtype=np.intp)
