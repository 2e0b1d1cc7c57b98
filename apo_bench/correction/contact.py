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
from apo_bench.correction.posterior import freedom, jacobian_rank, marginals
from apo_bench.correction.problem import Problem, Solved, Solver, problem
from apo_bench.correction.solvers import compiled
from apo_bench.correction.solvers.manifold import NearestGoals, nearest_goals
from apo_bench.correction.starts import best_start, turned_words
from apo_bench.correction.whole import correct_compiled, layout
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
    solver: Solver | None = None
    """What finds the nearest goals; None stands for `compiled.nearest_goals_compiled` where Numba is installed and can
    keep what it compiles, else for `manifold.nearest_goals`. They give the same goals but for rounding."""

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
        observation = lowered_observation(observation)
        made = self.together((observation,))
        return self.given(observation, None) if made is None else made[0]

    def together(self, observations: Sequence[Observation]) -> list[Correction] | None:
        """Correct observations of one assembly with the same start poses and play, compiled; None where that cannot be.

        Raises:
            InputError: As of one.
        """
        observations = [lowered_observation(one) for one in observations]
        loops = compiled.kept_loops() if self.solver is None else None
        known = None if loops is None else layout(observations[0].assembly, observations[0].play_m)
        if loops is None or known is None or any(one.shared or one.tails for one in observations):
            return None
        seen = [one for one in observations if one.seen.all()]
        made = iter(correct_compiled(loops, known, seen, self.doubt == "apply", self.level, self.given))
        return [next(made) if one.seen.all() else refused_correction(one) for one in observations]

    def given(self, observation: Observation, found: NearestGoals | None) -> Correction:
        """Correct an observation; `found` are its nearest goals without inequalities, if they are known already."""
        observation = lowered_observation(observation)
        if not observation.seen.all():
            return refused_correction(observation)
        asked = problem(observation, self.chosen_solver())
        every, before_m = asked.without(()), largest(asked.gaps(observation.goals))
        first = asked.solve(every, found)
        if self.elsewhere:
            asked, first = best_start(asked, first)
        solved = first
        test = replace(first.test, level=self.level)
        lost = not first.found.at_rest and largest(first.gaps) <= observation.gap_m
        if not test.passes and self.doubt != "apply" and first.found.finite and not lost:
            test = replace(test, suspects=asked.suspects(every))
        kept, dropped, after = every, tuple[str, ...](), test
        while self.doubt == "drop" and not after.passes and solved.found.finite and len(dropped) < DROPS:
            worst = asked.suspects(kept) if dropped else test.suspects
            if not worst:
                break
            dropped += (self._most_suspect(asked, kept, worst[0]),)
            kept = asked.without(dropped)
            solved = asked.solve(kept)
            after = replace(solved.test, level=self.level)
        return opposing(observation, self._report(asked, solved, kept, test, after, dropped, before_m))

    def leaving_out(self, observation: Observation, dropped: tuple[str, ...]) -> Correction:
        """Correct an observation by all contacts but those of some relations."""
        observation = lowered_observation(observation)
        asked = problem(observation, self.chosen_solver())
        kept = asked.without(dropped)
        solved = asked.solve(kept)
        test, before_m = replace(solved.test, level=self.level), largest(asked.gaps(observation.goals))
        return opposing(observation, self._report(asked, solved, kept, test, test, dropped, before_m))

    def chosen_solver(self) -> Solver:
        """What finds the nearest goals here."""
        if self.solver is not None:
            return self.solver
        return nearest_goals if compiled.kept_loops() is None else compiled.nearest_goals_compiled

    def _most_suspect(self, asked: Problem, kept: NDArray[np.bool_], worst: Suspect) -> str:
        """One contact of the most suspect relation if that is enough, since the others are worth keeping; else all."""
        single = asked.contact_suspects(kept, worst.relation)[0]
        return single.relation if single.p_value >= self.level else worst.relation

    def _report(
        self,
        asked: Problem,
        solved: Solved,
        kept: NDArray[np.bool_],
        test: Consistency,
        after: Consistency,
        dropped: tuple[str, ...],
        before_m: float,
    ) -> Correction:
        observation, found = asked.observation, solved.found
        known = freedom(found.Jt)
        directions = jacobian_rank(found.Jt) if known is None else known.rank
        status = _status(found, largest(solved.gaps[kept]), observation.gap_m)
        if status == "converged" and self.doubt in ("refuse", "drop") and not after.passes:
            status = "doubtful"
        of = "every contact" if kept.all() else f"every contact but those of {', '.join(dropped)}"
        doubts = "" if self.doubt == "apply" else _doubts(test, dropped)
        return Correction(
            goals=found.goals,
            status=status,
            sentence=status_sentence(status, observation.gap_m, of) + turned_words(asked, found.goals) + doubts,
            freed=pattern(observation.assembly).freed,
            gap_before_m=before_m,
            gap_after_m=largest(solved.gaps),
            rank=directions,
            trace=tuple(Iterate(turn.gap_m, directions, turn.step) for turn in found.trace),
            test=test,
            test_after=after if dropped else None,
            covariance=marginals(found, known.free) if known is not None and status == "converged" else None,
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
