"""Average the poses of one rest on SE(3) without outliers, with the covariance of the mean."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, copy_frozen, pose

_FRAME_FLOOR = copy_frozen(np.repeat([2e-5, 2e-4], 3), 6)
"""Smallest standard deviation of one frame per axis, [m, rad], since files hold rounded numbers."""
_FAR = 5.0
"""A frame is an outlier beyond this many standard deviations along or about any axis; 1 in 300,000 by chance."""
_ROUNDS = 12  # largest number of Gauss-Newton iterations
_MAD = 1.4826  # median absolute deviation to standard deviation of a Gaussian
_PRIOR = 8.0
"""Weight of the other rests in the covariance of a rest, in frames."""


@final
@dataclass(frozen=True, eq=False)
class Mean:
    """The mean of the poses of frames."""

    T: Array
    """(4, 4), [m]."""
    scatter: Array
    """(6, 6), covariance of one frame, body twist, [m, rad]."""
    inlier: NDArray[np.bool_]
    """(n,), whether each frame is no outlier."""
    independent: float
    """Number of independent frames with the same information as all inliers, whose errors are correlated in time."""

    @property
    def covariance(self) -> Array:
        """Covariance of the mean, (6, 6), [m, rad], without errors that are common to all frames."""
        return self.scatter / self.independent


def per_axis(C: Array) -> tuple[float, float]:
    """Return the standard deviations along and about an axis, [m, rad]: the mean over axes of a covariance (6, 6)."""
    return float(np.sqrt(np.trace(C[:3, :3]) / 3.0)), float(np.sqrt(np.trace(C[3:, 3:]) / 3.0))


def average(T: Array) -> Mean:
    """Return the mean of poses (n, 4, 4): the pose about which the mean twist of the inliers is zero.

    Outliers are more than `_FAR` robust standard deviations off along or about an axis.
    """
    middle = _middle(T)
    inlier = np.ones(len(T), dtype=np.bool_)
    # The mean on SE(3) by Gauss-Newton: step by the mean twist of the inliers until it is zero.
    for _ in range(_ROUNDS):
        xi = pose.log(pose.inverse(middle) @ T)
        inlier = _near(xi)
        step = xi[inlier].mean(axis=0)
        middle = middle @ pose.exp(step)
        if np.abs(step).max() < 1e-10:
            break
    xi = pose.log(pose.inverse(middle) @ T)[inlier]
    return Mean(middle, xi.T @ xi / max(len(xi) - 1, 1), inlier, _independent(xi))


def pool_mean(mean: Mean, others: Array) -> Mean:
    """Return the mean with its covariance pooled with that of other rests.

    Args:
        others: (6, 6), covariance of one frame over all rests, in the axes of the camera.
    """
    # Weighted mean of both covariances, as for an inverse Wishart prior with the weight of _PRIOR frames.
    n = float(mean.inlier.sum())
    A = np.kron(np.eye(2), mean.T[:3, :3])  # from axes of the part to those of the camera, at the same origin
    scatter = ((n - 1.0) * mean.scatter + _PRIOR * A.T @ others @ A) / (n - 1.0 + _PRIOR)
    return Mean(mean.T, scatter + np.diag(_FRAME_FLOOR**2), mean.inlier, mean.independent)


def common_scatter(means: list[Mean]) -> Array:
    """Return the covariance of one frame, pooled over rests by degrees of freedom, (6, 6), in axes of the camera."""
    freedom = [float(mean.inlier.sum()) - 1.0 for mean in means]
    axes = [np.kron(np.eye(2), mean.T[:3, :3]) for mean in means]
    scatters = [n * A @ mean.scatter @ A.T for n, A, mean in zip(freedom, axes, means, strict=True)]
    return np.sum([np.zeros((6, 6)), *scatters], axis=0) / max(sum(freedom), 1.0) + np.diag(_FRAME_FLOOR**2)


def _middle(T: Array) -> Array:
    """Return a robust start for the mean, (4, 4): the median position, and the rotation nearest to most frames."""
    # Of the 25 frames nearest to the median position, take the rotation with the least median angle to the others.
    place = np.median(T[:, :3, 3], axis=0)
    few = T[np.argsort(np.linalg.norm(T[:, :3, 3] - place, axis=1))[: min(len(T), 25)]]
    turns = np.linalg.norm(pose.log(pose.inverse(few)[:, None] @ few[None])[..., 3:], axis=-1)
    middle = np.array(few[int(np.argmin(np.median(turns, axis=1)))])
    middle[:3, 3] = place
    return middle


def _near(xi: Array) -> NDArray[np.bool_]:
    """Return which frames are no outliers, (n,): at least half of them, since few frames do not show their spread.

    Args:
        xi: (n, 6), twists of the frames from the current mean.
    """
    off = np.abs(xi - np.median(xi, axis=0))
    worst = (off / np.maximum(_MAD * np.median(off, axis=0), _FRAME_FLOOR)).max(axis=1)
    return np.asarray(worst <= max(_FAR, float(np.median(worst))))


def _independent(xi: Array) -> float:
    """Return the effective number of independent frames, n (1 - r) / (1 + r), between 1 and n.

    r is the correlation of neighbouring frames, averaged over axes. Fewer than 8 frames count as independent.
    """
    n = len(xi)
    if n < 8:
        return float(n)
    power = (xi**2).sum(axis=0)
    r = (xi[1:] * xi[:-1]).sum(axis=0)[power > 0.0] / power[power > 0.0]
    mean = float(np.clip(r.mean() if len(r) else 0.0, 0.0, 0.999))
    return max(1.0, n * (1.0 - mean) / (1.0 + mean))
