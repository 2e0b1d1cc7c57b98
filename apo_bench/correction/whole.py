"""The corrector `contact` on compiled loops: everything between observations and records as arrays.

Only what most observations are is done here: every contact an equation, contacts that agree, a rank that is clear, a
test that passes. What is left is handed on, with the goals that were found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from apo_bench.assembly.correction_record import Consistency, Correction, Iterate
from apo_bench.assembly.equations import pattern
from apo_bench.assembly.goals import Observation
from apo_bench.assembly.kinds import OPPOSING
from apo_bench.assembly.opposing import looking_away
from apo_bench.assembly.topology import Assembly
from apo_bench.correction.consistency import SOFT_M, softened_length
from apo_bench.correction.ending import status_sentence
from apo_bench.correction.play import fit_covariance
from apo_bench.correction.posterior import UNCLEAR
from apo_bench.correction.solvers.compact import CompactEquations, corner_moments
from apo_bench.correction.solvers.compiled import Kernels, solved
from apo_bench.correction.solvers.manifold import LARGEST_DENSE, NearestGoals, SolverTurn
from apo_bench.correction.starts import turned_far
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.remembered import remembered

Rest = Callable[[Observation, NearestGoals | None], Correction]
"""Corrects an observation in full, whose nearest goals are known already, or not."""


def correct_compiled(
    loops: Kernels, known: Layout, observations: Sequence[Observation], trusting: bool, level: float, rest: Rest
) -> list[Correction]:
    """Correct observations of one assembly with the same start poses and play, all operations seen.

    Args:
        known: The layout of that.
        trusting: Whether a test that fails changes nothing.
        level: The test fails if the p-value is below.
        rest: Corrects those that are not simple.
    """
    if not observations:
        return []
    first = observations[0]
    n, c, m, b = len(first.assembly), len(known.plane), len(known.corners), len(observations)
    start = np.array([first.start[part] for part in first.assembly.solids]).reshape(-1, 4, 4)
    goals = np.array([one.goals for one in observations])
    covariance = np.array([one.covariance for one in observations])
    faces = start, known.plane, known.onto, known.corners, known.begin, known.laid
    words = known.letters, known.inverse.astype(np.intp)
    vertex, points, L = np.empty((b, m, 3)), np.empty((b, c, 3, 4)), np.zeros((b, n, 6, 6))
    before, definite = np.empty(b), np.empty(b, np.bool_)
    loops.prepared(faces, words, known.moments, goals, covariance, vertex, points, L, before, definite)
    system = CompactEquations(start, known.letters, known.columns, known.inverse, known.plane, points, n)
    found, turns = solved(loops, system, goals, L, None)
    after, cosine, rank = np.empty(b), np.empty(b), np.empty(b, np.intp)
    clear, posterior = np.empty(b, np.bool_), np.empty((b, n, 6, 6))
    loops.rated(faces, words, vertex, found.goals, found.Jt, found.B, UNCLEAR, after, cosine, rank, clear, posterior)
    S = known.correlated
    chi_square = (found.z * found.z).sum(axis=1) if S is None else softened_length(found.z, found.Jt, S)
    p = np.where(rank > 0, chdtrc(np.maximum(rank, 1), chi_square), 1.0)
    holds = np.abs(found.e).max(axis=1, initial=0.0) <= SOFT_M
    trusted = (cosine <= OPPOSING) if known.opposing else ~looking_away(first.assembly, first.start, found.goals).any(1)
    trusted &= ~turned_far(goals, found.goals)
    simple = definite & found.finite & found.at_rest & clear & holds & trusted & (trusting | (p >= level))
    made = []
    numbers = (before, after, rank, chi_square, p, turns.ended, simple)
    for i, (one, values) in enumerate(zip(observations, zip(*(x.tolist() for x in numbers), strict=True), strict=True)):
        before_m, after_m, directions, square, p_value, ended, easy = values
        trace = turns.trace[i, :ended].tolist()
        if not (easy and after_m <= one.gap_m):
            made.append(rest(one, _one(found, i, trace) if definite[i] else None))
            continue
        made.append(
            Correction(
                goals=found.goals[i],
                status="converged",
                sentence=status_sentence("converged", one.gap_m),
                freed=known.freed,
                gap_before_m=before_m,
                gap_after_m=after_m,
                rank=directions,
                trace=tuple([Iterate(gap_m, directions, step) for gap_m, step in trace]),
                test=Consistency(square, directions, p_value, level),
                covariance=posterior[i],
            )
        )
    return made


def _one(found: NearestGoals, i: int, trace: list[list[float]]) -> NearestGoals:
    turns = tuple(SolverTurn(gap_m, step) for gap_m, step in trace)
    arrays = (found.goals[i], found.z[i], found.e[i], found.Jt[i], found.B[i], found.at_rest[i], found.finite[i])
    return NearestGoals(*arrays, trace=turns)


@final
@dataclass(frozen=True, eq=False)
class Layout:
    """What the loops need to know of an assembly; fields as in `Pattern` and `CompactEquations`."""

    letters: NDArray[np.intp]
    columns: NDArray[np.intp]
    inverse: NDArray[np.bool_]
    plane: Array
    """(c, 4), shifted to where it is asked to be."""
    onto: Array
    corners: Array
    begin: NDArray[np.intp]
    laid: NDArray[np.intp]
    moments: Array
    """(c, 3, 4): what stands for the corners of each contact."""
    correlated: Array | None
    """(3 c, 3 c), as of `fit_covariance`."""
    freed: tuple[int, ...]
    opposing: bool
    """Whether the faces of every contact are flat ones, that look at each other when they touch."""


@remembered
def layout(assembly: Assembly, play_m: float) -> Layout | None:
    """What the loops need to know; None for walls, and for so many operations that sparse matrices are better."""
    low, high = assembly.intervals(play_m).T
    known, n = pattern(assembly), len(assembly)
    if (low != high).any() or 6 * n > LARGEST_DENSE:
        return None
    k = known.letters - len(assembly.solids)
    plane = np.array(known.plane)
    plane[:, 3] -= low
    return Layout(
        letters=known.letters,
        columns=np.where((k >= 0) & (k < n), k, n),
        inverse=known.inverse,
        plane=plane,
        onto=known.onto,
        corners=known.corners,
        begin=known.begin,
        laid=known.laid.astype(np.intp),
        moments=corner_moments(known),
        correlated=fit_covariance(assembly, play_m),
        freed=known.freed,
        opposing=bool((known.opposing == OPPOSING).all()),
    )
