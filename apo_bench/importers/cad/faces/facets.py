"""Divide a mesh into facets, flat pieces of coplanar triangles, and find the facets that meet at a small angle."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import WHOLE_TURN, Array
from apo_bench.importers.cad.solids import Mesh, find_connected_groups

FEWEST_SIDES = 12
"""The smallest number of facets around a full turn of a round face."""
SMOOTH_RAD = np.radians(35.0)
"""Facets that meet at a smaller angle may belong to one curved surface."""
_SAME_RAD = 1e-3  # triangles at a smaller angle are coplanar
_NEAR_RAD = 0.02  # coplanar up to this angle if their corners are in one plane
FLAT = 1e-6
"""Tolerance of a plane, as a share of the size of a part."""


class Facets(NamedTuple):
    """The facets of a mesh: f facets, t triangles, m facet-corner pairs, s smooth edges."""

    of: Any
    """The facet of each triangle, (t,)."""
    normals: Array
    """Outward unit normals, (f, 3)."""
    areas: Array
    centers: Array
    owner: Any
    """Facet of each facet-corner pair, (m,), ascending."""
    corner: Any
    """Corner of each facet-corner pair, (m,)."""
    smooth: Any
    """The two facets at each smooth edge of the mesh, (s, 2)."""
    along: Any
    """The two corners of each smooth edge, (s, 2)."""
    angle: Array
    """The angle between the facets at each smooth edge, (s,), [rad]; negative where the surface is concave."""
    widest: float
    """Facets of one round face meet at a smaller angle than this, [rad]."""


def widest_of(fewest: int) -> float:
    """Return the largest angle at which neighbouring facets of a round face with this many sides may meet, [rad]."""
    return WHOLE_TURN / (fewest - 0.5)


def find_facets(mesh: Mesh, fewest: int = FEWEST_SIDES) -> Facets:
    """Divide a closed mesh into facets.

    Args:
        fewest: Smallest number of facets around a full turn of a round face.
    """
    widest = max(SMOOTH_RAD, widest_of(fewest))
    normals = _list_normals(mesh)
    i, k = mesh.neighbours.T
    # Small angles from |n_i x n_k|, as rounding makes arccos (n_i . n_k) coarse near 1.
    angle = np.arccos(np.clip((normals[i] * normals[k]).sum(axis=1), -1.0, 1.0))
    angle = np.where(angle < 0.1, np.linalg.norm(np.cross(normals[i], normals[k]), axis=1), angle)
    # Two triangles are in one facet if they face the same way, or nearly so and their corners lie in both planes.
    off = np.maximum(_measure_corner_heights(mesh, normals, i, k), _measure_corner_heights(mesh, normals, k, i))
    flat = (angle < _SAME_RAD) | ((angle < _NEAR_RAD) & (off < FLAT * mesh.extent))
    count, of = find_connected_groups(mesh.neighbours[flat], len(mesh.triangles))
    # Sums over the triangles of a facet: of their area vectors, and of their centres weighted by area.
    across = np.zeros((count, 3))
    np.add.at(across, of, mesh.across)
    size = np.linalg.norm(across, axis=1)
    weight = np.linalg.norm(mesh.across, axis=1)
    centers = np.zeros((count, 3))
    np.add.at(centers, of, weight[:, None] * mesh.corners[mesh.triangles].mean(axis=1))
    total = np.maximum(np.bincount(of, weight, count), 1e-300)  # avoids a division by zero
    pairs = np.unique(np.column_stack([np.repeat(of, 3), mesh.triangles.ravel()]), axis=0)
    bent = (of[i] != of[k]) & (angle < widest)
    # The edge runs along its first triangle i, so n_i x n_k points along it where the surface is convex.
    along = mesh.corners[mesh.edges[:, 1]] - mesh.corners[mesh.edges[:, 0]]
    sign = np.sign((np.cross(normals[i], normals[k]) * along).sum(axis=1))
    return Facets(
        of,
        across / np.maximum(size, 1e-300)[:, None],
        size / 2.0,
        centers / total[:, None],
        pairs[:, 0],
        pairs[:, 1],
        np.column_stack([of[i], of[k]])[bent],
        mesh.edges[bent],
        (sign * angle)[bent],
        widest,
    )


def _measure_corner_heights(mesh: Mesh, normals: Array, i: Any, k: Any) -> Array:
    """Return the largest distance of the corners of triangles k from the planes of triangles i, (len(i),), [mm]."""
    points = mesh.corners[mesh.triangles[k]] - mesh.corners[mesh.triangles[i, 0]][:, None]
    return np.asarray(np.abs((points * normals[i][:, None]).sum(axis=2)).max(axis=1))


def list_edges(mesh: Mesh) -> tuple[Array, Array, Array, Array]:
    """Return every edge twice, once for each of its triangles.

    Returns:
        This triangle, the other triangle and the length of each entry, (2 e,); and the longest edge of each triangle,
        (t,), [mm].
    """
    own = mesh.neighbours.T.ravel()
    other = mesh.neighbours[:, ::-1].T.ravel()
    length = np.tile(np.linalg.norm(mesh.corners[mesh.edges[:, 0]] - mesh.corners[mesh.edges[:, 1]], axis=1), 2)
    longest = np.zeros(len(mesh.triangles))
    np.maximum.at(longest, own, length)
    return own, other, length, longest


def _list_normals(mesh: Mesh) -> Array:
    """Return the unit normal of each triangle, (t, 3); of a needle that of its neighbour across the longest edge."""
    size = np.linalg.norm(mesh.across, axis=1)
    normals = mesh.across / np.maximum(size, 1e-300)[:, None]
    own, other, length, longest = list_edges(mesh)
    # Hardly any height over the longest edge, so its own normal is mere rounding.
    needle = size < FLAT * mesh.extent * longest
    # Entries where a needle has a sound neighbour across its longest edge.
    take = needle[own] & ~needle[other] & (length > longest[own] * (1.0 - 1e-9))
    normals[own[take]] = normals[other[take]]
    return np.asarray(normals)
