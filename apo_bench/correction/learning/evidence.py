"""What the contacts of one observation tell of its noise: the errors in the directions that they fix.

At corrected goals contacts fix some directions of the body twists xi and leave the others free. In the fixed ones the
corrected goals are as good as the truth, so B xi, with the rows of B an orthonormal basis of them, is an error that is
known without the truth: Gaussian with covariance B S B^t if xi has the covariance S. An operation that is grossly wrong
tells nothing of S; without it, and without the contacts in which it has a part, fewer directions are fixed.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Observation, lowered_observation
from apo_bench.assembly.equations import equations
from apo_bench.assembly.pattern import pattern
from apo_bench.correction.solvers import RANK_CUT_OFF, compact_equations, fit_covariance
from apo_bench.geometry import Array, frozen, pose

UNITS = frozen(np.repeat([1e-3, np.radians(1.0)], 3))
"""(6,): the unit of body twists here, 1 mm and 1 deg."""


@final
@dataclass(frozen=True, eq=False)
class Reading:
    """The errors that are known if some operations are grossly wrong."""

    gross: frozenset[int]
    """These operations, counted from 0."""
    known: Array
    """(r,): B xi, in `UNITS`."""
    fixed: Array
    """(r, 6 n): B."""
    play: Array
    """(r, r): the covariance that the play of parts that fit adds."""


def readings(observation: Observation, goals: Array, sets: Iterable[Collection[int]]) -> tuple[Reading, ...]:
    """What is known of the errors of an observation, for each set of operations that may be grossly wrong.

    Args:
        goals: (n, 4, 4), corrected, consistent with every contact.
    """
    observation = lowered_observation(observation)
    n = len(goals)
    system = compact_equations(equations(observation.assembly, observation.start, goals), n)
    _, blocks = system.blocks(goals, np.broadcast_to(np.diag(UNITS), (n, 6, 6)))
    J = system.gathered(blocks).T
    xi = (pose.log(pose.inverse(goals) @ observation.goals) / UNITS).ravel()
    play = fit_covariance(observation.assembly, observation.play_m)
    operations = pattern(observation.assembly).letters - len(observation.assembly.solids)
    known = []
    for gross in sets:
        kept = np.repeat(~np.isin(operations, list(gross)).any(axis=1), 3)
        U, w, Vt = np.linalg.svd(J[kept], full_matrices=False)
        r = int(np.count_nonzero(w > RANK_CUT_OFF * w.max(initial=0.0))) if w.size and w[0] > 0.0 else 0
        by = U[:, :r] / w[:r]
        S = np.zeros((r, r)) if play is None else by.T @ play[np.ix_(kept, kept)] @ by
        known.append(Reading(frozenset(gross), Vt[:r] @ xi, Vt[:r], S))
    return tuple(known)
