"""Put a shape where measured points are: the least robust distance of the points from its surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.depth_camera.distance import Shape, signed_distance
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array

_ARM_M = 0.04
"""Length by which turns are weighed against shifts: half a part."""
_LEAST_NOISE_M = 0.0001
"""What one point is worth at best, [m]: the shape is not known better than to a tenth of a millimetre."""
BENT_M = 0.003
"""Noise of this size doubles the covariance: beside an edge the nearest surface is then often not the one that was
hit, which the linear part of the formula does not know. Measured by `python benchmarks/eye.py`."""
PRIOR = np.array([0.05] * 3 + [0.5] * 3)
"""Standard deviation of what is known without any point, [m, rad]: it keeps directions finite of which points say
nothing, and states for them how little that is."""
PRIOR.flags.writeable = False


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

    def only(self, kept: NDArray[np.bool_]) -> Points:
        """Some of them."""
        return Points(self.at[kept], self.ray[kept], self.view[kept])

    def thinned(self, n: int) -> Points:
        """About n of them, evenly out of their order."""
        if len(self) <= n:
            return self
        kept = np.linspace(0, len(self) - 1, n).round().astype(int)
        return Points(self.at[kept], self.ray[kept], self.view[kept])


class Fits(NamedTuple):
    """Several fits of one shape to the same points."""

    T: Array
    """(s, 4, 4), world."""
    cost: Array
    """(s,), mean of the robust loss, in units of its width squared, 0 to 1."""


def refine(shape: Shape, points: Points, starts: Array, width_m: float, turns: int) -> Fits:
    """Go down from every start (s, 4, 4) at once, by damped Gauss-Newton on body twists.

    The loss of a distance d is that of Geman and McClure, d^2 / (d^2 + w^2): points that are farther away than some
    widths w belong to something else and hardly count.
    """
    T = np.array(starts)
    damping = np.full(len(starts), 1e-3)
    scale = np.array([1.0] * 3 + [1.0 / _ARM_M] * 3)
    d, J = _rows(shape, points, T)
    cost = _loss(d, width_m)
    for _ in range(turns):
        weight = 1.0 / (1.0 + (d / width_m) ** 2) ** 2
        WJ = J * scale * weight[..., None]
        H = np.swapaxes(J * scale, 1, 2) @ WJ
        g = np.einsum("sni,sn->si", WJ, d)
        mean = np.trace(H, axis1=1, axis2=2)[:, None, None] / 6 + 1e-12
        step = -scale * np.linalg.solve(H + damping[:, None, None] * mean * np.eye(6), g[..., None])[..., 0]
        length = np.linalg.norm(step / scale, axis=1, keepdims=True)
        tried = T @ pose.exp(step * np.minimum(1.0, 0.05 / np.maximum(length, 1e-12)))
        d_new, J_new = _rows(shape, points, tried)
        cost_new = _loss(d_new, width_m)
        better = cost_new < cost
        T[better] = tried[better]
        d[better] = d_new[better]
        J[better] = J_new[better]
        cost[better] = cost_new[better]
        damping = np.where(better, np.maximum(damping / 5.0, 1e-7), np.minimum(damping * 5.0, 1e3))
        if (length[:, 0] < 1e-8).all():
            break
    return Fits(T, cost)


def covariance(shape: Shape, points: Points, T: Array, width_m: float, noise_m: float, bias_m: float) -> Array:
    """(6, 6), of the body twist by which a fit at T is wrong, [m, rad].

    The minimum moves by H^-1 J^t W e if the points are wrong by e, so with independent noise and one common error per
    view the covariance is H^-1 J^t W (N + sum_v b_v b_v^t) W J H^-1; an error along a ray counts by the cosine between
    ray and normal. `PRIOR` stands for what no point says, `BENT_M` for what is not linear.
    """
    d, J = (a[0] for a in _rows(shape, points, T[None]))
    weight = 1.0 / (1.0 + (d / width_m) ** 2) ** 2
    WJ = J * weight[:, None]
    loose = float(weight.mean()) * (max(noise_m, _LEAST_NOISE_M) / PRIOR) ** 2
    inverse = np.linalg.inv(J.T @ WJ + np.diag(loose))
    gradient = -J[:, :3]
    slope = np.einsum("ni,ni->n", gradient @ T[:3, :3].T, points.ray)
    variance = (noise_m * slope) ** 2 + _LEAST_NOISE_M**2
    middle = WJ.T @ (variance[:, None] * WJ)
    for v in np.unique(points.view):
        common = WJ.T @ np.where(points.view == v, bias_m * slope, 0.0)
        middle += np.outer(common, common)
    bent = 1.0 + (noise_m / BENT_M) ** 2
    both = bent * inverse @ (middle + np.diag((loose * PRIOR) ** 2)) @ inverse
    return np.asarray((both + both.T) / 2)


def _rows(shape: Shape, points: Points, T: Array) -> tuple[Array, Array]:
    """Distances (s, n) of the points from the shape at each pose, and their derivatives by body twists, (s, n, 6)."""
    local = (points.at[None] - T[:, None, :3, 3]) @ T[:, :3, :3]
    d, gradient = signed_distance(shape, local)
    return d, -np.concatenate([gradient, np.cross(local, gradient)], axis=-1)


def _loss(d: Array, width_m: float) -> Array:
    return np.asarray((d * d / (d * d + width_m * width_m)).mean(axis=-1))
