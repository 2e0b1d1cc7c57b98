"""Regions become the faces of a part that can make contacts, [m]."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from apo_bench.cad.solids.raw_solid import RawSolid, Region, square_to
from apo_bench.geometry import Array, Face, RoundFace, sides_of, straightened
from apo_bench.parts.making.outline import COARSE_SIDES

_THINNEST_MM = 0.05


def contact_faces(raw: RawSolid) -> tuple[list[Face], list[RoundFace], dict[str, str]]:
    """Flat and round faces of the regions that have names; those that cannot be stated, with the reason."""
    flats: list[Face] = []
    rounds: list[RoundFace] = []
    refused: dict[str, str] = {}
    for region in raw.regions:
        if not region.name:
            continue
        if region.is_round and max(region.radii) < _THINNEST_MM:
            refused[region.name] = "it is too thin"
        elif region.is_round:
            span, radii = (1e-3 * np.array([region.span, region.radii])).tolist()
            point = 1e-3 * region.point
            rounds.append(RoundFace(region.name, point, region.direction, tuple(span), tuple(radii), region.hole))
        elif (face := _flat_face(raw, region)) is not None:
            flats.append(face)
        else:
            refused[region.name] = "it has more than one outline"
    return flats, rounds, refused


def _flat_face(raw: RawSolid, region: Region) -> Face | None:
    """A flat region with its holes; its ends of round walls are polygons inside of it, within 0.005 mm.

    None if it has no single outline.
    """
    n = region.direction
    flat = np.array(square_to(n))
    offset = 1e-3 * float(n @ region.point) * n
    outlines: list[Array] = []
    holes: list[Array] = []
    for corners, beside in _loops(raw, region):
        # The material is left of a border: outlines run counter-clockwise seen against n, holes the other way.
        area = _area(raw.mesh.corners[corners] @ flat.T)
        ring = _circle(raw, region, beside, area < 0.0)
        points = 1e-3 * (raw.mesh.corners[corners] if ring is None else ring)
        kept = straightened(points @ flat.T)
        if area * _area(kept) < 0.0:
            kept = kept[::-1]
        if len(kept) >= 3:
            (outlines if area > 0.0 else holes).append(kept @ flat + offset)
    return Face(region.name, outlines[0], tuple(holes)) if len(outlines) == 1 else None


def _area(ring: Array) -> float:
    """Of a polygon (k, 2), negative if it is clockwise."""
    x, y = (ring - ring[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def _loops(raw: RawSolid, region: Region) -> Iterator[tuple[Any, set[int]]]:
    """The borders of a region: corners in their order, and the regions on the other side."""
    mesh = raw.mesh
    of = np.full(len(mesh.triangles), -1)
    for k, each in enumerate(raw.regions):
        of[each.triangles] = k
    mine = np.isin(np.arange(len(mesh.triangles)), region.triangles)
    # Border edges as the triangle inside has them; an edge is directed as in the first of its two neighbours.
    i, k = mesh.neighbours.T
    forth = mine[i] & ~mine[k]
    back = mine[k] & ~mine[i]
    edges = np.concatenate([mesh.edges[forth], mesh.edges[back][:, ::-1]]).tolist()
    others = np.concatenate([of[k[forth]], of[i[back]]]).tolist()
    # From each corner to the next one, until a loop closes; a corner in which two loops touch has two ways on.
    after: dict[int, list[tuple[int, int]]] = {}
    for (a, b), other in zip(edges, others, strict=True):
        after.setdefault(a, []).append((b, other))
    while after:
        at = min(after)
        corners: list[int] = []
        beside = set()
        while at in after and at not in corners[:1]:
            corners.append(at)
            at, other = after[at].pop()
            beside.add(other)
            if not after[corners[-1]]:
                del after[corners[-1]]
        yield np.array(corners), beside


def _circle(raw: RawSolid, region: Region, beside: set[int], hole: bool) -> Array | None:
    """A border that is the whole end of a round wall, as a finer polygon than the mesh has, [mm]."""
    wall = raw.regions[beside.pop()]
    if beside or not wall.square:
        return None
    # Where the axis meets the plane; corners between those of the wall's pieces, for a hole on a circle around it.
    height = float((region.point - wall.point) @ region.direction / (wall.direction @ region.direction))
    r = float(wall.radius_at(height))
    n = max(sides_of(1e-3 * max(wall.radii)), COARSE_SIDES)
    angle = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    return wall.around(height, r / np.cos(np.pi / n) if hole else r, angle)
