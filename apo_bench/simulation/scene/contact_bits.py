"""Choose MuJoCo's contact bits so that pieces skip collisions with walls of holes that they cannot enter.

A piece that is wider than a hole cannot enter it: the piece behind the wall supports it, so contacts with the wall
itself are not needed. Its edge may penetrate by the thickness of the wall. Pieces that could enter, the arm, and walls
with nothing behind them collide as usual; walls do not collide with each other.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Box, Piece, Solid
from apo_bench.simulation.scene.walls import linings, simulated_pieces

_ARM = 1
"""Bit by which an arm collides with everything."""
OF_PARTS = (1 << 31) - 1 - _ARM
"""All other bits: parts collide by them."""
_PARTS = 1 << 30
"""Bit by which parts collide with each other; lower bits are for holes, the highest for the narrowest."""
_MOST = 16
"""Number of distinguished widths of holes; the widest share the last bit."""
_SURELY_M = 1e-4
"""A piece cannot enter if it is this much wider than the hole without its walls."""


class Bits(NamedTuple):
    """MuJoCo's contact bits of a geom.

    Two geoms collide if the `contype` of one and the `conaffinity` of the other have a common bit.
    """

    contype: int
    conaffinity: int


def meetings(solids: Mapping[str, Solid], clearance_m: float) -> Mapping[str, Mapping[str, Bits]]:
    """Part -> name of a simulated piece -> its contact bits."""
    lined = {part: linings(solid, clearance_m) for part, solid in solids.items()}
    widths = sorted({round(width, 6) for walls in lined.values() for width in walls.values()})
    return {
        part: {
            piece.name: _of_wall(lined[part][piece.name], widths) if piece.name in lined[part] else _of(piece, widths)
            for pieces in simulated_pieces(solid, clearance_m).values()
            for piece in pieces
        }
        for part, solid in solids.items()
    }


def is_lining(bits: Bits) -> bool:
    """Whether these are the bits of a wall that some pieces do not collide with."""
    return not bits.contype & (_ARM | _PARTS)


def _of_wall(width: float, widths: list[float]) -> Bits:
    """The bits of a wall; `width` is its distance from the axis to what lies behind."""
    return Bits(_hole(widths.index(round(width, 6))), _ARM)


def _of(piece: Piece, widths: list[float]) -> Bits:
    """The bits of a piece that is no wall: it collides with the walls of all holes that it may enter."""
    if not widths:
        return Bits(_ARM, _ARM)
    narrow = widest_disc(piece)  # it cannot enter a hole of a smaller radius
    met = _ARM | _PARTS
    for i, width in enumerate(widths):
        if narrow <= width + _SURELY_M:
            met |= _hole(i)
    return Bits(_PARTS, met)


def _hole(i: int) -> int:
    """The bit of the hole width with index i, the narrowest first."""
    return _PARTS >> (1 + min(i, _MOST - 1))


def widest_disc(piece: Piece) -> float:
    """The radius of a flat disc inside a piece, [m]; the piece cannot enter a narrower hole.

    For boxes and cylinders it is the widest such disc, for other pieces the widest about the mean corner that is
    parallel to a side.
    """
    if isinstance(piece, Box):
        return float(np.sort(piece.half)[1])  # across the shortest side
    if piece.cylinder is not None:
        return piece.cylinder.radius
    # In a plane of normal m through the middle, the distance to a side of normal n is its distance / |n x m|.
    n = piece.planes[:, :3]
    far = piece.planes[:, 3] - n @ piece.corners.mean(axis=0)  # distance of each side from the middle
    return float((far / np.sqrt(np.maximum(1.0 - (n @ n.T) ** 2, 1e-12))).min(axis=1).max())
