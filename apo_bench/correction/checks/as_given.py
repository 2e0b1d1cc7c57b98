"""Corrections from bare poses: the remaining gap is measured and stated in the sentence, whatever it is."""

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
"""Units of a twist in which the paper's solver measures singular values: metres, and metres per radian."""


def poses_as_given(observation: Observation, poses: Array, sentence: str) -> Correction:
    """Wrap poses, (n, 4, 4), as a correction to be executed as it is, whatever gap remains.

    Args:
        sentence: The sentence, if a contact does not hold within `observation.gap_m`.

    Returns:
        `converged`; `not_finite` with the observed poses, if a number is not finite.
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
    """The largest violation of any contact at poses (n, 4, 4), [m]: |e| of an equation, or how far an inequality is
    off.

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
    """Run a baseline on an observation, with the remaining gap in the sentence.

    Args:
        method: Takes an observation in which every operation was observed to poses, (n, 4, 4).
        done: What the method did, the beginning of the sentence.

    Returns:
        As `poses_as_given`, or `not_seen`; the observed poses if there is no contact.
    """
    if not observation.observed.all():
        return refuse_correction(observation)
    poses = method(observation) if observation.assembly.relations() else observation.poses
    left_m = measure_largest_gap(observation.assembly, observation.start, poses)
    return poses_as_given(observation, poses, f"{done}; the largest gap left is {left_m * 1e3:.2g} mm")
