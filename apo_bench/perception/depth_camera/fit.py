"""Fit a surface to measured points with small_gicp, with the covariance of the fit."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, copy_frozen, pose
from apo_bench.perception.depth_camera.surface import Surface, load_small_gicp

_LEAST_NOISE_M = 0.0001
"""What one point is worth at best, [m]: the shape is not known better than to a tenth of a millimetre."""
BENT_M = 0.003
"""Noise of this size doubles the covariance: near an edge the nearest surface is then often not the one that was
hit, which the linear part of the formula does not know. `benchmarks/depth_camera.py` measures it."""
PRIOR = copy_frozen([0.05] * 3 + [0.5] * 3, 6)
"""Standard deviation of what is known without any point, [m, rad]: it keeps directions finite of which points say
nothing, and states for them how little that is."""
_WIDTHS = 2.0
"""Points that are farther away than so many widths belong to something else."""
_END_M = 1e-8
"""A fit ends with a step that is shorter, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class Points:
    """Measured points of one part, seen from several views."""

    at: Array
    """(n, 3), world, [m]."""
    ray: Array
    """(n, 3), unit vectors along which they were measured, world."""
    view: Array
    """(n,), number of the view."""

    def __len__(self) -> int:
        return len(self.at)

    def only(self, kept: NDArray[Any]) -> "Points":
        """Some of them."""
        return Points(self.at[kept], self.ray[kept], self.view[kept])

    def thinned(self, n: int) -> "Points":
        """About n of them, evenly out of their order."""
        return self if len(self) <= n else self.only(np.linspace(0, len(self) - 1, n).round().astype(int))


class Fits(NamedTuple):
    """Several fits of one surface to the same points."""

    T: Array
    """(s, 4, 4), world."""
    cost: Array
    """(s,), mean of the squared distances over the largest that counts, 0 to 1."""


def refine_fit(surface: Surface, points: Points, starts: Iterable[Array], width_m: float, turns: int) -> Fits:
    """Go down from every start (s, 4, 4): the least distances of the points from the planes of the surface."""
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
            rotation_epsilon=_END_M,
            translation_epsilon=_END_M,
        )
        T.append(pose.inverse(found.T_target_source))
        # Of points that count the error is half of the squared distance; all others are as far as the farthest.
        cost.append(2.0 * found.error / reach**2 + len(points) - found.num_inliers)
    return Fits(np.array(T), np.array(cost) / len(points))


def covariance(surface: Surface, points: Points, T: Array, width_m: float, noise_m: float, bias_m: float) -> Array:
    """(6, 6), of the body twist by which a fit at T is wrong, [m, rad].

    The minimum moves by H^-1 J^t e if the points are wrong by e, so with independent noise and one common error per
    view the covariance is H^-1 J^t (N + sum_v b_v b_v^t) J H^-1; an error along a ray counts by the cosine between ray
    and normal. `PRIOR` stands for what no point says, `BENT_M` for what is not linear.
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
