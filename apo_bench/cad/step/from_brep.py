"""Solids of a B-rep become closed meshes whose triangles belong to faces with the parameters of the file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.faces.facets import facets_of
from apo_bench.cad.faces.fitting import plane_region, round_region
from apo_bench.cad.meshes.shells import INSIDE_OUT, check_closed, check_uncrossed, has_three
from apo_bench.cad.solids.naming import with_names
from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, Region, connected, put_together, square_to
from apo_bench.cad.step.open_cascade import TRIANGLES_RAD, BrepFace, BrepSolid
from apo_bench.cad.step.strips import wall_strips
from apo_bench.cad.step.surfaces import Flat, Wall, is_same, surface_of
from apo_bench.errors import InputError
from apo_bench.geometry import WHOLE_TURN
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
    off = np.array([_sagitta(face, surface) for face, surface in zip(solid.faces, surfaces, strict=True)])
    check_uncrossed(path, mesh, off[owner])
    is_inside_out = mesh.volume < 0.0
    if is_inside_out:
        mesh = mesh.flipped()
    # Faces that touch on one surface are one region; from here on `owner` is the region of each triangle.
    group = _joined(mesh, owner, surfaces)
    mesh, owner = _in_strips(mesh, group[owner], [surfaces[int(k)] for k in np.unique(group, return_index=True)[1]])
    regions = []
    for g in np.unique(owner):
        members = [surface for surface, k in zip(surfaces, group, strict=True) if k == g]
        residual = max((each.residual for each in members if each is not None), default=0.0)
        region = _region(mesh, np.flatnonzero(owner == g), members[0])
        regions.append(replace(region, residual=max(region.residual, residual)))
    named = with_names(mesh, sorted(regions, key=lambda region: int(region.triangles[0])))
    mended = (INSIDE_OUT,) if is_inside_out else ()
    return RawSolid(solid.name, mesh, solid.places, mended, named, facets_of(mesh).of, _moments(solid))


def _sagitta(face: BrepFace, surface: Flat | Wall | None) -> float:
    """How far triangles of a face may be from it, [mm]: the sagitta of the angle between neighbours."""
    if isinstance(surface, Flat):
        return 0.0
    size = float(np.ptp(face.corners, axis=0).max())
    radius = size
    if isinstance(surface, Wall):
        radius = surface.surface.radius + abs(surface.surface.slope) * size
    return float((1.0 - np.cos(TRIANGLES_RAD / 2.0)) * radius)


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


def _joined(mesh: Mesh, owner: Any, surfaces: list[Flat | Wall | None]) -> Any:
    """The group of each face, (f,): of those that touch, on one surface."""
    beside = np.unique(np.sort(owner[mesh.neighbours], axis=1), axis=0)
    pairs = [(i, k) for i, k in beside.tolist() if i != k and is_same(surfaces[i], surfaces[k], mesh.extent)]
    return connected(np.array(pairs, dtype=np.int64).reshape(-1, 2), len(surfaces))[1]


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
        if not isinstance(wall, Wall) or not len(triangles) or _turn(mesh, triangles, wall) < WHOLE_TURN:
            continue
        strips = wall_strips(mesh, triangles, wall.surface)
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
    return round_region(mesh, triangles, surface.surface, hole, _turn(mesh, triangles, surface))


def _turn(mesh: Mesh, triangles: Any, wall: Wall) -> float:
    """How far around its axis a wall reaches, as its triangles lie there, [rad]."""
    x, y = square_to(wall.surface.axis)
    _, distance, out = wall.surface.polar(mesh.corners[mesh.triangles[triangles]].reshape(-1, 3))
    angle = np.arctan2(out @ y, out @ x).reshape(-1, 3)
    # Each triangle from its lowest to its highest angle, seen from one of its corners; one on the axis has no angle.
    sound = (distance > 1e-6 * distance.max()).reshape(-1, 3)
    first = angle[np.arange(len(angle)), sound.argmax(axis=1)]
    off = np.where(sound, (angle - first[:, None] + np.pi) % WHOLE_TURN - np.pi, 0.0)
    low = (first + off.min(axis=1)) % WHOLE_TURN
    order = np.argsort(low)
    high = (low + off.max(axis=1) - off.min(axis=1))[order]
    low = low[order]
    # Gaps between the farthest angle that was reached so far and the next lowest one, around the turn.
    reach = np.maximum.accumulate(high)
    gaps = np.append(low[1:], low[0] + WHOLE_TURN) - np.maximum(reach, reach[-1] - WHOLE_TURN)
    widest = float(gaps.max())
    return WHOLE_TURN if widest < _FULL_RAD else WHOLE_TURN - widest
