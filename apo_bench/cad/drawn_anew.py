"""When a mesh is drawn anew: where its faces have corners inside of them, or are hidden by noise, [mm]."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.faces.bands import without_bands
from apo_bench.cad.faces.facets import facets_of
from apo_bench.cad.faces.fitting import border_of
from apo_bench.cad.faces.parallel import regular
from apo_bench.cad.faces.patch import rough_of
from apo_bench.cad.faces.polygons import seen_from_corners, with_rings
from apo_bench.cad.faces.redrawing import redrawn
from apo_bench.cad.faces.regions import regions_of
from apo_bench.cad.faces.rough import patches_of, together
from apo_bench.cad.meshes.crossings import crossings
from apo_bench.cad.solids.bodies import body_of, mesh_of
from apo_bench.cad.solids.raw_solid import Mesh, Region
from apo_bench.cad.time_limit import limit_of, time_limit
from apo_bench.errors import InputError
from apo_bench.geometry import WHOLE_TURN

_EXACT = 1e-6
"""Corners this near to a flat piece, in parts of the size, are left out of it."""
_NEAR_MM = (0.01, 0.045, 0.1, 0.2)
_NEAREST = 4e-3
"""How far corners may be off their faces: the first of these with which nearly all of the surface is faces, and no more
than this part of the size."""
_ALL = 0.998
_MORE = 0.005
"""A mesh is drawn anew if that makes so much more of its surface faces."""
_SIMPLER = 0.5
"""... or if the faces that it has then are less than this part as many, and all of the surface."""
_SMALL = 1500
_FEW = 0.5
_INSIDE = 0.02
_MANY = 0.05
"""A mesh of so many triangles, and with faces on so much of its surface, has so many corners inside of them if it was
remeshed, or so many faces, both for each of its own; drawing anew takes long, and does not help otherwise."""
_PART_OF_TIME = 0.4
"""Of what reading the file may take; a mesh for which that does not do is left as it is."""
_PART_OF_FINE = 0.1
"""... and so much of it for the finest of them, with which faces fall to bits where corners are farther off."""
_VOLUME = 0.02
"""... and changes its volume by no more than this part."""


class Faces(NamedTuple):
    """A mesh and its faces."""

    mesh: Mesh
    regions: tuple[Region, ...]
    facets: Any
    said: tuple[str, ...] = ()


def faces_of(mesh: Mesh, fewest: int) -> Faces:
    """The faces of a closed mesh as it is, or of one drawn anew if more of the surface is faces then.

    Args:
        fewest: Of the sides that a round face has in a whole turn.
    """
    as_is = Faces(mesh, *regions_of(mesh, fewest))
    share = _share(as_is)
    if share > _ALL:
        return as_is
    best = as_is
    body = body_of(mesh)
    plain = mesh_of(body.simplify(_EXACT * mesh.extent)) if body.num_tri() == len(mesh.triangles) else mesh
    if _is_sound(plain, mesh) and len(plain.triangles) < 0.9 * len(mesh.triangles):
        fewer = Faces(
            plain,
            *regions_of(plain, fewest),
            (f"{len(mesh.triangles) - len(plain.triangles):,} triangles were merged",),
        )
        if _share(fewer) > share + _MORE:
            share = _share(fewer)
            best = fewer
    if not _may_be_rough(as_is, share):
        return best
    limit_s = _PART_OF_TIME * limit_of(len(mesh.triangles))
    try:
        with time_limit("drawing the mesh anew", "save it with fewer triangles", limit_s):
            for anew in _anew(mesh, fewest):
                more, whole = _share(anew), sum(region.is_whole for region in anew.regions)
                is_rounder = more > _ALL and whole > sum(region.is_whole for region in best.regions)
                if more > share + _MORE or is_rounder or _is_simpler(anew, best):
                    share = more
                    best = anew
                # Part of a wall may be what noise leaves of a whole one.
                if share > _ALL and all(region.is_whole for region in best.regions if region.is_round):
                    break
    except InputError as error:  # faces as they were found are better than none
        best = best._replace(said=(*best.said, str(error).split(";")[0] + ", so it was left as it is"))
    return best


def _anew(mesh: Mesh, fewest: int) -> Iterator[Faces]:
    """The mesh drawn anew, with corners allowed to be farther and farther off its faces."""
    for near in _NEAR_MM:
        if near > _NEAREST * mesh.extent:
            return
        rough = rough_of(mesh, near, fewest)
        found = None
        limit_s = (_PART_OF_FINE if near == _NEAR_MM[0] else _PART_OF_TIME) * limit_of(len(mesh.triangles))
        with suppress(InputError), time_limit("finding its faces", "", limit_s):
            found = without_bands(rough, patches_of(rough), fewest)
        if found is None:
            continue
        patches = together(rough, regular(rough, with_rings(rough, found, fewest)))
        drawn = redrawn(rough, seen_from_corners(rough, patches))
        if drawn is None or not _is_sound(drawn.mesh, mesh, drawn.regions):
            continue
        said = (
            f"it was drawn anew, as corners are up to {near:g} mm off its faces: {len(mesh.triangles):,} triangles "
            f"became {len(drawn.mesh.triangles):,}, and corners moved by {drawn.moved:.2g} mm at most"
        )
        yield Faces(drawn.mesh, drawn.regions, facets_of(drawn.mesh).of, (said,))


def _may_be_rough(faces: Faces, share: float) -> bool:
    """Whether drawing a mesh anew may help: it is small, hardly a face is found, or too many, or corners lie inside.

    What CAD tessellates has its corners on the borders of faces; what is no face there is a free shape.
    """
    mesh = faces.mesh
    if len(mesh.triangles) < _SMALL or share < _FEW or len(faces.regions) > _MANY * len(mesh.triangles):
        return True
    inner = 0
    for region in faces.regions:
        if region.kind == "plane" or region.is_round:
            corners = np.unique(mesh.triangles[region.triangles])
            inner += len(np.setdiff1d(corners, border_of(mesh, region.triangles)))
    return inner > _INSIDE * len(mesh.corners)


def _is_sound(new: Mesh, old: Mesh, walls: Sequence[Region] = ()) -> bool:
    """Whether a mesh is closed, does not cross itself, and stands for the same solid.

    Args:
        walls: Those that had sides, and have none any more.
    """
    off = new.volume - old.volume - sum(_behind_sides(wall) for wall in walls if wall.sides)
    return new.is_closed and abs(off) < _VOLUME * old.volume and next(crossings(new), None) is None


def _behind_sides(wall: Region) -> float:
    """Between a round face and its sides, [mm^3]; negative for a hole."""
    angle = WHOLE_TURN / wall.sides
    segments = wall.turn / angle * (angle - np.sin(angle)) / 2.0 * (wall.radii[0] * wall.radii[1])
    return float((-1.0 if wall.hole else 1.0) * (wall.span[1] - wall.span[0]) * segments)


def _share(faces: Faces) -> float:
    """How much of the surface is faces that can be stated: flat ones, and round ones without corners inside."""
    areas = np.linalg.norm(faces.mesh.across, axis=1)
    good = (r.triangles for r in faces.regions if r.kind == "plane" or (r.is_round and _is_plain(faces.mesh, r)))
    return float(sum(areas[triangles].sum() for triangles in good) / areas.sum())


def _is_simpler(anew: Faces, before: Faces) -> bool:
    """Whether a mesh drawn anew has faces everywhere, and few: its sides had become faces of their own before."""
    everywhere = all(region.kind == "plane" or region.is_round for region in anew.regions)
    return everywhere and len(anew.regions) < _SIMPLER * len(before.regions)


def _is_plain(mesh: Mesh, wall: Region) -> bool:
    corners = np.unique(mesh.triangles[wall.triangles])
    inner = np.setdiff1d(corners, border_of(mesh, wall.triangles))
    return (wall.square or not wall.is_whole) and len(inner) <= 1
