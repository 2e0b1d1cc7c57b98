"""A baseline: every part snaps to its newest support, as in an editor, and earlier poses are never corrected.

Operation by operation, only the new pose is solved for the contacts that its own operation makes. Where earlier errors
make these contacts impossible together, their gaps are minimised in the sense of least squares.
"""

import numpy as np

from apo_bench.assembly import Correction, Equations, Observation, build_contact_equations
from apo_bench.correction.checks.as_given import TWIST_UNITS, run_method
from apo_bench.correction.solvers import REST_M, SINGULAR_CUT_OFF, WhitenedPoses
from apo_bench.correction.solvers.whitened import whitened
from apo_bench.geometry import Array

_ITERATIONS = 30
"""Most iterations per pose."""


def snap(observation: Observation) -> Correction:
    """Move each pose onto the contacts of its own operation, by the most likely twist, in the order of the operations.

    Returns:
        `converged` with the remaining gap in the sentence, or `not_seen`.

    Raises:
        InputError: A covariance is not positive definite.
    """
    return run_method(observation, _snap_all, "every part was put onto its newest support")


def _snap_all(observation: Observation) -> Array:
    """The poses, (n, 4, 4), after each was moved onto its own contacts."""
    poses = np.array(observation.poses)
    space = whitened(observation)
    system = build_contact_equations(observation.assembly, observation.start, poses)
    for k in range(len(poses)):
        poses[k] = _put(system.among(system.made == k), poses, k, space)
    return poses


def _put(own: Equations, poses: Array, k: int, space: WhitenedPoses) -> Array:
    """The pose of operation k, (4, 4), nearest to the observed one among those with the least sum of squared gaps.

    At each iteration the directions that the contacts fix get the Newton step of the paper, with its cut-off (Eq. 15
    and 22). The others go to where |z| is least. With V^t d = c for the fixed directions, the twist is covariance V
    (V^t covariance V)^-1 (c + V^t xi).
    """
    coordinates = WhitenedPoses(space.observed[k : k + 1], space.factor[k : k + 1])
    now = np.array(poses)
    z = np.zeros(6)
    for _ in range(_ITERATIONS):
        e, J = own.linearise(now)
        if not e.size:
            break
        U, w, Vt = np.linalg.svd(J[:, 6 * k : 6 * k + 6] / TWIST_UNITS, full_matrices=False)
        rank = int(np.count_nonzero(w > SINGULAR_CUT_OFF * w[0]))
        fixed = coordinates.pull_back(z, Vt[:rank] * TWIST_UNITS)
        wanted = fixed @ z - (U[:, :rank].T @ e) / w[:rank]
        step = np.linalg.lstsq(fixed, wanted, rcond=None)[0] - z
        z = z + step
        now[k] = coordinates.poses(z)[0]
        if np.linalg.norm(coordinates.factor[0] @ step * TWIST_UNITS) < REST_M:
            break
    return now[k]
