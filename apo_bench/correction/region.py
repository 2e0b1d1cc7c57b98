"""Coverage check for benchmarks and tests: whether the truth lies in the confidence region of a correction."""

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Correction, Observation, project_observation
from apo_bench.correction.contact.drawn import drawn_radius
from apo_bench.correction.contact.problem import seen_system
from apo_bench.correction.solvers import compute_freedom, factor_noise, linearise_by, whiten_twists
from apo_bench.geometry import Array, compute_right_jacobian, pose


def contains_truth(observation: Observation, correction: Correction, truth: Array, level: float = 0.95) -> bool | None:
    """Whether the true poses, (n, 4, 4), lie in the `level` region of the posterior of a correction.

    With hypotheses the region is a union: the most likely hypotheses up to a total weight of sqrt(level), each with its
    own region at sqrt(level). So the truth lies in it with probability `level`. Otherwise it is the single region of
    the correction.

    Returns:
        None if the correction states no posterior, did not converge, or nothing is free.
    """
    if correction.covariance is None or not correction.ok:
        return None
    if not correction.hypotheses:
        return _contains(correction.assumed or observation, correction.poses, correction.dropped, truth, level)
    each = np.sqrt(level)
    known = list[bool]()
    weight = 0.0
    for one in correction.hypotheses:
        inside = _contains(one.assumed, one.poses, one.dropped, truth, each)
        known += [] if inside is None else [inside]
        weight += one.weight
        if weight >= each:
            break
    return any(known) if known else None


def _contains(assumed: Observation, poses: Array, dropped: tuple[str, ...], truth: Array, level: float) -> bool | None:
    """Whether the truth lies in the region of one set of poses, given the observation assumed for it.

    The region lies in the tangent space of the contact manifold at the poses. The squared length of the deviation
    there, in standard deviations, is chi-square distributed with as many degrees of freedom as directions are free.

    Returns:
        None if nothing is free, or there are too many operations.
    """
    from scipy.special import chdtri

    observation = project_observation(assumed)
    L = factor_noise(observation)
    xi = pose.log(pose.inverse(observation.poses) @ poses)
    system = seen_system(observation).among(_equal(observation, dropped))
    known = compute_freedom(linearise_by(system, poses, compute_right_jacobian(xi) @ L)[1])
    if known is None or not known.free.shape[1]:
        return None
    free = known.free
    true = pose.log(pose.inverse(observation.poses) @ truth)
    # Deviation of the truth in the tangent space of the contacts, in standard deviations.
    off = free.T @ whiten_twists(L, true - xi)
    tailed = observation.tails is not None
    most = drawn_radius(observation, L, free, level) if tailed else chdtri(free.shape[1], 1.0 - level)
    return bool(off @ off <= most)


def _equal(observation: Observation, dropped: tuple[str, ...]) -> NDArray[np.bool_]:
    """The contacts that were equations, (c,): neither inequalities nor dropped."""
    low, high = observation.assembly.intervals(observation.play_m).T
    return np.asarray(low == high) & observation.assembly.without(dropped)
