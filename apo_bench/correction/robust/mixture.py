"""The covariance of a mixture of hypotheses about the poses of the likeliest.

Poses are those of the likeliest: a mean of poses that satisfy contacts satisfies none, and a mean of a part and the
same part turned round is nowhere. Hypotheses that lead to nearly the same poses are one mode of the mixture, and the
covariance is that of the mode. Those that lead elsewhere keep poses and covariance of their own.
"""

from collections.abc import Sequence

import numpy as np

from apo_bench.assembly import Hypothesis
from apo_bench.geometry import Array, compute_right_jacobian, pose

_APART = 22.5
"""Squared difference of two poses, in standard deviations of both, beyond which hypotheses are different modes: with
six degrees of freedom one in a thousand is larger."""
_FINE = np.diag(np.repeat([1e-4, 1e-3], 3) ** 2)
"""(6, 6): poses are not distinguished by less, [m, rad]."""


def mode_covariance(hypotheses: Sequence[Hypothesis]) -> Array | None:
    """The covariance of the first hypothesis and of those of its mode about its poses, (n, 6, 6), [m, rad].

    The second moment of a mixture: of each hypothesis its covariance and the square of how far its poses are off, by
    their weights.

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
