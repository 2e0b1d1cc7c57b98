"""The surface of a part as a point cloud with normals, for the fits of small_gicp."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import missing_package
from apo_bench.geometry import Array, Piece, build_union_mesh, collect_corners, pose

_SPACING_M = 0.001
"""Mean distance between points."""
_MOST_POINTS = 60_000
"""Points of one surface, at most."""
_NEIGHBOURS = 8
"""Points from which small_gicp estimates a normal."""


@final
@dataclass(frozen=True, eq=False)
class Surface:
    """Points of a surface, in the frame of its part, [m]."""

    points: Array
    """(n, 3)."""
    normals: Array
    """(n, 3), unit vectors out of the part."""
    corners: Array
    """(k, 3), corners of all convex pieces."""

    @cached_property
    def cloud(self) -> Any:
        """The point cloud of small_gicp, with the normals that it estimates, which are rounded at edges."""
        gicp = load_small_gicp()
        cloud = gicp.PointCloud(self.points)
        gicp.estimate_normals(cloud, self.tree, _NEIGHBOURS, 1)
        return cloud

    @cached_property
    def tree(self) -> Any:
        """The k-d tree of the points."""
        return load_small_gicp().KdTree(self.points)

    def find_nearest(self, points: Array) -> tuple[NDArray[np.int64], Array]:
        """The index of the nearest surface point and its distance [m], (m,) each, for points (m, 3)."""
        number, squared = self.tree.batch_nearest_neighbor_search(points)
        return np.asarray(number, dtype=np.int64), np.sqrt(squared)

    def looks_like(self, other: "Surface") -> bool:
        """True if both parts have the same corners, in the same order."""
        return self.corners.shape == other.corners.shape and np.allclose(self.corners, other.corners)


@lru_cache(maxsize=64)
def sample_surface(pieces: tuple[Piece, ...]) -> Surface:
    """Sample the surface of a union of pieces; deterministic."""
    from trimesh.sample import sample_surface as sample

    mesh = build_union_mesh(pieces)
    points, triangle = sample(mesh, min(_MOST_POINTS, round(mesh.area / _SPACING_M**2)), seed=0)
    return Surface(np.asarray(points), np.asarray(mesh.face_normals)[triangle], collect_corners(pieces)[0])


def join_surfaces(posed: Iterable[tuple[Surface, Array]]) -> Surface:
    """Join surfaces at poses (4, 4) into one."""
    points, normals, corners = [], [], []
    for surface, T in posed:
        points.append(pose.apply(T, surface.points))
        normals.append(surface.normals @ T[:3, :3].T)
        corners.append(pose.apply(T, surface.corners))
    return Surface(np.concatenate(points), np.concatenate(normals), np.concatenate(corners))


def load_small_gicp() -> Any:
    """Import the package small_gicp.

    Raises:
        InputError: The package is not installed.
    """
    try:
        import small_gicp
    except ImportError as error:
        raise missing_package("the depth camera", "small_gicp", " (the extra range of apo_bench)") from error
    return small_gicp
