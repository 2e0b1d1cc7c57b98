"""Observe a demonstration again: fresh draws of the same noise, as many as are allowed."""

from collections.abc import Collection
from copy import deepcopy
from dataclasses import replace
from functools import partial
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation
from apo_bench.errors import require
from apo_bench.perception.observation.noise import Noise
from apo_bench.perception.observation.observing import observe
from apo_bench.records import check


@final
class Reobservations:
    """A `apo_bench.assembly.Reobserver`: it knows the demonstration, and hands out nothing but observations.

    Each reobservation draws all operations, so that the pose of one does not depend on which were requested.
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
            rng: Not the one that the first observation was drawn from, which would change that of others.
            allowed: How many reobservations.
            assembly: What the corrector gets, if that is not right.
            first: As the first observation was drawn from, not used yet: noise that has a method `again` (assembly,
                demonstration, rng, first) may repeat what was false in that.

        Raises:
            InputError: The number is not allowed.
        """
        check("max_reobservations", allowed)
        self.left = allowed
        self.reobservations = 0
        """Operations that were observed again, each as often as that was."""
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
        again = getattr(self._noise, "again", None)
        noise = self._noise if again is None or self._first is None else partial(again, first=deepcopy(self._first))
        look = observe(self._demonstration, noise, self._rng)
        self.left -= 1
        self.reobservations += len(chosen)
        return replace(look, assembly=self._assembly, observed=look.observed & np.isin(np.arange(n), [*chosen]))
