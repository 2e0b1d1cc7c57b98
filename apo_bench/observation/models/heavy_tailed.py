"""Noise with heavy tails: most errors are smaller than a Gaussian's, and a few are much larger."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.errors import InputError
from apo_bench.observation.models.isotropic import observe_displaced
from apo_bench.observation.models.level import Facts, Level

FREEDOM = 5.0
"""Degrees of freedom: an excess kurtosis of 6, where public pose estimates on T-LESS have 5.6 along the ray."""


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
        states="L^2 in every direction, the true covariance; a test that takes it for a Gaussian's fails too often",
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
        return observe_displaced(assembly, demonstration, unit * scale * sigma, np.diag(sigma**2))
