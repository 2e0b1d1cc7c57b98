"""Which observations are outliers is part of the estimate: hypotheses of that, and how likely the views make them.

Given the states of all views, what contacts leave at the observation is Gaussian, with covariance J C J^t and what
play and curvature add, so hypotheses are compared by the likelihood of that; what no contact tells does not count. A
relation may be wrong in place of an observation: its faces are then anywhere.
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
    find_contact_pattern,
    find_faces_away,
)
from apo_bench.correction.checks.chi_square import CONTRADICTION_M, fit_deviation, p_value
from apo_bench.correction.contact.contact import ContactCorrector, contact_apply
from apo_bench.correction.contact.drawn import drawn_chi_squares, drawn_p_value
from apo_bench.correction.contact.inferred import infer_poses
from apo_bench.correction.contact.problem import problem_of, seen_system
from apo_bench.correction.robust.beliefs import DISPLACED, INLIER, ROOM, VIEW, State, States, says_nothing, together
from apo_bench.correction.robust.noise_scale import (
    LEAST,
    likeliest_scale,
    region_scale,
    scale_noise,
    scale_surprise,
    scaled_test,
)
from apo_bench.correction.robust.views import Merged, Sightings, exchanged_with, merge_views
from apo_bench.correction.solvers import compute_jacobian_rank, factor_noise, linearise_by
from apo_bench.geometry import Array, compute_right_jacobian, copy_frozen, pose

as_begun = ContactCorrector("apply", elsewhere=False)
_FAR_RAD = np.radians(10.0)
"""Parts that are assumed to be turned by less (a standard deviation) are not far from the observed ones: no other start
is tried, and what is far nevertheless is an outlier."""
UNKNOWN = copy_frozen(np.diag(np.repeat([0.05, 0.5], 3) ** 2))
"""(6, 6): how far the pose of an operation that was left out may be from what its contacts say of it, [m, rad]."""
_WRONG_M = 0.05
"""Faces that a wrong relation names may be so far apart."""


@final
@dataclass(frozen=True, eq=False)
class Case:
    """What there is to explain."""

    observation: Observation
    """The first look: assembly, start poses and play are those of all."""
    views: Sightings
    model: OutlierModel
    _merged: dict[tuple[int, State, int | None], Merged] = field(default_factory=dict, init=False, repr=False)

    def merge_views(self, k: int, state: State, exchanged: int | None = None) -> Merged:
        """`views.merge_views` of operation k, once each; `exchanged` is the operation whose view belongs to it."""
        key = k, state, exchanged
        if key not in self._merged:
            other = None if exchanged is None else self.views[exchanged][0]
            self._merged[key] = merge_views(self.views[k], state, self.model, other)
        return self._merged[key]


@final
@dataclass(frozen=True, eq=False)
class SolvedHypothesis:
    """What is assumed, and what comes of that."""

    case: Case
    states: States
    dropped: tuple[str, ...]
    """Relations that are rejected."""
    observation: Observation
    """Views merged, and operations of which none is assumed where contacts say, with `UNKNOWN`."""
    correction: Correction
    scale: float = 1.0
    """How much larger than stated the noise of all views is."""

    @property
    def key(self) -> tuple[States, tuple[str, ...], bool]:
        """What it assumes."""
        return self.states, self.dropped, self.scale > 1.0

    @property
    def left_out(self) -> tuple[int, ...]:
        """Operations whose views are all rejected."""
        return untrusted_operations(self.states)

    @property
    def doubts(self) -> bool:
        """Whether anything is not taken as stated."""
        return (
            bool(self.dropped)
            or self.scale > 1.0
            or any(belief != INLIER for state in self.states for belief in state)
            or () in self.states
        )

    @cached_property
    def badness(self) -> float:
        """-2 log of how likely states and views are together, but for a constant; infinite if there is no solution."""
        correction = self.correction
        observation = self.observation
        if not correction.ok or correction.test is None or not self._faces_oppose():
            return np.inf
        # What contacts leave at the observation is Gaussian with covariance S = J J^t + soft^2: -2 log of its density
        # is the squared length of the correction and log det S. Of an operation that was left out `ROOM` is as likely.
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
        """The same if all noise is larger than stated, by as much as is likeliest: the poses stay."""
        test = self.correction.test
        if test is None or self.scale > 1.0 or self.observation.shared:
            return self
        scale = likeliest_scale(test.chi_square, test.freedom)
        return replace(self, scale=scale) if scale >= LEAST else self

    @property
    def stated(self) -> Observation:
        """What is assumed with the noise that is."""
        return scale_noise(self.observation, self._region_scale) if self.scale > 1.0 else self.observation

    @property
    def covariance(self) -> Array | None:
        """Of the poses, (n, 6, 6), [m, rad], with the noise that is."""
        C = self.correction.covariance
        return C if C is None or self.scale == 1.0 else C * self._region_scale**2

    @property
    def _region_scale(self) -> float:
        return region_scale(self.scale, self.correction.test.freedom) if self.correction.test else self.scale

    def at(self, poses: Array, unknown: Sequence[int]) -> SolvedHypothesis:
        """The same with the inferred poses of some operations elsewhere, at these of poses (n, 4, 4)."""
        moved = self._move(poses, unknown)
        correction = retest(moved, _correct(moved, self.dropped), self.left_out)
        return replace(self, observation=moved, correction=correction)

    def poses_at(self, poses: Array, unknown: Sequence[int]) -> Array | None:
        """Its poses, (n, 4, 4), alone; None where there are none, or faces of contacts look away from each other."""
        correction = _correct(self._move(poses, unknown), self.dropped)
        return correction.poses if correction.ok and self.stands_at(correction.poses) else None

    def _move(self, poses: Array, unknown: Sequence[int]) -> Observation:
        there = np.array(self.observation.poses)
        there[list(unknown)] = poses[list(unknown)]
        return replace(self.observation, poses=there)

    def stands_at(self, poses: Array) -> bool:
        """Whether the faces of every contact that is assumed look at each other at the poses, (n, 4, 4)."""
        observation = self.observation
        away = find_faces_away(observation.assembly, observation.start, poses)
        return not (away & observation.assembly.without(self.dropped)).any()

    def _faces_oppose(self) -> bool:
        return self.stands_at(self.correction.poses)

    @property
    def p_value(self) -> float:
        """Of the test of its correction; 0 if there is no solution."""
        return self.test.p_value if self.test and np.isfinite(self.badness) else 0.0

    @property
    def test(self) -> Consistency | None:
        """Of its correction; with the noise that is, where that which is stated does not explain it."""
        test = self.correction.test
        return test if test is None or test.passes or self.scale == 1.0 else scaled_test(test, self.scale)


def untrusted_operations(states: States) -> tuple[int, ...]:
    """Operations whose views are all rejected."""
    return tuple(k for k, state in enumerate(states) if all(map(says_nothing, state)))


def prior_surprise(case: Case, states: States, dropped: tuple[str, ...]) -> float:
    """-2 log of how likely states are, and the views in them, without contacts; relative to all as stated."""
    each = sum(case.merge_views(k, state).surprise for k, state in enumerate(states))
    return each + together(states, case.model) + len(dropped) * case.model.relation_surprise


def soften(observation: Observation, dropped: tuple[str, ...]) -> tuple[NDArray[np.bool_], Array]:
    """Which equations are those of wrong relations, (3 c,), and how far each may be from nominal, (3 c,), [m].

    Faces of a wrong relation are anywhere: its equations deviate by their distance, not by what play leaves.
    """
    soft = soft_deviation(observation)
    if not dropped:
        return np.zeros(len(soft), dtype=np.bool_), soft
    wrong = np.repeat(~observation.assembly.without(dropped), 3)
    each = np.repeat(np.sqrt(np.diff(find_contact_pattern(observation.assembly).begin)), 3) * _WRONG_M
    return wrong, np.where(wrong, each, soft)


def hypothesis(
    case: Case, states: States, dropped: tuple[str, ...] = (), assumed: Observation | None = None
) -> SolvedHypothesis:
    """Solve for the poses that are most likely with these states, and without these relations.

    Args:
        assumed: The `assumed_observation` of the states, if it is at hand.
    """
    if assumed is None:
        assumed = assumed_observation(case, states)
    trusted = all(state and set(state) == {INLIER} for state in states) and not dropped
    correction = as_stated(assumed) if trusted else _correct(assumed, dropped)
    return SolvedHypothesis(case, states, dropped, assumed, retest(assumed, correction, untrusted_operations(states)))


def retest(assumed: Observation, correction: Correction, left_out: tuple[int, ...]) -> Correction:
    """With the test of what was observed alone: directions that only left-out operations could show are not tested.

    What is inferred agrees with its contacts, so these operations add nothing to the squared length, and the rank of
    their own columns is no degree of freedom.
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
    """The correction if every observation is assumed as it is stated."""
    far = (observation.covariance.diagonal(axis1=1, axis2=2)[:, 3:] > _FAR_RAD**2).any()
    return contact_apply(observation) if far else as_begun(observation)


def assumed_observation(case: Case, states: States) -> Observation:
    """Views merged, and what is rejected inferred; shared errors and tails of several views are not kept."""
    first = case.observation
    poses = np.array(first.poses)
    covariance = np.array(first.covariance)
    unknown = list[int]()
    for k, state in enumerate(states):
        every = case.merge_views(k, state, exchanged_with(state))
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
    """With one displacement that some operations share, about their middle."""
    P = np.eye(4)
    P[:3, 3] = observation.poses[list(operations), :3, 3].mean(axis=0)
    error = SharedError("view", operations, VIEW, P)
    covariance = np.array(observation.covariance)
    covariance[list(operations)] += error.added(observation.poses)
    return replace(observation, covariance=covariance, shared=(*observation.shared, error))


def soft_deviation(observation: Observation) -> Array:
    """How far each equation may be from nominal, (3 c,), [m]."""
    return np.hypot(fit_deviation(observation.assembly, observation.play_m), CONTRADICTION_M)


def _correct(observation: Observation, dropped: tuple[str, ...]) -> Correction:
    """Without other starts: what is rejected is where contacts say already."""
    return as_begun.leaving_out(observation, dropped) if dropped else as_begun(observation)
