"""Estimate poses under a hypothetical set of contacts, and the Bayes factor of that set.

If the contacts hold, the observation is Gaussian about the contact manifold. If not, parts lie anywhere in a range much
wider than the noise. The contact residual of the observation is r = J xi - e. Its covariance is J C J^t + S in the
first case and J (C + R) J^t + S in the second. C is the noise, R the range and S the effect of play and soft contacts.
The set explains the observation better than chance by

    log |J (C + R) J^t + S| - log |J C J^t + S| - r^t (J C J^t + S)^-1 r,

twice the logarithm of a Bayes factor (of Savage and Dickey; the range is so wide that its size alone counts). Equations
that others imply add equally to both determinants, so they gain nothing.
"""

from dataclasses import dataclass
from math import radians
from typing import final

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Observation,
    build_contact_equations,
    compute_joint_covariance,
    find_equation_pattern,
    project_round_faces,
)
from apo_bench.geometry import Array, compute_right_jacobian, copy_frozen, pose
from apo_bench.perception.detection.thresholds import CONTACT_SOFT_M

_ACCEPTED = copy_frozen(np.repeat([40e-3, radians(23.0)], 3), 6)
"""(6,): standard deviation of the pose of a part near others that it does not touch, [m, rad]."""
_CARRIED = 3.0
"""Number of independent plays that add up in a contact of an operation that carries parts."""
_TURNS = 6
"""Gauss-Newton steps at most."""
_SMALL = 1e-5
"""The steps end when no component of a pose changes by more, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """The likeliest poses of the first n operations under the assumption that some contacts hold."""

    assembly: Assembly
    """The first n operations, with these contacts."""
    poses: Array
    """(n, 4, 4), world frame, [m]."""
    covariance: Array
    """(6 n, 6 n), covariance of the body twists of their errors, [m, rad]."""
    room: Array
    """(6 n, 6 n), the same for parts that lie anywhere in the range about the observation, with the contacts closed."""
    badness: float
    """-2 log of the Bayes factor of the contacts against no contacts; lower is better."""


def estimate_poses(seen: Observation, assembly: Assembly, begin: Array) -> PoseEstimate:
    """Compute the maximum a posteriori poses of the first n operations, given their contacts, by Gauss-Newton steps.

    Args:
        seen: The observation; its own contacts are ignored.
        assembly: Its first n operations, with the hypothetical contacts.
        begin: (n, 4, 4), initial poses, world, [m].
    """
    n = len(begin)
    C = compute_joint_covariance(seen.poses, seen.covariance, seen.shared)[: 6 * n, : 6 * n]
    room = C + np.diag(np.tile(_ACCEPTED**2, n))
    back = pose.inverse(seen.poses[:n])
    poses = begin
    system = build_contact_equations(assembly, seen.start, begin)
    S = _residual_variances(assembly, seen.play_m)
    xi = pose.log(back @ poses)
    for _ in range(_TURNS):
        # Poses are seen.poses exp(xi); equations are linear in body twists at the poses, which are Jr d(xi).
        e, J = system.linearise(poses)
        Jr = compute_right_jacobian(xi)
        J = (J.reshape(-1, n, 1, 6) @ Jr).reshape(-1, 6 * n)
        CJ = C @ J.T
        r = J @ xi.ravel() - e
        A = J @ CJ + S
        # The likeliest xi of covariance C for which J xi - r is of covariance S: C J^t (J C J^t + S)^-1 r.
        new = (CJ @ np.linalg.solve(A, r)).reshape(n, 6)
        step = np.abs(new - xi).max(initial=0.0)
        xi = new
        poses = seen.poses[:n] @ pose.exp(xi)
        if step < _SMALL:
            break
    # A and B are the covariances of the contact residual with and without the contacts: see the module docstring.
    B = J @ room @ J.T + S
    badness = float(r @ np.linalg.solve(A, r) - (np.linalg.slogdet(B)[1] - np.linalg.slogdet(A)[1]))
    return PoseEstimate(
        assembly, poses, _condition_on_contacts(C, J, A, Jr), _condition_on_contacts(room, J, B, Jr), badness
    )


def _condition_on_contacts(C: Array, J: Array, A: Array, Jr: Array) -> Array:
    """The covariance of poses after conditioning on contact equations, (6 n, 6 n), as body twists at these poses.

    Args:
        C: (6 n, 6 n), covariance before, of body twists xi at the observed poses.
        J: (m, 6 n), derivative of the equations by xi.
        A: (m, m), J C J^t + S.
        Jr: (n, 6, 6), right Jacobians, from xi to body twists at the estimated poses.
    """
    n = len(Jr)
    JC = J @ C
    left = C - JC.T @ np.linalg.solve(A, JC)
    turned = np.einsum("kab,kblc,ldc->kald", Jr, left.reshape(n, 6, n, 6), Jr).reshape(6 * n, 6 * n)
    return np.asarray((turned + turned.T) / 2)


def _residual_variances(assembly: Assembly, play_m: float) -> Array:
    """The diagonal covariance (m, m) of the residuals of true contacts, from play and softness, [m^2].

    Each variance is multiplied by the number of equations of its contact: all of them are off together, so their mean
    must not become more certain than one equation.
    """
    each = []
    flat = project_round_faces(assembly)
    for operation in flat.operations:
        for contact in operation.contacts:
            carried = (_CARRIED - 1.0) * bool(operation.carries) * play_m**2
            each.append(CONTACT_SOFT_M**2 + (flat.play(contact, play_m) ** 2 + carried) / 3.0)
    count = np.diff(find_equation_pattern(assembly).begin)
    return np.diag(np.repeat(np.array(each).reshape(-1) * count, count))
