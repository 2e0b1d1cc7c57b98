"""Solids of a B-rep become closed meshes whose triangles belong to faces with the parameters of the file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.faces.facets import facets_of
from apo_bench.cad.faces.fitting import Round, border_of, plane_region, round_region, turn_of
from apo_bench.cad.meshes.closing import has_three
from apo_bench.cad.meshes.shells import INSIDE_OUT, check_closed, check_uncrossed
from apo_bench.cad.solids.naming import with_names
from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, Region, connected, put_together, square_to
from apo_bench.cad.step.surfaces import TRIANGLES_RAD, BrepFace, BrepSolid, Flat, Wall, is_same, surface_of
from apo_bench.errors import InputError
from apo_bench.geometry import WHOLE_TURN, Array
from apo_bench.parts.making.moments import Moments

_SAME_CORNER = 1e-7
"""Corners nearer to each other than this part of the size are one."""
_LEVEL = 1e-6
_SAME_RAD = 1e-5
_FEWEST = 6
"""Corners of an end are level within this part of the size, and lie at one angle with those of the other end."""


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
    off = np.array([_sagitta(face, surface) for face, surface in zip(solid.faces, surfaces, strict=True)])
    check_uncrossed(path, mesh, off[owner])
    mended = (INSIDE_OUT,) if mesh.volume < 0.0 else ()
    mesh = mesh.flipped() if mended else mesh
    # Faces that touch on one surface are one region; from here on `owner` is the region of each triangle.
    beside = np.unique(np.sort(owner[mesh.neighbours], axis=1), axis=0)
    pairs = [(i, k) for i, k in beside.tolist() if i != k and is_same(surfaces[i], surfaces[k], mesh.extent)]
    _, group = connected(np.array(pairs, dtype=np.int64).reshape(-1, 2), len(surfaces))
    mesh, owner = _in_strips(mesh, group[owner], [surfaces[int(k)] for k in np.unique(group, return_index=True)[1]])
    regions = []
    for g in np.unique(owner):
        members = [surface for surface, k in zip(surfaces, group, strict=True) if k == g]
        residual = max((each.residual for each in members if each is not None), default=0.0)
        region = _region(mesh, np.flatnonzero(owner == g), members[0])
        regions.append(replace(region, residual=max(region.residual, residual)))
    named = with_names(mesh, sorted(regions, key=lambda region: int(region.triangles[0])))
    return RawSolid(solid.name, mesh, solid.places, mended, named, facets_of(mesh).of, _moments(solid))


def _sagitta(face: BrepFace, surface: Flat | Wall | None) -> float:
    """How far triangles of a face may be from it, [mm]: the sagitta of the angle between neighbours."""
    radius = float(np.ptp(face.corners, axis=0).max())
    if isinstance(surface, Wall):
        radius = surface.surface.radius + abs(surface.surface.slope) * radius
    return 0.0 if isinstance(surface, Flat) else float((1.0 - np.cos(TRIANGLES_RAD / 2.0)) * radius)


def _moments(solid: BrepSolid) -> Moments:
    """About the origin. The integral of x x^T is trace(J) / 2 - J, J being the inertia."""
    J = solid.inertia if solid.size > 0.0 else -solid.inertia
    second = np.trace(J) / 2.0 * np.eye(3) - J
    return Moments(abs(solid.size), np.zeros(3), second).moved(np.eye(3), solid.centroid)


def _mesh(faces: tuple[BrepFace, ...]) -> tuple[Mesh, Any]:
    """The triangles of all faces with common corners, and the face of each."""
    from scipy.spatial import cKDTree

    whole = put_together([Mesh(face.corners, face.triangles) for face in faces])
    owner = np.repeat(np.arange(len(faces)), [len(face.triangles) for face in faces])
    # One group of near corners is its first one.
    near = _SAME_CORNER * max(float(np.ptp(whole.corners, axis=0).max()), 1e-9)
    count = len(whole.corners)
    groups, group = connected(cKDTree(whole.corners).query_pairs(near, output_type="ndarray"), count)
    first = np.full(groups, count)
    np.minimum.at(first, group, np.arange(count))
    triangles = group[whole.triangles]
    sound = has_three(triangles)
    return Mesh(whole.corners[first], triangles[sound]), owner[sound]


def _in_strips(mesh: Mesh, owner: Any, surfaces: list[Flat | Wall | None]) -> tuple[Mesh, Any]:
    """With walls between two circles as strips from end to end.

    Args:
        owner: The surface of each triangle.
    """
    kept = np.ones(len(owner), dtype=bool)
    added = [mesh.triangles[:0]]
    owner_of_added = [owner[:0]]
    for k, wall in enumerate(surfaces):
        triangles = np.flatnonzero(owner == k)
        if not isinstance(wall, Wall) or not len(triangles) or turn_of(mesh, triangles, wall.surface) < WHOLE_TURN:
            continue
        strips = _wall_strips(mesh, triangles, wall.surface)
        if strips is not None:
            kept[triangles] = False
            added.append(strips)
            owner_of_added.append(np.full(len(strips), k))
    new = Mesh(mesh.corners, np.concatenate([mesh.triangles[kept], *added]))
    return new.part(np.arange(len(new.triangles))), np.concatenate([owner[kept], *owner_of_added])


def _region(mesh: Mesh, triangles: Any, surface: Flat | Wall | None) -> Region:
    if surface is None:
        return Region("other", triangles)
    across = mesh.across[triangles]
    if isinstance(surface, Flat):
        sign = float(np.sign(across.sum(axis=0) @ surface.normal)) or 1.0
        return plane_region(mesh, triangles, sign * surface.normal, surface.point)
    _, _, out = surface.surface.polar(mesh.corners[mesh.triangles[triangles]].mean(axis=1))
    hole = bool((across * out).sum() < 0.0)
    return round_region(mesh, triangles, surface.surface, hole, turn_of(mesh, triangles, surface.surface))


def _wall_strips(mesh: Mesh, triangles: Any, surface: Round) -> Any:
    """Other triangles, (s, 3), for some of a mesh, with the same border and no corner inside of it.

    None: its ends are not two level circles with corners at the same angles, nor one and a tip.
    """
    near = _LEVEL * mesh.extent
    x, y = square_to(surface.axis)
    every = np.unique(mesh.triangles[triangles])
    height, distance, out = surface.polar(mesh.corners[every])
    angle = np.arctan2(out @ y, out @ x)
    tip = distance < near
    # Corners of the border, and a tip, at either end, in their order around the axis.
    left = np.isin(every, border_of(mesh, triangles)) | tip
    ends = []
    for end in (height.min(), height.max()):
        mine = np.flatnonzero(left & (np.abs(height - end) < near))
        left[mine] = False
        ends.append(mine[np.argsort(angle[mine])])
    low, high = ends
    if tip.any():
        are_ends = (len(low) == 1) != (len(high) == 1)
    else:
        are_ends = len(low) == len(high) >= _FEWEST and _are_at_one_angle(angle[low], angle[high])
    if left.any() or not are_ends:
        return None
    strips = _between(every[low], every[high])
    # They look the way that the triangles did: outwards, or towards the axis for a hole.
    points = mesh.corners[strips]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    outward = (normals * _out(surface, points)).sum()
    before = (mesh.across[triangles] * _out(surface, mesh.corners[mesh.triangles[triangles]])).sum()
    return strips if outward * before > 0.0 else strips[:, ::-1]


def _are_at_one_angle(a: Array, b: Array) -> bool:
    off = np.abs(a - b)
    return bool(np.minimum(off, 2.0 * np.pi - off).max() < _SAME_RAD)


def _between(low: Any, high: Any) -> Any:
    """Triangles between two rings of corners, or a ring and a tip."""
    low_next = np.roll(low, -1)
    high_next = np.roll(high, -1)
    if len(high) == 1:
        return np.column_stack([low, low_next, np.full(len(low), high[0])])
    if len(low) == 1:
        return np.column_stack([np.full(len(high), low[0]), high_next, high])
    return np.concatenate([np.column_stack([low, low_next, high_next]), np.column_stack([low, high_next, high])])


def _out(surface: Round, points: Array) -> Array:
    """The way from the axis at the middle of each triangle (t, 3, 3)."""
    return surface.polar(points.mean(axis=1))[2]
