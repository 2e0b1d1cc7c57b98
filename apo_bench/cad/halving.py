"""Solids cut along planes until the parts are convex: first along flat faces, then along sides of free shapes, [mm]."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.corners import SAME_MM, corners_of
from apo_bench.cad.raw import Mesh, Region
from apo_bench.geometry.arrays import Array

_MOST_CUTS = 400
_TRIES = 6
_HAIR = 2e-6
_MOST_FREE_PLANES = 80
_MOST_BISECTED = 40
_ROUGH = 0.01
_FINE_TRIANGLES = 4000
"""Free shapes with more planes at reflex edges are halved instead, into so many pieces, until their hulls are so little
larger; they need not have more triangles."""
_NONE = np.zeros((0, 4))


class Part(NamedTuple):
    """A part of a solid that is to be one piece."""

    body: Any
    """As manifold3d has it."""
    planes: Array
    """Along which it was cut, (k, 4)."""


def convex_parts(whole: Any, size: float, flats: Array) -> Iterator[Part]:
    """Parts that are convex, or that stand for a hollow free shape with their hull.

    Args:
        flats: Planes of flat faces, (k, 4).
    """
    cuts = [_MOST_CUTS]
    for part in _cut(Part(whole, _NONE), size, flats, True, cuts, whole.volume()):
        planes = _reflex_planes(part.body, size)
        if not len(planes) or (part.body.num_tri() > _FINE_TRIANGLES and _is_nearly_convex(part.body)):
            yield part
        elif len(planes) <= _MOST_FREE_PLANES:
            yield from _cut(part, size, flats, False, cuts, whole.volume())
        else:
            yield from _halved(part, size, whole.volume())


def _cut(part: Part, size: float, flats: Array, only_flats: bool, cuts: list[int], volume: float) -> Iterator[Part]:
    """Cut along planes of reflex edges, as long as there are cuts left.

    Both halves keep a hair's breadth off the plane: on it, rounding would leave flaps of no thickness.
    """
    open_ = [part]
    least = 1e-7 * volume
    hair = _HAIR * size
    while open_:
        found, along = open_.pop()
        for body in _without_cavities(found, least):
            if body.volume() < least:
                continue
            halves = None
            planes = _planes_to_cut(body, size, flats, only_flats) if cuts[0] > 0 else []
            for n, d in [*planes[:_TRIES], *_through_cavity(body, least)]:
                one = body.trim_by_plane(n, d + hair)
                other = body.trim_by_plane(-n, hair - d)
                if min(one.volume(), other.volume()) > least:
                    used = np.concatenate([along, [[*n, d]]])
                    halves = [Part(one, used), Part(other, used)]
                    break
            if halves is None:
                yield Part(body, along)
            else:
                cuts[0] -= 1
                open_ += halves


def _without_cavities(body: Any, least: float) -> list[Any]:
    """The bodies that one consists of; the whole, if there is a cavity in one of them.

    Args:
        least: A cavity that is smaller is rounding.
    """
    found = body.decompose()
    return [body] if any(each.volume() < -least for each in found) else found


def _through_cavity(body: Any, least: float) -> Iterator[tuple[Array, float]]:
    """Planes through the middle of a cavity, if there is one."""
    for each in body.decompose():
        if each.volume() < -least:
            low, high = np.array(each.bounding_box()).reshape(2, 3)
            for axis in np.argsort(high - low):
                yield np.eye(3)[axis], float(low[axis] + high[axis]) / 2.0


def _planes_to_cut(body: Any, size: float, flats: Array, only_flats: bool) -> list[tuple[Array, float]]:
    """Planes of reflex edges, as the flat face in them has it."""
    found = []
    for plane in _reflex_planes(body, size):
        same = (np.abs(flats[:, :3] @ plane[:3]) > 1.0 - 1e-6) & (
            np.abs(flats[:, 3] * np.sign(flats[:, :3] @ plane[:3]) - plane[3]) < _HAIR * size
        )
        if same.any():
            found.append((flats[same][0, :3], float(flats[same][0, 3])))
        elif not only_flats:
            found.append((plane[:3], float(plane[3])))
    return found


def _is_nearly_convex(body: Any) -> bool:
    return bool(body.hull().volume() < 1.001 * body.volume())


def _halved(part: Part, size: float, volume: float) -> list[Part]:
    """A hollow free shape, halved where that brings its hulls nearest to it."""
    body = part.body.simplify(1e-3 * size) if part.body.num_tri() > _FINE_TRIANGLES else part.body
    parts = [Part(each, part.planes) for each in body.decompose()]
    spare = [each.body.hull().volume() - each.body.volume() for each in parts]
    while parts and len(parts) < _MOST_BISECTED and max(spare) > _ROUGH * volume / len(parts):
        k = int(np.argmax(spare))
        halves = _best_halves(parts[k])
        parts[k : k + 1] = halves
        spare[k : k + 1] = [each.body.hull().volume() - each.body.volume() for each in halves]
        if len(halves) == 1:
            spare[k] = 0.0
    return parts


def _best_halves(part: Part) -> list[Part]:
    low, high = np.array(part.body.bounding_box()).reshape(2, 3)
    best: tuple[float, list[Part]] = (np.inf, [part])
    for axis in np.argsort(low - high):
        n = np.eye(3)[axis]
        d = float(low[axis] + high[axis]) / 2.0
        cut = (part.body.trim_by_plane(n, d), part.body.trim_by_plane(-n, -d))
        bodies = [each for half in cut for each in half.decompose()]
        hulls = float(sum(each.hull().volume() for each in bodies))
        if len(bodies) > 1 and hulls < best[0] * (1.0 - 1e-6):
            best = (hulls, [Part(each, np.concatenate([part.planes, [[*n, d]]])) for each in bodies])
    return best[1]


def at_shoulders(parts: Iterator[Part], shafts: Sequence[Region], size: float) -> Iterator[Part]:
    """Parts cut where one round wall goes over into another one: a cylinder and its chamfer are two pieces."""
    hair = _HAIR * size
    for part in parts:
        corners = corners_of(part.body)
        mine = [shaft for shaft in shafts if _touches(corners, shaft)]
        open_ = [part]
        for shaft in mine if len(mine) > 1 else ():
            assert shaft.axis is not None
            assert shaft.point is not None
            for end in shaft.span:
                d = float(shaft.point @ shaft.axis) + end
                halves = []
                for each in open_:
                    height = corners_of(each.body) @ shaft.axis - d
                    if height.min() > -10.0 * hair or height.max() < 10.0 * hair:
                        halves.append(each)
                        continue
                    used = np.concatenate([each.planes, [[*shaft.axis, d]]])
                    halves.append(Part(each.body.trim_by_plane(shaft.axis, d + hair), used))
                    halves.append(Part(each.body.trim_by_plane(-shaft.axis, hair - d), used))
                open_ = halves
        yield from open_


def _touches(corners: Array, shaft: Region) -> bool:
    height, distance, _ = shaft.polar(corners)
    within = (height > shaft.span[0] - SAME_MM) & (height < shaft.span[1] + SAME_MM)
    return int((within & (np.abs(distance - shaft.radius_at(height)) < 1e-3)).sum()) >= 6


def settled(corners: Array, planes: Array, size: float) -> Array:
    """Corners that are a hair's breadth off the planes of cuts, on them."""
    found = corners.copy()
    for _ in range(4):
        for n, d in zip(planes[:, :3], planes[:, 3], strict=True):
            off = found @ n - d
            off[np.abs(off) > 3.0 * _HAIR * size] = 0.0
            found -= np.outer(off, n)
    return found


def _reflex_planes(part: Any, size: float) -> Array:
    """Planes, (k, 4), of sides at reflex edges, those with the longest edges in them first."""
    raw = part.to_mesh64()
    mesh = Mesh(np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts).astype(np.int64))
    length = np.linalg.norm(mesh.across, axis=1)
    normals = mesh.across / np.maximum(length, 1e-300)[:, None]
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
    d = (n * mesh.corners[mesh.triangles[sides, 0]]).sum(axis=1)
    planes = np.column_stack([n, d])
    keys = np.round(planes * [1e5, 1e5, 1e5, 1e5 / size])
    _, first = np.unique(keys, axis=0, return_index=True)
    planes = planes[np.sort(first)][:400]
    inside = (np.abs(ends @ planes[:, :3].T - planes[:, 3]) < 2e-6 * size).all(axis=1)
    score = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) @ inside
    aligned = np.abs(planes[:, :3]).max(axis=1) > 1.0 - 1e-9
    return np.asarray(planes[np.lexsort((~aligned, -np.round(score / size, 6)))])
