"""The corrector `contact-robust`: some observations may be grossly wrong, or missing; contacts tell which.

While the test of `contact` holds, nothing is doubted. If it fails, the smallest sets of operations are looked for
without which the rest agrees: a set is solved only if the contacts that none of it has a part in agree with each other
at what was seen, which is quick to say for every set. Of the sets whose test holds the likeliest is taken, and each of
its operations may turn out to be seen badly in place of not at all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import final

import numpy as np

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.equations import largest_gap, pattern
from apo_bench.assembly.goals import Observation
from apo_bench.correction.consistency import SOFT_M, TEST_LEVEL, fit_deviation, p_value
from apo_bench.correction.ending import refused_correction
from apo_bench.correction.posterior import jacobian_rank
from apo_bench.correction.robust.hypotheses import (
    BROAD,
    GROSS,
    INLIER,
    Hypothesis,
    OutlierModel,
    States,
    faces_oppose,
    hypothesis,
    seen_system,
)
from apo_bench.correction.robust.inferred import inferred_goals
from apo_bench.correction.robust.room import least_crowded
from apo_bench.correction.solvers.whitened import scales
from apo_bench.geometry.arrays import Array

MOST_EXACT = 12
"""Operations up to which every set is looked at; of more, sets grow by one operation at a time."""
_LENIENT = 1e-4
"""A set is not solved if what is left of the contacts agrees worse than by this p-value."""
_LEVER_M = 0.1
"""What is turned by an angle is off by its square times about this, beyond what is linear, [m]."""
_MOST_SOLVED = 24
"""Sets of one size that are solved, those whose rest agrees best."""


@final
@dataclass(frozen=True)
class RobustCorrector:
    """Nearest consistent goals, with observations left out that the others contradict."""

    outliers: OutlierModel = field(default_factory=OutlierModel)
    level: float = TEST_LEVEL
    """A set of observations is believed if the p-value of its correction is not below."""

    def __call__(self, observation: Observation) -> Correction:
        """Correct an observation.

        Returns:
            As `contact`; the sentence names operations whose observation was left out, their goals are inferred from
            contacts. `not_seen` if one was not seen of which no contact says anything. No posterior where an operation
            is no inlier.

        Raises:
            InputError: The covariance of an operation is not positive definite.
        """
        n, missing = len(observation.goals), tuple(map(int, np.flatnonzero(~observation.seen)))
        if inferred_goals(observation, missing).baseless:
            return refused_correction(observation)
        first = hypothesis(observation, _states(n, missing), self.outliers)
        if first.p_value >= self.level:
            return _report(observation, first, with_room(first))
        found = self._smallest(observation, missing)
        if found is None:
            return first.correction if not missing else refused_correction(observation)
        return _report(observation, first, with_room(self._refined(observation, found, missing)))

    def _smallest(self, observation: Observation, missing: tuple[int, ...]) -> Hypothesis | None:
        """The likeliest of the smallest sets whose test holds; if none does, of all that were solved."""
        solved = list[Hypothesis]()
        for sets in self._sets(observation, missing):
            tried = [hypothesis(observation, _states(len(observation.goals), s), self.outliers) for s in sets]
            solved += [one for one in tried if np.isfinite(one.badness)]
            held = [one for one in tried if one.p_value >= self.level]
            if held:
                return min(held, key=lambda one: one.badness)
        return min(solved, key=lambda one: one.badness, default=None)

    def _sets(self, observation: Observation, missing: tuple[int, ...]) -> Iterator[list[tuple[int, ...]]]:
        """Sets of operations to leave out, size by size, those whose rest agrees best first."""
        rest = _Rest(observation, missing)
        seen = [k for k in range(len(observation.goals)) if k not in missing]
        grown: list[tuple[int, ...]] = [()]
        for size in range(1, len(seen)):
            if len(seen) <= MOST_EXACT:
                chosen = [(*missing, *s) for s in combinations(seen, size)]
            else:
                chosen = sorted({(*missing, *sorted({*s, k})) for s in grown for k in seen if k not in s})
            rated = sorted(((rest.agreement(s), s) for s in chosen), reverse=True)
            grown = [s[len(missing) :] for _, s in rated[:3]]
            yield [s for p, s in rated[:_MOST_SOLVED] if p >= _LENIENT]

    def _refined(self, observation: Observation, found: Hypothesis, missing: tuple[int, ...]) -> Hypothesis:
        """One state after the other changed for the better, until none is."""
        while True:
            near = [
                (*found.states[:k], state, *found.states[k + 1 :])
                for k, now in enumerate(found.states)
                if now != INLIER and k not in missing
                for state in (INLIER, BROAD, GROSS)
                if state != now
            ]
            best = min((hypothesis(observation, s, self.outliers) for s in near), key=_badness, default=found)
            if not best.badness < found.badness:
                return found
            found = best


contact_robust = RobustCorrector()


def with_room(found: Hypothesis) -> Hypothesis:
    """A hypothesis whose gross operations lead to where there is room for their parts."""
    gross = tuple(k for k, state in enumerate(found.states) if state == GROSS)
    if not gross or not np.isfinite(found.badness):
        return found

    def solve(goals: Array) -> Array | None:
        made = found.at(goals, gross).correction
        return made.goals if made.ok and faces_oppose(found.observation, made.goals) else None

    better = least_crowded(found.observation, found.correction.goals, gross, solve)
    return found if better is None else found.at(better, gross)


def _badness(one: Hypothesis) -> float:
    return one.badness


def _states(n: int, gross: tuple[int, ...]) -> States:
    return tuple(GROSS if k in gross else INLIER for k in range(n))


class _Rest:
    """How well contacts agree that none of some operations has a part in, linearised once at what was seen."""

    def __init__(self, observation: Observation, missing: tuple[int, ...]) -> None:
        L = scales(observation.covariance)
        goals = inferred_goals(observation, missing).goals
        seen = replace(observation, goals=goals)
        system = seen_system(seen)
        self._e, blocks = system.blocks(goals, L)
        self._Jt: Array = system.gathered(blocks)
        soft = np.hypot(fit_deviation(observation.assembly, observation.play_m), SOFT_M)
        turned = np.sqrt(np.trace(observation.covariance[:, 3:, 3:], axis1=1, axis2=2).max(initial=0.0))
        self._soft = np.hypot(soft, turned * turned * _LEVER_M)
        self._operations = pattern(observation.assembly).letters - len(observation.assembly.solids)

    def agreement(self, left_out: tuple[int, ...]) -> float:
        """The p-value of the test of the other contacts."""
        kept = np.repeat(~np.isin(self._operations, left_out).any(axis=1), 3)
        J, e, soft = self._Jt[:, kept].T, self._e[kept], self._soft[kept]
        if not len(e):
            return 1.0
        square = float(e @ np.linalg.solve(J @ J.T + np.diag(soft * soft), e))
        return p_value(square, jacobian_rank(J.T))


def _report(observation: Observation, first: Hypothesis, found: Hypothesis) -> Correction:
    """The correction of the states that were found, with what was believed at first."""
    made, doubted = found.correction, tuple(k for k, state in enumerate(found.states) if state == GROSS)
    if not any(found.states):
        return made
    before = (
        largest_gap(observation.assembly, observation.start, observation.goals) if observation.seen.all() else np.nan
    )
    broad = tuple(k for k, state in enumerate(found.states) if state == BROAD)
    said = "".join(
        f"; {what} operation {', '.join(str(k + 1) for k in those)}"
        for what, those in (("left out what was seen of", doubted), ("seen badly:", broad))
        if those
    )
    return replace(
        made,
        sentence=made.sentence + said,
        gap_before_m=before,
        test=first.correction.test or made.test,
        test_after=made.test,
        covariance=None,
    )
