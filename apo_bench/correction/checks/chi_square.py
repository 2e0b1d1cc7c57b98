"""Is a relation wrong? The chi-square test of a correction.

If every relation is right and the stated noise is too, the squared length of the correction is chi-square distributed
with as many degrees of freedom as the contacts fix. A redundant contact that is wrong contradicts the others; one that
is not redundant only asks for a correction that is too long.
"""

from math import isfinite, sqrt

import numpy as np
from scipy.special import chdtrc

from apo_bench.assembly import Assembly, find_contact_pattern
from apo_bench.correction.solvers import SMALLEST, count_plays
from apo_bench.geometry import Array, copy_frozen, remember

TEST_LEVEL = 0.01
"""False alarms that are accepted."""
ROUNDING = 1e-13
"""Part of the largest diagonal entry that is added to all: redundant contacts without play have no other."""
CONTRADICTION_M = 0.05e-3
"""Standard deviation that contradictory contacts are given, [m], so that their contradiction can be measured. They hold
if no compact equation, which counts sqrt(v) times at the centre of v vertices, is off by more."""


@remember
def fit_deviation(assembly: Assembly, play_m: float) -> Array:
    """The standard deviation of each compact equation, (3 c,), [m]: a contact that fits is uniform within its play.

    A row stands for all vertices of its contact, so it is off by as much as they are together.
    """
    count, unit_m = count_plays(assembly, play_m)
    each = unit_m / sqrt(3.0) * np.sqrt(count * np.diff(find_contact_pattern(assembly).begin))
    return copy_frozen(np.repeat(each, 3))


def p_value(chi_square: float, degrees: int) -> float:
    """The chance of a chi-square at least as large, of so many degrees of freedom; 1 where nothing is tested."""
    if not isfinite(chi_square):
        return 0.0
    return float(chdtrc(degrees, chi_square)) if degrees else 1.0


def soft_chi_square(z: Array, Jt: Array, S: Array) -> Array:
    """The squared length, (b,), of corrections z, (b, 6 n), if equations may be off by covariance S, (3 c, 3 c), [m^2].

    Near z equations are linear in the little that play leaves, so the shortest sum of what is left of z and of what
    equations are off by is r^t (J J^t + S)^-1 r, with r = J z what the observation was off by.
    """
    # r is what the observation was off by, Gaussian with covariance J J^t of noise and S of play.
    J = np.swapaxes(Jt, 1, 2)
    A = J @ Jt + S
    r = J @ z[..., None]
    diagonal = A.reshape(len(A), -1)[:, :: A.shape[1] + 1]
    diagonal += ROUNDING * diagonal.max(axis=1, initial=SMALLEST)[:, None]
    return np.asarray((r * np.linalg.solve(A, r)).sum(axis=(1, 2)))
