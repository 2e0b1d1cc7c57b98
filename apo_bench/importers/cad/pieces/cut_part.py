"""A body with the planes along which it was cut from a solid, and the operations that cut it further, [mm]."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array

SLIVER = 1e-7
"""A smaller share of the volume of a solid is rounding."""


class CutPart(NamedTuple):
    """A body that shall become one convex piece, with the planes of its cuts."""

    body: Any
    """A manifold3d body."""
    planes: Array
    """Planes n . x = d along which it was cut, (k, 4)."""

    def cut_in_halves(self, n: Array, d: float, hair: float = 0.0) -> tuple["CutPart", "CutPart"]:
        """Return the parts above and below the plane n . x = d, each trimmed by `hair` on its side of the plane.

        Trimming exactly on the plane would leave sheets of no thickness, by rounding.
        """
        planes = np.concatenate([self.planes, [[*n, d]]])
        above = CutPart(self.body.trim_by_plane(n, d + hair), planes)
        return above, CutPart(self.body.trim_by_plane(-n, hair - d), planes)


def list_bodies(halves: tuple[CutPart, CutPart], least: float) -> list[CutPart]:
    """Return the connected bodies of both halves, without those below a volume, [mm^3]."""
    every = (CutPart(body, half.planes) for half in halves for body in half.body.decompose())
    return [each for each in every if each.body.volume() > least]


def cut_through(part: CutPart, point: Array, normals: Array, least: float, hair: float) -> list[CutPart]:
    """Cut a part along the plane through a point that leaves the least hull volume; return the part alone if none can.

    Args:
        normals: Normals of the planes to try, (k, 3).
        least: Smaller bodies are rounding, and a cut that leaves a smaller half does not count, [mm^3].
    """
    best = [part]
    smallest = np.inf
    for n in normals:
        cut_in_halves = part.cut_in_halves(n, float(n @ point), hair)
        bodies = list_bodies(cut_in_halves, least)
        filled = sum(each.body.hull().volume() for each in bodies)
        if filled < smallest and min(half.body.volume() for half in cut_in_halves) > least:
            smallest = filled
            best = bodies
    return best
