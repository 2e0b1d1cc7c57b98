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


def cut_into_coarse_parts(body: Any, raw: RawSolid, beside: HollowSpace) -> Iterator[CutPart]:
    """Yield parts whose hulls stand for a solid: exact along flat faces that others come near, coarse elsewhere.

    Args:
        body: The solid as a manifold3d body, its round holes filled.
    """
    volume = body.volume()
    flats = beside.flats[_find_near_faces(raw, beside)]
    first = list(cut_at_reflex_edges(CutPart(body, np.zeros((0, 4))), beside.size, flats, True, [_MOST_CUTS], volume))
    most = max(2, _MOST_HULLS // len(first)) if first else 0
    for part in first:
        yield from bisect_hollow_part(part, beside.size, volume, most)


def _find_near_faces(raw: RawSolid, beside: HollowSpace) -> Array:
    """Return which flat regions other solids come near, (k,); all if the others are unknown."""
    flats = [region for region in raw.regions if region.kind == "plane"]
    if beside.others is None:
        return np.ones(len(flats), dtype=np.bool_)
    middles = raw.mesh.corners[raw.mesh.triangles].mean(axis=1)
    reach = [
        _NEAR_MM + float(np.ptp(raw.mesh.corners[raw.mesh.triangles[r.triangles]], axis=(0, 1)).max()) / 2
        for r in flats
    ]
    return np.array(
        [
            np.isfinite(beside.others.query(middles[region.triangles], distance_upper_bound=far)[0]).any()
            for region, far in zip(flats, reach, strict=True)
        ],
        dtype=np.bool_,
    )
