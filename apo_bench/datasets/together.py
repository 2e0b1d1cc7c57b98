"""Many demonstrations, seen by one call of a noise model: as one long demonstration whose parts are all different."""

from functools import lru_cache
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Demonstration, Observation, Operation
from apo_bench.geometry import Array
from apo_bench.observation.models.anisotropic import Anisotropic, Sighted
from apo_bench.observation.models.empirical import Empirical
from apo_bench.observation.models.failures import AlongRay, Flipped, Stale
from apo_bench.observation.models.fitted import Fitted
from apo_bench.observation.models.isotropic import HeavyTailed, Isotropic, PerPart
from apo_bench.observation.models.outliers import Outliers
from apo_bench.observation.models.shared import Bias
from apo_bench.observation.models.symmetric import AnyTurn, Symmetric
from apo_bench.observation.noise import Noise
from apo_bench.observation.observing import observe
from apo_bench.scenario.layouts import Layouts

_BY_PART = frozenset(
    (
        *(Isotropic, Anisotropic, PerPart, Sighted, HeavyTailed, Outliers, Bias, Symmetric, AnyTurn),
        *(Flipped, Stale, AlongRay, Empirical, Fitted),
    )
)
"""Models whose errors of operations on different parts are independent, whatever else is seen."""


@final
class Seen(NamedTuple):
    """What was seen of many demonstrations."""

    goals: Array
    """(n, k, 4, 4)."""
    covariance: Array
    """(n, k, 6, 6)."""
    seen: NDArray[np.bool_]
    """(n, k)."""


def by_part(noise: Noise) -> bool:
    """Whether a noise model draws many demonstrations at once; others draw one after the other."""
    shares_view = isinstance(noise, Fitted) and noise.measured.view is not None
    return type(noise) in _BY_PART and not shares_view


def observe_many(assembly: Assembly, shown: Layouts, careless: Array, noise: Noise, rng: np.random.Generator) -> Seen:
    """What a noise model makes of many demonstrations of one assembly.

    Args:
        shown: Where every part was put.
        careless: (k, 6, 6), as in a `Demonstration`.
    """
    n, k = shown.goals.shape[:2]
    if by_part(noise):
        start = {_copy(part, i): T for part, poses in shown.start.items() for i, T in enumerate(poses)}
        long = Demonstration(
            _repeated(assembly, n), start, shown.goals.reshape(-1, 4, 4), {}, np.tile(careless, (n, 1, 1))
        )
        return _stacked([noise(long.assembly, long, rng)], n, k)
    each = []
    for i, goals in enumerate(shown.goals):
        one = Demonstration(assembly, {part: poses[i] for part, poses in shown.start.items()}, goals, {}, careless)
        each.append(observe(one, noise, rng))
    return _stacked(each, n, k)


def _stacked(observations: list[Observation], n: int, k: int) -> Seen:
    return Seen(
        np.concatenate([seen.goals for seen in observations]).reshape(n, k, 4, 4),
        np.concatenate([seen.covariance for seen in observations]).reshape(n, k, 6, 6),
        np.concatenate([seen.seen for seen in observations]).reshape(n, k),
    )


def _copy(part: str, i: int) -> str:
    return f"{part}/{i}"


@lru_cache(maxsize=32)
def _repeated(assembly: Assembly, n: int) -> Assembly:
    """The same operations n times, each time with parts of their own, and without contacts, which no camera sees."""
    return Assembly(
        {_copy(part, i): solid for part, solid in assembly.solids.items() for i in range(n)},
        tuple(
            Operation(_copy(each.main, i), carries=tuple(_copy(part, i) for part in each.carries))
            for i in range(n)
            for each in assembly.operations
        ),
        frozenset(_copy(part, i) for part in assembly.fixed for i in range(n)),
    )
