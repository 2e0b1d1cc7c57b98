"""Noise that is right on SE(3): the same in every direction, in the frame of the part that was seen."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.shared_error import SharedError
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.models.level import Facts, Level

COVARIANCE_FLOOR = np.repeat([0.05e-3, np.radians(0.05)], 3)
"""Smallest standard deviation that is ever stated, [m, rad]: no camera is perfect, and a covariance has an inverse."""
COVARIANCE_FLOOR.flags.writeable = False
OWN = 1.0 / 20.0
"""What operations that share an error err by themselves, as part of the level."""
OWN_FACT = f"o = {OWN:g}: part of the level by which each operation errs alone"


@final
@dataclass(frozen=True)
class Isotropic:
    """Every goal is seen at `T exp(xi)`, xi a Gaussian body twist of zero mean.

    Levels only scale the unit draws, so the same generator gives comparable errors at all levels, and level 0 draws
    exactly zero: the goals are then those that were shown, bit for bit.
    """

    level: Level

    FACTS: ClassVar[Facts] = Facts(
        title="the same in every direction",
        formula=("T_seen = T exp(L e)",),
        frame="of the part that is seen",
        parameters=(),
        states="L^2 in every direction, which is exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        xi = rng.standard_normal((len(assembly), 6)) * sigma
        return observe_displaced(assembly, demonstration, xi, np.diag(sigma**2))


def observe_displaced(assembly: Assembly, demonstration: Demonstration, xi: Array, covariance: Array) -> Observation:
    """Every goal seen at `T exp(xi)`; it states the covariance of xi, what carelessness adds, and at least the floor.

    Args:
        xi: (n, 6), body twists; where one is zero the goal is the one that was shown, bit for bit.
        covariance: (6, 6) or (n, 6, 6), of xi, [m, rad].
    """
    goals = np.where(
        np.any(xi, axis=1, keepdims=True)[..., None], demonstration.goals @ pose.exp(xi), demonstration.goals
    )
    stated = floored(covariance + demonstration.careless)
    return Observation(assembly, demonstration.start, goals, stated, np.ones(len(assembly), dtype=np.bool_))


def observe_shared(
    assembly: Assembly,
    demonstration: Demonstration,
    xi: Array,
    own: Array,
    shared: Callable[[Array], Sequence[SharedError]],
) -> Observation:
    """Every goal seen at `T exp(xi)`, by errors of which operations share most.

    Args:
        xi: (n, 6), body twists; where one is zero the goal is the one that was shown, bit for bit.
        own: (6,), standard deviation of what of xi operations do not share, [m, rad]. Without any, operations would be
            told to agree without an error, which no camera does.
        shared: The goals that are seen, (n, 4, 4) -> what operations share.
    """
    made = observe_displaced(assembly, demonstration, xi, np.diag(own**2))
    return with_shared(made, *shared(made.goals)) if own.any() else made


def with_shared(made: Observation, *shared: SharedError) -> Observation:
    """An observation that states, beside what it states already, errors that operations share."""
    stated = np.array(made.covariance)
    for one in shared:
        stated[list(one.operations)] += one.added(made.goals)
    return replace(made, covariance=stated, shared=(*made.shared, *shared))


def floored(covariance: Array) -> Array:
    """The least covariance (n, 6, 6) above the given one that says at least `COVARIANCE_FLOOR` in every direction.

    In units of the floor, eigenvalues below 1 are raised to 1, so the result is symmetric and positive definite.
    """
    unit = np.outer(COVARIANCE_FLOOR, COVARIANCE_FLOOR)
    w, V = np.linalg.eigh(covariance / unit)
    raised = unit * ((V * np.maximum(w, 1.0)[:, None]) @ np.swapaxes(V, -1, -2))
    return np.where(
        np.all(w >= 1.0, axis=1, keepdims=True)[..., None], covariance, (raised + np.swapaxes(raised, -1, -2)) / 2
    )
