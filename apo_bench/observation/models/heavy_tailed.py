"""Noise with heavy tails: most errors are smaller than a Gaussian's, and a few are much larger."""

from dataclasses import dataclass, replace
from math import inf
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.tails import Tails
from apo_bench.assembly.topology import Assembly
from apo_bench.errors import InputError
from apo_bench.observation.models.isotropic import observe_displaced
from apo_bench.observation.models.level import Facts, Level

FREEDOM = 5.0
"""Degrees of freedom: an excess kurtosis of 6, where public pose estimates on T-LESS have 5.6 along the ray."""

_FARTHEST = 1e6
"""[m] and [rad]: no limit."""


@final
@dataclass(frozen=True)
class HeavyTailed:
    """Isotropic noise from a multivariate Student t in place of a Gaussian: position and turn are bad together.

    It is scaled so that the level is the true standard deviation, which is finite above two degrees of freedom.
    """

    level: Level
    freedom: float = FREEDOM

    FACTS: ClassVar[Facts] = Facts(
        title="Student t of one scale per operation: few errors are far too large",
        formula=("T_seen = T exp(L e sqrt((nu - 2) / c))", "c ~ chi-square(nu), one per operation"),
        frame="of the part that is seen, the same in every direction",
        parameters=(f"nu = {FREEDOM:g}: degrees of freedom, above 2",),
        states="L^2 in every direction, the true covariance, and the tails",
    )

    def __post_init__(self) -> None:
        if not 2.0 < self.freedom < inf:
            raise InputError(
                f"a Student t with {self.freedom:g} degrees of freedom was given; give a finite number above 2, below "
                "which it has no covariance."
            )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        unit = rng.standard_normal((len(assembly), 6))
        scale = np.sqrt((self.freedom - 2.0) / rng.chisquare(self.freedom, (len(assembly), 1)))
        made = observe_displaced(assembly, demonstration, unit * scale * sigma, np.diag(sigma**2))
        return replace(made, tails=self._tails(len(assembly))) if min(self.level) > 0.0 else made

    def _tails(self, n: int) -> Tails:
        each = self.level.sigma()[[0, 0, 3, 3]]
        return Tails(
            frames=np.tile(np.eye(3), (n, 1, 1)),
            scales=each * np.sqrt((self.freedom - 2.0) / self.freedom),
            freedom=np.full(4, self.freedom),
            variances=each**2,
            limits=np.full(2, _FARTHEST),
            joined=True,
        )
