"""Input of the solver for a batch of observations of one assembly: equations, inequalities and noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Observation, build_contact_equations, find_equation_pattern
from apo_bench.correction.checks.chi_square import TEST_LEVEL, fit_deviation
from apo_bench.correction.solvers import (
    LARGEST_DENSE,
    CompactEquations,
    Inequalities,
    NearestPoses,
    ProjectedContacts,
    bound_contacts,
    build_compact_equations,
    factor_covariance,
    factor_noise,
    fit_covariance,
    project_vertices,
    solve_batch,
    whiten_poses,
)
from apo_bench.geometry import Array, remember


class _Demands(NamedTuple):
    """Which of the c contacts of an assembly are equations, with distances and covariances from play."""

    exact: NDArray[np.bool_]
    """(c,): contacts that are equations; the others are inequalities."""
    all_exact: bool
    """Whether all of them are equations."""
    low: Array
    """(c,), [m]: the least allowed distance of each contact."""
    high: Array
    """(c,), [m]: the largest allowed distance of each contact."""
    plane: Array
    """(c, 4): planes of Eq. 1, shifted by the distance at which an equation must hold."""
    slack_m: Array | None
    """(3 c,): the standard deviation of each equation from play, [m]; None without play."""
    play_covariance: Array | None
    """(3 c, 3 c): the covariance of the equations from play, [m^2]; None: none."""


@final
@dataclass(frozen=True, eq=False)
class Problem:
    """A batch of b observations of one assembly with n operations and c contacts, the same start poses and play."""

    observations: tuple[Observation, ...]
    poses: Array
    """(b, n, 4, 4), the observed poses, world, [m]."""
    L: Array
    """Factor of the noise: (b, n, 6, 6), or (b, n, 6, 6 n) if operations share errors."""
    laid: ProjectedContacts
    """The equations of every contact, with shifted planes."""
    demands: _Demands
    inequalities: tuple[Inequalities, ...]
    """The inequalities of each observation; empty if every contact is an equation."""
    level: float
    """The test fails if the p-value is below this."""
    begin: Array | None = None
    """(b, 6 n): the correction to start from, in standard deviations; None: none."""

    @property
    def observation(self) -> Observation:
        """The first observation of the batch.

        In larger batches use it only for what all observations have in common. Observations with tails or shared errors
        come in batches of one (`ContactCorrector.together`).
        """
        return self.observations[0]

    @property
    def all_contacts(self) -> NDArray[np.bool_]:
        """The choice of all contacts, (c,)."""
        return np.ones(len(self.demands.exact), dtype=np.bool_)

    def only(self, i: int) -> Problem:
        """The problem of observation i alone."""
        if len(self.observations) == 1:
            return self
        some = slice(i, i + 1)
        return replace(
            self,
            observations=self.observations[some],
            poses=self.poses[some],
            L=self.L[some],
            laid=self.laid.only(some),
            inequalities=self.inequalities[some],
            begin=None if self.begin is None else self.begin[some],
        )

    def without(self, dropped: tuple[str, ...]) -> NDArray[np.bool_]:
        """The choice, (c,), of all contacts but those of these relations or single contacts."""
        return self.observation.assembly.without(dropped)

    def seen_gap_m(self) -> list[float]:
        """The largest |e| of all contacts at the observed poses, [m], per observation."""
        return self.gaps(self.poses, self.laid.forms).max(axis=1, initial=0.0).tolist()

    def gaps(self, poses: Array, forms: Array | None = None) -> Array:
        """The largest |e| of each contact, (b, c), [m], at poses (b, n, 4, 4); for an inequality its violation.

        Args:
            forms: (b, c, 4), n D_a^-1 D_b of each contact there, if that is known.
        """
        gaps = self.laid.gaps(self.laid.system.forms(poses) if forms is None else forms)
        for own, wall, at in zip(gaps, self.inequalities, poses, strict=False):
            own[~self.demands.exact] = wall.overstepped(at)
        return gaps

    def play_covariance(self, chosen: NDArray[np.bool_]) -> Array | None:
        """The covariance of the equations of the chosen contacts, (c,), from play, [m^2]; None: none."""
        S = self.demands.play_covariance
        if S is None or chosen.all():
            return S
        rows = np.repeat(chosen, 3)
        return S[np.ix_(rows, rows)]

    def slack(self, chosen: NDArray[np.bool_]) -> Array:
        """The standard deviation of each equation of the chosen contacts, (c,), from play, [m]."""
        slack_m = self.demands.slack_m
        return np.zeros(3 * np.count_nonzero(chosen)) if slack_m is None else slack_m[np.repeat(chosen, 3)]

    def among(self, chosen: NDArray[np.bool_]) -> CompactEquations:
        """The equations of the chosen contacts, (c,)."""
        return self.laid.system if chosen.all() else self.laid.system.among(chosen)

    def nearest(self, chosen: NDArray[np.bool_], soft_m: Array | None = None) -> NearestPoses:
        """The nearest poses for the equations of the chosen contacts, (c,).

        Args:
            soft_m: Standard deviation of each of these equations, [m]; None: they must hold.
        """
        return solve_batch(self.among(chosen), self.poses, self.L, soft_m, self.begin)

    @property
    def is_plain(self) -> bool:
        """Whether several choices of contacts can be solved in one batch.

        True for small matrices, equations without play, and Gaussian errors that are independent between operations.
        """
        demands = self.demands
        gaussian = self.observation.tails is None and not self.observation.shared
        equations = demands.all_exact and demands.slack_m is None and demands.play_covariance is None
        return gaussian and equations and 6 * self.laid.system.n <= LARGEST_DENSE

    def nearest_by_each(self, choices: NDArray[np.bool_]) -> NearestPoses:
        """The nearest poses of one observation for each choice of contacts, (k, c), as a batch of k."""
        k = len(choices)
        # Zero points make the equations of a contact that is left out 0 = 0.
        system = replace(self.laid.system, points=self.laid.system.points[:1] * choices[:, :, None, None])
        begin = None if self.begin is None else np.tile(self.begin[:1], (k, 1))
        poses, L = (np.tile(x[:1], (k, *[1] * (x.ndim - 1))) for x in (self.poses, self.L))
        return solve_batch(system, poses, L, None, begin)


def problem_of(observations: Sequence[Observation], level: float = TEST_LEVEL, at: Array | None = None) -> Problem:
    """Build the problem of observations of one assembly with flat faces, the same start poses and play.

    Args:
        level: The test fails if the p-value is below.
        at: Poses, (b, n, 4, 4), at which vertices are projected and the solver starts; None: the observed poses.

    Raises:
        InputError: A covariance is not positive definite, or shared errors exceed the covariances that contain them.
    """
    first = observations[0]
    assembly = first.assembly
    shared = any(observation.shared for observation in observations)
    poses = np.concatenate([observation.poses for observation in observations]).reshape(len(observations), -1, 4, 4)
    start = np.concatenate([np.zeros((0, 4)), *(first.start[part] for part in assembly.solids)]).reshape(-1, 4, 4)
    demands = _demands(assembly, first.play_m)
    there = poses if at is None else at
    laid = project_vertices(assembly, start, demands.plane, there)
    inequalities = tuple[Inequalities, ...]()
    if not demands.all_exact:
        systems = (build_contact_equations(assembly, first.start, T) for T in there)
        inequalities = tuple(bound_contacts(system, demands.exact, demands.low, demands.high) for system in systems)
    L = np.array([factor_noise(observation) for observation in observations]) if shared else _factors(observations)
    begin = (
        None if at is None else np.array([whiten_poses(*observation) for observation in zip(poses, L, at, strict=True)])
    )
    return Problem(tuple(observations), poses, L, laid, demands, inequalities, level, begin)


@remember
def _demands(assembly: Assembly, play_m: float) -> _Demands:
    """The demands on the contacts of an assembly whose parts fit with this play, [m]."""
    low, high = assembly.intervals(play_m).T
    exact = low == high
    plane = np.array(find_equation_pattern(assembly).plane)
    plane[:, 3] -= np.where(exact, low, 0.0)
    slack_m = fit_deviation(assembly, play_m)
    return _Demands(
        exact,
        bool(exact.all()),
        low,
        high,
        plane,
        slack_m if slack_m.any() else None,
        fit_covariance(assembly, play_m),
    )


def _factors(observations: Sequence[Observation]) -> Array:
    """L of observations with independent operations, (b, n, 6, 6)."""
    try:
        covariances = np.concatenate([observation.covariance for observation in observations])
        L = np.linalg.cholesky(covariances).reshape(len(observations), -1, 6, 6)
        if np.isfinite(L).all():
            return L
    except np.linalg.LinAlgError:
        pass
    return np.array([factor_covariance(observation.covariance) for observation in observations])


def seen_system(observation: Observation) -> CompactEquations:
    """The equations of every contact, with vertices projected at the observed poses."""
    return build_compact_equations(
        build_contact_equations(observation.assembly, observation.start, observation.poses), len(observation.poses)
    )
