"""Join solids that belong together, such as those of a servo or a bearing, into one solid."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import manifold3d
import numpy as np

from apo_bench.importers.cad.solids import (
    RawSolid,
    convert_to_manifold,
    convert_to_mesh,
    find_connected_groups,
    simplify_body,
)
from apo_bench.scenario.parts.mass_checks import APART_M

_NEAR_MM = 1e3 * APART_M
"""Solids of one component that are nearer to each other are one part."""


def join_near_solids(raws: Sequence[RawSolid]) -> list[RawSolid]:
    """Return the solids of one component with those joined that lie next to each other."""
    bodies = [convert_to_manifold(raw.mesh) for raw in raws]
    near = [
        (i, k) for i, k in combinations(range(len(raws)), 2) if bodies[i].min_gap(bodies[k], 2 * _NEAR_MM) < _NEAR_MM
    ]
    count, group = find_connected_groups(np.array(near, dtype=np.int64).reshape(-1, 2), len(raws))
    return number_solids([_join([raw for raw, g in zip(raws, group, strict=True) if g == k]) for k in range(count)])


def number_solids(raws: Sequence[RawSolid]) -> list[RawSolid]:
    """Return the solids of one name with a number behind it if there are several."""
    return [_number(raw, f"_{k}") for k, raw in enumerate(raws, start=1)] if len(raws) > 1 else [*raws]


def _number(raw: RawSolid, number: str) -> RawSolid:
    places = (place._replace(name=raw.name + number) if place.name == raw.name else place for place in raw.places)
    return replace(raw, name=raw.name + number, places=tuple(places))


def _join(raws: Sequence[RawSolid]) -> RawSolid:
    """Return the union of solids without faces, with name and places of the first one."""
    if len(raws) == 1:
        return raws[0]
    bodies = [convert_to_manifold(raw.mesh) for raw in raws]
    mesh = simplify_body(convert_to_mesh(manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)))
    repairs = dict.fromkeys(repair for raw in raws for repair in raw.repairs)
    joined = f"{len(raws)} solids next to each other are joined"
    return RawSolid(raws[0].name, mesh, raws[0].places, (*repairs, joined))


def split_solid(raw: RawSolid) -> list[RawSolid]:
    """Return the connected solids of a joined one, each with its faces; the solid itself if it is one, or hollow."""
    mesh = raw.mesh
    count, group = find_connected_groups(mesh.neighbours, len(mesh.triangles))
    parts = [mesh.part(np.flatnonzero(group == k)) for k in range(count)]
    if count == 1 or min(part.volume for part in parts) < 0.0:
        return [raw]
    # The number of each triangle among those of its solid.
    number = np.zeros(len(group), dtype=np.int64)
    for k in range(count):
        number[group == k] = np.arange((group == k).sum())
    return [
        replace(
            raw,
            mesh=part,
            regions=tuple(replace(r, triangles=number[r.triangles]) for r in raw.regions if group[r.triangles[0]] == k),
        )
        for k, part in enumerate(parts)
    ]
