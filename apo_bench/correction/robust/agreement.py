"""Cheap scores of hypotheses without solving them: contacts are linearised once, at the assumed poses."""

from collections.abc import Sequence
from dataclasses import replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Observation, find_equation_pattern
from apo_bench.correction.checks.chi_square import p_value
from apo_bench.correction.contact.problem import seen_system
from apo_bench.correction.robust.beliefs import ROOM, States
from apo_bench.correction.robust.hypotheses import (
    Case,
    assumed_observation,
    prior_surprise,
    soft_deviation,
    soften,
    untrusted_operations,
)
from apo_bench.correction.solvers import compute_jacobian_rank, factor_noise, linearise_by

_LEVER_M = 0.1
"""Lever arm of the second-order error: a rotation by an angle a moves points about a^2 times this beyond linear,
[m]."""


def expected_badness(case: Case, states: States, dropped: tuple[str, ...], assumed: Observation) -> float:
    """Estimate `SolvedHypothesis.badness` of a hypothesis, in case it has a solution.

    Args:
        states: The assumed state of each operation.
        dropped: Relations assumed to be wrong.
        assumed: The `assumed_observation` of the states.
    """
    left_out = untrusted_operations(states)
    wide = np.array(assumed.covariance)
    wide[list(left_out)] = ROOM
    e, Jt = linearise_by(seen_system(assumed), assumed.poses, factor_noise(replace(assumed, covariance=wide)))
    _, soft = soften(assumed, dropped)
    # -2 log of the density of e, Gaussian with covariance S = J J^t + soft^2; what is not linear is no contradiction.
    S = Jt.T @ Jt + np.diag(soft * soft)
    beyond = _beyond_linear(assumed, left_out)
    square = e @ np.linalg.solve(S + beyond * beyond * np.eye(len(e)), e)
    return float(square + np.linalg.slogdet(S)[1]) + prior_surprise(case, states, dropped)


def _beyond_linear(assumed: Observation, unknown: Sequence[int]) -> float:
    """How far points may move beyond the linear model if parts are rotated by their noise, [m].

    Args:
        unknown: Operations whose poses are inferred; they do not count.
    """
    known = np.delete(assumed.covariance, unknown, axis=0)
    turned = np.sqrt(np.trace(known[:, 3:, 3:], axis1=1, axis2=2).max(initial=0.0))
    return float(turned * turned * _LEVER_M)


@final
class ContactAgreement:
    """Tests how well the contacts agree that do not depend on some operations, linearised once at the assumed poses."""

    def __init__(self, case: Case, states: States) -> None:
        seen = assumed_observation(case, states)
        self._unknown = untrusted_operations(states)
        system = seen_system(seen)
        self._e, self._Jt = linearise_by(system, seen.poses, factor_noise(seen))
        # A turn by an angle a moves points by a^2 beyond what is linear: that much is no contradiction.
        soft = np.hypot(soft_deviation(seen), _beyond_linear(seen, self._unknown))
        self._S = self._Jt.T @ self._Jt + np.diag(soft * soft)
        letters = find_equation_pattern(seen.assembly).letters - len(seen.assembly.solids)
        c = len(system)
        self._uses = (letters[..., None] == np.arange(len(seen.poses))).any(axis=1)
        # e^t S^-1 e of every contact by itself: a lower bound of what any set with it leaves.
        each = self._e.reshape(c, 3, 1), self._S.reshape(c, 3, c, 3)[np.arange(c), :, np.arange(c)]
        self._alone = (each[0] * np.linalg.solve(each[1], each[0])).sum(axis=(1, 2))

    def agreement(self, left_out: Sequence[int], contacts: Sequence[int] = ()) -> float:
        """The p-value of the test of the remaining contacts.

        Args:
            left_out: Operations; contacts that depend on one of them are left out.
            contacts: Contacts to leave out too, numbers in `relations()`.
        """
        kept = self._kept(left_out, contacts)
        if p_value(self._alone[kept].max(initial=0.0), 3 * len(kept)) == 0.0:
            return 0.0
        rows = np.repeat(kept, 3)
        return p_value(self._square(rows), compute_jacobian_rank(self._Jt[:, rows]))

    def disagreement(self) -> float:
        """The squared length of the residuals of contacts that depend on no inferred operation, in standard
        deviations.
        """
        return self._square(np.repeat(self._kept((), ()), 3))

    def _kept(self, left_out: Sequence[int], contacts: Sequence[int]) -> NDArray[np.bool_]:
        """Which contacts remain, (c,): not in `contacts`, and dependent on no operation that is left out or
        inferred.
        """
        kept = ~self._uses[:, [*left_out, *self._unknown]].any(axis=1)
        kept[list(contacts)] = False
        return np.asarray(kept)

    def _square(self, rows: NDArray[np.bool_]) -> float:
        """The squared length of the residuals of some equations, (3 c,) booleans, in standard deviations."""
        e = self._e[rows]
        return float(e @ np.linalg.solve(self._S[np.ix_(rows, rows)], e))
