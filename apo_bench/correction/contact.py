"""The corrector `contact`: the most likely consistent goals, tested against the stated noise.

Every motion parameter is free; what the contacts do not ask for is not changed, since any change costs likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.correction_record import Consistency, Correction, Iterate, Suspect
from apo_bench.assembly.equations import largest, pattern
from apo_bench.assembly.goals import Observation
from apo_bench.assembly.lowering import lowered_observation
from apo_bench.correction.consistency import TEST_LEVEL
from apo_bench.correction.ending import opposing, refused_correction, status_sentence
from apo_bench.correction.problem import Problem, Solved, problem
from apo_bench.correction.solvers.gauss_newton import LARGEST_DENSE, NearestGoals
from apo_bench.correction.starts import best_start, turned_far, turned_words
from apo_bench.errors import InputError

Doubt = Literal["apply", "warn", "refuse", "drop"]
DROPS = 3
"""Relations that `drop` leaves out at most."""


@final
@dataclass(frozen=True)
class ContactCorrector:
    """Nearest consistent goals; what to do if the test of the correction fails is said beforehand."""

    doubt: Doubt = "warn"
    """`apply` says nothing, `warn` names the suspects and goes on, `refuse` does not go on (status `doubtful`), and
    `drop` leaves the most suspect relation out, or one contact of it if that is enough, up to three in turn, until the
    test passes."""
    level: float = TEST_LEVEL
    """The test fails if the p-value is below: the share of false alarms."""
    elsewhere: bool = True
    """Whether other starts are tried where what was seen leads to no solution, or far."""
    compiled: bool = True
    """Whether kernels are used where Numba is installed and can keep what it compiles: the same goals but for
    rounding."""

    def __post_init__(self) -> None:
        if self.doubt not in ("apply", "warn", "refuse", "drop"):
            raise InputError(f"doubt={self.doubt!r} was given; apply, warn, refuse or drop is allowed.")
        if not isinstance(self.level, float | int) or not 0.0 < self.level < 1.0:
            raise InputError(f"a test level of {self.level!r} was given; a number between 0 and 1 is allowed.")

    def __call__(self, observation: Observation) -> Correction:
        """Correct an observation.

        Returns:
            `converged`, `not_seen`, `inconsistent` (the contacts contradict each other), `doubtful` (of `refuse` and
            `drop`: the test fails), `not_converged` or `not_finite`; only the first is meant to be executed. `freed`
            are all operations that a contact depends on; `covariance` is the posterior.

        Raises:
            InputError: A covariance is not positive definite.
        """
        return self.together((observation,))[0]

    def together(self, observations: Sequence[Observation]) -> list[Correction]:
        """Correct observations of one assembly with the same start poses and play, at once.

        Raises:
            InputError: As of one.
        """
        observations = [lowered_observation(one) for one in observations]
        seen = [one for one in observations if one.seen.all()]
        alone = any(6 * len(one.goals) > LARGEST_DENSE or one.shared or one.tails for one in seen)
        batches = [[one] for one in seen] if alone else [seen] if seen else []
        made = iter([one for batch in batches for one in self._corrected(batch)])
        return [next(made) if one.seen.all() else refused_correction(one) for one in observations]

    def leaving_out(self, observation: Observation, dropped: tuple[str, ...]) -> Correction:
        """Correct an observation by all contacts but those of some relations."""
        asked = problem((lowered_observation(observation),), self.level, self.compiled)
        kept = asked.without(dropped)
        solved = asked.solve(kept)[0]
        before_m = largest(asked.measured(None)[0])
        return opposing(
            asked.observation, self._report(asked.observation, solved, kept, solved.test, None, dropped, before_m)
        )

    def _corrected(self, observations: Sequence[Observation]) -> list[Correction]:
        """Correct a batch, lowered, every operation seen: all at once, then by itself what is in doubt."""
        asked = problem(observations, self.level, self.compiled)
        every = np.ones(len(asked.exact), dtype=np.bool_)
        before_m = np.abs(asked.measured(None)[0]).max(axis=1, initial=0.0).tolist()
        solved = asked.solve(every)
        far = turned_far(asked.goals, np.array([one.found.goals for one in solved])).tolist()
        made = []
        for i, one in enumerate(solved):
            sure = (one.test.passes or self.doubt == "apply") and not far[i] and not one.away.any()
            if sure and _status(one.found, largest(one.gaps), observations[i].gap_m) == "converged":
                made.append(self._report(observations[i], one, every, one.test, None, (), before_m[i]))
            else:
                made.append(self._in_doubt(asked.only(i), one, every, before_m[i]))
        return made

    def _in_doubt(self, asked: Problem, first: Solved, every: NDArray[np.bool_], before_m: float) -> Correction:
        """Correct an observation whose first solution is none, or far, or fails the test: other starts, suspects."""
        if self.elsewhere:
            asked, first = best_start(asked, first)
        solved = first
        test = first.test
        gap_m = asked.observation.gap_m
        lost = not first.found.at_rest and largest(first.gaps) <= gap_m
        if not test.passes and self.doubt != "apply" and first.found.finite and not lost:
            test = replace(test, suspects=asked.suspects(every))
        kept = every
        dropped = tuple[str, ...]()
        after = test
        while self.doubt == "drop" and not after.passes and solved.found.finite and len(dropped) < DROPS:
            worst = asked.suspects(kept) if dropped else test.suspects
            if not worst:
                break
            dropped += (self._most_suspect(asked, kept, worst[0]),)
            kept = asked.without(dropped)
            solved = asked.solve(kept)[0]
            after = solved.test
        turned = turned_words(asked, solved.found.goals)
        last = after if dropped else None
        report = self._report(asked.observation, solved, kept, test, last, dropped, before_m, turned)
        return opposing(asked.observation, report)

    def _most_suspect(self, asked: Problem, kept: NDArray[np.bool_], worst: Suspect) -> str:
        """One contact of the most suspect relation if that is enough, since the others are worth keeping; else all."""
        single = asked.contact_suspects(kept, worst.relation)[0]
        return single.relation if single.p_value >= self.level else worst.relation

    def _report(
        self,
        observation: Observation,
        solved: Solved,
        kept: NDArray[np.bool_],
        test: Consistency,
        after: Consistency | None,
        dropped: tuple[str, ...],
        before_m: float,
        turned: str = "",
    ) -> Correction:
        found = solved.found
        rank = solved.rank
        status = _status(found, largest(solved.gaps[kept]), observation.gap_m)
        if status == "converged" and self.doubt in ("refuse", "drop") and not (after or test).passes:
            status = "doubtful"
        of = f"every contact but those of {', '.join(dropped)}" if dropped else "every contact"
        doubts = "" if self.doubt == "apply" else _doubts(test, dropped)
        return Correction(
            goals=found.goals,
            status=status,
            sentence=status_sentence(status, observation.gap_m, of) + turned + doubts,
            freed=pattern(observation.assembly).freed,
            gap_before_m=before_m,
            gap_after_m=largest(solved.gaps),
            rank=rank,
            trace=tuple([Iterate(gap_m, rank, step) for gap_m, step in found.turns.tolist() if step == step]),
            test=test,
            test_after=after,
            covariance=solved.covariance if status == "converged" else None,
            dropped=dropped,
        )


contact = ContactCorrector()
contact_apply = ContactCorrector("apply")
contact_refuse = ContactCorrector("refuse")
contact_drop = ContactCorrector("drop")
contact_fast = contact


def _status(found: NearestGoals, left_m: float, gap_m: float) -> str:
    if not found.finite:
        return "not_finite"
    if left_m <= gap_m:
        return "converged" if found.at_rest else "not_converged"
    return "inconsistent"


def _doubts(tested: Consistency, dropped: tuple[str, ...]) -> str:
    """What the test says, if it has something to say."""
    if tested.passes:
        return ""
    named = ", ".join(suspect.relation for suspect in tested.ambiguous) or "none alone"
    said = f"; the correction is longer than the stated noise explains (p = {tested.p_value:.2g}), suspected: {named}"
    return f"{said}; left out: {', '.join(dropped)}" if dropped else said
