"""What a batch of observations of one assembly asks of the solver: equations, inequalities, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Observation, build_contact_equations, find_contact_pattern
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
    """What is asked of the c contacts of an assembly."""

    exact: NDArray[np.bool_]
    """(c,): contacts that are equations; the others are inequalities."""
    all_exact: bool
    """Whether all of them are equations."""
    low: Array
    """(c,), [m]: the least distance of each contact; so is `high` the largest."""
    high: Array
    plane: Array
    """(c, 4): planes shifted to where equations are asked to be."""
    slack_m: Array | None
    """(3 c,): the standard deviation of each equation that play of parts that fit leaves, [m]; None: nowhere any."""
    play_covariance: Array | None
    """(3 c, 3 c): the covariance of the equations that play causes, [m^2]; None: none."""


@final
@dataclass(frozen=True, eq=False)
class Problem:
    """b observations of one assembly, with the same start poses and play, and what is asked of its c contacts."""

    observations: tuple[Observation, ...]
    poses: Array
    """(b, n, 4, 4), what was observed."""
    L: Array
    """(b, n, 6, 6), or (b, n, 6, 6 n) where operations share errors."""
    laid: ProjectedContacts
    """The equations of every contact, planes shifted to where they are asked to be."""
    demands: _Demands
    inequalities: tuple[Inequalities, ...]
    """Those of each observation; none if every contact is an equation."""
    level: float
    """The test fails if the p-value is below."""
    begin: Array | None = None
    """(b, 6 n): the correction that is begun with, in standard deviations; None stands for no correction."""

    @property
    def observation(self) -> Observation:
        """The first of a batch; of a batch of one, the only one.

        Of larger batches only what all have in common is read off it: `ContactCorrector.together` makes batches of one
        where observations state tails or shared errors.
        """
        return self.observations[0]

    @property
    def all_contacts(self) -> NDArray[np.bool_]:
        """The choice of all contacts, (c,): true throughout."""
        return np.ones(len(self.demands.exact), dtype=np.bool_)

    def only(self, i: int) -> Problem:
        """What one of the observations asks."""
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
        """The contacts that are left without these relations or single contacts, (c,)."""
        return self.observation.assembly.without(dropped)

    def seen_gap_m(self) -> list[float]:
        """The largest |e| of all contacts at what was observed, [m], of each observation."""
        return self.gaps(self.poses, self.laid.forms).max(axis=1, initial=0.0).tolist()

    def gaps(self, poses: Array, forms: Array | None = None) -> Array:
        """The largest |e| of each contact, (b, c), [m], at poses (b, n, 4, 4), or how far an inequality is violated.

        Args:
            forms: (b, c, 4), n D_a^-1 D_b of each contact there, if that is known.
        """
        gaps = self.laid.gaps(self.laid.system.forms(poses) if forms is None else forms)
        for own, wall, at in zip(gaps, self.inequalities, poses, strict=False):
            own[~self.demands.exact] = wall.overstepped(at)
        return gaps

    def play_covariance(self, chosen: NDArray[np.bool_]) -> Array | None:
        """The covariance of the equations of the contacts that are chosen, (c,), that play causes, [m^2]."""
        S = self.demands.play_covariance
        if S is None or chosen.all():
            return S
        rows = np.repeat(chosen, 3)
        return S[np.ix_(rows, rows)]

    def slack(self, chosen: NDArray[np.bool_]) -> Array:
        """The standard deviation of each of their equations that play of parts that fit leaves, [m]."""
        slack_m = self.demands.slack_m
        return np.zeros(3 * np.count_nonzero(chosen)) if slack_m is None else slack_m[np.repeat(chosen, 3)]

    def among(self, chosen: NDArray[np.bool_]) -> CompactEquations:
        """The equations of the contacts that are chosen, (c,)."""
        return self.laid.system if chosen.all() else self.laid.system.among(chosen)

    def nearest(self, chosen: NDArray[np.bool_], soft_m: Array | None = None) -> NearestPoses:
        """The nearest poses by some of the equations, demanded or given a standard deviation each, [m]."""
        return solve_batch(self.among(chosen), self.poses, self.L, soft_m, self.begin)

    @property
    def is_plain(self) -> bool:
        """Whether matrices are small, contacts equations without play, and errors Gaussian, of each operation alone."""
        demands = self.demands
        gaussian = self.observation.tails is None and not self.observation.shared
        equations = demands.all_exact and demands.slack_m is None and demands.play_covariance is None
        return gaussian and equations and 6 * self.laid.system.n <= LARGEST_DENSE

    def nearest_by_each(self, choices: NDArray[np.bool_]) -> NearestPoses:
        """The nearest poses of one observation by each of the choices of contacts, (k, c), as a batch of k."""
        k = len(choices)
        # The points of a contact that is left out are zero, and so are its equations.
        system = replace(self.laid.system, points=self.laid.system.points[:1] * choices[:, :, None, None])
        begin = None if self.begin is None else np.tile(self.begin[:1], (k, 1))
        poses, L = (np.tile(x[:1], (k, *[1] * (x.ndim - 1))) for x in (self.poses, self.L))
        return solve_batch(system, poses, L, None, begin)


def problem_of(observations: Sequence[Observation], level: float = TEST_LEVEL, at: Array | None = None) -> Problem:
    """What observations of one assembly with flat faces ask, with the same start poses and play.

    Args:
        level: The test fails if the p-value is below.
        at: Poses, (b, n, 4, 4), at which vertices are laid onto the other face of their contact and which the solver
            begins with; None stands for those that were observed.

    Raises:
        InputError: A covariance is not positive definite; several operations share errors.
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
    """What is asked of the contacts of an assembly whose parts fit with this play, [m]."""
    low, high = assembly.intervals(play_m).T
    exact = low == high
    plane = np.array(find_contact_pattern(assembly).plane)
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
    """L of observations whose operations err each by itself, (b, n, 6, 6)."""
    try:
        covariances = np.concatenate([observation.covariance for observation in observations])
        L = np.linalg.cholesky(covariances).reshape(len(observations), -1, 6, 6)
        if np.isfinite(L).all():
            return L
    except np.linalg.LinAlgError:
        pass
    return np.array([factor_covariance(observation.covariance) for observation in observations])


def seen_system(observation: Observation) -> CompactEquations:
    """The equations of every contact, each vertex where it was observed."""
    return build_compact_equations(
        build_contact_equations(observation.assembly, observation.start, observation.poses), len(observation.poses)
    )
