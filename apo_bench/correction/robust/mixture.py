"""Covariance of the poses of the most likely hypothesis, with the hypotheses that lead to nearly the same poses.

The reported poses are those of the most likely hypothesis, since a mean of consistent poses is not consistent.
Hypotheses with nearly the same poses form one mode of the mixture, and the covariance is that of the mode. Others keep
their own poses and covariance.
"""

from collections.abc import Sequence

import numpy as np

from apo_bench.assembly import Hypothesis
from apo_bench.geometry import Array, compute_right_jacobian, pose

_APART = 22.5
"""Squared distance of two poses, in standard deviations of both, beyond which they are different modes; one in a
thousand is larger, with six degrees of freedom."""
_FINE = np.diag(np.repeat([1e-4, 1e-3], 3) ** 2)
"""Covariance added to differences of poses, (6, 6), [m, rad], so that tiny differences do not separate modes."""


def mode_covariance(hypotheses: Sequence[Hypothesis]) -> Array | None:
    """The covariance of the first hypothesis and those of its mode, about the poses of the first, (n, 6, 6), [m, rad].

    It is the weighted second moment: the covariance of each hypothesis plus the square of its offset from the first.

    Returns:
        None if the first has no covariance.
    """
    first = hypotheses[0]
    if first.covariance is None:
        return None
    total = 0.0
    second = np.zeros(first.covariance.shape)
    for one in hypotheses:
        if one.covariance is None:
            continue
        off = pose.log(pose.inverse(first.poses) @ one.poses)
        both = first.covariance + one.covariance + _FINE
        if (np.einsum("ki,ki->k", off, np.linalg.solve(both, off[..., None])[..., 0]) > _APART).any():
            continue
        # T_one exp(x) = T_first exp(off) exp(x) is T_first exp(off + A x), with A the inverse of J_r(off).
        A = np.linalg.inv(compute_right_jacobian(off))
        second += one.weight * (A @ one.covariance @ np.swapaxes(A, 1, 2) + off[:, :, None] * off[:, None, :])
        total += one.weight
    return np.asarray(second / total)
