"""Regions become the faces of a part that can make contacts, [m]."""

import numpy as np
import shapely

from apo_bench.geometry import Array, Face, RoundFace, count_sides, list_rings, straighten
from apo_bench.importers.cad.faces.fitting import ON_WALL
from apo_bench.importers.cad.solids import RawSolid, Region, find_square_axes
from apo_bench.scenario.parts.making.outline import COARSE_SIDES

_THINNEST_MM = 0.05


def contact_faces(raw: RawSolid) -> tuple[list[Face], list[RoundFace], dict[str, str]]:
    """Return flat and round faces of the regions that have names; those that cannot be stated, with the reason."""
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
    flat = np.array(find_square_axes(n))
    triangles = raw.mesh.corners[raw.mesh.triangles[region.triangles]] @ flat.T
    area = shapely.coverage_union_all(shapely.polygons(triangles))
    if area.geom_type != "Polygon":
        return None
    offset = float(n @ region.point) * n
    rings = [ring @ flat + offset for ring in list_rings(area, 1.0)]
    drawn = [_circle(raw, region, ring, k > 0) @ flat.T for k, ring in enumerate(rings)]
    outline, *holes = (straighten(1e-3 * ring) @ flat + 1e-3 * offset for ring in drawn)
    return Face(region.name, outline, tuple(holes))


def _circle(raw: RawSolid, region: Region, ring: Array, hole: bool) -> Array:
    """A border, (k, 3); one that is the whole end of a round wall as a finer polygon than the mesh has, [mm]."""
    near = ON_WALL * raw.mesh.extent
    wall = next((each for each in raw.regions if each.square and each.is_on_wall(ring, near).all()), None)
    if wall is None:
        return ring
    # Where the axis meets the plane; corners between those of the wall's pieces, for a hole on a circle around it.
    along = float(wall.direction @ region.direction)
    height = float((region.point - wall.point) @ region.direction / along)
    r = float(wall.radius_at(height))
    n = max(count_sides(1e-3 * max(wall.radii)), COARSE_SIDES)
    # An outline is counter-clockwise seen against the normal of its face, a hole clockwise.
    turn = -1.0 if hole == (along > 0.0) else 1.0
    return wall.around(height, r / np.cos(np.pi / n) if hole else r, turn * 2.0 * np.pi * (np.arange(n) + 0.5) / n)
