"""Put a shape where measured points are: where a fit may begin, and the least robust distance of the points from it."""

from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.depth_camera.distance import Shape, signed_distance
from apo_bench.geometry import Array, frozen, pose, quarter_turns

_ARM_M = 0.04
"""Length by which turns are weighed against shifts: half a part."""
_LEAST_NOISE_M = 0.0001
"""What one point is worth at best, [m]: the shape is not known better than to a tenth of a millimetre."""
BENT_M = 0.003
"""Noise of this size doubles the covariance: beside an edge the nearest surface is then often not the one that was
hit, which the linear part of the formula does not know. Measured by `python benchmarks/eye.py` of the repository."""
PRIOR = frozen([0.05] * 3 + [0.5] * 3, 6)
"""Standard deviation of what is known without any point, [m, rad]: it keeps directions finite of which points say
nothing, and states for them how little that is."""
_EDGE = 0.01
"""Share of the points beyond either end of their extent: noise makes regions larger than parts."""
_STEPS = 45
"""Directions between 0 and 90 degrees that are tried for the sides of the smallest rectangle."""


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


class ShapeFits(NamedTuple):
    """Several fits of one shape to the same points."""

    T: Array
    """(s, 4, 4), world."""
    cost: Array
    """(s,), mean of the robust loss, in units of its width squared, 0 to 1."""


def starts(shape: Shape, points: Array, same: Array) -> Array:
    """Poses (s, 4, 4) of a shape whose visible surface may be the points (n, 3), world, [m].

    The smallest rectangle around the points, seen from above, says how the sides of a part that stands on one of its
    sides are turned; of the 24 ways to put a box on a table those that look alike are tried once. The part is put in
    the middle of the rectangle, and as high as the points reach.

    Args:
        same: (m, 4, 4), displacements after which the shape looks the same.
    """
    turn = _sides(points[:, :2])
    c = np.cos(turn)
    s = np.sin(turn)
    Z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    low, high = np.quantile(points @ Z, (_EDGE, 1.0 - _EDGE), axis=0)
    turns = distinct(quarter_turns(), same)
    T = np.tile(np.eye(4), (len(turns), 1, 1))
    for start, R in zip(T, turns, strict=True):
        a, b = turned_bounds(shape, R)
        start[:3, :3] = Z @ R
        start[:3, 3] = Z @ [*((low + high) / 2 - (a + b) / 2)[:2], high[2] - b[2]]
    return T


def distinct(turns: Array, same: Array) -> Array:
    """Rotations without repetition: one, (3, 3), of each set in (k, 3, 3) that symmetries make alike."""
    kept: list[Array] = []
    for R in turns:
        if not any((np.abs(K @ same[:, :3, :3] - R).max(axis=(1, 2)) < 1e-9).any() for K in kept):
            kept.append(R)
    return np.array(kept)


def turned_bounds(shape: Shape, R: Array) -> tuple[Array, Array]:
    """The lowest and the highest corner of the turned shape, (3,) each, [m]."""
    centers = shape.center @ R.T
    reach = np.einsum("kij,kj->ki", np.abs(R @ shape.turn), shape.half)
    return (centers - reach).min(axis=0), (centers + reach).max(axis=0)


def _sides(flat: Array) -> float:
    """The turn, 0 to 90 degrees, of the smallest rectangle around points (n, 2), [rad]."""
    turns = np.arange(_STEPS) * np.pi / 2 / _STEPS
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    across = np.stack([-np.sin(turns), np.cos(turns)], axis=1)
    sizes = [np.ptp(np.quantile(flat @ w.T, (_EDGE, 1.0 - _EDGE), axis=0), axis=0) for w in (ways, across)]
    return float(turns[np.argmin(sizes[0] * sizes[1])])


def refine(shape: Shape, points: Points, starts: Array, width_m: float, turns: int) -> ShapeFits:
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
        # Weights of Geman and McClure, the slope of the loss over d: w^4 / (d^2 + w^2)^2. Turns count by an arm's
        # length, so that H weighs them like shifts.
        weight = 1.0 / (1.0 + (d / width_m) ** 2) ** 2
        WJ = J * scale * weight[..., None]
        H = np.swapaxes(J * scale, 1, 2) @ WJ
        g = np.einsum("sni,sn->si", WJ, d)
        mean = np.trace(H, axis1=1, axis2=2)[:, None, None] / 6 + 1e-12
        step = -scale * np.linalg.solve(H + damping[:, None, None] * mean * np.eye(6), g[..., None])[..., 0]
        # No step is longer than 0.05 m; one that does not lower the loss is not taken, and damped more.
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
    return ShapeFits(T, cost)


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
    # An error along a ray moves a point off the surface by the cosine between ray and normal.
    slope = np.einsum("ni,ni->n", -J[:, :3] @ T[:3, :3].T, points.ray)
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
    # d(p) of p = T^-1 at: a body twist (v, w) of T moves p by -(v + w x p), so d by -(g . v + (p x g) . w).
    local = (points.at[None] - T[:, None, :3, 3]) @ T[:, :3, :3]
    d, gradient = signed_distance(shape, local)
    return d, -np.concatenate([gradient, np.cross(local, gradient)], axis=-1)


def _loss(d: Array, width_m: float) -> Array:
    return np.asarray((d * d / (d * d + width_m * width_m)).mean(axis=-1))
