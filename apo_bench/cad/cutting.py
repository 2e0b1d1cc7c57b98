"""Solids cut into convex pieces: along the planes of reflex edges, then around round holes, [mm]."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.boring import bored, filled, least_pieces
from apo_bench.cad.corners import corners_of, extremes, is_thick, once, volume_of
from apo_bench.cad.halving import at_shoulders, convex_parts, settled
from apo_bench.cad.raw import Mesh, RawSolid
from apo_bench.cad.shafts import as_cylinders, rounded
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull
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


def cut(raw: RawSolid) -> Cut:
    """The convex pieces of a solid: flat ones exact, round holes as wedges that touch the fitted wall.

    Raises:
        InputError: The mesh makes no solid, or there are more pieces than a part may have.
    """
    size = raw.mesh.extent
    whole = manifold_of(raw.mesh)
    bores = [r for r in raw.regions if r.is_round and r.hole and r.square]
    if least_pieces(bores) > MOST_PIECES:
        raise InputError(
            f"its {len(bores)} round holes take {least_pieces(bores):,} convex pieces; {MOST_PIECES:,} are the most "
            "in a part, so leave out small ones."
        )
    for bore in bores:
        whole = whole + filled(raw.mesh, bore)
    if whole.num_tri() > _MOST_TRIANGLES:
        whole = whole.simplify(1e-3 * size)
    grown = 0.0
    hulls = 0
    flats = flat_planes(raw)
    pieces: list[Array] = []
    shafts = [r for r in raw.regions if r.is_round and not r.hole and r.square]
    for part in at_shoulders(convex_parts(whole, size, flats), shafts, size):
        given = once(settled(corners_of(part.body), part.planes, size))
        if len(given) < 4 or not is_thick(given):
            continue
        fine = rounded(given, shafts)
        corners = extremes(fine, flats, part.planes)
        true = part.body.volume()
        more = volume_of(given) - true + volume_of(corners) - volume_of(fine)
        if abs(more) > _LOSS * true:
            grown = grown + more
            hulls = hulls + 1
        pieces.append(corners)
    found: list[Hull] = []
    for corners in pieces:
        more = bored(corners, bores, flats, MOST_PIECES - len(found))
        found += [Hull("", 1e-3 * each) for each in more]
        if len(found) > MOST_PIECES:
            raise InputError(
                f"the part takes more than {MOST_PIECES:,} convex pieces, which are the most; leave out small holes "
                "and fillets."
            )
    return Cut(tuple(as_cylinders(found, shafts)), grown, hulls)


def manifold_of(mesh: Mesh) -> Any:
    """The mesh as manifold3d has it."""
    import manifold3d

    given = manifold3d.Mesh64(np.ascontiguousarray(mesh.corners), np.ascontiguousarray(mesh.triangles, dtype=np.uint64))
    found = manifold3d.Manifold(given)
    if found.status() != manifold3d.Error.NoError or found.is_empty():
        raise InputError("the mesh makes no solid; mend it where it was drawn, and save it again.")
    return found


def flat_planes(raw: RawSolid) -> Array:
    """The planes of the flat faces, (k, 4)."""
    found = [(*r.normal, r.normal @ r.point) for r in raw.regions if r.normal is not None and r.point is not None]
    return np.array(found).reshape(-1, 4)
