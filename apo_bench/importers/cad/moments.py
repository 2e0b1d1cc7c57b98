"""Compute volume, centroid and inertia of solids from their meshes, with round walls at their fitted radii."""

from collections.abc import Iterable

import manifold3d
import numpy as np
import trimesh

from apo_bench.geometry import Hull
from apo_bench.importers.cad.solids import Mesh, RawSolid, Region, convert_to_mesh
from apo_bench.scenario.parts.making.moments import Moments, compute_frustum_moments


def compute_solid_moments(raw: RawSolid) -> Moments:
    """Return the moments of a solid, [m]: its mesh, plus the slivers between the facets and the fitted round walls."""
    moments = _compute_mesh_moments(raw.mesh)
    for region in raw.regions:
        if region.square:
            # Removes material at a hole.
            moments = moments.plus(_compute_sliver_moments(raw.mesh, region), -1.0 if region.hole else 1.0)
    return moments.in_metres


def compute_piece_moments(pieces: Iterable[Hull]) -> Moments:
    """Return the moments of the union of the pieces, [m]."""
    hulls = [manifold3d.Manifold.hull_points(1e3 * piece.corners) for piece in pieces]
    return _compute_mesh_moments(
        convert_to_mesh(manifold3d.Manifold.batch_boolean(hulls, manifold3d.OpType.Add))
    ).in_metres


def _compute_mesh_moments(mesh: Mesh) -> Moments:
    """Return the moments of a closed mesh, [mm]."""
    found = trimesh.Trimesh(mesh.corners, mesh.triangles, process=False).mass_properties
    # The integral of x x^T about the centroid is trace(J) / 2 - J, J being the inertia.
    second = np.trace(found.inertia) / 2.0 * np.eye(3) - found.inertia
    return Moments(float(found.volume), np.zeros(3), second).moved(np.eye(3), found.center_mass)


def _compute_sliver_moments(mesh: Mesh, wall: Region) -> Moments:
    """Return the moments of the space between a round wall and its facets, [mm]."""
    corners = mesh.corners[np.unique(mesh.triangles[wall.triangles])]
    within = _compute_mesh_moments(convert_to_mesh(manifold3d.Manifold.hull_points(corners)))
    true = compute_frustum_moments(*wall.span, *wall.radii).moved(
        np.column_stack([*wall.across, wall.direction]), wall.point
    )
    return true.plus(within, -1.0)
