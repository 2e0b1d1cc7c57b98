"""Poses to be executed as they are, whatever gap they leave: that gap is measured, and stated in the sentence."""

from collections.abc import Callable, Collection

import numpy as np

from apo_bench.assembly import Correction, Observation, largest, largest_gap, project_observation
from apo_bench.assembly.equations import equations
from apo_bench.correction.checks.status import refused_correction, status_sentence
from apo_bench.correction.solvers import LENGTH_M, SINGULAR_CUT_OFF, demanded, least_step, violations
from apo_bench.geometry import Array
from apo_bench.records import outcomes

TWIST_UNITS = (1.0, 1.0, 1.0, LENGTH_M, LENGTH_M, LENGTH_M)


def goals_as_given(observation: Observation, goals: Array, sentence: str) -> Correction:
    """A correction of these goals, (n, 4, 4), to be executed as it is, whatever gap it leaves.

    Args:
        sentence: The sentence, if a contact does not hold within `observation.gap_m`.

    Returns:
        `converged`; `not_finite`, and what was seen, if a number is not finite.
    """
    before = largest_gap(observation.assembly, observation.start, observation.poses)
    if not np.isfinite(goals).all():
        return Correction(observation.poses, "not_finite", outcomes.sentence("not_finite"), (), before, before, 0)
    e, J = equations(observation.assembly, observation.start, goals).linearised(goals)
    _, rank = least_step(J / np.tile(TWIST_UNITS, len(goals)), e, SINGULAR_CUT_OFF)
    freed = tuple(int(k) for k in np.flatnonzero((goals != observation.poses).any(axis=(1, 2)))[::-1])
    after = largest(e)
    sentence = status_sentence("converged", observation.gap_m) if after <= observation.gap_m else sentence
    return Correction(goals, "converged", sentence, freed, before, after, rank)


def gap_of(observation: Observation, goals: Array, dropped: Collection[str] = ()) -> float:
    """The largest |e| at goals (n, 4, 4) of what is asked of the contacts, [m]; or how far an inequality is violated.

    Args:
        dropped: Relations, or single contacts, that do not count.
    """
    observation = project_observation(observation)
    plain = equations(observation.assembly, observation.start, observation.poses)
    system, exact, inequalities = demanded(plain, observation.assembly, observation.play_m)
    return largest(violations(system, exact, inequalities, goals)[observation.assembly.without(dropped)])


def as_it_ends(observation: Observation, mended: Callable[[Observation], Array], done: str) -> Correction:
    """What a method that promises nothing makes of an observation, with the gap that it leaves in the sentence.

    Args:
        mended: Goals (n, 4, 4) out of an observation of which every operation was seen.
        done: What the method did, the beginning of the sentence.

    Returns:
        As `goals_as_given`, or `not_seen`; what was seen where there is no contact.
    """
    if not observation.observed.all():
        return refused_correction(observation)
    goals = mended(observation) if observation.assembly.relations() else observation.poses
    left_m = largest_gap(observation.assembly, observation.start, goals)
    return goals_as_given(observation, goals, f"{done}; the largest gap left is {left_m * 1e3:.2g} mm")
