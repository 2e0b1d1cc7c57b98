"""Isotropic noise: Gaussian, Gaussian with a factor per part, or with heavy tails."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation, Tails
from apo_bench.perception.observation.models.displacement import observe_displaced
from apo_bench.perception.observation.models.facts import Facts, NoiseLevel

LEAST_FACTOR = 0.3
"""Smallest factor of a part on the level."""
MOST_FACTOR = 4.0
"""Largest factor of a part on the level."""
FREEDOM = 5.0
"""Degrees of freedom: excess kurtosis 6; public pose estimates on T-LESS have 5.6 along the ray."""
_FARTHEST = 1e6
"""Stated limit of an error, [m] and [rad]; so large that there is none."""


@final
@dataclass(frozen=True)
class IsotropicNoise:
    """Every pose is observed at `T exp(xi)`, xi a Gaussian body twist of zero mean.

    The level only scales unit draws, so equal seeds give proportional errors at all levels. At level 0 the observed
    poses are the demonstrated ones, bit for bit.
    """

    noise_level: NoiseLevel

    FACTS: ClassVar[Facts] = Facts(
        title="the same in every direction",
        formula=("T_obs = T exp(L e)",),
        frame="of the observed part",
        parameters=(),
        states="L^2 in every direction, exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.noise_level.sigma()
        xi = rng.standard_normal((len(assembly), 6)) * sigma
        return observe_displaced(assembly, demonstration, xi, np.diag(sigma**2))


@final
@dataclass(frozen=True)
class PerPartNoise:
    """Isotropic noise with one log-uniform factor per part, the same in every operation that moves the part.

    The factors are drawn after the unit draws of the twists. So a part has the same factor at all levels, and its
    errors are those of `isotropic` times the factor.
    """

    noise_level: NoiseLevel

    FACTS: ClassVar[Facts] = Facts(
        title="some parts have much larger errors than others",
        formula=("T_obs = T exp(L f_part e)",),
        frame="of the observed part, isotropic",
        parameters=(
            f"f = {LEAST_FACTOR:g} to {MOST_FACTOR:g}, log-uniform: factor of a part, drawn per trial, for all its "
            "operations",
        ),
        states="(L f)^2 in every direction, with the factor that was drawn: exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        unit = rng.standard_normal((len(assembly), 6))
        factor = draw_part_factors(assembly.solids, rng)
        each = np.array([factor[operation.main] for operation in assembly.operations])
        sigma = self.noise_level.sigma() * each.reshape(-1, 1)
        covariance = sigma[:, :, None] * np.eye(6) * sigma[:, None, :]
        return observe_displaced(assembly, demonstration, unit * sigma, covariance)


@final
@dataclass(frozen=True)
class HeavyTailedNoise:
    """Isotropic noise from a multivariate Student t distribution: position and rotation have a common scale.

    It is scaled so that the level is the true standard deviation, which is finite above two degrees of freedom.
    """

    noise_level: NoiseLevel
    freedom: float = FREEDOM
    """Degrees of freedom, above 2, so that the covariance is finite."""

    FACTS: ClassVar[Facts] = Facts(
        title="Student t with one scale per operation: a few errors are very large",
        formula=("T_obs = T exp(L e sqrt((nu - 2) / c))", "c ~ chi-square(nu), one per operation"),
        frame="of the observed part, isotropic",
        parameters=(f"nu = {FREEDOM:g}: degrees of freedom, above 2",),
        states="L^2 in every direction, the true covariance, and the tails",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.noise_level.sigma()
        unit = rng.standard_normal((len(assembly), 6))
        scale = np.sqrt((self.freedom - 2.0) / rng.chisquare(self.freedom, (len(assembly), 1)))
        seen = observe_displaced(assembly, demonstration, unit * scale * sigma, np.diag(sigma**2))
        return replace(seen, tails=self._tails(len(assembly))) if min(self.noise_level) > 0.0 else seen

    def _tails(self, n: int) -> Tails:
        """The stated tails of n operations."""
        # A Student t of scale s has the variance s^2 nu / (nu - 2). Indices: position across and along, then rotation.
        each = self.noise_level.sigma()[[0, 0, 3, 3]]
        return Tails(
            frames=np.tile(np.eye(3), (n, 1, 1)),
            scales=each * np.sqrt((self.freedom - 2.0) / self.freedom),
            freedom=np.full(4, self.freedom),
            variances=each**2,
            limits=np.full(2, _FARTHEST),
            joined=True,
        )


def draw_part_factors(parts: Iterable[str], rng: np.random.Generator) -> Mapping[str, float]:
    """Draw the factor of every part, one random number each, in alphabetical order of the parts."""
    names = sorted(parts)
    return dict(
        zip(names, np.exp(rng.uniform(np.log(LEAST_FACTOR), np.log(MOST_FACTOR), len(names))).tolist(), strict=True)
    )
