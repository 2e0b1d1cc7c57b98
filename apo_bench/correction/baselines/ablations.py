"""The corrector of the paper with one thing taken away, to see what it is worth."""

from collections.abc import Iterable
from itertools import combinations, islice

import numpy as np

from apo_bench.assembly import Correction, Observation
from apo_bench.correction.baselines.paper import at_once
from apo_bench.correction.baselines.track import track_operations

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
