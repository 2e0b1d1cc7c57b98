"""Cut a solid along planes until its parts are convex: along flat faces, then along sides of free shapes, [mm]."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.pieces.corners import corners_of
from apo_bench.importers.cad.pieces.cut_part import SLIVER, CutPart, cut_through
from apo_bench.importers.cad.pieces.refining import Beside, refine_pieces
from apo_bench.importers.cad.solids import Region, convert_to_mesh

_MOST_CUTS = 400
_TRIES = 6
HAIR = 2e-6
"""The distance of a cut from its plane, as a share of the size."""
_MOST_FREE_PLANES = 80
"""A free shape with more planes at reflex edges is halved."""
_MOST_BISECTED = 40  # parts of a shape that is halved
_ROUGH = 0.01  # of its volume: what hulls may fill beyond its parts
_FINE_TRIANGLES = 4000  # of a shape that is simplified before


def convex_parts(solid: Any, beside: Beside) -> Iterator[CutPart]:
    """Return parts that are convex, or that stand for a hollow free shape with their hull."""
    volume = solid.volume()
    yield from refine_pieces(_parts(solid, beside.size, beside.flats, volume), beside, volume, HAIR * beside.size)


def _parts(solid: Any, size: float, flats: Array, volume: float) -> Iterator[CutPart]:
    cuts = [_MOST_CUTS]
    for part in _cut(CutPart(solid, np.zeros((0, 4))), size, flats, True, cuts, volume):
        planes = _reflex_planes(part.body, size)
        if not len(planes) or (part.body.num_tri() > _FINE_TRIANGLES and _spare(part) < 1e-3 * part.body.volume()):
            yield part
        elif len(planes) <= _MOST_FREE_PLANES:
            yield from _cut(part, size, flats, False, cuts, volume)
        else:
            yield from _halved(part, size, volume)


def _cut(
    part: CutPart, size: float, flats: Array, only_flats: bool, cuts: list[int], volume: float
) -> Iterator[CutPart]:
    """Cut along planes of reflex edges, as long as there are cuts left."""
    to_cut = [part]
    least = SLIVER * volume
    while to_cut:
        whole, along = to_cut.pop()
        # The bodies that one consists of; the whole, if there is a cavity in one of them: a smaller one is rounding.
        bodies = whole.decompose()
        for body in [whole] if any(each.volume() < -least for each in bodies) else bodies:
            if body.volume() < least:
                continue
            each = CutPart(body, along)
            # The first of the best planes that leaves something on both sides; through a cavity if there is one, since
            # no plane of a reflex edge may reach it.
            planes = _planes_to_cut(body, size, flats, only_flats) if cuts[0] > 0 else []
            for n, d in [*planes[:_TRIES], *_through_cavity(body, least)]:
                halves = each.halves(n, d, HAIR * size)
                if min(half.body.volume() for half in halves) > least:
                    cuts[0] -= 1
                    to_cut += halves
                    break
            else:
                yield each


def _through_cavity(body: Any, least: float) -> Iterator[tuple[Array, float]]:
    """Planes through the middle of a cavity, if there is one."""
    for each in body.decompose():
        if each.volume() < -least:
            low, high = np.array(each.bounding_box()).reshape(2, 3)
            for axis in np.argsort(high - low):
                yield np.eye(3)[axis], float(low[axis] + high[axis]) / 2.0


def _planes_to_cut(body: Any, size: float, flats: Array, only_flats: bool) -> list[tuple[Array, float]]:
    """Planes of reflex edges, as the flat face in them has it."""
    planes = []
    for plane in _reflex_planes(body, size):
        # The side of a body is rounded by the cuts before; the plane of the face that it lies on is not.
        cosine = flats[:, :3] @ plane[:3]
        same = (np.abs(cosine) > 1.0 - 1e-6) & (np.abs(flats[:, 3] * np.sign(cosine) - plane[3]) < HAIR * size)
        planes += [*flats[same], *([] if only_flats else [plane])][:1]
    return [(plane[:3], float(plane[3])) for plane in planes]


def _spare(part: CutPart) -> float:
    """What the hull of a part fills beyond the part."""
    return float(part.body.hull().volume() - part.body.volume())


def _halved(part: CutPart, size: float, volume: float) -> list[CutPart]:
    """A hollow free shape, halved where that brings its hulls nearest to it."""
    body = part.body.simplify(min(1e-3 * size, 0.01)) if part.body.num_tri() > _FINE_TRIANGLES else part.body
    parts = [CutPart(each, part.planes) for each in body.decompose()]
    spare = [_spare(each) for each in parts]
    while parts and len(parts) < _MOST_BISECTED and max(spare) > _ROUGH * volume / len(parts):
        # The part whose hull fills most beyond it; one that no cut makes better counts as done.
        k = int(np.argmax(spare))
        low, high = np.reshape(parts[k].body.bounding_box(), (2, 3))
        halves = cut_through(parts[k], (low + high) / 2.0, np.eye(3), SLIVER * volume, HAIR * size)
        parts[k : k + 1] = halves
        spare[k : k + 1] = [_spare(each) for each in halves] if len(halves) > 1 else [0.0]
    return parts


def cut_at_shoulders(parts: Iterator[CutPart], shafts: Sequence[Region], size: float) -> Iterator[CutPart]:
    """Cut parts where one round wall meets another one: a cylinder and its chamfer are two pieces."""
    for part in parts:
        # So many corners of a part are on the wall of a shaft that it is one.
        corners = corners_of(part.body)
        mine = [shaft for shaft in shafts if shaft.is_on_wall(corners, 1e-3).sum() >= 6]
        slices = [part]
        if len(mine) > 1:
            for n, d in ((s.direction, float(s.point @ s.direction) + end) for s in mine for end in s.span):
                slices = [half for each in slices for half in _across(each, n, d, HAIR * size)]
        yield from slices


def _across(part: CutPart, n: Array, d: float, hair: float) -> Sequence[CutPart]:
    """Both halves of a part, or the part where a plane does not go through it."""
    height = corners_of(part.body) @ n - d
    is_beside = height.min() > -10.0 * hair or height.max() < 10.0 * hair
    return (part,) if is_beside else part.halves(n, d, hair)


def snap_to_planes(corners: Array, planes: Array, size: float) -> Array:
    """Move corners that are a hair's breadth off the planes of cuts onto them."""
    corners = corners.copy()
    # A corner on two or three planes is brought onto them in turns, as each step leaves the other ones a little.
    for _ in range(4):
        for n, d in zip(planes[:, :3], planes[:, 3], strict=True):
            off = corners @ n - d
            off[np.abs(off) > 3.0 * HAIR * size] = 0.0
            corners -= np.outer(off, n)
    return corners


def _reflex_planes(body: Any, size: float) -> Array:
    """Planes, (k, 4), of sides at reflex edges, those with the longest edges in them first."""
    mesh = convert_to_mesh(body)
    length = np.linalg.norm(mesh.across, axis=1)
    normals = mesh.across / np.maximum(length, 1e-300)[:, None]
    # An edge is reflex if the far corner of one triangle is above the plane of the other one.
    i, k = mesh.neighbours.T
    points = mesh.corners[mesh.triangles[k]] - mesh.corners[mesh.edges[:, 0]][:, None]
    above = (points * normals[i][:, None]).sum(axis=2).max(axis=1)
    sound = (length[i] > 1e-9 * size**2) & (length[k] > 1e-9 * size**2)
    reflex = sound & (above > max(1e-6 * size, 1e-4)) & ((normals[i] * normals[k]).sum(axis=1) < 1.0 - 1e-7)
    if not reflex.any():
        return np.zeros((0, 4))
    ends = mesh.corners[mesh.edges[reflex]]
    sides = np.concatenate([i[reflex], k[reflex]])
    n = normals[sides]
    planes = np.column_stack([n, (n * mesh.corners[mesh.triangles[sides, 0]]).sum(axis=1)])
    # Each plane once, up to rounding; the score of a plane is the length of all reflex edges in it, planes along the
    # frame before others of the same score.
    _, first = np.unique(np.round(planes * [1e5, 1e5, 1e5, 1e5 / size]), axis=0, return_index=True)
    planes = planes[np.sort(first)][:400]
    inside = (np.abs(ends @ planes[:, :3].T - planes[:, 3]) < 2e-6 * size).all(axis=1)
    score = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) @ inside
    aligned = np.abs(planes[:, :3]).max(axis=1) > 1.0 - 1e-9
    return np.asarray(planes[np.lexsort((~aligned, -np.round(score / size, 6)))])
