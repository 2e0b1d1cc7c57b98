"""Observe a demonstration again on request: a limited number of new draws of the same noise."""

from collections.abc import Collection
from copy import deepcopy
from dataclasses import replace
from functools import partial
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.errors import require
from apo_bench.perception.observation.noise import Noise
from apo_bench.perception.observation.observe import observe
from apo_bench.records import check


@final
class Reobservations:
    """The `apo_bench.assembly.Reobserver` of a trial; a corrector gets only its observations, not the demonstration.

    Each reobservation draws all operations, so the pose of one does not depend on which others were requested.
    """

    def __init__(
        self,
        demonstration: Demonstration,
        noise: Noise,
        rng: np.random.Generator,
        allowed: int,
        assembly: Assembly | None = None,
        first: np.random.Generator | None = None,
    ) -> None:
        """Args:
            noise: As in `observe`.
            rng: A separate generator, not the one of the first observation.
            allowed: Number of reobservations.
            assembly: The assembly in the observations, where its contacts are wrong on purpose. Default: the right one.
            first: A generator in the state in which the first observation used it. A noise model with a method
                `reobserve` (assembly, demonstration, rng, first) can repeat failures of the first observation.

        Raises:
            InputError: `allowed` is out of range.
        """
        check("max_reobservations", allowed)
        self.left = allowed
        self.reobservations = 0
        """Number of reobserved operations so far; an operation counts each time it is reobserved."""
        self._demonstration = demonstration
        self._noise = noise
        self._rng = rng
        self._first = first
        self._assembly = assembly or demonstration.assembly

    def __call__(self, operations: Collection[int]) -> Observation:
        n = len(self._assembly)
        chosen = {*operations}
        require(
            self.left >= 1,
            "no reobservation is left; check `reobserve.left` before, or give a larger max_reobservations.",
        )
        require(
            chosen and all(isinstance(k, int | np.integer) and 0 <= k < n for k in chosen),
            f"operations {[*chosen]} cannot be reobserved; give one or more whole numbers from 0 to {n - 1}.",
        )
        again = getattr(self._noise, "reobserve", None)
        noise = self._noise if again is None or self._first is None else partial(again, first=deepcopy(self._first))
        look = observe(self._demonstration, noise, self._rng)
        self.left -= 1
        self.reobservations += len(chosen)
        return replace(look, assembly=self._assembly, observed=look.observed & np.isin(np.arange(n), [*chosen]))
