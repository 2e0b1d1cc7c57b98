"""Make an observation of displaced poses, with its stated covariance and shared errors."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from apo_bench.assembly import Assembly, Demonstration, Observation, SharedError
from apo_bench.geometry import Array, copy_frozen, pose

COVARIANCE_FLOOR = copy_frozen(np.repeat([0.05e-3, np.radians(0.05)], 3), 6)
"""(6,), smallest standard deviation that an observation states, [m, rad], so that a covariance is invertible."""


def observe_displaced(assembly: Assembly, demonstration: Demonstration, xi: Array, covariance: Array) -> Observation:
    """Make the observation with poses `T exp(xi)`; it states the covariance of xi plus that of the human error.

    Args:
        xi: (n, 6), body twists; a zero twist keeps the demonstrated pose bit for bit.
        covariance: (6, 6) or (n, 6, 6), of xi, [m, rad]; raised to `COVARIANCE_FLOOR` where it is smaller.
    """
    poses = displace_poses(demonstration.poses, xi)
    stated = floor_covariance(covariance + demonstration.human_error_covariance)
    return Observation(assembly, demonstration.start, poses, stated, np.ones(len(assembly), dtype=np.bool_))


def displace_poses(poses: Array, xi: Array) -> Array:
    """`T exp(xi)` of poses (n, 4, 4) and body twists (n, 6); a zero twist keeps the pose bit for bit."""
    return np.where(np.any(xi, axis=1, keepdims=True)[..., None], poses @ pose.exp(xi), poses)


def observe_shared(
    assembly: Assembly,
    demonstration: Demonstration,
    xi: Array,
    own: Array,
    shared: Callable[[Array], Sequence[SharedError]],
) -> Observation:
    """Make the observation with poses `T exp(xi)`, where operations share a part of the error.

    Args:
        xi: (n, 6), body twists; a zero twist keeps the demonstrated pose bit for bit.
        own: (6,), standard deviation of the part of xi that is independent per operation, [m, rad]. If all are 0, no
            shared error is stated.
        shared: Observed poses (n, 4, 4) -> shared errors.
    """
    seen = observe_displaced(assembly, demonstration, xi, np.diag(own**2))
    return add_shared_error(seen, *shared(seen.poses)) if own.any() else seen


def add_shared_error(observation: Observation, *shared: SharedError) -> Observation:
    """The observation with additional shared errors; their covariance is added to that of each operation."""
    stated = np.array(observation.covariance)
    for error in shared:
        stated[list(error.operations)] += error.covariances(observation.poses)
    return replace(observation, covariance=stated, shared=(*observation.shared, *shared))


def floor_covariance(covariance: Array) -> Array:
    """Raise covariances (n, 6, 6) to at least `COVARIANCE_FLOOR` in every direction; larger ones stay unchanged.

    In units of the floor, eigenvalues below 1 are raised to 1, so the result is symmetric and positive definite.
    """
    # C / unit = V diag(w) V^t; directions with w < 1 are below the floor, and get w = 1.
    unit = np.outer(COVARIANCE_FLOOR, COVARIANCE_FLOOR)
    w, V = np.linalg.eigh(covariance / unit)
    raised = unit * ((V * np.maximum(w, 1.0)[:, None]) @ np.swapaxes(V, -1, -2))
    return np.where(
        np.all(w >= 1.0, axis=1, keepdims=True)[..., None], covariance, (raised + np.swapaxes(raised, -1, -2)) / 2
    )
