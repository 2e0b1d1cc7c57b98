"""Solids cut into convex pieces: along the planes of reflex edges, then around round holes, [mm]."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.boring import bored, filled
from apo_bench.cad.corners import corners_of, extremes, is_thick, once, volume_of
from apo_bench.cad.halving import at_shoulders, convex_parts, settled
from apo_bench.cad.raw import Mesh, RawSolid
from apo_bench.cad.shafts import as_cylinders, rounded
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull

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
    """The convex pieces of a solid: flat ones exact, round holes as wedges that touch the fitted wall."""
    size = raw.mesh.extent
    whole = manifold_of(raw.mesh)
    bores = [r for r in raw.regions if r.is_round and r.hole and r.square]
    for bore in bores:
        whole = whole + filled(raw.mesh, bore)
    if whole.num_tri() > _MOST_TRIANGLES:
        whole = whole.simplify(1e-3 * size)
    grown, hulls = 0.0, 0
    flats = flat_planes(raw)
    pieces: list[Array] = []
    shafts = [r for r in raw.regions if r.is_round and not r.hole and r.square]
    for part in at_shoulders(convex_parts(whole, size, flats), shafts, size):
        corners = once(settled(corners_of(part.body), part.planes, size))
        if len(corners) < 4 or not is_thick(corners):
            continue
        corners = extremes(corners, flats)
        volume, true = volume_of(corners), part.body.volume()
        if abs(volume - true) > _LOSS * true:
            grown, hulls = grown + volume - true, hulls + 1
        pieces.append(corners)
    found: list[Hull] = []
    for corners in pieces:
        found += [Hull("", 1e-3 * each) for each in bored(rounded(corners, shafts), bores, flats)]
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
