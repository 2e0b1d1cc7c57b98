"""The corrector `contact`: the most likely consistent poses, tested against the stated noise.

All motion parameters are free. Directions that no contact fixes stay as observed, since any change costs likelihood.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly import (
    Consistency,
    Correction,
    Iterate,
    Observation,
    Suspect,
    project_observations,
)
from apo_bench.correction.checks.chi_square import TEST_LEVEL
from apo_bench.correction.checks.status import check_facing, refuse_correction, status_sentence
from apo_bench.correction.contact.problem import Problem, problem_of
from apo_bench.correction.contact.solved import Solved, solve
from apo_bench.correction.contact.starts import best_start, describe_turns
from apo_bench.correction.contact.suspects import contact_suspects, suspects
from apo_bench.correction.solvers import LARGEST_DENSE
from apo_bench.errors import require

Doubt = Literal["apply", "warn", "refuse", "drop"]
DROPS = 3
"""Most relations that `drop` leaves out."""


@final
@check_arguments
@dataclass(frozen=True)
class ContactCorrector:
    """The corrector `contact`: the most likely poses that satisfy every contact, tested against the stated noise.

    Call it with an `Observation`; it returns a `Correction`. Source: `docs/how/contact.md`.

    Examples:
        >>> import apo_bench
        >>> strict = apo_bench.ContactCorrector(doubt="refuse", level=0.05)
        >>> table = apo_bench.evaluate(
        ...     {"strict": strict}, scenario="block_on_block", seeds=1, fidelity="near-contact"
        ... )
        >>> table.rows[0]["rate"]
        1.0
    """

    doubt: Doubt = "warn"
    """What to do if the test fails. `apply`: nothing. `warn`: name the suspect relations. `refuse`: end with status
    `doubtful`. `drop`: leave out the most suspect relation, or one contact of it, up to three in turn, until the test
    passes."""
    level: float = TEST_LEVEL
    """The test fails if the p-value is below this; it is the share of false alarms."""
    elsewhere: bool = True
    """Whether to try other starts where the observed poses lead to no solution, or to a distant one."""

    def __post_init__(self) -> None:
        require(
            0.0 < self.level < 1.0,
            f"a test level of {self.level!r} was given; a number between 0 and 1 is allowed.",
        )

    @check_arguments
    def __call__(self, observation: Observation) -> Correction:
        """Correct an observation.

        Returns:
            `converged`, `not_seen`, `inconsistent` (a gap is left, mostly since the contacts contradict each other, or
            faces look the same way), `doubtful` (of `refuse` and `drop`: the test fails), `not_converged` (no gap is
            left, but steps go on: these may not be the nearest poses) or `not_finite`; only the first is meant to be
            executed. `freed` are all operations that a contact depends on; `covariance` is the posterior.

        Raises:
            InputError: A covariance is not positive definite.
        """
        return self.together((observation,))[0]

    def together(self, observations: Sequence[Observation]) -> list[Correction]:
        """Correct observations of one assembly with the same start poses and play, in one batch.

        Raises:
            InputError: As of one.
        """
        # Direct callers pass round faces; observations that `correctors.correct` has projected come back unchanged.
        observations = project_observations(observations)
        results = [None if all(each.observed.tolist()) else refuse_correction(each) for each in observations]
        whole = [i for i, correction in enumerate(results) if correction is None]
        alone = any(
            6 * len(observation.poses) > LARGEST_DENSE or observation.shared or observation.tails
            for observation in observations
        )
        for batch in ([i] for i in whole) if alone else [whole] if whole else []:
            for i, correction in zip(batch, self._correct([observations[i] for i in batch]), strict=True):
                results[i] = correction
        return [correction for correction in results if correction is not None]

    @check_arguments
    def leaving_out(self, observation: Observation, dropped: tuple[str, ...]) -> Correction:
        """Correct an observation without the contacts of some relations."""
        problem = problem_of((observation,), self.level)
        solved = solve(problem, problem.without(dropped))[0]
        (before_m,) = problem.seen_gap_m()
        return check_facing(problem.observation, self._report(problem, 0, solved, before_m, dropped))

    def _correct(self, observations: Sequence[Observation]) -> list[Correction]:
        """Correct a batch of projected, fully observed observations together; doubtful ones again one by one."""
        problem = problem_of(observations, self.level)
        corrections = []
        for i, (before_m, solved) in enumerate(
            zip(problem.seen_gap_m(), solve(problem, problem.all_contacts), strict=True)
        ):
            sure = (solved.test.passes or self.doubt == "apply") and not solved.far and not solved.away
            if sure and _status(solved, observations[i].gap_m) == "converged":
                corrections.append(self._report(problem, i, solved, before_m))
            else:
                corrections.append(self._in_doubt(problem.only(i), solved, before_m))
        return corrections

    def _in_doubt(self, problem: Problem, solved: Solved, before_m: float) -> Correction:
        """Correct an observation whose first solution is invalid, far, or fails the test: try other starts, rank
        suspects.
        """
        if self.elsewhere:
            problem, solved = best_start(problem, solved)
        test = solved.test
        # Contacts hold, but steps go on (status `not_converged`): a nearer solution may pass, so nothing is suspected.
        still_moving = not solved.at_rest and solved.worst_m <= problem.observation.gap_m
        if not test.passes and self.doubt != "apply" and solved.finite and not still_moving:
            test = replace(test, suspects=suspects(problem, problem.all_contacts))
        kept = problem.all_contacts
        dropped = tuple[str, ...]()
        while self.doubt == "drop" and not solved.test.passes and solved.finite and len(dropped) < DROPS:
            worst = suspects(problem, kept) if dropped else test.suspects
            if not worst:
                break
            dropped += (self._most_suspect(problem, kept, worst[0]),)
            kept = problem.without(dropped)
            solved = solve(problem, kept)[0]
        report = self._report(problem, 0, solved, before_m, dropped, test, describe_turns(problem, solved.poses))
        return check_facing(problem.observation, report)

    def _most_suspect(self, problem: Problem, kept: NDArray[np.bool_], worst: Suspect) -> str:
        """The name of one contact of the most suspect relation if the test passes without it; else of the whole
        relation.
        """
        single = contact_suspects(problem, kept, worst.relation)[0]
        return single.relation if single.p_value >= self.level else worst.relation

    def _report(
        self,
        problem: Problem,
        i: int,
        solved: Solved,
        before_m: float,
        dropped: tuple[str, ...] = (),
        test_before: Consistency | None = None,
        turned: str = "",
    ) -> Correction:
        """The correction of observation i.

        Args:
            before_m: The largest gap at the observed poses, [m].
            test_before: The test before relations were dropped; None if none were.
            turned: Part of the sentence on operations that were observed turned.
        """
        gap_m = problem.observations[i].gap_m
        test = test_before or solved.test
        status = _status(solved, gap_m)
        if status == "converged" and self.doubt in ("refuse", "drop") and not solved.test.passes:
            status = "doubtful"
        poses = solved.poses
        if not np.isfinite(poses).all():
            poses = problem.observations[i].poses
            status = "not_finite"
        of = f"every contact but those of {', '.join(dropped)}" if dropped else "every contact"
        doubts = "" if self.doubt == "apply" else _doubts(test, dropped)
        return Correction(
            poses=poses,
            status=status,
            sentence=status_sentence(status, gap_m, of) + turned + doubts,
            freed=problem.laid.pattern.freed,
            gap_before_m=before_m,
            gap_after_m=solved.worst_m,
            rank=solved.rank,
            # The rank is known where the solver ended only, and stands in every iterate.
            trace=tuple([Iterate(open_m, solved.rank, step) for open_m, step in solved.trace]),
            test=test,
            test_after=solved.test if dropped and test_before else None,
            covariance=solved.covariance if status == "converged" else None,
            dropped=dropped,
        )


contact = ContactCorrector()
contact_apply = ContactCorrector("apply")
contact_refuse = ContactCorrector("refuse")
contact_drop = ContactCorrector("drop")


def _status(solved: Solved, gap_m: float) -> str:
    """The status of a solution.

    `inconsistent` if a gap is open, whether or not the solver converged; `not_converged` if contacts hold but the
    solver still moves. The paper's solver has another rule, `status.solver_status`: contacts that hold count as
    converged.
    """
    if not solved.finite:
        return "not_finite"
    if solved.kept_m <= gap_m:
        return "converged" if solved.at_rest else "not_converged"
    return "inconsistent"


def _doubts(test: Consistency, dropped: tuple[str, ...]) -> str:
    """The part of the sentence on a failed test; empty if the test passes."""
    if test.passes:
        return ""
    named = ", ".join(suspect.relation for suspect in test.ambiguous) or "none alone"
    words = f"; the correction is longer than the stated noise explains (p = {test.p_value:.2g}), suspected: {named}"
    return f"{words}; left out: {', '.join(dropped)}" if dropped else words
