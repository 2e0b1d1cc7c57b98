"""Hypotheses of which observations are outliers, each solved for its poses and scored by its likelihood.

Given the states of all views, the residual of the contacts at the observation is Gaussian. Its covariance is J C J^t
plus what play and curvature add. Hypotheses are compared by the likelihood of that residual; what no contact depends on
does not count. Instead of an observation a relation may be wrong: its faces may then be anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import (
    Consistency,
    Correction,
    Observation,
    OutlierModel,
    SharedError,
    find_equation_pattern,
    find_faces_away,
)
from apo_bench.correction.checks.chi_square import CONTRADICTION_M, fit_deviation, p_value
from apo_bench.correction.contact.contact import ContactCorrector, contact_apply
from apo_bench.correction.contact.drawn import drawn_chi_squares, drawn_p_value
from apo_bench.correction.contact.inferred import infer_poses
from apo_bench.correction.contact.problem import problem_of, seen_system
from apo_bench.correction.robust.beliefs import (
    DISPLACED,
    INLIER,
    ROOM,
    VIEW,
    State,
    States,
    says_nothing,
    together,
)
from apo_bench.correction.robust.noise_scale import (
    LEAST,
    likeliest_scale,
    region_scale,
    scale_noise,
    scale_surprise,
    scaled_test,
)
from apo_bench.correction.robust.views import Merged, Sightings, merge_views, views_by_state
from apo_bench.correction.solvers import (
    compute_jacobian_rank,
    factor_noise,
    linearise_by,
)
from apo_bench.geometry import Array, compute_right_jacobian, copy_frozen, pose

as_begun = ContactCorrector("apply", elsewhere=False)
"""The corrector `contact` that ignores a failed test and tries no other starts."""
_FAR_RAD = np.radians(10.0)
"""Standard deviation of a rotation below which no other start is tried: a larger error is an outlier."""
UNKNOWN = copy_frozen(np.diag(np.repeat([0.05, 0.5], 3) ** 2))
"""Covariance of the pose of a left-out operation about the inferred one, (6, 6), [m, rad]."""
_WRONG_M = 0.05
"""Standard deviation of the distance of faces that a wrong relation names, [m]."""


@final
@dataclass(frozen=True, eq=False)
class Case:
    """The input of a search: an observation, all views of its operations, and the outlier model."""

    observation: Observation
    """The first observation: its assembly, start poses and play hold for all views."""
    views: Sightings
    model: OutlierModel
    _merged: dict[tuple[int, State], Merged] = field(default_factory=dict, init=False, repr=False)

    def merge_views(self, k: int, state: State) -> Merged:
        """`views.merge_views` of operation k, cached."""
        key = k, state
        if key not in self._merged:
            shown = views_by_state(self.views, k, state)
            self._merged[key] = merge_views(self.views[k], state, self.model, shown)
        return self._merged[key]


@final
@dataclass(frozen=True, eq=False)
class SolvedHypothesis:
    """A hypothesis, with the correction that follows from it."""

    case: Case
    states: States
    dropped: tuple[str, ...]
    """Relations that are rejected."""
    observation: Observation
    """The assumed observation: views merged; operations without a trusted view inferred from contacts, covariance
    `UNKNOWN`."""
    correction: Correction
    scale: float = 1.0
    """Assumed ratio of the actual noise of all views to the stated noise."""

    @property
    def key(self) -> tuple[States, tuple[str, ...], bool]:
        """The assumptions as a key: states, dropped relations, and whether the noise is larger than stated."""
        return self.states, self.dropped, self.scale > 1.0

    @property
    def left_out(self) -> tuple[int, ...]:
        """Operations whose views are all rejected."""
        return untrusted_operations(self.states)

    @property
    def doubts(self) -> bool:
        """Whether the hypothesis differs from what was stated: an outlier, a missing operation, a wrong relation,
        larger noise.
        """
        return (
            bool(self.dropped)
            or self.scale > 1.0
            or any(belief != INLIER for state in self.states for belief in state)
            or () in self.states
        )

    @cached_property
    def badness(self) -> float:
        """-2 log of the joint probability of states and views, up to a constant; infinite if there is no solution."""
        correction = self.correction
        observation = self.observation
        if not correction.ok or correction.test is None or not self._faces_oppose():
            return np.inf
        # What contacts leave at the observation is Gaussian with covariance S = J J^t + soft^2: -2 log of its density
        # is the squared length of the correction plus log det S. A left-out operation may be anywhere (`ROOM`).
        wide = observation.covariance * self.scale**2
        wide[list(self.left_out)] = ROOM
        system = seen_system(observation)
        xi = pose.log(pose.inverse(observation.poses) @ correction.poses)
        L = factor_noise(replace(observation, covariance=wide))
        _, Jt = linearise_by(system, correction.poses, compute_right_jacobian(xi) @ L)
        wrong, soft = soften(observation, self.dropped)
        false = np.where(wrong, system.residual(correction.poses) / soft, 0.0) if self.dropped else np.zeros(len(soft))
        S = Jt.T @ Jt + np.diag(soft * soft)
        unlikely = correction.test.chi_square / self.scale**2 + false @ false + np.linalg.slogdet(S)[1]
        surprise = prior_surprise(self.case, self.states, self.dropped)
        if self.scale > 1.0:
            surprise += scale_surprise(self.scale, correction.test.freedom)
        return float(unlikely + surprise)

    def scale_noise(self) -> SolvedHypothesis:
        """The hypothesis with the most likely noise scale, if that is above `LEAST`; poses stay the same."""
        test = self.correction.test
        if test is None or self.scale > 1.0 or self.observation.shared:
            return self
        scale = likeliest_scale(test.chi_square, test.freedom)
        return replace(self, scale=scale) if scale >= LEAST else self

    @property
    def stated(self) -> Observation:
        """The assumed observation with the estimated noise."""
        return scale_noise(self.observation, self._region_scale) if self.scale > 1.0 else self.observation

    @property
    def covariance(self) -> Array | None:
        """Posterior covariance of the poses with the estimated noise, (n, 6, 6), [m, rad]; None if unknown."""
        C = self.correction.covariance
        return C if C is None or self.scale == 1.0 else C * self._region_scale**2

    @property
    def _region_scale(self) -> float:
        """Noise scale for regions, which includes the uncertainty of the scale itself."""
        return region_scale(self.scale, self.correction.test.freedom) if self.correction.test else self.scale

    def at(self, poses: Array, unknown: Sequence[int]) -> SolvedHypothesis:
        """The hypothesis solved again from other inferred poses of the `unknown` operations, taken from `poses`, (n, 4,
        4).
        """
        moved = self._move(poses, unknown)
        correction = retest(moved, _correct(moved, self.dropped), self.left_out)
        return replace(self, observation=moved, correction=correction)

    def poses_at(self, poses: Array, unknown: Sequence[int]) -> Array | None:
        """The poses of `at` alone, (n, 4, 4); None if there is no solution or faces in contact do not oppose."""
        correction = _correct(self._move(poses, unknown), self.dropped)
        return correction.poses if correction.ok and self.stands_at(correction.poses) else None

    def _move(self, poses: Array, unknown: Sequence[int]) -> Observation:
        """The assumed observation with the poses of the `unknown` operations taken from `poses`, (n, 4, 4)."""
        there = np.array(self.observation.poses)
        there[list(unknown)] = poses[list(unknown)]
        return replace(self.observation, poses=there)

    def stands_at(self, poses: Array) -> bool:
        """Whether the faces of every contact that is not dropped oppose at the poses, (n, 4, 4)."""
        observation = self.observation
        away = find_faces_away(observation.assembly, observation.start, poses)
        return not (away & observation.assembly.without(self.dropped)).any()

    def _faces_oppose(self) -> bool:
        """Whether the faces of every contact that is not dropped oppose at the corrected poses."""
        return self.stands_at(self.correction.poses)

    @property
    def p_value(self) -> float:
        """The p-value of `test`; 0 if there is no solution."""
        return self.test.p_value if self.test and np.isfinite(self.badness) else 0.0

    @property
    def test(self) -> Consistency | None:
        """The test of the correction; with the estimated noise if the stated noise does not explain it."""
        test = self.correction.test
        return test if test is None or test.passes or self.scale == 1.0 else scaled_test(test, self.scale)


def untrusted_operations(states: States) -> tuple[int, ...]:
    """Operations whose views are all stale or gross, or that have none."""
    return tuple(k for k, state in enumerate(states) if all(map(says_nothing, state)))


def prior_surprise(case: Case, states: States, dropped: tuple[str, ...]) -> float:
    """-2 log of the probability of states, views and dropped relations, without contacts, relative to all as stated."""
    each = sum(case.merge_views(k, state).surprise for k, state in enumerate(states))
    return each + together(states, case.model) + len(dropped) * case.model.relation_surprise


def soften(observation: Observation, dropped: tuple[str, ...]) -> tuple[NDArray[np.bool_], Array]:
    """Which equations belong to wrong relations, (3 c,), and the standard deviation of each equation, (3 c,), [m].

    Equations of a wrong relation deviate by `_WRONG_M`, all others by play and by what counts as a contradiction.
    """
    soft = soft_deviation(observation)
    if not dropped:
        return np.zeros(len(soft), dtype=np.bool_), soft
    wrong = np.repeat(~observation.assembly.without(dropped), 3)
    each = np.repeat(np.sqrt(np.diff(find_equation_pattern(observation.assembly).begin)), 3) * _WRONG_M
    return wrong, np.where(wrong, each, soft)


def hypothesis(
    case: Case, states: States, dropped: tuple[str, ...] = (), assumed: Observation | None = None
) -> SolvedHypothesis:
    """Solve for the most likely poses under assumed states and dropped relations.

    Args:
        assumed: The `assumed_observation` of the states, if it is known already.
    """
    if assumed is None:
        assumed = assumed_observation(case, states)
    trusted = all(state and set(state) == {INLIER} for state in states) and not dropped
    correction = as_stated(assumed) if trusted else _correct(assumed, dropped)
    return SolvedHypothesis(case, states, dropped, assumed, retest(assumed, correction, untrusted_operations(states)))


def retest(assumed: Observation, correction: Correction, left_out: tuple[int, ...]) -> Correction:
    """The correction with its test restricted to what was observed.

    Directions that only left-out operations could violate are no degrees of freedom: their inferred poses agree with
    their contacts and add nothing to the squared length.
    """
    if not left_out or correction.test is None or not correction.ok:
        return correction
    kept = assumed.assembly.without(correction.dropped)
    system = seen_system(assumed).among(kept)
    n = len(correction.poses)
    own = linearise_by(system, correction.poses, np.tile(np.eye(6), (n, 1, 1)))[1]
    own = own.reshape(n, 6, -1)[list(left_out)].reshape(6 * len(left_out), -1)
    freedom = max(0, correction.test.freedom - compute_jacobian_rank(own))
    p = p_value(correction.test.chi_square, freedom)
    if assumed.tails is not None and freedom:
        L = factor_noise(assumed)
        xi = pose.log(pose.inverse(assumed.poses) @ correction.poses)
        _, Jt = linearise_by(system, correction.poses, compute_right_jacobian(xi) @ L)
        play = problem_of((assumed,)).play_covariance(kept)
        drawn = drawn_chi_squares(assumed, L, Jt, play, left_out)
        p = drawn_p_value(drawn, correction.test.chi_square)
    return replace(correction, test=replace(correction.test, freedom=freedom, p_value=p))


def as_stated(observation: Observation) -> Correction:
    """The correction that trusts every observation; other starts are tried only if a rotation is very uncertain."""
    far = (observation.covariance.diagonal(axis1=1, axis2=2)[:, 3:] > _FAR_RAD**2).any()
    return contact_apply(observation) if far else as_begun(observation)


def assumed_observation(case: Case, states: States) -> Observation:
    """The observation that the states imply: views merged, rejected operations inferred from contacts.

    With several views of an operation, shared errors and tails are not kept.
    """
    first = case.observation
    poses = np.array(first.poses)
    covariance = np.array(first.covariance)
    unknown = list[int]()
    for k, state in enumerate(states):
        every = case.merge_views(k, state)
        if every.goal is None:
            unknown.append(k)
            covariance[k] = UNKNOWN
        else:
            poses[k] = every.goal
            covariance[k] = every.covariance
    assumed = replace(first, poses=poses, covariance=covariance, observed=np.ones(len(states), dtype=np.bool_))
    if any(len(views) > 1 for views in case.views):
        assumed = replace(assumed, shared=(), tails=None)
    displaced = tuple(k for k, state in enumerate(states) if state == (DISPLACED,))
    if displaced:
        assumed = _displace(assumed, displaced)
    return replace(assumed, poses=infer_poses(assumed, unknown).poses) if unknown else assumed


def _displace(observation: Observation, operations: tuple[int, ...]) -> Observation:
    """Add a displacement that some operations share, about their mean position, as a shared error."""
    P = np.eye(4)
    P[:3, 3] = observation.poses[list(operations), :3, 3].mean(axis=0)
    error = SharedError("view", operations, VIEW, P)
    covariance = np.array(observation.covariance)
    covariance[list(operations)] += error.covariances(observation.poses)
    return replace(observation, covariance=covariance, shared=(*observation.shared, error))


def soft_deviation(observation: Observation) -> Array:
    """The standard deviation of each equation, (3 c,), [m], from play and from what counts as a contradiction."""
    return np.hypot(fit_deviation(observation.assembly, observation.play_m), CONTRADICTION_M)


def _correct(observation: Observation, dropped: tuple[str, ...]) -> Correction:
    """Correct without other starts, since rejected operations begin where their contacts put them."""
    return as_begun.leaving_out(observation, dropped) if dropped else as_begun(observation)
