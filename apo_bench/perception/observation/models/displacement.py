"""Displaced poses as an observation, with the covariance that it states."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation, SharedError
from apo_bench.geometry import Array, copy_frozen, pose

COVARIANCE_FLOOR = copy_frozen(np.repeat([0.05e-3, np.radians(0.05)], 3), 6)
"""Smallest standard deviation that is ever stated, [m, rad]: no camera is perfect, and a covariance has an inverse."""


def observe_displaced(assembly: Assembly, demonstration: Demonstration, xi: Array, covariance: Array) -> Observation:
    """Observe every pose at `T exp(xi)`, with the covariance of xi and of the human error, and at least the floor.

    Args:
        xi: (n, 6), body twists; where one is zero the pose is the one that was shown, bit for bit.
        covariance: (6, 6) or (n, 6, 6), of xi, [m, rad].
    """
    poses = displace(demonstration.poses, xi)
    stated = floor_covariance(covariance + demonstration.human_error_covariance)
    return Observation(assembly, demonstration.start, poses, stated, np.ones(len(assembly), dtype=np.bool_))


def displace(poses: Array, xi: Array) -> Array:
    """`T exp(xi)` of poses (n, 4, 4); where a twist is zero the pose as it is, bit for bit."""
    return np.where(np.any(xi, axis=1, keepdims=True)[..., None], poses @ pose.exp(xi), poses)


def observe_shared(
    assembly: Assembly,
    demonstration: Demonstration,
    xi: Array,
    own: Array,
    shared: Callable[[Array], Sequence[SharedError]],
) -> Observation:
    """Every pose observed at `T exp(xi)`, by errors of which operations share most.

    Args:
        xi: (n, 6), body twists; where one is zero the pose is the one that was shown, bit for bit.
        own: (6,), standard deviation of what of xi operations do not share, [m, rad]. Without any, operations would be
            stated to agree without an error, which no camera does.
        shared: The poses that are observed, (n, 4, 4) -> what operations share.
    """
    seen = observe_displaced(assembly, demonstration, xi, np.diag(own**2))
    return add_shared_error(seen, *shared(seen.poses)) if own.any() else seen


def add_shared_error(observation: Observation, *shared: SharedError) -> Observation:
    """An observation that states, in addition to what it states already, errors that operations share."""
    stated = np.array(observation.covariance)
    for error in shared:
        stated[list(error.operations)] += error.added(observation.poses)
    return replace(observation, covariance=stated, shared=(*observation.shared, *shared))


def floor_covariance(covariance: Array) -> Array:
    """The least covariance (n, 6, 6) above the given one that says at least `COVARIANCE_FLOOR` in every direction.

    In units of the floor, eigenvalues below 1 are raised to 1, so the result is symmetric and positive definite.
    """
    # C / unit = V diag(w) V^t; directions with w < 1 are surer than the floor, and get w = 1.
    unit = np.outer(COVARIANCE_FLOOR, COVARIANCE_FLOOR)
    w, V = np.linalg.eigh(covariance / unit)
    raised = unit * ((V * np.maximum(w, 1.0)[:, None]) @ np.swapaxes(V, -1, -2))
    return np.where(
        np.all(w >= 1.0, axis=1, keepdims=True)[..., None], covariance, (raised + np.swapaxes(raised, -1, -2)) / 2
    )
