"""A part of a solid that is to be one piece, [mm]."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array


class CutPart(NamedTuple):
    """A part of a solid that is to be one piece."""

    body: Any
    """As manifold3d has it."""
    planes: Array
    """Along which it was cut, (k, 4)."""

    def halves(self, n: Array, d: float, hair: float = 0.0) -> tuple["CutPart", "CutPart"]:
        """What is above and below the plane n . x = d, both a hair's breadth off it.

        On the plane, rounding would leave flaps of no thickness.
        """
        planes = np.concatenate([self.planes, [[*n, d]]])
        above = CutPart(self.body.trim_by_plane(n, d + hair), planes)
        return above, CutPart(self.body.trim_by_plane(-n, hair - d), planes)
