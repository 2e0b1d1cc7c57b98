"""The surface of a part as a cloud of points for small_gicp."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import missing_package
from apo_bench.geometry import Array, Piece, build_union_mesh, collect_corners, pose

_SPACING_M = 0.001
"""Between points, on average."""
_MOST_POINTS = 60_000
_NEIGHBOURS = 8
"""So many points say which way the surface looks."""


@final
@dataclass(frozen=True, eq=False)
class Surface:
    """Points of a surface, in the frame of its part, [m]."""

    points: Array
    """(n, 3)."""
    normals: Array
    """(n, 3), unit vectors out of the part."""
    corners: Array
    """(k, 3), of all convex pieces."""

    @cached_property
    def cloud(self) -> Any:
        """The points as small_gicp has them, with its own normals, which are round at edges."""
        gicp = load_small_gicp()
        cloud = gicp.PointCloud(self.points)
        gicp.estimate_normals(cloud, self.tree, _NEIGHBOURS, 1)
        return cloud

    @cached_property
    def tree(self) -> Any:
        """What finds the nearest of the points."""
        return load_small_gicp().KdTree(self.points)

    def find_nearest(self, points: Array) -> tuple[NDArray[np.int64], Array]:
        """The number of the nearest point of the surface, and its distance, (m,) each, of points (m, 3)."""
        number, squared = self.tree.batch_nearest_neighbor_search(points)
        return np.asarray(number, dtype=np.int64), np.sqrt(squared)

    def looks_like(self, other: "Surface") -> bool:
        """Whether both are of parts of one shape."""
        return self.corners.shape == other.corners.shape and np.allclose(self.corners, other.corners)


@lru_cache(maxsize=64)
def sample_surface(pieces: tuple[Piece, ...]) -> Surface:
    """The surface of a union of pieces; the same pieces give the same points."""
    from trimesh.sample import sample_surface as sample

    mesh = build_union_mesh(pieces)
    points, triangle = sample(mesh, min(_MOST_POINTS, round(mesh.area / _SPACING_M**2)), seed=0)
    return Surface(np.asarray(points), np.asarray(mesh.face_normals)[triangle], collect_corners(pieces)[0])


def join_surfaces(posed: Iterable[tuple[Surface, Array]]) -> Surface:
    """Surfaces that stand at poses (4, 4) as one."""
    points, normals, corners = [], [], []
    for surface, T in posed:
        points.append(pose.apply(T, surface.points))
        normals.append(surface.normals @ T[:3, :3].T)
        corners.append(pose.apply(T, surface.corners))
    return Surface(np.concatenate(points), np.concatenate(normals), np.concatenate(corners))


def load_small_gicp() -> Any:
    """The package that fits.

    Raises:
        InputError: It is not installed.
    """
    try:
        import small_gicp
    except ImportError as error:
        raise missing_package("the depth camera", "small_gicp", " (the extra range of apo_bench)") from error
    return small_gicp
