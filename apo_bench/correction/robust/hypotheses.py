"""Which observations are outliers is part of the estimate: hypotheses of that, and how likely what was seen makes them.

Each operation is an inlier, seen with the stated noise; broad, seen with some times that; or gross, so that what was
seen says nothing. Given the states, what contacts leave at the observation is Gaussian, with covariance J C J^t and
what play and curvature add, so states are compared by the likelihood of that; what no contact tells does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

import numpy as np

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.equations import equations
from apo_bench.assembly.goals import Observation
from apo_bench.assembly.opposing import looking_away
from apo_bench.correction.consistency import SOFT_M, fit_deviation
from apo_bench.correction.contact import ContactCorrector, contact_apply
from apo_bench.correction.robust.inferred import inferred_goals
from apo_bench.correction.solvers.compact import CompactEquations, compact_equations
from apo_bench.correction.solvers.whitened import scales
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.twist import right_jacobian

INLIER, BROAD, GROSS = 0, 1, 2
_as_begun = ContactCorrector("apply", elsewhere=False)
"""Goals of gross operations come from contacts already."""
States = tuple[int, ...]
"""One of these for each operation."""
UNKNOWN = np.diag(np.repeat([0.05, 0.5], 3) ** 2)
"""(6, 6): how far the goal of a gross operation may be from what its contacts say of it, [m, rad]."""
UNKNOWN.flags.writeable = False


@final
@dataclass(frozen=True)
class OutlierModel:
    """How often observations are worse than their covariance says."""

    gross: float = 0.1
    """Part of the operations of which what was seen says nothing."""
    broad: float = 0.03
    """Part that is seen with `times` the stated deviation."""
    times: float = 10.0

    def __post_init__(self) -> None:
        rates = (self.gross, self.broad, 1.0 - self.gross - self.broad)
        if not all(0.0 < rate < 1.0 for rate in rates):
            raise InputError(
                f"rates of {self.gross!r} gross and {self.broad!r} broad were given; both must be above 0, together "
                "below 1."
            )
        if not 1.0 < self.times < np.inf:
            raise InputError(f"times={self.times!r} was given; a broad observation needs a finite number above 1.")

    def surprise(self, states: States) -> float:
        """-2 log of the probability of states, beside that of inliers alone."""
        rates = (1.0 - self.gross - self.broad, self.broad, self.gross)
        return -2.0 * float(sum(np.log(rates[state] / rates[INLIER]) for state in states))


@final
@dataclass(frozen=True, eq=False)
class Hypothesis:
    """States, and what comes of them."""

    states: States
    observation: Observation
    """What was seen, gross operations as contacts say, with covariances that the states widen."""
    correction: Correction
    model: OutlierModel

    @cached_property
    def badness(self) -> float:
        """-2 log of how likely states and observation are together, but for a constant; infinite if no solution."""
        test = self.correction.test
        if not self.correction.ok or test is None or not faces_oppose(self.observation, self.correction.goals):
            return np.inf
        L = scales(self.observation.covariance)
        xi = pose.log(pose.inverse(self.observation.goals) @ self.correction.goals)
        system = seen_system(self.observation)
        _, blocks = system.blocks(self.correction.goals, right_jacobian(xi) @ L)
        Jt = system.gathered(blocks)
        soft = np.hypot(fit_deviation(self.observation.assembly, self.observation.play_m), SOFT_M)
        S = Jt.T @ Jt + np.diag(soft * soft)
        return float(test.chi_square + np.linalg.slogdet(S)[1] + self.model.surprise(self.states))

    def at(self, goals: Array, gross: Sequence[int]) -> Hypothesis:
        """The same with gross operations inferred to lead elsewhere, to these of goals (n, 4, 4)."""
        there = np.array(self.observation.goals)
        there[list(gross)] = goals[list(gross)]
        moved = replace(self.observation, goals=there)
        return replace(self, observation=moved, correction=contact_apply(moved))

    @property
    def p_value(self) -> float:
        """Of the test of its correction; 0 if there is no solution."""
        return self.correction.test.p_value if self.correction.test and np.isfinite(self.badness) else 0.0


def hypothesis(observation: Observation, states: States, model: OutlierModel) -> Hypothesis:
    """Solve for the goals that are most likely with these states."""
    gross = [k for k, state in enumerate(states) if state == GROSS]
    goals = inferred_goals(observation, gross).goals if gross else observation.goals
    covariance = np.array(observation.covariance)
    for k, state in enumerate(states):
        if state == BROAD:
            covariance[k] *= model.times**2
        if state == GROSS:
            covariance[k] = UNKNOWN
    widened = replace(observation, goals=goals, covariance=covariance, seen=np.ones(len(states), dtype=np.bool_))
    return Hypothesis(states, widened, (_as_begun if any(states) else contact_apply)(widened), model)


def faces_oppose(observation: Observation, goals: Array) -> bool:
    """Whether the faces of every contact look at each other at the goals, (n, 4, 4)."""
    return not looking_away(observation.assembly, observation.start, goals).any()


def seen_system(observation: Observation) -> CompactEquations:
    """The equations of every contact, each vertex where it was seen."""
    return compact_equations(
        equations(observation.assembly, observation.start, observation.goals), len(observation.goals)
    )
