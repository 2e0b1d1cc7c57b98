"""Chi-square test of a correction, which detects wrong relations.

If all relations and the stated noise are right, the squared length of the correction is chi-square distributed, with as
many degrees of freedom as the contacts fix. A wrong contact that is redundant contradicts the others; one that is not
redundant only makes the correction too long.
"""

from math import isfinite, sqrt

import numpy as np
from scipy.special import chdtrc

from apo_bench.assembly import Assembly, find_equation_pattern
from apo_bench.correction.solvers import SMALLEST, count_plays
from apo_bench.geometry import Array, copy_frozen, remember

TEST_LEVEL = 0.01
"""Accepted rate of false alarms."""
ROUNDING = 1e-13
"""Fraction of the largest diagonal entry that is added to all, since redundant contacts without play make A
singular."""
CONTRADICTION_M = 0.05e-3
"""Standard deviation given to contradictory contacts, [m], so that their contradiction can be measured. Contacts hold
if no compact equation is off by more; it counts sqrt(v) times at the centre of v vertices."""


@remember
def fit_deviation(assembly: Assembly, play_m: float) -> Array:
    """The standard deviation of each compact equation, (3 c,), [m]: a fit contact is uniform within its play.

    A row stands for all v vertices of its contact, so its deviation is sqrt(v) times that of one vertex.
    """
    count, unit_m = count_plays(assembly, play_m)
    each = unit_m / sqrt(3.0) * np.sqrt(count * np.diff(find_equation_pattern(assembly).begin))
    return copy_frozen(np.repeat(each, 3))


def p_value(chi_square: float, degrees: int) -> float:
    """The probability of a chi-square at least as large with these degrees of freedom; 1 if there are none."""
    if not isfinite(chi_square):
        return 0.0
    return float(chdtrc(degrees, chi_square)) if degrees else 1.0


def soft_chi_square(z: Array, Jt: Array, S: Array) -> Array:
    """The squared length of corrections, (b,), if equations may be off.

    Near z the equations are linear, so the least sum of squares of z and of the residuals of the equations is r^t (J
    J^t + S)^-1 r, with r = J z the residual at the observation.

    Args:
        z: The corrections, (b, 6 n), in standard deviations.
        Jt: (b, 6 n, 3 c), the transposed derivative of the equations by z.
        S: Covariance of the equations, (3 c, 3 c), [m^2].
    """
    # The residual r at the observation is Gaussian with covariance J J^t from noise plus S from play.
    J = np.swapaxes(Jt, 1, 2)
    A = J @ Jt + S
    r = J @ z[..., None]
    diagonal = A.reshape(len(A), -1)[:, :: A.shape[1] + 1]
    diagonal += ROUNDING * diagonal.max(axis=1, initial=SMALLEST)[:, None]
    return np.asarray((r * np.linalg.solve(A, r)).sum(axis=(1, 2)))
