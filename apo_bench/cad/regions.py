"""The faces of a mesh: flat pieces that meet smoothly are tried as cylinders and cones, and what is left as planes."""

from typing import Any

import numpy as np

from apo_bench.cad.bands import turn_of, without_bands
from apo_bench.cad.facets import FLAT, Facets, facets_of
from apo_bench.cad.growing import groups, walls_of
from apo_bench.cad.raw import Mesh, Region
from apo_bench.cad.round_region import fitted_plane, round_region

_LARGER = 8.0
"""A flat piece so much larger than most of its neighbours on a free surface, slivers aside, is a plane beside it."""


def regions_of(mesh: Mesh) -> tuple[tuple[Region, ...], Any]:
    """The faces of a closed mesh in an order that its triangles give, and the flat piece of each triangle."""
    facets = facets_of(mesh)
    count = len(facets.areas)
    rounds = without_bands(mesh, facets, walls_of(mesh, facets), count)
    of_round = np.full(count, -1)
    for k, each in enumerate(rounds):
        of_round[each.members] = k
    found = [
        round_region(
            mesh, np.flatnonzero(np.isin(facets.of, each.members)), each.surface, each.hole, turn_of(facets, each)
        )
        for each in rounds
    ]
    free = _free(facets, of_round)
    thin = facets.areas < (FLAT * mesh.extent) ** 2
    free |= thin & (of_round < 0)
    for f in np.flatnonzero((of_round < 0) & ~free):
        found.append(fitted_plane(mesh, np.flatnonzero(facets.of == f)))
    for group in groups(facets, np.flatnonzero(free)):
        found.append(Region("other", np.flatnonzero(np.isin(facets.of, group))))
    found.sort(key=lambda region: int(region.triangles[0]))
    return tuple(found), facets.of


def _free(facets: Facets, of_round: Any) -> Any:
    """Which flat pieces belong to surfaces that are neither flat nor round."""
    left = of_round < 0
    pairs = facets.smooth[left[facets.smooth].all(axis=1)]
    free = np.zeros(len(left), dtype=bool)
    free[pairs] = True
    owner, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    order = np.lexsort((facets.areas[other], owner))
    pieces, first, count = np.unique(owner[order], return_index=True, return_counts=True)
    beside = facets.areas[other[order]]
    free[pieces] = facets.areas[pieces] < _LARGER * beside[first + 3 * count // 4]
    return free
