"""Choose by contact bits which pieces can meet.

What is wider than a hole without its walls does not go in, and what is behind the walls holds it up: contacts with the
walls themselves are not needed. It may dig in with an edge, by the thickness of the walls deeper than it would. All
that could go in, the arm, and walls with nothing behind them meet as ever; walls do not meet walls.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Box, Piece, Solid
from apo_bench.simulation.scene.walls import linings, simulated_pieces

_ARM = 1
"""The bit by which an arm meets everything."""
OF_PARTS = (1 << 31) - 1 - _ARM
"""All other bits: what parts meet by."""
_PARTS = 1 << 30
"""The bit by which parts meet each other; those below it are of holes, the narrowest has the highest."""
_MOST = 16
"""So many widths of holes are distinguished; wider ones count as one."""
_SURELY_M = 1e-4
"""What is wider than the hole without its walls by this stays out."""


class Bits(NamedTuple):
    """Two geoms meet if the `contype` of one and the `conaffinity` of the other have a bit in common."""

    contype: int
    conaffinity: int


def meetings(solids: Mapping[str, Solid], clearance_m: float) -> Mapping[str, Mapping[str, Bits]]:
    """Part -> name of a piece as it is simulated -> its bits."""
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
    """Whether these are the bits of a wall that not all meets."""
    return not bits.contype & (_ARM | _PARTS)


def _of_wall(width: float, widths: list[float]) -> Bits:
    return Bits(_hole(widths.index(round(width, 6))), _ARM)


def _of(piece: Piece, widths: list[float]) -> Bits:
    if not widths:
        return Bits(_ARM, _ARM)
    narrow = widest_disc(piece)
    met = _ARM | _PARTS
    for i, width in enumerate(widths):
        if narrow <= width + _SURELY_M:
            met |= _hole(i)
    return Bits(_PARTS, met)


def _hole(i: int) -> int:
    return _PARTS >> (1 + min(i, _MOST - 1))


def widest_disc(piece: Piece) -> float:
    """The radius of a flat disc inside of a piece, [m]: the piece does not go through a narrower hole.

    Of boxes and cylinders it is the widest, of other pieces the widest about their middle that is parallel to a side.
    """
    if isinstance(piece, Box):
        return float(np.sort(piece.half)[1])
    if piece.cylinder is not None:
        return piece.cylinder.radius
    # From the middle, along a plane of normal m, a side of normal n is at its distance / |n x m|.
    n = piece.planes[:, :3]
    far = piece.planes[:, 3] - n @ piece.corners.mean(axis=0)
    return float((far / np.sqrt(np.maximum(1.0 - (n @ n.T) ** 2, 1e-12))).min(axis=1).max())
