"""A part of a solid that is to be one piece, [mm]."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array

SLIVER = 1e-7
"""A smaller share of a solid is rounding."""


class CutPart(NamedTuple):
    """A part of a solid that is to be one piece."""

    body: Any
    """Of manifold3d."""
    planes: Array
    """Along which it was cut, (k, 4)."""

    def halves(self, n: Array, d: float, hair: float = 0.0) -> tuple["CutPart", "CutPart"]:
        """Return the halves above and below the plane n . x = d, both a hair's breadth off it.

        On the plane, rounding would leave flaps of no thickness.
        """
        planes = np.concatenate([self.planes, [[*n, d]]])
        above = CutPart(self.body.trim_by_plane(n, d + hair), planes)
        return above, CutPart(self.body.trim_by_plane(-n, hair - d), planes)


def bodies_of(halves: tuple[CutPart, CutPart], least: float) -> list[CutPart]:
    """Return the connected bodies of halves, without those of less volume, [mm^3]."""
    every = (CutPart(body, half.planes) for half in halves for body in half.body.decompose())
    return [each for each in every if each.body.volume() > least]


def cut_through(part: CutPart, point: Array, normals: Array, least: float, hair: float) -> list[CutPart]:
    """Cut a part through a point along the plane that leaves the least hulls; return the part alone if none does.

    Args:
        normals: Of the planes to try, (k, 3).
        least: Bodies of less volume are rounding, and a half of less is none, [mm^3].
    """
    best = [part]
    smallest = np.inf
    for n in normals:
        halves = part.halves(n, float(n @ point), hair)
        bodies = bodies_of(halves, least)
        filled = sum(each.body.hull().volume() for each in bodies)
        if filled < smallest and min(half.body.volume() for half in halves) > least:
            smallest = filled
            best = bodies
    return best
