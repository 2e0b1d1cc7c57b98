"""Solids cut into convex pieces: along the planes of reflex edges, then around round holes, [mm]."""

from typing import NamedTuple

import numpy as np

from apo_bench.cad.pieces.corners import corners_of, extremes, is_thick, without_near
from apo_bench.cad.pieces.halving import at_shoulders, convex_parts, settled
from apo_bench.cad.pieces.refining import Beside
from apo_bench.cad.pieces.round_walls import as_cylinders, bored, least_pieces, with_round_shafts
from apo_bench.cad.solids.bodies import body_of
from apo_bench.cad.solids.raw_solid import RawSolid
from apo_bench.errors import InputError
from apo_bench.geometry import Array, Hull
from apo_bench.parts.allowed import MOST_PIECES

_MOST_TRIANGLES = 20_000
_LOSS = 1e-3
"""A piece whose volume differs by more than this part from what it stands for is said to do so."""


class Cut(NamedTuple):
    """The convex pieces of a solid."""

    pieces: tuple[Hull, ...]
    """[m]."""
    grown: float
    """By how much pieces that stand for hollow or free shapes are larger, [mm^3]; negative: smaller."""
    hulls: int
    """How many do."""


def cut(raw: RawSolid, others: Array | None = None) -> Cut:
    """The convex pieces of a solid: flat ones exact, round holes as wedges that touch the fitted wall.

    Args:
        others: Points of what comes near to it, (k, 3), [mm]; None: nothing is known of others.

    Raises:
        InputError: The mesh makes no solid, or there are more pieces than a part may have.
    """
    import manifold3d
    from scipy.spatial import ConvexHull, cKDTree

    size = raw.mesh.extent
    body = body_of(raw.mesh)
    if body.status() != manifold3d.Error.NoError or body.is_empty():
        raise InputError("the mesh makes no solid; mend it where it was drawn, and save it again.")
    bores = [r for r in raw.regions if r.is_round and r.hole and r.square]
    if least_pieces(bores) > MOST_PIECES:
        raise InputError(
            f"its {len(bores)} round holes take {least_pieces(bores):,} convex pieces; {MOST_PIECES:,} are the most "
            "in a part, so leave out small ones."
        )
    for bore in bores:  # is filled with what was taken away, as the mesh has it
        body = body + manifold3d.Manifold.hull_points(raw.mesh.corners[np.unique(raw.mesh.triangles[bore.triangles])])
    if body.num_tri() > _MOST_TRIANGLES:
        body = body.simplify(min(1e-3 * size, 0.01))
    grown = list[float]()
    flats = np.array([(*r.direction, r.direction @ r.point) for r in raw.regions if r.kind == "plane"]).reshape(-1, 4)
    beside = Beside(size, flats, None if others is None else cKDTree(others))
    outlines: list[Array] = []
    shafts = [r for r in raw.regions if r.is_round and not r.hole and r.square]
    for part in at_shoulders(convex_parts(body, beside), shafts, size):
        coarse = without_near(settled(corners_of(part.body), part.planes, size))
        if len(coarse) < 4 or not is_thick(coarse):
            continue
        fine = with_round_shafts(coarse, shafts)
        corners = extremes(fine, flats, part.planes, others is not None)
        # What a hull fills of a hollow part, and what is lost where corners are left out; round walls are no loss.
        true = part.body.volume()
        coarse_volume, fine_volume, kept_volume = (ConvexHull(each).volume for each in (coarse, fine, corners))
        more = coarse_volume - true + kept_volume - fine_volume
        if abs(more) > _LOSS * true:
            grown.append(more)
        outlines.append(corners)
    pieces: list[Hull] = []
    for corners in outlines:
        pieces += [Hull("", 1e-3 * each) for each in bored(corners, bores, flats, MOST_PIECES - len(pieces))]
        if len(pieces) > MOST_PIECES:
            raise InputError(
                f"the part takes more than {MOST_PIECES:,} convex pieces, which are the most; leave out small holes "
                "and fillets."
            )
    return Cut(tuple(as_cylinders(pieces, shafts)), sum(grown, 0.0), len(grown))
