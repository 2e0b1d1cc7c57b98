"""Noise of a camera that sees some parts much better than others: small, shiny or half hidden ones are worse."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.observation.models.isotropic import observe_displaced
from apo_bench.observation.models.level import Facts, Level

LEAST = 0.3
MOST = 4.0
"""Range of the factor of a part on the level."""


@final
@dataclass(frozen=True)
class PerPart:
    """Isotropic noise with one factor per part on the level, in every operation that moves the part.

    Factors are log-uniform, and drawn after the unit draws of the twists: at all levels a part has the same factor,
    and its errors are those of `isotropic` times that.
    """

    level: Level

    FACTS: ClassVar[Facts] = Facts(
        title="some parts are seen much worse than others",
        formula=("T_seen = T exp(L f_part e)",),
        frame="of the part that is seen, the same in every direction",
        parameters=(
            f"f = {LEAST:g} to {MOST:g}, log-uniform: factor of a part, drawn per trial, for all its operations",
        ),
        states="(L f)^2 in every direction, with the factor that was drawn: exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        unit = rng.standard_normal((len(assembly), 6))
        factor = factors(assembly.solids, rng)
        sigma = self.level.sigma() * np.array([[factor[operation.main]] for operation in assembly.operations]).reshape(
            -1, 1
        )
        return observe_displaced(
            assembly, demonstration, unit * sigma, sigma[:, :, None] * np.eye(6) * sigma[:, None, :]
        )


def factors(parts: Iterable[str], rng: np.random.Generator) -> Mapping[str, float]:
    """The factor of every part; one number of chance for each, in the order of their names."""
    names = sorted(parts)
    return dict(zip(names, np.exp(rng.uniform(np.log(LEAST), np.log(MOST), len(names))).tolist(), strict=True))
