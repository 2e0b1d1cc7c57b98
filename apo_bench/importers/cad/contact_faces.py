"""Convert named regions of a solid to the flat and round faces of a part, [m]."""

from typing import Any

import numpy as np
import shapely

from apo_bench.geometry import Array, Face, RoundFace, count_sides, list_rings, straighten
from apo_bench.importers.cad.faces.surface_fitting import ON_WALL
from apo_bench.importers.cad.solids import RawSolid, Region, find_square_axes
from apo_bench.scenario.parts.making.outline import COARSE_SIDES

_SNAP_MM = 1e-6  # grid on which triangles that overlap are united
_THINNEST_MM = 0.05  # largest radius of a round face that is too thin for contacts


def make_contact_faces(raw: RawSolid) -> tuple[list[Face], list[RoundFace], dict[str, str]]:
    """Return the flat and the round faces of the named regions, and the regions that make none -> the reason."""
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
        elif (face := _make_flat_face(raw, region)) is not None:
            flats.append(face)
        else:
            refused[region.name] = "it has more than one outline"
    return flats, rounds, refused


def _make_flat_face(raw: RawSolid, region: Region) -> Face | None:
    """Return a flat region as a face with its holes; None if it has more than one outline.

    Borders that are ends of round walls become finer polygons inside the true circle, within 0.005 mm.
    """
    n = region.direction
    flat = np.array(find_square_axes(n))
    triangles = raw.mesh.corners[raw.mesh.triangles[region.triangles]] @ flat.T
    area = _unite(shapely.polygons(triangles))
    if area.geom_type != "Polygon":
        return None
    offset = float(n @ region.point) * n
    rings = [ring @ flat + offset for ring in list_rings(area, 1.0)]
    drawn = [_refine_circle(raw, region, ring, k > 0) @ flat.T for k, ring in enumerate(rings)]
    outline, *holes = (straighten(1e-3 * ring) @ flat + 1e-3 * offset for ring in drawn)
    return Face(region.name, outline, tuple(holes))


def _unite(triangles: Any) -> Any:
    """Return the area of triangles in a plane; overlaps of slivers are united as well."""
    try:
        return shapely.coverage_union_all(triangles)
    except shapely.GEOSException:
        return shapely.union_all(triangles, grid_size=_SNAP_MM)


def _refine_circle(raw: RawSolid, region: Region, ring: Array, hole: bool) -> Array:
    """Return a border, (k, 3), [mm]; if it is the whole end of a round wall, as a finer polygon than the mesh has.

    Args:
        ring: The corners of the border, (k, 3), [mm].
        hole: Whether the border is that of a hole in the region.
    """
    near = ON_WALL * raw.mesh.extent
    wall = next((each for each in raw.regions if each.square and each.is_on_wall(ring, near).all()), None)
    if wall is None:
        return ring
    # Height of the end along the axis of the wall. Corners lie between those of the wall's pieces, and for a hole on
    # a circumscribed circle.
    along = float(wall.direction @ region.direction)
    height = float((region.point - wall.point) @ region.direction / along)
    r = float(wall.radius_at(height))
    n = max(count_sides(1e-3 * max(wall.radii)), COARSE_SIDES)  # corners of the finer polygon
    # An outline is counter-clockwise seen against the normal of its face, a hole clockwise.
    turn = -1.0 if hole == (along > 0.0) else 1.0
    return wall.around(height, r / np.cos(np.pi / n) if hole else r, turn * 2.0 * np.pi * (np.arange(n) + 0.5) / n)
