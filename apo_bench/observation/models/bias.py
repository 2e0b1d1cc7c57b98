"""Noise that is the same whenever a part is seen: its model has its origin in the wrong place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.observation.models.facts import Facts
from apo_bench.observation.models.isotropic import observe_displaced
from apo_bench.observation.models.level import Level


@final
@dataclass(frozen=True)
class Bias:
    """Every part has one body twist, drawn per trial, by which it is wrong in every operation that moves it.

    Zero on average over seeds, not over the operations of a trial. Corrections that take the errors of a part in two
    operations for independent ones are told too much.
    """

    level: Level

    FACTS: ClassVar[Facts] = Facts(
        title="one constant error per part, the same in every operation that moves it",
        formula=("T_seen_k = T_k exp(L e_part)",),
        frame="of the part: as if the origin of its model were in the wrong place",
        parameters=(),
        states="L^2 in every direction, over seeds; that the errors of one part are equal is not said, since an "
        "observation has no place for it",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = np.repeat([self.level.mm * 1e-3, np.radians(self.level.deg)], 3)
        parts = sorted(assembly.solids)
        unit = dict(zip(parts, rng.standard_normal((len(parts), 6)), strict=True))
        xi = np.array([unit[operation.main] for operation in assembly.operations]).reshape(-1, 6) * sigma
        return observe_displaced(assembly, demonstration, xi, np.diag(sigma**2))
