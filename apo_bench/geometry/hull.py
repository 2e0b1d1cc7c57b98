"""Convex pieces other than boxes, given by their corners; cylinders are prisms that remember their axis and radius."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np

from apo_bench.geometry.arrays import Array, copy_frozen, freeze, make_copyable
from apo_bench.geometry.polygon import find_direction_across

SAGITTA_M = 5e-6
"""Largest distance between a round wall and the flat sides that stand for it, [m]."""
FEWEST_SIDES = 16
"""Least number of flat sides of a round wall."""
_COPLANAR = 1e-7
"""Two unit vectors are equal if their cosine is above 1 minus this."""


def count_sides(radius_m: float) -> int:
    """The even number N of flat sides of a round wall, so that r (1 / cos(pi / N) - 1) is at most `SAGITTA_M`."""
    return max(FEWEST_SIDES, 2 * int(np.ceil(np.pi / np.arccos(radius_m / (radius_m + SAGITTA_M)) / 2.0)))


class Cylinder(NamedTuple):
    """A cylinder in the frame of its solid."""

    center: Array
    """(3,), [m]."""
    axis: Array
    """Unit vector, (3,)."""
    radius: float
    """[m]."""
    half_length: float
    """Half the length along the axis, [m]."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Hull:
    """The convex hull of some corners, in the frame of its solid."""

    name: str
    corners: Array
    """(k, 3), each a vertex of the hull, [m]."""
    cylinder: Cylinder | None = None
    """The cylinder that the hull approximates, its corners on the two circles; None for any other hull."""

    def __post_init__(self) -> None:
        freeze(self, corners=(None, 3))

    @cached_property
    def center(self) -> Array:
        """The centre of the axis-aligned box around the hull, (3,), [m]."""
        return copy_frozen((self.corners.min(axis=0) + self.corners.max(axis=0)) / 2, 3)

    @cached_property
    def half(self) -> Array:
        """Half the size of the axis-aligned box around the hull, (3,), [m]."""
        return copy_frozen((self.corners.max(axis=0) - self.corners.min(axis=0)) / 2, 3)

    @cached_property
    def planes(self) -> Array:
        """The sides, (s, 4): outward unit normal n and d, so that n . x <= d inside, [m]."""
        from scipy.spatial import ConvexHull

        planes = ConvexHull(self.corners).equations * [1.0, 1.0, 1.0, -1.0]
        return copy_frozen(planes[find_distinct_directions(planes[:, :3], signed=True)], None, 4)

    @cached_property
    def normals(self) -> Array:
        """Normals of the sides, (s, 3), each direction once, whichever its sign."""
        return copy_frozen(self.planes[find_distinct_directions(self.planes[:, :3]), :3], None, 3)

    @cached_property
    def edges(self) -> Array:
        """Directions of the edges, (e, 3), each once, whichever its sign."""
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
    """A cylinder as a convex piece: a prism whose corners lie on its two circles."""
    n = count_sides(cylinder.radius)
    z = cylinder.axis
    x = find_direction_across(z)
    # The corners of both ends: a ring of n points about the axis.
    angle = 2.0 * np.pi * np.arange(n) / n
    ring = cylinder.radius * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), np.cross(z, x)))
    ends = [cylinder.center + sign * cylinder.half_length * z + ring for sign in (-1.0, 1.0)]
    return Hull(name, np.concatenate(ends), cylinder)


def find_distinct_directions(directions: Array, signed: bool = False) -> Array:
    """Indices of the distinct ones among unit vectors, (k, 3): the first of each group that is equal.

    Args:
        signed: True: opposite vectors are distinct; False: they are equal.
    """
    cosine = directions @ directions.T
    alike = (cosine if signed else np.abs(cosine)) > 1.0 - _COPLANAR
    kept: list[int] = []
    known = np.zeros(len(directions), dtype=np.bool_)
    for i, like in enumerate(alike):
        if not known[i]:
            kept.append(i)
            known |= like
    return np.array(kept, dtype=np.intp)
