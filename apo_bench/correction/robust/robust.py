"""The corrector `contact-robust`: rejects observations that contradict the others through their contacts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.assembly import (
    Correction,
    Hypothesis,
    Observation,
    OutlierModel,
    Reobserver,
    measure_largest_gap,
    project_observations,
)
from apo_bench.correction.checks.chi_square import TEST_LEVEL
from apo_bench.correction.checks.status import refuse_correction
from apo_bench.correction.contact.contact import contact_apply
from apo_bench.correction.contact.inferred import infer_poses
from apo_bench.correction.robust.beliefs import BROAD, DISPLACED, FLIPPED, GROSS, INLIER, SHIFTED, STALE, States
from apo_bench.correction.robust.chosen_hypothesis import retest_as_chosen
from apo_bench.correction.robust.crowding import least_crowded
from apo_bench.correction.robust.hypotheses import Case, SolvedHypothesis, as_begun, as_stated
from apo_bench.correction.robust.mixture import mode_covariance
from apo_bench.correction.robust.noise_scale import LEAST, likeliest_scale, region_scale, scale_noise, scale_words
from apo_bench.correction.robust.search import Search
from apo_bench.correction.robust.views import Sightings, add_views, confused_with, views_of
from apo_bench.geometry import Array

TEMPERATURE = 3.0
"""Temperature at which the weights of hypotheses are calibrated, tuned on scenes of no benchmark."""
UNNAMED = 0.02
"""Rate at which none of the hypotheses was right on those scenes; all weights together leave this to 1."""
_LITTLE = 0.005
"""Probability below which a wrong relation is not mentioned."""
_SURE = 0.01
"""Probability of another state above which an operation is observed again."""
_SURE_DEVIATION = np.repeat([5e-3, np.radians(5.0)], 3)
"""Standard deviation of a pose above which its operation is observed again, [m, rad]."""


@final
@dataclass(frozen=True)
class RobustCorrector:
    """The corrector `contact-robust`: nearest consistent poses without observations that contradict the others."""

    outliers: OutlierModel | None = None
    """Rates of outliers; None: those of the observation, or else the defaults of `OutlierModel`."""
    level: float = TEST_LEVEL
    """A set of observations is accepted if the p-value of its correction is at least this."""
    temperature: float = TEMPERATURE
    """Weights of hypotheses are likelihoods to the power of 1 / temperature."""

    def __call__(self, observation: Observation) -> Correction:
        """Correct an observation.

        Returns:
            As `contact`; `left_out` are operations whose observations are all rejected, their poses are
            inferred from contacts. `not_seen` if one was not observed of which no contact says anything.

        Raises:
            InputError: The covariance of an operation is not positive definite.
        """
        return self.correct_and_reobserve(observation, None)

    def together(self, observations: Sequence[Observation]) -> list[Correction]:
        """Correct observations of one assembly with the same start poses and play; those that pass the test, in one
        batch.
        """
        observations = project_observations(observations)
        plain = [i for i, observation in enumerate(observations) if self._is_plain(observation)]
        made: list[Correction | None] = [None] * len(observations)
        for i, correction in zip(plain, as_begun.together([observations[i] for i in plain]), strict=True):
            made[i] = self._accept(observations[i], correction)
        return [one or self(observation) for one, observation in zip(made, observations, strict=True)]

    def correct_and_reobserve(self, observation: Observation, reobserve: Reobserver | None) -> Correction:
        """Correct an observation, observing doubtful operations again while there are any and observations are left."""
        if reobserve is None and self._is_plain(observation):
            correction = self._accept(observation, as_stated(observation))
            if correction is not None:
                return correction
        model = self._model(observation)
        views = views_of(observation, model)
        again = list[int]()
        first = None
        best = None
        while True:
            search = Search(Case(observation, views, model), self.level, self.temperature)
            baseless = infer_poses(observation, [k for k, own in enumerate(views) if not own]).baseless
            best = None if baseless else search.likeliest(best)
            first = first or search.first
            doubted = baseless or unsure(search, best, views)
            if reobserve is None or not reobserve.left or not doubted:
                break
            views = add_views(views, reobserve(doubted), observation, model)
            again += doubted
        if best is None:
            return contact_apply(observation) if observation.observed.all() else refuse_correction(observation)
        return _report(observation, first or best, search, with_room(best).scale_noise(), again)

    def _model(self, observation: Observation) -> OutlierModel:
        """The outlier model: that of the corrector, or else of the observation, or else the default."""
        return self.outliers or observation.outliers or OutlierModel()

    def _is_plain(self, observation: Observation) -> bool:
        """Whether no search is needed if the test passes: all operations observed, and inliers likelier than gross
        errors.
        """
        model = self._model(observation)
        return bool(observation.observed.all()) and model.surprises[INLIER] < model.surprises[GROSS]

    def _accept(self, observation: Observation, correction: Correction) -> Correction | None:
        """The correction that trusts all observations, if its test passes, with the estimated noise scale; otherwise
        None.
        """
        test = correction.test
        if not correction.ok or test is None or test.p_value < self.level:
            return None
        scale = likeliest_scale(test.chi_square, test.freedom)
        if scale < LEAST or observation.shared:
            return correction
        C = correction.covariance
        return replace(
            correction,
            sentence=correction.sentence + scale_words(scale),
            covariance=None if C is None else C * region_scale(scale, test.freedom) ** 2,
            assumed=scale_noise(observation, region_scale(scale, test.freedom)),
            noise_scale=scale,
        )


contact_robust = RobustCorrector()
"""The corrector `contact-robust` with its default settings."""


def unsure(search: Search, best: SolvedHypothesis | None, views: Sightings) -> tuple[int, ...]:
    """Operations to observe again: no view is an inlier, the pose is uncertain, or another state is likely.

    An operation that was seen where one of them was goes with it, since the two may have been swapped.
    """
    if best is None:
        return tuple(range(search.operations))
    doubted = []
    for k, state in enumerate(best.states):
        C = best.correction.covariance
        wide = C is not None and bool((np.sqrt(np.diag(C[k])) > _SURE_DEVIATION).any())
        if all(belief != INLIER for belief in state) or wide or search.share(best, k) > _SURE:
            doubted.append(k)
    return tuple(sorted({*doubted, *confused_with(views, doubted)}))


def with_room(hypothesis: SolvedHypothesis) -> SolvedHypothesis:
    """The hypothesis with inferred and shifted operations moved to where their parts have room (`crowding`)."""
    shifted = tuple(k for k, state in enumerate(hypothesis.states) if state == (SHIFTED,))
    unknown = tuple(sorted({*hypothesis.left_out, *shifted}))
    covariance = hypothesis.correction.covariance
    if not unknown or covariance is None or not np.isfinite(hypothesis.badness):
        return hypothesis

    def solve(poses: Array) -> Array | None:
        return hypothesis.poses_at(poses, unknown)

    better = least_crowded(hypothesis.observation, hypothesis.correction.poses, covariance, unknown, solve)
    return hypothesis if better is None else hypothesis.at(better, unknown)


def _report(
    observation: Observation, first: SolvedHypothesis, search: Search, best: SolvedHypothesis, again: list[int]
) -> Correction:
    """The correction of the best hypothesis, with gaps and test of the first observation.

    Args:
        first: The hypothesis that trusts each operation by itself, whose test is reported.
        best: The most likely hypothesis.
        again: Operations that were observed again.
    """
    correction = best.correction
    if not best.doubts and not again:
        return replace(correction, sentence=correction.sentence + _describe_misfit(best))
    before = measure_largest_gap(observation.assembly, observation.start, observation.poses)
    hypotheses = _hypotheses(search, best)
    return replace(
        correction,
        sentence=correction.sentence + _describe_misfit(best) + _doubts(search, best) + _looks(again),
        covariance=mode_covariance(hypotheses),
        noise_scale=best.scale,
        gap_before_m=before if observation.observed.all() else np.nan,
        test=first.correction.test or correction.test,
        test_after=retest_as_chosen(best),
        left_out=best.left_out,
        assumed=best.stated,
        hypotheses=hypotheses,
    )


def _hypotheses(search: Search, best: SolvedHypothesis) -> tuple[Hypothesis, ...]:
    """All hypotheses that are kept, with weights, the best first; it has the poses that are returned."""
    weights = dict[tuple[States, tuple[str, ...]], float]()
    solved_by = {(best.states, best.dropped): best}
    for weight, solved in search.weighted():
        # Noise that is larger than stated leaves the poses, so it is no other hypothesis.
        what = solved.states, solved.dropped
        weights[what] = weights.get(what, 0.0) + weight
        solved_by.setdefault(what, solved.scale_noise())
    weighted = sorted(
        ((weight, solved_by[what]) for what, weight in weights.items()), key=lambda one: (one[1] is not best, -one[0])
    )
    return tuple(
        Hypothesis(
            (1.0 - UNNAMED) * weight,
            solved.correction.poses,
            solved.covariance,
            solved.stated,
            solved.left_out,
            solved.dropped,
            _list_doubts(solved).removeprefix("; "),
            solved.scale,
        )
        for weight, solved in weighted
    )


def _describe_misfit(best: SolvedHypothesis) -> str:
    """State in words that the test of the best hypothesis fails; empty if it passes."""
    if best.test is None or best.test.passes:
        return ""
    p = best.test.p_value
    return f"; the correction is longer than the stated noise explains (p = {p:.2g}), no outlier does"


def _doubts(search: Search, best: SolvedHypothesis) -> str:
    """State in words what is rejected, and how likely a wrong relation is compared with a wrong observation."""
    words = _list_doubts(best)
    rival = search.rival(best)
    if rival is None:
        return words
    wrong = search.weight(best, lambda one: bool(one.dropped))
    if wrong < _LITTLE and not best.dropped:
        return words
    named = (best if best.dropped else rival).dropped[0]
    return f"{words}; an observation is to blame with {_share(1.0 - wrong)}, a relation ({named}) with {_share(wrong)}"


def _list_doubts(best: SolvedHypothesis) -> str:
    """`; left out what was observed of operation 2; seen turned: operation 3`, or empty."""
    states = best.states
    stale = tuple(k for k in best.left_out if STALE in states[k])
    lists = (
        ("not seen:", tuple(k for k, state in enumerate(states) if not state)),
        ("left out what was seen of", tuple(k for k in best.left_out if states[k] and k not in stale)),
        ("seen where the part was before:", stale),
        ("seen badly:", _those(best, lambda belief: belief == BROAD)),
        ("seen too near or too far:", _those(best, lambda belief: belief == SHIFTED)),
        ("seen turned:", _those(best, lambda belief: belief >= FLIPPED)),
        ("seen in each other's place:", _those(best, lambda belief: belief < 0)),
        ("seen displaced together:", _those(best, lambda belief: belief == DISPLACED)),
    )
    words = "".join(f"; {what} {_operations(those)}" for what, those in lists if those)
    return words + "".join(f"; left out {relation}" for relation in best.dropped) + scale_words(best.scale)


def _those(best: SolvedHypothesis, which: Callable[[int], bool]) -> tuple[int, ...]:
    """Operations that are not left out and have a view whose belief satisfies `which`."""
    return tuple(k for k, state in enumerate(best.states) if any(map(which, state)) and k not in best.left_out)


def _looks(again: list[int]) -> str:
    """State in words which operations were observed again."""
    return f"; looked again at {_operations(sorted({*again}))}" if again else ""


def _operations(some: Sequence[int]) -> str:
    """Operations in words, counted from 1: `operation 2, 3`."""
    return f"operation {', '.join(str(k + 1) for k in some)}"


def _share(x: float) -> str:
    """A probability in words: `0.93`, `< 0.01` or `> 0.99`."""
    return "< 0.01" if x < _LITTLE else f"{min(x, 0.99):.2f}" if x < 1.0 - _LITTLE else "> 0.99"
