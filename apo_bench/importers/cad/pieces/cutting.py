"""Solids cut into convex pieces: along the planes of reflex edges, then around round holes, [mm]."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array, Hull
from apo_bench.importers.cad.pieces.corners import corners_of, extremes, is_thick, without_near
from apo_bench.importers.cad.pieces.halving import HAIR, at_shoulders, convex_parts, settled
from apo_bench.importers.cad.pieces.keeping_out import keeping_out
from apo_bench.importers.cad.pieces.refining import Beside
from apo_bench.importers.cad.pieces.round_walls import as_cylinders, bored, least_pieces, with_round_shafts
from apo_bench.importers.cad.solids.bodies import body_of
from apo_bench.importers.cad.solids.raw_solid import RawSolid, Region
from apo_bench.scenario.parts.allowed import MOST_PIECES
from apo_bench.scenario.parts.checking import touching_groups

_MOST_TRIANGLES = 20_000
_MOUTH_MM = 1.0
_WEDGES = 300
"""Beside other parts holes that nothing comes near to are filled where all holes would take more pieces."""
_CRUMB = 1e-3
"""Pieces that touch none of the others are left out if they are so little of a solid."""
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
    filled: tuple[str, ...] = ()
    """Round holes that are not there, since the part would have too many pieces with them."""


def cut(raw: RawSolid, others: Array | None = None, mates: Any = None) -> Cut:
    """The convex pieces of a solid: flat ones exact, round holes as wedges that touch the fitted wall.

    Args:
        others: Points of what comes near to it, (k, 3), [mm]; None: nothing is known of others.
        mates: All others where they are, as one body of manifold3d, as far as that is known.

    Raises:
        InputError: The mesh makes no solid, or there are more pieces than a part may have.
    """
    trimmed, is_one = _cut(raw, others, mates, True)
    # What is taken off hulls may be all that holds two of them together.
    return trimmed if is_one else _cut(raw, others, mates, False)[0]


def _cut(raw: RawSolid, others: Array | None, mates: Any, trims: bool) -> tuple[Cut, bool]:
    """The pieces, and whether all of them hang together."""
    import manifold3d
    from scipy.spatial import ConvexHull, cKDTree

    size = raw.mesh.extent
    body = body_of(raw.mesh)
    if body.status() != manifold3d.Error.NoError or body.is_empty():
        raise InputError("the mesh makes no solid; correct it where it was drawn, and save it again.")
    bores = [r for r in raw.regions if r.is_round and r.hole and r.square]
    for bore in bores:  # is filled with what was taken away, as the mesh has it
        body = body + manifold3d.Manifold.hull_points(raw.mesh.corners[np.unique(raw.mesh.triangles[bore.triangles])])
    if body.num_tri() > _MOST_TRIANGLES:
        body = body.simplify(min(1e-3 * size, 0.01))
    grown = list[float]()
    flats = np.array([(*r.direction, r.direction @ r.point) for r in raw.regions if r.kind == "plane"]).reshape(-1, 4)
    beside = Beside(size, flats, None if others is None else cKDTree(others), trims)
    outlines: list[Array] = []
    shafts = [r for r in raw.regions if r.is_round and not r.hole and r.square]
    parts = convex_parts(body, beside)
    if mates is not None:
        parts = keeping_out(parts, body, mates, HAIR * size)
    for part in at_shoulders(parts, shafts, size):
        coarse = without_near(settled(corners_of(part.body), part.planes, size))
        if len(coarse) < 4 or not is_thick(coarse):
            continue
        fine = with_round_shafts(coarse, shafts)
        corners = extremes(fine, flats, part.planes)
        # What a hull fills of a hollow part, and what is lost where corners are left out; round walls are no loss.
        true = part.body.volume()
        coarse_volume, fine_volume, kept_volume = (ConvexHull(each).volume for each in (coarse, fine, corners))
        more = coarse_volume - true + kept_volume - fine_volume
        if abs(more) > _LOSS * true:
            grown.append(more)
        outlines.append(corners)
    kept = sorted(bores, key=lambda bore: (_is_near(bore, others), max(bore.radii)), reverse=True)
    # Screws that nobody drew: beyond some pieces, holes that nothing comes near to are filled.
    while others is not None and kept and least_pieces(kept) > _WEDGES and not _is_near(kept[-1], others):
        kept.pop()
    pieces = _bored(outlines, kept, flats)
    while pieces is None and kept:
        # What nothing comes near to goes first, and what is small; others are there as they were drawn.
        kept = kept[: min(len(kept) * 3 // 4, max(1, MOST_PIECES * len(kept) // least_pieces(kept)))]
        pieces = _bored(outlines, kept, flats)
    if pieces is None:
        raise InputError(
            f"the part takes more than {MOST_PIECES:,} convex pieces without its holes, which are the most; leave "
            "out fillets and free surfaces."
        )
    filled = tuple(bore.name for bore in bores if bore not in kept)
    whole, lost, is_one = _without_crumbs(list(as_cylinders(pieces, shafts)), _CRUMB * raw.mesh.volume)
    return Cut(tuple(whole), sum([*grown, *(-each for each in lost)]), len(grown) + len(lost), filled), is_one


def _without_crumbs(pieces: list[Hull], most: float) -> tuple[list[Hull], list[float], bool]:
    """Without what hangs on nothing once free shapes are trimmed, if it is no more than that; how much that is; and
    whether nothing else hangs on nothing."""
    from scipy.spatial import ConvexHull

    groups = sorted(touching_groups(pieces), key=len)
    lost = [(group, sum(ConvexHull(1e3 * pieces[k].corners).volume for k in group)) for group in groups[:-1]]
    crumbs = [(group, volume) for group, volume in lost if volume < most]
    gone = {k for group, _ in crumbs for k in group}
    left = [piece for k, piece in enumerate(pieces) if k not in gone]
    return left, [volume for _, volume in crumbs], len(crumbs) == len(lost)


def _bored(outlines: Sequence[Array], bores: Sequence[Region], flats: Array) -> list[Hull] | None:
    """All pieces less holes; None if there are too many."""
    pieces: list[Hull] = []
    for corners in outlines if least_pieces(bores) <= MOST_PIECES else ():
        pieces += [Hull("", 1e-3 * each) for each in bored(corners, bores, flats, MOST_PIECES - len(pieces))]
        if len(pieces) > MOST_PIECES:
            return None
    return pieces or None


def _is_near(bore: Region, others: Array | None) -> bool:
    """Whether points of others, (k, 3), come into a hole or to its mouth."""
    if others is None or not len(others):
        return False
    height, distance, _ = bore.polar(others)
    level = (height > bore.span[0] - _MOUTH_MM) & (height < bore.span[1] + _MOUTH_MM)
    return bool((level & (distance < max(bore.radii))).any())
