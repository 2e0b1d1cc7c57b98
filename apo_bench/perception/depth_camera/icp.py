"""Fit the pose of a surface to measured points (point-to-plane ICP of small_gicp), with its covariance."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, copy_frozen, pose
from apo_bench.perception.depth_camera.surface import Surface, load_small_gicp

_LEAST_NOISE_M = 0.0001
"""Least standard deviation of one point, [m]: the shape is known to a tenth of a millimetre at best."""
BENT_M = 0.003
"""Noise of this size doubles the covariance: near an edge the nearest surface is often not the one that the ray hit,
which the linear formula neglects. `benchmarks/depth_camera.py` measures it."""
PRIOR = copy_frozen([0.05] * 3 + [0.5] * 3, 6)
"""Standard deviation of a pose before any measurement, [m, rad]. It keeps the covariance finite in directions that the
points do not determine."""
_WIDTHS = 2.0
"""A point farther from the surface than so many widths is taken as part of something else."""
_STEP_TOLERANCE_M = 1e-8
"""A fit ends when a step is shorter, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class Points:
    """Measured points of one part, from several views."""

    at: Array
    """(n, 3), world, [m]."""
    ray: Array
    """(n, 3), unit vectors along which they were measured, world."""
    view: Array
    """(n,), index of the view."""

    def __len__(self) -> int:
        return len(self.at)

    def select(self, kept: NDArray[Any]) -> "Points":
        """The points that a mask (n,) or an array of indices selects."""
        return Points(self.at[kept], self.ray[kept], self.view[kept])

    def thin_out(self, n: int) -> "Points":
        """At most n points, evenly spaced in their order."""
        return self if len(self) <= n else self.select(np.linspace(0, len(self) - 1, n).round().astype(int))


class RefinedPoses(NamedTuple):
    """Several fits of one surface to the same points, one per start pose."""

    T: Array
    """(s, 4, 4), fitted poses, world, [m]."""
    cost: Array
    """(s,), mean squared distance, relative to the square of the largest distance that counts, 0 to 1."""


def refine_fit(surface: Surface, points: Points, starts: Iterable[Array], width_m: float, turns: int) -> RefinedPoses:
    """Minimise the distances of the points from the tangent planes of the surface, from every start pose.

    Args:
        starts: (s, 4, 4), poses of the surface, world, [m].
        width_m: Points farther from the surface than twice this width are ignored.
        turns: Iterations at most.
    """
    gicp = load_small_gicp()
    source = gicp.PointCloud(points.at)
    reach = _WIDTHS * width_m
    T = []
    cost = []
    for start in starts:
        found = gicp.align(
            surface.cloud,
            source,
            surface.tree,
            init_T_target_source=pose.inverse(start),
            registration_type="PLANE_ICP",
            max_correspondence_distance=reach,
            max_iterations=turns,
            rotation_epsilon=_STEP_TOLERANCE_M,
            translation_epsilon=_STEP_TOLERANCE_M,
        )
        T.append(pose.inverse(found.T_target_source))
        # The error is the sum of half the squared distances of the inliers; each outlier counts as the full reach.
        cost.append(2.0 * found.error / reach**2 + len(points) - found.num_inliers)
    return RefinedPoses(np.array(T), np.array(cost) / len(points))


def compute_fit_covariance(
    surface: Surface, points: Points, T: Array, width_m: float, noise_m: float, bias_m: float
) -> Array:
    """The covariance (6, 6) of the body twist of the error of a fit at pose T, [m, rad].

    Errors e of the points move the minimum by H^-1 J^t e. With independent noise and one common error per view the
    covariance is H^-1 J^t (N + sum_v b_v b_v^t) J H^-1. An error along a ray counts by the cosine between ray and
    normal. `PRIOR` covers directions that no point determines, `BENT_M` the nonlinearity.

    Args:
        T: (4, 4), pose of the surface, world, [m].
        noise_m: Standard deviation of the independent error of a ray.
        bias_m: Standard deviation of the error that all rays of one view have in common.
    """
    local = (points.at - T[:3, 3]) @ T[:3, :3]
    nearest, distance = surface.find_nearest(local)
    near = distance < _WIDTHS * width_m
    normal = surface.normals[nearest[near]]
    # A body twist (v, w) of T moves p = T^-1 at by -(v + w x p), its distance by -(n . v + (p x n) . w).
    J = -np.concatenate([normal, np.cross(local[near], normal)], axis=1)
    loose = (max(noise_m, _LEAST_NOISE_M) / PRIOR) ** 2
    inverse = np.linalg.inv(J.T @ J + np.diag(loose))
    # An error along a ray moves a point off the surface by the cosine between ray and normal.
    slope = np.einsum("ni,ni->n", normal @ T[:3, :3].T, points.ray[near])
    variance = (noise_m * slope) ** 2 + _LEAST_NOISE_M**2
    middle = J.T @ (variance[:, None] * J)
    for v in np.unique(points.view):
        common = J.T @ np.where(points.view[near] == v, bias_m * slope, 0.0)
        middle += np.outer(common, common)
    bent = 1.0 + (noise_m / BENT_M) ** 2
    both = bent * inverse @ (middle + np.diag((loose * PRIOR) ** 2)) @ inverse
    return np.asarray((both + both.T) / 2)
