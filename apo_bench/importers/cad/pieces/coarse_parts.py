"""Cut a solid where other solids come near only: along the flat faces there, then into hulls of halves, [mm]."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.pieces.cut_part import CutPart
from apo_bench.importers.cad.pieces.hollow_parts import HollowSpace
from apo_bench.importers.cad.pieces.plane_cuts import bisect_hollow_part, cut_at_reflex_edges
from apo_bench.importers.cad.solids import RawSolid

_NEAR_MM = 5.0
"""Solids within this distance of a flat face come near it."""
_MOST_CUTS = 60  # along flat faces
_MOST_HULLS = 80  # of the whole solid


def cut_into_coarse_parts(body: Any, beside: HollowSpace) -> Iterator[CutPart]:
    """Yield parts whose hulls stand for a solid: exact along flat faces that others come near, coarse elsewhere.

    Args:
        body: The solid as a manifold3d body, its round holes filled.
    """
    volume = body.volume()
    whole = CutPart(body, np.zeros((0, 4)))
    first = list(cut_at_reflex_edges(whole, beside.size, beside.flats, True, [_MOST_CUTS], volume))
    most = max(2, _MOST_HULLS // len(first)) if first else 0
    for part in first:
        yield from bisect_hollow_part(part, beside.size, volume, most)


def list_near_flats(raw: RawSolid, others: Any) -> Array:
    """Return the planes n . x = d of the flat faces that other solids come near, (k, 4); all if they are unknown.

    Args:
        others: KD tree of points of other solids, or None.
    """
    flats = [region for region in raw.regions if region.kind == "plane"]
    middles = raw.mesh.corners[raw.mesh.triangles].mean(axis=1)
    near = []
    for region in flats:
        reach = _NEAR_MM + float(np.ptp(raw.mesh.corners[raw.mesh.triangles[region.triangles]], axis=(0, 1)).max()) / 2
        if others is None or np.isfinite(others.query(middles[region.triangles], distance_upper_bound=reach)[0]).any():
            near.append((*region.direction, region.direction @ region.point))
    return np.array(near).reshape(-1, 4)
