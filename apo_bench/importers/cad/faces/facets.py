"""Flat pieces of a surface: triangles in one plane, and which pieces meet at a small angle."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import WHOLE_TURN, Array
from apo_bench.importers.cad.solids import Mesh, find_connected_groups

FEWEST_SIDES = 12
"""The smallest number of flat pieces in a whole turn of a round face."""
SMOOTH_RAD = np.radians(35.0)
"""Flat pieces that meet at less may be of one free surface."""
_SAME_RAD = 1e-3
_NEAR_RAD = 0.02
FLAT = 1e-6
"""Of the size of a part: what is nearer to a plane lies in it."""


class Facets(NamedTuple):
    """The flat pieces of a mesh."""

    of: Any
    """That of each triangle, (t,)."""
    normals: Array
    """(f, 3)."""
    areas: Array
    centers: Array
    owner: Any
    """Pairs of a piece and a corner of it, each once, by piece: the piece, (m,)."""
    corner: Any
    """... and the corner, (m,)."""
    smooth: Any
    """Pairs of pieces that meet smoothly, (s, 2), once for each edge of the mesh."""
    along: Any
    """The corners of these edges, (s, 2)."""
    angle: Array
    """At them, (s,), [rad]; negative where the surface is hollow."""
    widest: float
    """Flat pieces of one round face meet at less, [rad]."""


def widest_of(fewest: int) -> float:
    """Return the angle at which flat pieces of a round face of this many sides meet at most, [rad]."""
    return WHOLE_TURN / (fewest - 0.5)


def find_facets(mesh: Mesh, fewest: int = FEWEST_SIDES) -> Facets:
    """Cut a closed mesh into flat pieces.

    Args:
        fewest: Of the sides of a round face in a whole turn.
    """
    widest = max(SMOOTH_RAD, widest_of(fewest))
    normals = _normals(mesh)
    i, k = mesh.neighbours.T
    # Small angles from |n_i x n_k|, as rounding makes arccos (n_i . n_k) coarse near 1.
    angle = np.arccos(np.clip((normals[i] * normals[k]).sum(axis=1), -1.0, 1.0))
    angle = np.where(angle < 0.1, np.linalg.norm(np.cross(normals[i], normals[k]), axis=1), angle)
    # Two triangles are of one piece if they face the same way, or nearly so and neither leaves the plane of the other.
    off = np.maximum(_height(mesh, normals, i, k), _height(mesh, normals, k, i))
    flat = (angle < _SAME_RAD) | ((angle < _NEAR_RAD) & (off < FLAT * mesh.extent))
    count, of = find_connected_groups(mesh.neighbours[flat], len(mesh.triangles))
    # Sums over the triangles of a piece: of n times twice the area, and of the middles, weighed by the area.
    across = np.zeros((count, 3))
    np.add.at(across, of, mesh.across)
    size = np.linalg.norm(across, axis=1)
    weight = np.linalg.norm(mesh.across, axis=1)
    centers = np.zeros((count, 3))
    np.add.at(centers, of, weight[:, None] * mesh.corners[mesh.triangles].mean(axis=1))
    total = np.maximum(np.bincount(of, weight, count), 1e-300)
    pairs = np.unique(np.column_stack([np.repeat(of, 3), mesh.triangles.ravel()]), axis=0)
    bent = (of[i] != of[k]) & (angle < widest)
    # At an edge that its left triangle i goes along, n_i x n_k points forwards where the surface bulges out.
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


def _height(mesh: Mesh, normals: Array, i: Any, k: Any) -> Array:
    """How far the corners of triangles k are from the planes of triangles i."""
    points = mesh.corners[mesh.triangles[k]] - mesh.corners[mesh.triangles[i, 0]][:, None]
    return np.asarray(np.abs((points * normals[i][:, None]).sum(axis=2)).max(axis=1))


def edges_of(mesh: Mesh) -> tuple[Array, Array, Array, Array]:
    """Each edge twice, once for either of its triangles: this one, the other, and its length; and the longest of each
    triangle, [mm]."""
    own = mesh.neighbours.T.ravel()
    other = mesh.neighbours[:, ::-1].T.ravel()
    length = np.tile(np.linalg.norm(mesh.corners[mesh.edges[:, 0]] - mesh.corners[mesh.edges[:, 1]], axis=1), 2)
    longest = np.zeros(len(mesh.triangles))
    np.maximum.at(longest, own, length)
    return own, other, length, longest


def _normals(mesh: Mesh) -> Array:
    """Of each triangle; of a needle, that of the neighbour across its longest edge."""
    size = np.linalg.norm(mesh.across, axis=1)
    normals = mesh.across / np.maximum(size, 1e-300)[:, None]
    own, other, length, longest = edges_of(mesh)
    needle = size < FLAT * mesh.extent * longest
    take = needle[own] & ~needle[other] & (length > longest[own] * (1.0 - 1e-9))
    normals[own[take]] = normals[other[take]]
    return np.asarray(normals)
