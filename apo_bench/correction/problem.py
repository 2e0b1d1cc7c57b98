"""What observations of one assembly ask of the solver: equations, inequalities, noise; solved with some contacts.

The batch is the primitive: one observation is a batch of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from apo_bench.assembly.correction_record import Consistency, Suspect
from apo_bench.assembly.equations import equations, largest, pattern
from apo_bench.assembly.goals import Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.correction.consistency import (
    SOFT_M,
    TEST_LEVEL,
    contact_suspects,
    fit_deviation,
    p_value,
    softened_length,
    suspects,
)
from apo_bench.correction.play import fit_covariance
from apo_bench.correction.posterior import jacobian_rank, marginals, projections
from apo_bench.correction.solvers.compact import CompactEquations, Laid, compact_equations, laid_contacts
from apo_bench.correction.solvers.gauss_newton import NearestGoals, batch_goals
from apo_bench.correction.solvers.inequalities import Inequalities, active_rank, bounded, nearest_between
from apo_bench.correction.solvers.whitened import correction_to, noise_factor, scales
from apo_bench.correction.tailed import drawn_lengths, drawn_p_value
from apo_bench.geometry.arrays import Array, frozen, remembered


class Solved(NamedTuple):
    """What some contacts ask of one observation."""

    found: NearestGoals
    test: Consistency
    gaps: Array
    """(c,): the largest |e| of each contact at the goals that were found, [m]; or how far an inequality is violated."""
    away: NDArray[np.bool_]
    """(c,): contacts whose faces do not look at each other there."""
    rank: int
    """Directions that the equations fix there."""
    covariance: Array | None
    """(n, 6, 6), of the body twists there, [m, rad]; None of very many operations."""


@final
@dataclass(frozen=True, eq=False)
class Problem:
    """b observations of one assembly, with the same start poses and play, and what is asked of its c contacts."""

    observations: tuple[Observation, ...]
    goals: Array
    """(b, n, 4, 4), what was seen."""
    L: Array
    """(b, n, 6, 6), or (b, n, 6, 6 n) where operations share errors."""
    laid: Laid
    """The equations of every contact, planes shifted to where they are asked to be."""
    exact: NDArray[np.bool_]
    """(c,): contacts that are equations; the others are inequalities."""
    inequalities: tuple[Inequalities, ...]
    """Those of each observation; none if every contact is an equation."""
    level: float
    """The test fails if the p-value is below."""
    compiled: bool
    begin: Array | None = None
    """(b, 6 n): the correction that is begun with, in standard deviations; None stands for no correction."""

    @property
    def observation(self) -> Observation:
        """The only one."""
        return self.observations[0]

    @property
    def compact(self) -> CompactEquations:
        """The equations of every contact, each observation with points of its own."""
        return self.laid.system

    def only(self, i: int) -> Problem:
        """What one of the observations asks."""
        if len(self.observations) == 1:
            return self
        some = slice(i, i + 1)
        system = replace(self.compact, points=self.compact.points[some])
        return replace(
            self,
            observations=self.observations[some],
            goals=self.goals[some],
            L=self.L[some],
            laid=replace(self.laid, system=system, vertex=self.laid.vertex[some], forms=self.laid.forms[some]),
            inequalities=self.inequalities[some],
            begin=None if self.begin is None else self.begin[some],
        )

    def solve(self, kept: NDArray[np.bool_]) -> list[Solved]:
        """The nearest goals of each observation by the contacts that are `kept`, (c,), and the test of the correction.

        Contacts that contradict each other have no nearest goals; those that share the contradiction out are returned.
        """
        chosen = kept & self.exact
        found = self._nearest(chosen)
        gaps, away = self.measured(found.goals)
        rank, free = projections(found.Jt)
        covariance = [None] * len(rank) if free is None else marginals(found.B, free)
        chi_square, simple = self._lengths(chosen, found)
        p = np.where(rank > 0, chdtrc(np.maximum(rank, 1), chi_square), 1.0)
        simple &= gaps[:, chosen].max(axis=1, initial=0.0) <= [one.gap_m for one in self.observations]
        simple &= self.observation.tails is None and bool(self.exact[kept].all())
        numbers = zip(*(x.tolist() for x in (chi_square, rank, p, simple)), strict=True)
        return [
            Solved(found.at(i), Consistency(square, freedom, p, self.level), gaps[i], away[i], freedom, covariance[i])
            if easy
            else self.only(i)._in_full(kept, found.at(i).batch())
            for i, (square, freedom, p, easy) in enumerate(numbers)
        ]

    def _in_full(self, kept: NDArray[np.bool_], found: NearestGoals) -> Solved:
        """The same of one observation whose contacts contradict each other, or that has walls or tails.

        Active inequalities count like equations: given which they are, the squared length is chi-square
        distributed with that many degrees of freedom more (Shapiro, "Towards a unified theory of inequality constrained
        testing", 1988), if they are active at the truth too, and shorter otherwise.
        """
        chosen = kept & self.exact
        chi_square, freedom = self._length(chosen, found)
        if found.finite[0] and largest(self.gaps(found.goals)[:, chosen]) > self.observation.gap_m:
            found = self._nearest(chosen, np.hypot(self._slack(chosen), SOFT_M))
        elif found.finite[0] and not self.exact[kept].all():
            inequalities = self.inequalities[0].among(kept[~self.exact])
            start = found.at(0)
            held = nearest_between(self._among(chosen).only(0), inequalities, self.goals[0], self.L[0], start)
            chi_square += float(held.z @ held.z - start.z @ start.z)
            freedom += active_rank(start.Jt, inequalities, held)
            found = held.batch()
        gaps, away = self.measured(found.goals)
        rank, free = projections(found.Jt)
        covariance = None if free is None else marginals(found.B, free)[0]
        return Solved(
            found.at(0), self._tested(chosen, found, chi_square, freedom), gaps[0], away[0], int(rank[0]), covariance
        )

    def suspects(self, kept: NDArray[np.bool_]) -> tuple[Suspect, ...]:
        """Relations whose contacts are `kept`, the most suspect first."""
        return suspects(self.observation.assembly, kept, self._test, lambda: self._pull(kept))

    def contact_suspects(self, kept: NDArray[np.bool_], relation: str) -> tuple[Suspect, ...]:
        """The contacts of one relation that are `kept`, the most suspect first."""
        return contact_suspects(self.observation.assembly, kept, self._test, relation)

    def without(self, dropped: tuple[str, ...]) -> NDArray[np.bool_]:
        """The contacts that are left without these relations or single contacts, (c,)."""
        return self.observation.assembly.without(dropped)

    def gaps(self, goals: Array) -> Array:
        """The largest |e| of each contact, (b, c), [m], at (b, n, 4, 4); or how far an inequality is violated."""
        return self.measured(goals)[0]

    def measured(self, goals: Array | None) -> tuple[Array, NDArray[np.bool_]]:
        """The same, and contacts whose faces do not look at each other, (b, c); None stands for what was seen."""
        forms = self.laid.forms if goals is None else self.laid.forms_at(goals)
        gaps = self.laid.gaps(forms)
        for own, wall, at in zip(gaps, self.inequalities, self.goals if goals is None else goals, strict=False):
            own[~self.exact] = wall.overstepped(at)
        return gaps, self.laid.looking_away(forms)

    def _test(self, kept: NDArray[np.bool_]) -> Consistency:
        """The test of one observation."""
        if not self.exact[kept].all():
            return self.solve(kept)[0].test
        found = self._nearest(kept)
        return self._tested(kept, found, *self._length(kept, found))

    def _tested(self, chosen: NDArray[np.bool_], found: NearestGoals, chi_square: float, freedom: int) -> Consistency:
        """The test of one squared length: by the chi-square distribution, or by draws where errors have tails."""
        p = p_value(chi_square, freedom)
        tails = self.observation.tails
        if tails is not None and freedom and np.isfinite(chi_square) and isinstance(found.Jt, np.ndarray):
            p = drawn_p_value(drawn_lengths(self.observation, self.L[0], found.Jt[0], self._play(chosen)), chi_square)
        return Consistency(chi_square, freedom, p, self.level)

    def _length(self, chosen: NDArray[np.bool_], found: NearestGoals) -> tuple[float, int]:
        """The squared length of one correction, of contradictory contacts with what is left of them, and its degrees
        of freedom.
        """
        freedom = jacobian_rank(found.Jt[0])
        if not found.finite[0]:
            return np.inf, freedom
        (square,), (simple,) = self._lengths(chosen, found)
        if simple:
            return float(square), freedom
        slack_m = self._slack(chosen)
        soft = slack_m if found.at_rest[0] and largest(found.e) <= SOFT_M else np.hypot(slack_m, SOFT_M)
        relaxed = self._nearest(chosen, soft)
        asked = soft > 0.0
        over = relaxed.e[0, asked] / soft[asked]
        return float(relaxed.z[0] @ relaxed.z[0] + over @ over), freedom

    def _lengths(self, chosen: NDArray[np.bool_], found: NearestGoals) -> tuple[Array, NDArray[np.bool_]]:
        """Squared lengths of corrections, (b,), and whether that is what the test asks for: contacts hold, (b,)."""
        S = self._play(chosen)
        holds = found.finite & found.at_rest & (np.abs(found.e).max(axis=1, initial=0.0) <= SOFT_M)
        if S is None:
            return np.square(found.z).sum(axis=1), holds & (not self._slack(chosen).any())
        Jt = found.Jt if isinstance(found.Jt, np.ndarray) else found.Jt[0].toarray()[None]
        return softened_length(found.z, Jt, S), holds

    def _play(self, chosen: NDArray[np.bool_]) -> Array | None:
        """The covariance of the equations of the contacts that are chosen, (c,), that play causes, [m^2]."""
        S = fit_covariance(self.observation.assembly, self.observation.play_m)
        if S is None or chosen.all():
            return S
        rows = np.repeat(chosen, 3)
        return S[np.ix_(rows, rows)]

    def _slack(self, chosen: NDArray[np.bool_]) -> Array:
        """The standard deviation of each of their equations that play of parts that fit leaves, [m]."""
        return fit_deviation(self.observation.assembly, self.observation.play_m)[np.repeat(chosen, 3)]

    def _among(self, chosen: NDArray[np.bool_]) -> CompactEquations:
        return self.compact if chosen.all() else self.compact.among(chosen)

    def _nearest(self, chosen: NDArray[np.bool_], soft_m: Array | None = None) -> NearestGoals:
        """The nearest goals by some of the equations, demanded or given a standard deviation each, [m]."""
        return batch_goals(self._among(chosen), self.goals, self.L, soft_m, self.begin, self.compiled)

    def _pull(self, kept: NDArray[np.bool_]) -> Array:
        """How hard each contact pulls at the goals, (c,), by the multipliers of its equations."""
        chosen = kept & self.exact
        soft = np.hypot(self._slack(chosen), SOFT_M)
        pull = np.zeros((len(self.compact), 3))
        pull[chosen] = (self._nearest(chosen, soft).e[0] / soft).reshape(-1, 3)
        return np.asarray((pull * pull).sum(axis=1))


def problem(
    observations: Sequence[Observation], level: float = TEST_LEVEL, compiled: bool = False, at: Array | None = None
) -> Problem:
    """What observations of one assembly with flat faces ask, with the same start poses and play.

    Args:
        level: The test fails if the p-value is below.
        compiled: Whether kernels are used where Numba is installed.
        at: Goals, (b, n, 4, 4), at which vertices are laid onto the other face of their contact and which the solver
            begins with; None stands for those that were seen.

    Raises:
        InputError: A covariance is not positive definite; several operations share errors.
    """
    first = observations[0]
    assembly = first.assembly
    shared = any(one.shared for one in observations)
    goals = np.array([one.goals for one in observations])
    start = np.array([first.start[part] for part in assembly.solids]).reshape(-1, 4, 4)
    exact, low, high, plane = _demands(assembly, first.play_m)
    there = goals if at is None else at
    laid = laid_contacts(assembly, start, plane, there)
    inequalities = tuple[Inequalities, ...]()
    if not exact.all():
        systems = (equations(assembly, first.start, T) for T in there)
        inequalities = tuple(bounded(system, exact, low, high) for system in systems)
    L = np.array([noise_factor(one) for one in observations]) if shared else _factors(observations)
    begin = None if at is None else np.array([correction_to(*one) for one in zip(goals, L, at, strict=True)])
    return Problem(tuple(observations), goals, L, laid, exact, inequalities, level, compiled, begin)


@remembered
def _demands(assembly: Assembly, play_m: float) -> tuple[NDArray[np.bool_], Array, Array, Array]:
    """Which contacts are equations, (c,), their least and largest distances, (c,), [m], and their planes, (c, 4), where
    equations are asked to be.
    """
    low, high = assembly.intervals(play_m).T
    exact = low == high
    plane = np.array(pattern(assembly).plane)
    plane[:, 3] -= np.where(exact, low, 0.0)
    return exact, low, high, frozen(plane)


def _factors(observations: Sequence[Observation]) -> Array:
    """L of observations whose operations err each by itself, (b, n, 6, 6)."""
    try:
        L = np.linalg.cholesky(np.array([one.covariance for one in observations]))
        if np.isfinite(L).all():
            return L
    except np.linalg.LinAlgError:
        pass
    return np.array([scales(one.covariance) for one in observations])


def seen_system(observation: Observation) -> CompactEquations:
    """The equations of every contact, each vertex where it was seen."""
    return compact_equations(
        equations(observation.assembly, observation.start, observation.goals), len(observation.goals)
    )
