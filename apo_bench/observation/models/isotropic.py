"""Noise that is right on SE(3): the same in every direction, in the frame of the part that was seen.

Gaussian, with a factor of its own for each part, or with heavy tails; and how displaced goals become an observation.

What every noise model has: its level, and facts for its card.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import ClassVar, NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation, SharedError, Tails
from apo_bench.errors import require
from apo_bench.geometry import Array, frozen, pose


class Level(NamedTuple):
    """How much noise: standard deviation per axis."""

    mm: float
    deg: float

    def sigma(self) -> Array:
        """The standard deviation of each coordinate of a body twist, (6,), [m, rad]."""
        return np.repeat([self.mm * 1e-3, np.radians(self.deg)], 3)


class Facts(NamedTuple):
    """The attribute `FACTS` of a noise model: what its card prints. Models that bring none have their docstring."""

    title: str
    formula: tuple[str, ...]
    """One line each; L is the level, e are independent standard normal numbers, xi is the body twist."""
    frame: str
    parameters: tuple[str, ...]
    """`name = value unit: meaning`, one each; numbers are read from the constants that the model uses."""
    states: str
    """Which covariance an observation states, and how that compares with the errors."""
    notes: tuple[str, ...] = ()
    measured: bool = False
    """Whether a level multiplies what was measured, instead of being the deviation in mm and degrees."""


COVARIANCE_FLOOR = frozen(np.repeat([0.05e-3, np.radians(0.05)], 3), 6)
"""Smallest standard deviation that is ever stated, [m, rad]: no camera is perfect, and a covariance has an inverse."""
OWN = 1.0 / 20.0
"""What operations that share an error err by themselves, as part of the level."""
OWN_FACT = f"o = {OWN:g}: part of the level by which each operation errs alone"
LEAST_FACTOR = 0.3
MOST_FACTOR = 4.0
"""Range of the factor of a part on the level."""
FREEDOM = 5.0
"""Degrees of freedom: an excess kurtosis of 6, where public pose estimates on T-LESS have 5.6 along the ray."""
_FARTHEST = 1e6
"""[m] and [rad]: no limit."""


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
            f"f = {LEAST_FACTOR:g} to {MOST_FACTOR:g}, log-uniform: factor of a part, drawn per trial, for all its "
            "operations",
        ),
        states="(L f)^2 in every direction, with the factor that was drawn: exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        unit = rng.standard_normal((len(assembly), 6))
        factor = part_factors(assembly.solids, rng)
        each = np.array([factor[operation.main] for operation in assembly.operations])
        sigma = self.level.sigma() * each.reshape(-1, 1)
        covariance = sigma[:, :, None] * np.eye(6) * sigma[:, None, :]
        return observe_displaced(assembly, demonstration, unit * sigma, covariance)


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
        require(
            2.0 < self.freedom < inf,
            f"a Student t with {self.freedom:g} degrees of freedom was given; give a finite number above 2, below "
            "which it has no covariance.",
        )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sigma = self.level.sigma()
        unit = rng.standard_normal((len(assembly), 6))
        scale = np.sqrt((self.freedom - 2.0) / rng.chisquare(self.freedom, (len(assembly), 1)))
        seen = observe_displaced(assembly, demonstration, unit * scale * sigma, np.diag(sigma**2))
        return replace(seen, tails=self._tails(len(assembly))) if min(self.level) > 0.0 else seen

    def _tails(self, n: int) -> Tails:
        # A Student t of scale s has the variance s^2 nu / (nu - 2).
        each = self.level.sigma()[[0, 0, 3, 3]]
        return Tails(
            frames=np.tile(np.eye(3), (n, 1, 1)),
            scales=each * np.sqrt((self.freedom - 2.0) / self.freedom),
            freedom=np.full(4, self.freedom),
            variances=each**2,
            limits=np.full(2, _FARTHEST),
            joined=True,
        )


def part_factors(parts: Iterable[str], rng: np.random.Generator) -> Mapping[str, float]:
    """The factor of every part; one number of chance for each, in the order of their names."""
    names = sorted(parts)
    return dict(
        zip(names, np.exp(rng.uniform(np.log(LEAST_FACTOR), np.log(MOST_FACTOR), len(names))).tolist(), strict=True)
    )


def observe_displaced(assembly: Assembly, demonstration: Demonstration, xi: Array, covariance: Array) -> Observation:
    """Every goal seen at `T exp(xi)`; it states the covariance of xi, what carelessness adds, and at least the floor.

    Args:
        xi: (n, 6), body twists; where one is zero the goal is the one that was shown, bit for bit.
        covariance: (6, 6) or (n, 6, 6), of xi, [m, rad].
    """
    goals = displaced(demonstration.goals, xi)
    stated = floored(covariance + demonstration.careless)
    return Observation(assembly, demonstration.start, goals, stated, np.ones(len(assembly), dtype=np.bool_))


def displaced(goals: Array, xi: Array) -> Array:
    """`T exp(xi)` of goals (n, 4, 4); where a twist is zero the goal as it is, bit for bit."""
    return np.where(np.any(xi, axis=1, keepdims=True)[..., None], goals @ pose.exp(xi), goals)


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
    seen = observe_displaced(assembly, demonstration, xi, np.diag(own**2))
    return with_shared(seen, *shared(seen.goals)) if own.any() else seen


def with_shared(observation: Observation, *shared: SharedError) -> Observation:
    """An observation that states, beside what it states already, errors that operations share."""
    stated = np.array(observation.covariance)
    for error in shared:
        stated[list(error.operations)] += error.added(observation.goals)
    return replace(observation, covariance=stated, shared=(*observation.shared, *shared))


def floored(covariance: Array) -> Array:
    """The least covariance (n, 6, 6) above the given one that says at least `COVARIANCE_FLOOR` in every direction.

    In units of the floor, eigenvalues below 1 are raised to 1, so the result is symmetric and positive definite.
    """
    # C / unit = V diag(w) V^t; directions with w < 1 are surer than the floor, and get w = 1.
    unit = np.outer(COVARIANCE_FLOOR, COVARIANCE_FLOOR)
    w, V = np.linalg.eigh(covariance / unit)
    raised = unit * ((V * np.maximum(w, 1.0)[:, None]) @ np.swapaxes(V, -1, -2))
    return np.where(
        np.all(w >= 1.0, axis=1, keepdims=True)[..., None], covariance, (raised + np.swapaxes(raised, -1, -2)) / 2
    )
