"""The corrector of the paper, all at once: the whole graph after the whole demonstration (Section 3.3).

The corrector of the paper with one thing taken away, to see what it is worth.
"""

from collections.abc import Iterable
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Correction, Observation, largest
from apo_bench.assembly.equations import equations
from apo_bench.correction.baselines.track import candidates, solve_own_contacts, track_operations
from apo_bench.correction.checks.status import refused_correction, solver_status, status_sentence
from apo_bench.correction.solvers import solve_newton


def paper(observation: Observation) -> Correction:
    """Solve for the motion parameters that Section 3.3.2 chooses, and settle every other goal by itself.

    Returns:
        `converged` if every |e| is within `observation.gap_m`; otherwise `not_seen` (nothing was changed),
        `inconsistent`, `not_converged` or `not_finite` (nothing was changed), with its sentence. `freed` are the
        candidates; rank and trace are those of their joint solution.
    """
    return at_once(observation, np.ones(len(observation.assembly.relations()), dtype=np.bool_))


def at_once(observation: Observation, known: NDArray[np.bool_]) -> Correction:
    """The correction of the paper on a graph of the `known` contacts, (c,), in the order of `relations()`.

    The status says whether those hold; the gaps are those of every contact ever made.
    """
    if not observation.seen.all():
        return refused_correction(observation)
    system = equations(observation.assembly, observation.start, observation.goals)
    before = system.gaps(observation.goals)
    freed = candidates(observation.assembly, known & ~(before <= observation.gap_m), known)
    solution = solve_newton(system.among(known & system.containing(freed)), observation.goals, freed)
    status = solver_status(solution, largest(system.gaps(solution.goals)[known]), observation.gap_m)
    goals = solution.goals
    if status == "converged":
        for k in sorted(set(range(len(goals))).difference(freed)):
            goals = solve_own_contacts(system, goals, k, observation.gap_m)
    return Correction(
        goals=goals,
        status=status,
        sentence=status_sentence(
            status, observation.gap_m, "every contact" if known.all() else "every contact that was kept"
        ),
        freed=freed,
        gap_before_m=largest(before),
        gap_after_m=largest(system.gaps(goals)),
        rank=solution.rank,
        trace=solution.trace,
    )


MOST_SETS = 255
"""Sets that `minimal` tries at a step: every set of 8 candidates; of more, the smallest ones."""


def last_only(observation: Observation) -> Correction:
    """Tracking that never reaches back: only the motion parameter of the newest operation may change."""
    return track_operations(observation, lambda chosen: (chosen[:1],))


def minimal(observation: Observation) -> Correction:
    """Tracking with the smallest set of candidates that suffices, the most recent one of that size."""
    return track_operations(observation, smallest)


def smallest(chosen: tuple[int, ...]) -> Iterable[tuple[int, ...]]:
    """Sets of candidates by size, then by recency, at most `MOST_SETS`; after those, all candidates."""
    sets = (free for size in range(1, len(chosen) + 1) for free in combinations(chosen, size))
    yield from islice(sets, MOST_SETS)
    if 2 ** len(chosen) - 1 > MOST_SETS:
        yield chosen


def no_disappeared(observation: Observation) -> Correction:
    """All at once without the contacts that were lost by the end: not in the graph, not in the joint equations.

    Goals that are no candidates are still settled for what they make, lost contacts too.
    """
    return at_once(
        observation, np.array([relation.lost is None for relation in observation.assembly.relations()], dtype=np.bool_)
    )
