"""What is measured of a solution, in the words of `solver.md`, section 0.

xi is the body twist from the seen to the corrected goals, z = L^-1 xi with covariance = L L^t: sigma units. The null
space at a solution is that of the equations as functions of z, so the exact constrained optimum has no drift.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, pose, right_jacobian
from benchmarks.corrector_bench.draws import Draw, factors
from benchmarks.corrector_bench.problems import Problem


class Quality(NamedTuple):
    """How good one solution is; everything but the residual is in sigma units."""

    residual_mm: float
    drift: float
    length: float
    """|z|."""
    true_length: float
    """|z| of the truth."""
    free_error: float
    """Root mean square, per free direction, of the error against the truth."""
    fixed_error: float
    """Norm of the error against the truth across the free directions."""
    seen_free_error: float
    """`free_error` of the observation itself."""
    position_mm: float
    """Root mean square distance of the parts' frames from where they truly are."""

    @property
    def overlong(self) -> bool:
        """Whether the correction is longer than the true one, which is feasible too."""
        return self.length > self.true_length * (1 + 1e-9)


def quality(of: Problem, given: Draw, goals: Array, residual_m: float | None = None) -> Quality:
    """Everything about one solution, (n, 4, 4).

    Args:
        residual_m: Largest |e|, where the caller has it already.
    """
    if not np.isfinite(goals).all():
        return Quality(*[float("inf")] * len(Quality._fields))
    if residual_m is None:
        residual_m = float(np.abs(of.system(given.seen).residual(goals)).max())
    z = lengths(given, goals)
    true = lengths(given, given.truth)
    error = sigma(given, given.truth, goals)
    seen_error = sigma(given, given.truth, given.seen)
    Q = free_at_truth(of, given)
    f = np.sqrt(Q.shape[1])
    return Quality(
        residual_mm=1e3 * residual_m,
        drift=float(np.linalg.norm(free_basis(of, given, goals).T @ z)),
        length=float(np.linalg.norm(z)),
        true_length=float(np.linalg.norm(true)),
        free_error=float(np.linalg.norm(Q.T @ error) / f),
        fixed_error=float(np.linalg.norm(error - Q @ (Q.T @ error))),
        seen_free_error=float(np.linalg.norm(Q.T @ seen_error) / f),
        position_mm=1e3 * float(np.sqrt(np.mean(np.sum((goals - given.truth)[:, :3, 3] ** 2, axis=1)))),
    )


def sigma(given: Draw, from_goals: Array, to_goals: Array) -> Array:
    """L^-1 log(T_from^-1 T_to), (6 n,)."""
    twist = pose.log(pose.inverse(from_goals) @ to_goals)
    return np.asarray(np.linalg.solve(factors(given.covariance), twist[..., None])).ravel()


def lengths(given: Draw, goals: Array) -> Array:
    """z of some goals, (6 n,)."""
    return sigma(given, given.seen, goals)


def free_basis(of: Problem, given: Draw, goals: Array) -> Array:
    """An orthonormal basis of the free directions of z at consistent goals, (6 n, f): L^-1 J_r(xi)^-1 N."""
    twist = pose.log(pose.inverse(given.seen) @ goals)
    return _spanned(right_jacobian(twist) @ factors(given.covariance), of.free(goals))


def free_at_truth(of: Problem, given: Draw) -> Array:
    """An orthonormal basis of the free directions around the truth, in sigma units, (6 n, f)."""
    return _spanned(factors(given.covariance), of.free(given.truth))


def spread(of: Problem, given: Draw, goals: Array) -> float:
    """Squared length of the truth's offset along the tangent of the contacts at a solution, in sigma units.

    Chi-square distributed with n - rank degrees of freedom if the solution is the nearest consistent point.
    """
    Q = free_basis(of, given, goals)
    return float(np.sum((Q.T @ (lengths(given, given.truth) - lengths(given, goals))) ** 2))


def freedom_error(of: Problem, given: Draw, goals: Array, covariance: Array) -> float:
    """How far the stated posterior, (n, 6, 6), is from what the geometry leaves free, as a part of the noise.

    In sigma units the posterior of the free directions Q is Q Q^t; a direction that is called fixed or free wrongly
    shows in the blocks of its parts.
    """
    L = factors(given.covariance)
    B = right_jacobian(pose.log(pose.inverse(given.seen) @ goals)) @ L
    Q = free_basis(of, given, goals).reshape(of.n, 6, -1)
    inward = np.linalg.inv(B)
    stated = inward @ covariance @ np.swapaxes(inward, 1, 2)
    return float(np.abs(stated - Q @ np.swapaxes(Q, 1, 2)).max())


def _spanned(blocks: Array, N: Array) -> Array:
    """Orthonormal basis of the span of blocks^-1 N, blocks (n, 6, 6)."""
    n = len(blocks)
    return np.linalg.qr(np.linalg.solve(blocks, N.reshape(n, 6, -1)).reshape(6 * n, -1))[0]
