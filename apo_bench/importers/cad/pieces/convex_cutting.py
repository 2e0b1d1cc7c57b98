"""Cut a solid into convex pieces: along planes of reflex edges, then around round holes, [mm]."""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import manifold3d
import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, Hull
from apo_bench.importers.cad.joined_solids import split_solid
from apo_bench.importers.cad.pieces.coarse_parts import cut_into_coarse_parts, list_near_flats
from apo_bench.importers.cad.pieces.corners import is_thick, list_body_corners, list_hull_corners, merge_near_points
from apo_bench.importers.cad.pieces.holes import bore_piece, count_least_pieces
from apo_bench.importers.cad.pieces.hollow_parts import HollowSpace
from apo_bench.importers.cad.pieces.plane_cuts import cut_at_shoulders, cut_into_convex_parts, snap_to_planes
from apo_bench.importers.cad.pieces.shafts import convert_to_cylinders, refine_shaft_corners
from apo_bench.importers.cad.solids import RawSolid, Region, convert_to_manifold
from apo_bench.scenario.parts.limits import MOST_PIECES
from apo_bench.scenario.parts.mass_checks import group_touching_pieces

_MOST_TRIANGLES = 20_000  # a body with more is simplified first
_INSIDE_MM = 0.05  # a solid deeper in a hole than this comes into it, and does not only cover it
_WEDGES = 100
"""In an assembly, unused holes are filled if all holes would need more wedges than this."""
_CRUMB = 1e-3
"""Groups of pieces that touch no others are dropped if they are below this share of the volume of the solid."""
_COARSE_CRUMB = 0.03  # the same share for coarse pieces
_LOSS = 1e-3
"""A piece counts as a hull of a free-form shape if its volume is off by more than this share."""


class CutSolid(NamedTuple):
    """The convex pieces of a solid."""

    pieces: tuple[Hull, ...]
    """Convex pieces, [m]."""
    hulls: int
    """The number of pieces that are hulls of hollow or free-form shapes, or were dropped."""
    filled: tuple[str, ...] = ()
    """Names of the round holes that are filled, as pieces around them would be too many."""
    coarse: bool = False
    """Whether pieces are exact only next to faces that other solids come near."""


def cut_solid(raw: RawSolid, others: Array | None = None, coarse: bool = False) -> CutSolid:
    """Cut a solid into convex pieces: exact at flat faces, wedges that touch the fitted wall around round holes.

    Args:
        others: Points of other solids that come near, (k, 3), [mm]; None: unknown.
        coarse: Whether to cut only along flat faces that other solids come near; hulls stand for the rest.

    Raises:
        InputError: The mesh makes no solid, or there are more pieces than a part may have.
    """
    cuts = [_cut_connected(each, others, coarse) for each in split_solid(raw)]
    pieces = tuple(chain.from_iterable(each.pieces for each in cuts))
    filled = tuple(chain.from_iterable(each.filled for each in cuts))
    _check_count(len(pieces))
    return CutSolid(pieces, sum(each.hulls for each in cuts), filled, coarse)


def _check_count(pieces: int) -> None:
    """Raise InputError if a part needs more pieces than it may have."""
    require(
        pieces <= MOST_PIECES,
        f"the shape for collisions needs more than {MOST_PIECES:,} convex blocks, which are the most; leave out "
        "fillets and free surfaces.",
    )


def _cut_connected(raw: RawSolid, others: Array | None, coarse: bool) -> CutSolid:
    """Cut a connected solid into convex pieces."""
    body = convert_to_manifold(raw.mesh)
    if body.status() != manifold3d.Error.NoError or body.is_empty():
        raise InputError("the mesh makes no solid; repair it in its CAD program, and save it again.")
    bores = [r for r in raw.regions if r.is_round and r.hole and r.square]
    shafts = [r for r in raw.regions if r.is_round and not r.hole and r.square]
    # Planes n . x = d.
    flats = np.array([(*r.direction, r.direction @ r.point) for r in raw.regions if r.kind == "plane"]).reshape(-1, 4)
    size = raw.mesh.extent
    for bore in bores:  # fill the hole for now; `_bore_holes` cuts it again with wedges
        body = body + manifold3d.Manifold.hull_points(raw.mesh.corners[np.unique(raw.mesh.triangles[bore.triangles])])
    if body.num_tri() > _MOST_TRIANGLES:
        body = body.simplify(min(1e-3 * size, 0.01))
    hulls = 0
    outlines: list[Array] = []
    tree = None if others is None else cKDTree(others)
    beside = HollowSpace(size, list_near_flats(raw, tree), tree)
    parts = cut_into_coarse_parts(body, beside) if coarse else cut_into_convex_parts(body, beside)
    for part in cut_at_shoulders(parts, shafts, size):
        rough = merge_near_points(snap_to_planes(list_body_corners(part.body), part.planes, size))
        if len(rough) < 4 or not is_thick(rough):
            continue
        fine = refine_shaft_corners(rough, shafts)
        corners = list_hull_corners(fine, flats, part.planes)
        # A hull fills concave parts, and loses volume where corners are dropped; rounded walls are no error.
        true = part.body.volume()
        rough_volume, fine_volume, kept_volume = (ConvexHull(each).volume for each in (rough, fine, corners))
        hulls += abs(rough_volume - true + kept_volume - fine_volume) > _LOSS * true
        outlines.append(corners)
    # Most important holes first: those that other solids come near, then the widest.
    used = [_is_used(bore, others) for bore in bores]
    order = sorted(range(len(bores)), key=lambda k: (used[k], max(bores[k].radii)), reverse=True)
    kept = [bores[k] for k in order]
    # Unused holes, such as screw holes, are filled from the least important one if all of them need too many wedges.
    most = 0 if coarse else _WEDGES
    while others is not None and len(kept) > sum(used) and count_least_pieces(kept) > most:
        kept.pop()
    pieces = _bore_holes(outlines, kept, flats)
    while pieces is None and kept:
        # Fill at least a quarter of the holes, the least important ones.
        kept = kept[: min(len(kept) * 3 // 4, max(1, MOST_PIECES * len(kept) // count_least_pieces(kept)))]
        pieces = _bore_holes(outlines, kept, flats)
    _check_count(MOST_PIECES + 1 if pieces is None else len(pieces))
    assert pieces is not None
    crumb = (_COARSE_CRUMB if coarse else _CRUMB) * raw.mesh.volume
    whole, lost = _drop_crumbs(list(convert_to_cylinders(pieces, shafts)), crumb)
    return CutSolid(tuple(whole), hulls + lost, tuple(bore.name for bore in bores if bore not in kept), coarse)


def _drop_crumbs(pieces: list[Hull], most: float) -> tuple[list[Hull], int]:
    """Drop groups of pieces of little volume that touch no other pieces.

    Args:
        most: Volume below which a group is dropped, [mm^3].

    Returns:
        The remaining pieces, and the number of dropped groups.
    """
    loose = sorted(group_touching_pieces(pieces), key=len)[:-1]  # all groups but the one with most pieces
    volumes = [sum(ConvexHull(1e3 * pieces[k].corners).volume for k in group) for group in loose]
    crumbs = [group for group, volume in zip(loose, volumes, strict=True) if volume < most]
    dropped = set[int]().union(*crumbs)
    return [piece for k, piece in enumerate(pieces) if k not in dropped], len(crumbs)


def _bore_holes(outlines: Sequence[Array], bores: Sequence[Region], flats: Array) -> list[Hull] | None:
    """Return all pieces with the holes cut out, [m]; None if there are too many.

    Args:
        outlines: The corners of each piece, (k, 3), [mm].
        flats: Planes of flat faces, (k, 4).
    """
    pieces: list[Hull] = []
    for corners in outlines if count_least_pieces(bores) <= MOST_PIECES else ():
        pieces += [Hull("", 1e-3 * each) for each in bore_piece(corners, bores, flats, MOST_PIECES - len(pieces))]
        if len(pieces) > MOST_PIECES:
            return None
    return pieces or None


def _is_used(bore: Region, others: Array | None) -> bool:
    """Whether points of other solids, (k, 3), come into a hole."""
    if others is None:
        return False
    height, distance, _ = bore.polar(others)
    is_level = (height > bore.span[0] + _INSIDE_MM) & (height < bore.span[1] - _INSIDE_MM)
    return bool((is_level & (distance < max(bore.radii))).any())
