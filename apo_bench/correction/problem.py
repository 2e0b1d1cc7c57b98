"""What observations of one assembly ask of the solver: equations, inequalities, noise; solved with some contacts.

The batch is the primitive: one observation is a batch of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, radians
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

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
from apo_bench.correction.solvers.compact import CompactEquations, compact_equations
from apo_bench.correction.solvers.gauss_newton import NearestGoals, batch_goals
from apo_bench.correction.solvers.inequalities import Inequalities, active_rank, bounded, nearest_between
from apo_bench.correction.solvers.kernels import Kernels, kernels
from apo_bench.correction.solvers.laid import Laid, laid_contacts
from apo_bench.correction.solvers.whitened import correction_to, noise_factor, scales
from apo_bench.correction.tailed import drawn_lengths, drawn_p_value
from apo_bench.geometry.arrays import Array, remembered

FAR_DEG = 45.0
"""A goal that is turned further is turned far. Of 320 corrections at 8 mm and degrees, over the eight scenarios, none
turned a goal by more than 33 degrees; every one that was longer than the truth, at 25 and 40, did by 56 or more."""
_FAR = 1.0 + 2.0 * cos(radians(FAR_DEG))
"""The trace of such a turn."""


class Solved(NamedTuple):
    """What some contacts ask of one observation."""

    goals: Array
    """(n, 4, 4)."""
    z: Array
    """(6 n,): the correction in standard deviations."""
    at_rest: bool
    finite: bool
    trace: Sequence[tuple[float, float]]
    """As of `NearestGoals`."""
    test: Consistency
    gaps: Array
    """(c,): the largest |e| of each contact at the goals, [m]; or how far an inequality is violated."""
    worst_m: float
    """The largest of those."""
    kept_m: float
    """The largest of contacts that were asked for."""
    away: bool
    """Whether faces of a contact do not look at each other there."""
    rank: int
    """Directions that the equations fix there."""
    covariance: Array | None
    """(n, 6, 6), of the body twists there, [m, rad]; None of very many operations."""
    far: bool
    """Whether a goal is turned so far that a local minimum is to be feared."""


class _Demands(NamedTuple):
    """What is asked of the c contacts of an assembly."""

    exact: NDArray[np.bool_]
    """(c,): contacts that are equations; the others are inequalities."""
    every: bool
    """Whether that is all of them."""
    low: Array
    """(c,), [m]: the least distance of each contact; so is `high` the largest."""
    high: Array
    plane: Array
    """(c, 4): planes shifted to where equations are asked to be."""
    slack_m: Array | None
    """(3 c,): the standard deviation of each equation that play of parts that fit leaves, [m]; None: nowhere any."""
    play: Array | None
    """(3 c, 3 c): the covariance of the equations that play causes, [m^2]; None: none."""


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
    demands: _Demands
    inequalities: tuple[Inequalities, ...]
    """Those of each observation; none if every contact is an equation."""
    level: float
    """The test fails if the p-value is below."""
    kernels: Kernels | None
    begin: Array | None = None
    """(b, 6 n): the correction that is begun with, in standard deviations; None stands for no correction."""

    @property
    def observation(self) -> Observation:
        """The only one."""
        return self.observations[0]

    @property
    def every(self) -> NDArray[np.bool_]:
        """All contacts, (c,)."""
        return np.ones(len(self.demands.exact), dtype=np.bool_)

    def only(self, i: int) -> Problem:
        """What one of the observations asks."""
        if len(self.observations) == 1:
            return self
        some = slice(i, i + 1)
        return replace(
            self,
            observations=self.observations[some],
            goals=self.goals[some],
            L=self.L[some],
            laid=self.laid.only(some),
            inequalities=self.inequalities[some],
            begin=None if self.begin is None else self.begin[some],
        )

    def solve(self, kept: NDArray[np.bool_]) -> list[Solved]:
        """The nearest goals of each observation by the contacts that are `kept`, (c,), and the test of the correction.

        Contacts that contradict each other have no nearest goals; those that share the contradiction out are returned.
        """
        chosen = kept & self.demands.exact
        found = self._nearest(chosen)
        chi_square, simple = self._lengths(chosen, found)
        if self.observation.tails is not None or not self.demands.exact[kept].all():
            simple[:] = False
        return [
            solved if easy and solved.kept_m <= one.gap_m else self.only(i)._in_full(kept, found.at(i).batch())
            for i, (one, easy, solved) in enumerate(
                zip(self.observations, simple.tolist(), self._solved(kept, found, chi_square.tolist()), strict=True)
            )
        ]

    def _solved(self, kept: NDArray[np.bool_], found: NearestGoals, chi_square: list[float]) -> list[Solved]:
        """What is to say of each of the nearest goals, given the squared lengths of corrections, (b,)."""
        gaps, away = self.measured(found.goals, found.forms if kept.all() and self.demands.every else None)
        worst_m = gaps.max(axis=1, initial=0.0).tolist()
        kept_m = worst_m if kept.all() else gaps[:, kept].max(axis=1, initial=0.0).tolist()
        averted = np.any(away, axis=1).tolist()
        far = turned_far(self.goals, found.goals).tolist()
        rank, free = projections(found.Jt)
        covariance = [None] * len(rank) if free is None else marginals(found.B, free)
        rest = found.at_rest.tolist()
        finite = found.finite.tolist()
        return [
            Solved(
                found.goals[i],
                found.z[i],
                rest[i],
                finite[i],
                found.trace[i],
                Consistency(chi_square[i], rank[i], p_value(chi_square[i], rank[i]), self.level),
                gaps[i],
                worst_m[i],
                kept_m[i],
                averted[i],
                rank[i],
                covariance[i],
                far[i],
            )
            for i in range(len(rank))
        ]

    def _in_full(self, kept: NDArray[np.bool_], found: NearestGoals) -> Solved:
        """The same of one observation whose contacts contradict each other, or that has walls or tails.

        Active inequalities count like equations: given which they are, the squared length is chi-square
        distributed with that many degrees of freedom more (Shapiro, "Towards a unified theory of inequality constrained
        testing", 1988), if they are active at the truth too, and shorter otherwise.
        """
        exact = self.demands.exact
        chosen = kept & exact
        chi_square, freedom = self._length(chosen, found)
        if found.finite[0] and largest(self.measured(found.goals)[0][:, chosen]) > self.observation.gap_m:
            found = self._nearest(chosen, np.hypot(self._slack(chosen), SOFT_M))
        elif found.finite[0] and not exact[kept].all():
            inequalities = self.inequalities[0].among(kept[~exact])
            start = found.at(0)
            held = nearest_between(self._among(chosen).only(0), inequalities, self.goals[0], self.L[0], start)
            chi_square += float(held.z @ held.z - start.z @ start.z)
            freedom += active_rank(start.Jt, inequalities, held)
            found = held.batch()
        (solved,) = self._solved(kept, found, [chi_square])
        return solved._replace(test=self._tested(chosen, found, chi_square, freedom))

    def suspects(self, kept: NDArray[np.bool_]) -> tuple[Suspect, ...]:
        """Relations whose contacts are `kept`, the most suspect first."""
        return suspects(self.observation.assembly, kept, self._test, lambda: self._pull(kept))

    def contact_suspects(self, kept: NDArray[np.bool_], relation: str) -> tuple[Suspect, ...]:
        """The contacts of one relation that are `kept`, the most suspect first."""
        return contact_suspects(self.observation.assembly, kept, self._test, relation)

    def without(self, dropped: tuple[str, ...]) -> NDArray[np.bool_]:
        """The contacts that are left without these relations or single contacts, (c,)."""
        return self.observation.assembly.without(dropped)

    def seen_gap_m(self) -> list[float]:
        """The largest |e| of all contacts at what was seen, [m], of each observation."""
        return self._gaps(self.goals, self.laid.forms).max(axis=1, initial=0.0).tolist()

    def measured(self, goals: Array, forms: Array | None = None) -> tuple[Array, NDArray[np.bool_]]:
        """The largest |e| of each contact, (b, c), [m], at goals (b, n, 4, 4), or how far an inequality is violated;
        and contacts whose faces do not look at each other, (b, c).

        Args:
            forms: (b, c, 4), n D_a^-1 D_b of each contact there, if that is known.
        """
        forms = self.laid.system.forms(goals) if forms is None else forms
        return self._gaps(goals, forms), self.laid.looking_away(forms)

    def _gaps(self, goals: Array, forms: Array) -> Array:
        gaps = self.laid.gaps(forms)
        for own, wall, at in zip(gaps, self.inequalities, goals, strict=False):
            own[~self.demands.exact] = wall.overstepped(at)
        return gaps

    def _test(self, kept: NDArray[np.bool_]) -> Consistency:
        """The test of one observation."""
        if not self.demands.exact[kept].all():
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
            return np.square(found.z).sum(axis=1), holds & (
                self.demands.slack_m is None or not self._slack(chosen).any()
            )
        Jt = found.Jt if isinstance(found.Jt, np.ndarray) else found.Jt[0].toarray()[None]
        return softened_length(found.z, Jt, S), holds

    def _play(self, chosen: NDArray[np.bool_]) -> Array | None:
        """The covariance of the equations of the contacts that are chosen, (c,), that play causes, [m^2]."""
        S = self.demands.play
        if S is None or chosen.all():
            return S
        rows = np.repeat(chosen, 3)
        return S[np.ix_(rows, rows)]

    def _slack(self, chosen: NDArray[np.bool_]) -> Array:
        """The standard deviation of each of their equations that play of parts that fit leaves, [m]."""
        slack_m = self.demands.slack_m
        return np.zeros(3 * np.count_nonzero(chosen)) if slack_m is None else slack_m[np.repeat(chosen, 3)]

    def _among(self, chosen: NDArray[np.bool_]) -> CompactEquations:
        return self.laid.system if chosen.all() else self.laid.system.among(chosen)

    def _nearest(self, chosen: NDArray[np.bool_], soft_m: Array | None = None) -> NearestGoals:
        """The nearest goals by some of the equations, demanded or given a standard deviation each, [m]."""
        return batch_goals(self._among(chosen), self.goals, self.L, soft_m, self.begin, self.kernels)

    def _pull(self, kept: NDArray[np.bool_]) -> Array:
        """How hard each contact pulls at the goals, (c,), by the multipliers of its equations."""
        chosen = kept & self.demands.exact
        soft = np.hypot(self._slack(chosen), SOFT_M)
        pull = np.zeros((len(chosen), 3))
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
    goals = np.concatenate([one.goals for one in observations]).reshape(len(observations), -1, 4, 4)
    start = np.array([first.start[part] for part in assembly.solids]).reshape(-1, 4, 4)
    demands = _demands(assembly, first.play_m)
    by = kernels() if compiled else None
    there = goals if at is None else at
    laid = laid_contacts(assembly, start, demands.plane, there)
    inequalities = tuple[Inequalities, ...]()
    if not demands.every:
        systems = (equations(assembly, first.start, T) for T in there)
        inequalities = tuple(bounded(system, demands.exact, demands.low, demands.high) for system in systems)
    L = np.array([noise_factor(one) for one in observations]) if shared else _factors(observations)
    begin = None if at is None else np.array([correction_to(*one) for one in zip(goals, L, at, strict=True)])
    return Problem(tuple(observations), goals, L, laid, demands, inequalities, level, by, begin)


def turned_far(observed: Array, goals: Array) -> NDArray[np.bool_]:
    """Whether a correction turns a goal so far that a local minimum is to be feared: (b, n, 4, 4) -> (b,)."""
    traces = np.einsum("bnij,bnij->bn", observed[:, :, :3, :3], goals[:, :, :3, :3])
    return np.asarray(traces.min(axis=1, initial=3.0) < _FAR)


@remembered
def _demands(assembly: Assembly, play_m: float) -> _Demands:
    """What is asked of the contacts of an assembly whose parts fit with this play, [m]."""
    low, high = assembly.intervals(play_m).T
    exact = low == high
    plane = np.array(pattern(assembly).plane)
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
        covariances = np.concatenate([one.covariance for one in observations])
        L = np.linalg.cholesky(covariances).reshape(len(observations), -1, 6, 6)
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
