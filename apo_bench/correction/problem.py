"""What one observation asks of a solver: equations, inequalities, noise; solved with all contacts or some."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.correction_record import Consistency, Suspect
from apo_bench.assembly.equations import Equations, equations, largest
from apo_bench.assembly.goals import Observation
from apo_bench.correction.consistency import (
    SOFT_M,
    TEST_LEVEL,
    contact_suspects,
    correction_length,
    fit_deviation,
    p_value,
    suspects,
)
from apo_bench.correction.play import fit_covariance
from apo_bench.correction.solvers.compact import CompactEquations, compact_assembly, compact_equations
from apo_bench.correction.solvers.inequalities import Inequalities, active_rank, demanded, nearest_between, violations
from apo_bench.correction.solvers.manifold import NearestGoals, nearest_goals
from apo_bench.correction.solvers.whitened import correction_to, noise_factor
from apo_bench.correction.tailed import drawn_lengths, drawn_p_value
from apo_bench.geometry.arrays import Array

Solver = Callable[[CompactEquations, Array, Array, Array | None], NearestGoals]
"""(equations, goals seen, L, soft_m) -> nearest goals; `manifold.nearest_goals` and what does the same."""


class Solved(NamedTuple):
    """What some contacts ask for."""

    found: NearestGoals
    test: Consistency
    gaps: Array
    """(c,): the largest |e| of each contact at the goals that were found, [m]; or how far an inequality is violated."""


@final
@dataclass(frozen=True, eq=False)
class Problem:
    """One observation with what is asked of its c contacts."""

    observation: Observation
    system: Equations
    """The equations of every contact, planes shifted to where they are asked to be."""
    compact: CompactEquations
    """The equations of `system` in compact form, three per contact."""
    exact: NDArray[np.bool_]
    """(c,): contacts that are equations; the others are inequalities."""
    inequalities: Inequalities
    L: Array
    """(n, 6, 6), or (n, 6, 6 n) where operations share errors."""
    slack_m: Array
    """(3 c,): what the play of parts that fit leaves, for the test."""
    correlated: Array | None
    """(3 c, 3 c), as of `fit_covariance`."""
    solver: Solver
    begin: Array | None = None
    """(6 n,): the correction that is begun with, in standard deviations; None stands for no correction."""

    def solve(self, kept: NDArray[np.bool_], found: NearestGoals | None = None) -> Solved:
        """The nearest goals by the contacts that are `kept`, (c,), and the test of their correction.

        Active inequalities count like equations: given which they are, the squared length is chi-square
        distributed with that many degrees of freedom more (Shapiro, "Towards a unified theory of inequality constrained
        testing", 1988), if they are active at the truth too, and shorter otherwise.

        Contacts that contradict each other have no nearest goals; those that share the contradiction out are returned.

        Args:
            found: The nearest goals without inequalities, if they are known already.
        """
        chosen = kept & self.exact
        part, slack_m = self._equal(chosen)
        found = self._nearest(part) if found is None else found
        gaps = self.gaps(found.goals)
        chi_square, freedom, shared = self._length(chosen, found)
        if found.finite and largest(gaps[chosen]) > self.observation.gap_m:
            found = shared or self._nearest(part, np.hypot(slack_m, SOFT_M))
            gaps = self.gaps(found.goals)
        elif found.finite and kept[~self.exact].any():
            inequalities = self.inequalities.among(kept[~self.exact])
            held = nearest_between(part, inequalities, self.observation.goals, self.L, found)
            touched = active_rank(found.Jt, inequalities, held)
            chi_square += float(held.z @ held.z - found.z @ found.z)
            found, freedom, gaps = held, freedom + touched, self.gaps(held.goals)
        return Solved(found, self._tested(chosen, found, chi_square, freedom), gaps)

    def suspects(self, kept: NDArray[np.bool_]) -> tuple[Suspect, ...]:
        """Relations whose contacts are `kept`, the most suspect first."""
        return suspects(self.observation.assembly, kept, self._test, lambda: self._pull(kept))

    def contact_suspects(self, kept: NDArray[np.bool_], relation: str) -> tuple[Suspect, ...]:
        """The contacts of one relation that are `kept`, the most suspect first."""
        return contact_suspects(self.observation.assembly, kept, self._test, relation)

    def _test(self, kept: NDArray[np.bool_]) -> Consistency:
        if kept[~self.exact].any():
            return self.solve(kept).test
        chosen = kept & self.exact
        found = self._nearest(self._equal(chosen)[0])
        chi_square, freedom, _ = self._length(chosen, found)
        return self._tested(chosen, found, chi_square, freedom)

    def _tested(self, chosen: NDArray[np.bool_], found: NearestGoals, chi_square: float, freedom: int) -> Consistency:
        """The test of a squared length: by the chi-square distribution, or by draws where errors have tails."""
        p, Jt = p_value(chi_square, freedom), found.Jt
        if self.observation.tails is not None and freedom and np.isfinite(chi_square) and isinstance(Jt, np.ndarray):
            p = drawn_p_value(drawn_lengths(self.observation, self.L, Jt, self._play(chosen)), chi_square)
        return Consistency(chi_square, freedom, p, TEST_LEVEL)

    def _play(self, chosen: NDArray[np.bool_]) -> Array | None:
        """The covariance of the equations of the contacts that are chosen, (c,), that play causes, [m^2]."""
        rows, S = np.repeat(chosen, 3), self.correlated
        return S if S is None or chosen.all() else S[np.ix_(rows, rows)]

    def _nearest(self, part: CompactEquations, soft_m: Array | None = None) -> NearestGoals:
        """The nearest goals by some of the equations, demanded or given a standard deviation each, [m]."""
        if self.begin is None:
            return self.solver(part, self.observation.goals, self.L, soft_m)
        return nearest_goals(part, self.observation.goals, self.L, soft_m, self.begin)

    def _length(self, chosen: NDArray[np.bool_], found: NearestGoals) -> tuple[float, int, NearestGoals | None]:
        """As `correction_length`, by the contacts that are chosen, (c,)."""
        part, slack_m = self._equal(chosen)
        S = self._play(chosen)
        return correction_length(found, slack_m, S, lambda soft_m: self._nearest(part, soft_m))

    def _equal(self, chosen: NDArray[np.bool_]) -> tuple[CompactEquations, Array]:
        """The equations of the contacts that are chosen, (c,), and the slack of each, [m]."""
        return self.compact if chosen.all() else self.compact.among(chosen), self.slack_m[np.repeat(chosen, 3)]

    def _pull(self, kept: NDArray[np.bool_]) -> Array:
        """How hard each contact pulls at the goals, (c,), by the multipliers of its equations."""
        chosen = kept & self.exact
        soft = np.hypot(self.slack_m, SOFT_M)[np.repeat(chosen, 3)]
        pull = np.zeros((len(self.compact), 3))
        relaxed = self._nearest(self.compact.among(chosen), soft)
        pull[chosen] = (relaxed.e / soft).reshape(-1, 3)
        return np.asarray((pull * pull).sum(axis=1))

    def without(self, dropped: tuple[str, ...]) -> NDArray[np.bool_]:
        """The contacts that are left without these relations or single contacts, (c,)."""
        return self.observation.assembly.without(dropped)

    def gaps(self, goals: Array) -> Array:
        """The largest |e| of each contact, (c,), [m]; or how far an inequality is violated."""
        return violations(self.system, self.exact, self.inequalities, goals)


def problem(observation: Observation, solver: Solver, at: Array | None = None) -> Problem:
    """What an observation asks.

    Args:
        at: Goals, (n, 4, 4), at which vertices are laid onto the other face of their contact and which solvers begin
            with; None stands for those that were seen.

    Raises:
        InputError: A covariance is not positive definite.
    """
    L = noise_factor(observation)
    plain = equations(observation.assembly, observation.start, observation.goals if at is None else at)
    system, exact, inequalities = demanded(plain, observation.assembly, observation.play_m)
    every = compact_assembly(observation.assembly, system)
    slack_m = fit_deviation(observation.assembly, observation.play_m)
    begin = None if at is None else correction_to(observation.goals, L, at)
    correlated = fit_covariance(observation.assembly, observation.play_m)
    return Problem(observation, system, every, exact, inequalities, L, slack_m, correlated, solver, begin)


def seen_system(observation: Observation) -> CompactEquations:
    """The equations of every contact, each vertex where it was seen."""
    return compact_equations(
        equations(observation.assembly, observation.start, observation.goals), len(observation.goals)
    )
