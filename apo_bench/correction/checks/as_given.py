"""Poses to be executed as they are, whatever gap they leave: that gap is measured, and stated in the sentence."""

from collections.abc import Callable, Collection

import numpy as np

from apo_bench.assembly import (
    Correction,
    Observation,
    build_contact_equations,
    find_largest_residual,
    measure_largest_gap,
    project_observation,
)
from apo_bench.correction.checks.status import refuse_correction, status_sentence
from apo_bench.correction.solvers import (
    LENGTH_M,
    SINGULAR_CUT_OFF,
    compute_least_step,
    compute_violations,
    list_contact_demands,
)
from apo_bench.geometry import Array
from apo_bench.records import outcomes

TWIST_UNITS = (1.0, 1.0, 1.0, LENGTH_M, LENGTH_M, LENGTH_M)


def poses_as_given(observation: Observation, poses: Array, sentence: str) -> Correction:
    """A correction of these poses, (n, 4, 4), to be executed as it is, whatever gap it leaves.

    Args:
        sentence: The sentence, if a contact does not hold within `observation.gap_m`.

    Returns:
        `converged`; `not_finite`, and what was observed, if a number is not finite.
    """
    before = measure_largest_gap(observation.assembly, observation.start, observation.poses)
    if not np.isfinite(poses).all():
        return Correction(
            observation.poses, "not_finite", outcomes.describe_outcome("not_finite"), (), before, before, 0
        )
    e, J = build_contact_equations(observation.assembly, observation.start, poses).linearise(poses)
    _, rank = compute_least_step(J / np.tile(TWIST_UNITS, len(poses)), e, SINGULAR_CUT_OFF)
    freed = tuple(int(k) for k in np.flatnonzero((poses != observation.poses).any(axis=(1, 2)))[::-1])
    after = find_largest_residual(e)
    sentence = status_sentence("converged", observation.gap_m) if after <= observation.gap_m else sentence
    return Correction(poses, "converged", sentence, freed, before, after, rank)


def gap_of(observation: Observation, poses: Array, dropped: Collection[str] = ()) -> float:
    """The largest |e| at poses (n, 4, 4) of what is asked of the contacts, [m]; or how far an inequality is violated.

    Args:
        dropped: Relations, or single contacts, that do not count.
    """
    observation = project_observation(observation)
    plain = build_contact_equations(observation.assembly, observation.start, observation.poses)
    system, exact, inequalities = list_contact_demands(plain, observation.assembly, observation.play_m)
    return find_largest_residual(
        compute_violations(system, exact, inequalities, poses)[observation.assembly.without(dropped)]
    )


def run_method(observation: Observation, method: Callable[[Observation], Array], done: str) -> Correction:
    """What a method that promises nothing makes of an observation, with the gap that it leaves in the sentence.

    Args:
        method: Poses (n, 4, 4) out of an observation of which every operation was observed.
        done: What the method did, the beginning of the sentence.

    Returns:
        As `poses_as_given`, or `not_seen`; what was observed where there is no contact.
    """
    if not observation.observed.all():
        return refuse_correction(observation)
    poses = method(observation) if observation.assembly.relations() else observation.poses
    left_m = measure_largest_gap(observation.assembly, observation.start, poses)
    return poses_as_given(observation, poses, f"{done}; the largest gap left is {left_m * 1e3:.2g} mm")
