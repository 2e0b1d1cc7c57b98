"""Turn a B-rep solid into a closed mesh whose regions have the surface parameters of the STEP file."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from apo_bench.errors import require
from apo_bench.geometry import WHOLE_TURN
from apo_bench.importers.cad.faces.surface_fitting import (
    RoundSurface,
    list_border_corners,
    make_plane_region,
    make_round_region,
    measure_wall_turn,
)
from apo_bench.importers.cad.meshes.corner_merging import SAME_CORNER, merge_corners
from apo_bench.importers.cad.meshes.shells import INSIDE_OUT, check_closed
from apo_bench.importers.cad.solids import (
    Mesh,
    RawSolid,
    Region,
    concatenate_meshes,
    find_connected_groups,
    name_regions,
)
from apo_bench.importers.cad.step.surfaces import BrepFace, BrepSolid, Plane, is_same_surface

_LEVEL = 1e-6
"""Corners of an end within this share of the size are at one height."""


def raw_of(path: Path, solid: BrepSolid) -> RawSolid:
    """Return a solid with its regions, in its own frame.

    Raises:
        InputError: A face could not be triangulated, or its shell is open.
    """
    faces = solid.faces
    is_whole = all(len(face.triangles) for face in faces)
    require(is_whole, f"{path}: a face of '{solid.name}' cannot be cut into triangles; repair it in its CAD program.")
    mesh, owner = _mesh(faces)
    check_closed(path, mesh)
    repairs = (INSIDE_OUT,) if mesh.volume < 0.0 else ()
    mesh = mesh.flip() if repairs else mesh
    # Neighbouring faces on one surface become one region; from here on `owner` is the region of each triangle.
    neighbours = np.unique(np.sort(owner[mesh.neighbours], axis=1), axis=0)
    pairs = [(i, k) for i, k in neighbours.tolist() if i != k and is_same_surface(faces[i], faces[k], mesh.extent)]
    _, group = find_connected_groups(np.array(pairs, dtype=np.int64).reshape(-1, 2), len(faces))
    first_of_group = [faces[int(k)] for k in np.unique(group, return_index=True)[1]]
    mesh, owner = _in_strips(mesh, group[owner], [face.surface for face in first_of_group])
    regions = []
    for g in np.unique(owner):
        regions.append(_region(mesh, np.flatnonzero(owner == g), first_of_group[g].surface))
    named = name_regions(mesh, sorted(regions, key=lambda region: int(region.triangles[0])))
    return RawSolid(solid.name, mesh, solid.places, repairs, named)


def _mesh(faces: tuple[BrepFace, ...]) -> tuple[Mesh, Any]:
    """Return the triangles of all faces as one mesh with shared corners, and the face of each triangle, (t,)."""
    whole = concatenate_meshes([Mesh(face.corners, face.triangles) for face in faces])
    owner = np.repeat(np.arange(len(faces)), [len(face.triangles) for face in faces])
    mesh, has_three = merge_corners(whole, SAME_CORNER * max(whole.extent, 1e-9))
    return mesh, owner[has_three]


def _in_strips(mesh: Mesh, owner: Any, surfaces: list[Plane | RoundSurface | None]) -> tuple[Mesh, Any]:
    """Return the mesh with walls between two circles retriangulated in strips from end to end, and its new `owner`.

    Args:
        owner: Index into `surfaces` of each triangle, (t,).
    """
    for k, wall in enumerate(surfaces):
        mine = np.flatnonzero(owner == k)
        if not isinstance(wall, RoundSurface) or not len(mine) or measure_wall_turn(mesh, mine, wall) < WHOLE_TURN:
            continue
        strips = _strips(mesh, mine, wall)
        if strips is not None:
            mesh = Mesh(mesh.corners, np.concatenate([np.delete(mesh.triangles, mine, axis=0), strips]))
            owner = np.append(np.delete(owner, mine), np.full(len(strips), k))
    return mesh.part(np.arange(len(mesh.triangles))), owner


def _strips(mesh: Mesh, triangles: Any, wall: RoundSurface) -> Any:
    """Return triangles, (s, 3), that replace those of a wall: the sides of the hull of its border and of a cone's tip.

    None if the ends are not two circles square to the axis, nor a circle and a tip.
    """
    near = _LEVEL * mesh.extent
    every = np.unique(mesh.triangles[triangles])
    every = every[np.isin(every, list_border_corners(mesh, triangles)) | (wall.polar(mesh.corners[every])[1] < near)]
    points = mesh.corners[every]
    height = wall.polar(points)[0]
    if (np.minimum(height - height.min(), height.max() - height) > near).any():
        return None
    hull = ConvexHull(points).simplices
    sides = hull[np.ptp(height[hull], axis=1) > near]  # without the two end caps
    # Orient them as the old triangles: outwards, or towards the axis for a hole.
    across = np.cross(points[sides[:, 1]] - points[sides[:, 0]], points[sides[:, 2]] - points[sides[:, 0]])
    outward = (across * wall.polar(points[sides].mean(axis=1))[2]).sum(axis=1)
    before = (mesh.across[triangles] * wall.polar(mesh.corners[mesh.triangles[triangles]].mean(axis=1))[2]).sum()
    return every[np.where((outward * before > 0.0)[:, None], sides, sides[:, ::-1])]


def _region(mesh: Mesh, triangles: Any, surface: Plane | RoundSurface | None) -> Region:
    """Return the region of triangles on a surface; None means a free-form surface."""
    if surface is None:
        return Region("other", triangles)
    across = mesh.across[triangles]
    if isinstance(surface, Plane):
        # The file's normal may point inwards; 1.0 for a face without area.
        sign = float(np.sign(across.sum(axis=0) @ surface.normal)) or 1.0
        return make_plane_region(triangles, sign * surface.normal, surface.point)
    _, _, out = surface.polar(mesh.corners[mesh.triangles[triangles]].mean(axis=1))
    hole = bool((across * out).sum() < 0.0)
    return make_round_region(mesh, triangles, surface, hole, measure_wall_turn(mesh, triangles, surface))
