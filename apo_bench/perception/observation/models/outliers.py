"""Isotropic noise with unmarked gross outliers and missed operations."""

from dataclasses import dataclass, replace
from typing import ClassVar, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Demonstration, Observation, Poses, make_measured_model
from apo_bench.geometry import Array, copy_frozen
from apo_bench.perception.observation.models.displacement import observe_displaced
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel

OUTLIERS = 0.1
"""Fraction of operations that are outliers."""
MISSES = 0.02
"""Fraction of operations that are not observed."""
OUTLIER_TIMES = 10.0
"""Factor on the error of an outlier."""
UNOBSERVED_DEVIATION = copy_frozen(np.repeat([0.5, np.pi / 2.0], 3), 6)
"""(6,), standard deviation that is stated for a missed operation, [m, rad]."""


@final
@dataclass(frozen=True)
class OutlierNoise:
    """Isotropic noise in which some errors are many times larger, unmarked, and some operations are missed.

    The stated covariance is that of inliers. The same operations are outliers and missed at every level, except at
    level 0, where all are observed exactly.
    """

    noise_level: NoiseLevel
    outliers: float = OUTLIERS
    """Probability of an outlier."""
    misses: float = MISSES
    """Probability of a miss."""
    times: float = OUTLIER_TIMES
    """Factor on the error of an outlier."""

    FACTS: ClassVar[Facts] = Facts(
        title="gross outliers that are not marked, and missed operations",
        formula=("T_obs = T exp(L e), or, of an outlier, T exp(m L e)", "of a miss: observed = false"),
        frame="of the observed part, isotropic",
        parameters=(
            f"p = {OUTLIERS:g}: share of outliers among the observed operations",
            f"q = {MISSES:g}: share of misses",
            f"m = {OUTLIER_TIMES:g}: an outlier errs m times as much",
        ),
        states=(
            f"L^2, the covariance of inliers; that of all errors is 1 + p (m^2 - 1) = "
            f"{1.0 + OUTLIERS * (OUTLIER_TIMES**2 - 1.0):g} times as large"
        ),
        notes=(
            f"A missed operation has the last observed pose of its part, or its start, with "
            f"{UNOBSERVED_DEVIATION[0]:g} m and {np.degrees(UNOBSERVED_DEVIATION[3]):g} deg: most methods reject it",
            "At level 0 nothing is missed",
        ),
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.noise_level.sigma()
        unit = rng.standard_normal((len(assembly), 6))
        chance = rng.random((len(assembly), 2))
        times = np.where(chance[:, :1] < self.outliers, self.times, 1.0)
        seen = observe_displaced(assembly, demonstration, unit * times * sigma, np.diag(sigma**2))
        missed = (chance[:, 1] < self.misses) & (max(self.noise_level) > 0.0)
        poses = seen.poses.copy()
        covariance = seen.covariance.copy()
        poses[missed] = find_last_observed_poses(assembly, demonstration.start, poses, ~missed)[missed]
        covariance[missed] = np.diag(UNOBSERVED_DEVIATION**2)
        stated = make_measured_model(0.0, self.outliers, self.times) if self.times > 1.0 else None
        return replace(seen, poses=poses, covariance=covariance, observed=~missed, outliers=stated)


def find_last_observed_poses(assembly: Assembly, start: Poses, poses: Array, seen: NDArray[np.bool_]) -> Array:
    """The last observed pose of the main part of each operation, or its start pose, (n, 4, 4).

    Args:
        poses: (n, 4, 4), observed poses.
        seen: (n,), True for an operation that was observed.
    """
    now = dict(start)
    out = poses.copy()
    for k, operation in enumerate(assembly.operations):
        if seen[k]:
            now[operation.main] = poses[k]
        out[k] = now.get(operation.main, np.eye(4))
    return out
