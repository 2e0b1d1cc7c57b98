"""Solids of a B-rep become closed meshes whose triangles belong to faces with the parameters of the file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.brep import ANGLE_RAD, BrepFace, BrepSolid
from apo_bench.cad.facets import facets_of
from apo_bench.cad.naming import with_names
from apo_bench.cad.raw import Mesh, RawSolid, Region
from apo_bench.cad.round_region import plane_region, round_region
from apo_bench.cad.shells import check_closed, check_uncrossed
from apo_bench.cad.strips import wall_strips
from apo_bench.cad.surfaces import Flat, Wall, same, surface_of
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.round_face import WHOLE_TURN
from apo_bench.parts.making.moments import Moments

_SAME_CORNER = 1e-7
"""Corners nearer to each other than this part of the size are one."""
_FULL_RAD = 1e-6


def raw_of(path: Path, solid: BrepSolid) -> RawSolid:
    """A solid with its faces, in its own frame.

    Raises:
        InputError: A face of it could not be cut into triangles, or its shell is open.
    """
    if any(face.kind == "none" for face in solid.faces):
        raise InputError(f"{path}: a face of '{solid.name}' cannot be cut into triangles; mend it where it was drawn.")
    mesh, owner = _mesh(solid.faces)
    check_closed(path, mesh)
    surfaces = [surface_of(face) for face in solid.faces]
    check_uncrossed(path, mesh, _off(solid.faces, surfaces)[owner])
    said: tuple[str, ...] = ()
    if mesh.volume < 0.0:
        mesh = Mesh(mesh.corners, mesh.triangles[:, ::-1])
        said = ("it was inside out, and was turned",)
    groups = _joined(mesh, owner, surfaces)
    mesh, owner = _in_strips(mesh, owner, groups, surfaces)
    regions = with_names(mesh, _regions(mesh, owner, groups, surfaces))
    return RawSolid(solid.name, mesh, regions, facets_of(mesh).of, solid.places, said, _moments(solid))


def _off(faces: tuple[BrepFace, ...], surfaces: list[Flat | Wall | None]) -> Array:
    """How far triangles of each face may be from it, (f,), [mm]: the sagitta of the angle between neighbours."""
    found = []
    for face, surface in zip(faces, surfaces, strict=True):
        size = float(np.ptp(face.corners, axis=0).max())
        if isinstance(surface, Flat):
            found.append(0.0)
        elif isinstance(surface, Wall):
            found.append((1.0 - np.cos(ANGLE_RAD / 2.0)) * (surface.surface.radius + abs(surface.surface.slope) * size))
        else:
            found.append((1.0 - np.cos(ANGLE_RAD / 2.0)) * size)
    return np.array(found)


def _moments(solid: BrepSolid) -> Moments:
    """About the origin."""
    J = solid.inertia if solid.size > 0.0 else -solid.inertia
    second = np.trace(J) / 2.0 * np.eye(3) - J
    return Moments(abs(solid.size), np.zeros(3), second).moved(np.eye(3), solid.centroid)


def _mesh(faces: tuple[BrepFace, ...]) -> tuple[Mesh, Any]:
    """The triangles of all faces with common corners, and the face of each."""
    offsets = np.cumsum([0, *(len(face.corners) for face in faces[:-1])])
    corners = np.concatenate([face.corners for face in faces])
    triangles = np.concatenate([face.triangles + k for face, k in zip(faces, offsets, strict=True)])
    owner = np.repeat(np.arange(len(faces)), [len(face.triangles) for face in faces])
    index, kept = _one_each(corners)
    triangles = index[triangles]
    a, b, c = triangles.T
    real = (a != b) & (b != c) & (c != a)
    return Mesh(kept, triangles[real]), owner[real]


def _one_each(corners: Array) -> tuple[Any, Array]:
    """Which corner each one is, of those that are left; one group of near corners is one."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    near = _SAME_CORNER * max(float(np.ptp(corners, axis=0).max()), 1e-9)
    pairs = cKDTree(corners).query_pairs(near, output_type="ndarray")
    count = len(corners)
    number, owner = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), (count, count)), directed=False)
    first = np.full(number, count)
    np.minimum.at(first, owner, np.arange(count))
    return owner, corners[first]


def _in_strips(mesh: Mesh, owner: Any, groups: list[list[int]], surfaces: list[Flat | Wall | None]) -> tuple[Mesh, Any]:
    """With walls between two circles as strips from end to end."""
    kept = np.ones(len(owner), dtype=bool)
    more = [mesh.triangles[:0]]
    of = [owner[:0]]
    for members in groups:
        wall = surfaces[members[0]]
        triangles = np.flatnonzero(np.isin(owner, members))
        if not isinstance(wall, Wall) or not len(triangles) or _turn(mesh, triangles, wall) < WHOLE_TURN:
            continue
        strips = wall_strips(mesh, triangles, wall.surface)
        if strips is not None:
            kept[triangles] = False
            more.append(strips)
            of.append(np.full(len(strips), members[0]))
    new = Mesh(mesh.corners, np.concatenate([mesh.triangles[kept], *more]))
    return new.part(np.arange(len(new.triangles))), np.concatenate([owner[kept], *of])


def _regions(mesh: Mesh, owner: Any, groups: list[list[int]], surfaces: list[Flat | Wall | None]) -> tuple[Region, ...]:
    found = []
    for members in groups:
        triangles = np.flatnonzero(np.isin(owner, members))
        if len(triangles):
            residual = max((each.residual for k in members if (each := surfaces[k]) is not None), default=0.0)
            region = _region(mesh, triangles, surfaces[members[0]])
            found.append(replace(region, residual=max(region.residual, residual)))
    return tuple(sorted(found, key=lambda region: int(region.triangles[0])))


def _joined(mesh: Mesh, owner: Any, surfaces: list[Flat | Wall | None]) -> list[list[int]]:
    """Faces that touch, on one surface."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    beside = np.unique(np.sort(owner[mesh.neighbours], axis=1), axis=0)
    pairs = [(i, k) for i, k in beside.tolist() if i != k and same(surfaces[i], surfaces[k], mesh.extent)]
    rows = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    count = len(surfaces)
    _, group = connected_components(coo_matrix((np.ones(len(rows)), rows.T), (count, count)), directed=False)
    return [np.flatnonzero(group == g).tolist() for g in range(int(group.max()) + 1)]


def _region(mesh: Mesh, triangles: Any, surface: Flat | Wall | None) -> Region:
    if surface is None:
        return Region("other", triangles)
    across = mesh.across[triangles]
    if isinstance(surface, Flat):
        sign = float(np.sign(across.sum(axis=0) @ surface.normal)) or 1.0
        return plane_region(mesh, triangles, sign * surface.normal, surface.point)
    _, _, out = surface.surface.polar(mesh.corners[mesh.triangles[triangles]].mean(axis=1))
    hole = bool((across * out).sum() < 0.0)
    return round_region(mesh, triangles, surface.surface, hole, _turn(mesh, triangles, surface))


def _turn(mesh: Mesh, triangles: Any, wall: Wall) -> float:
    """How far around its axis a wall reaches, as its triangles lie there, [rad]."""
    points = mesh.corners[mesh.triangles[triangles]].reshape(-1, 3)
    axis = wall.surface.axis
    x = np.eye(3)[int(np.abs(axis).argmin())]
    x = x - (x @ axis) * axis
    x /= np.linalg.norm(x)
    _, distance, out = wall.surface.polar(points)
    angle = np.arctan2(out @ np.cross(axis, x), out @ x).reshape(-1, 3)
    sound = (distance > 1e-6 * distance.max()).reshape(-1, 3)
    first = angle[np.arange(len(angle)), sound.argmax(axis=1)]
    off = np.where(sound, (angle - first[:, None] + np.pi) % WHOLE_TURN - np.pi, 0.0)
    low = (first + off.min(axis=1)) % WHOLE_TURN
    order = np.argsort(low)
    high = (low + off.max(axis=1) - off.min(axis=1))[order]
    low = low[order]
    reach = np.maximum.accumulate(high)
    gaps = np.append(low[1:], low[0] + WHOLE_TURN) - np.maximum(reach, reach[-1] - WHOLE_TURN)
    widest = float(gaps.max())
    return WHOLE_TURN if widest < _FULL_RAD else WHOLE_TURN - widest
