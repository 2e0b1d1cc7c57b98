"""Twists in units of the stated noise: z = L^-1 xi, with covariance L L^t, so that |z| is a Mahalanobis length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly.goals import Observation
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.twist import right_jacobian


@final
@dataclass(frozen=True, eq=False)
class Whitened:
    """The motion parameters of n operations as a vector z, (6 n,), that is zero at what was seen."""

    observed: Array
    """(n, 4, 4), world frame, [m]."""
    factor: Array
    """(n, 6, 6), L of each operation, [m, rad]."""

    def goals(self, z: Array) -> Array:
        """T_seen exp(L z), (n, 4, 4)."""
        return np.asarray(self.observed @ pose.exp(self._twists(z)))

    def pulled(self, z: Array, J: Array) -> Array:
        """A derivative by the body twists of the goals at z, (m, 6 n), as the derivative by z."""
        n = len(self.observed)
        D = right_jacobian(self._twists(z)) @ self.factor
        return np.einsum("mni,nij->mnj", J.reshape(-1, n, 6), D).reshape(-1, 6 * n)

    def _twists(self, z: Array) -> Array:
        return np.asarray((self.factor @ z.reshape(-1, 6, 1))[..., 0])


def whitened(observation: Observation) -> Whitened:
    """The coordinates of an observation.

    Raises:
        InputError: A covariance is not positive definite.
    """
    return Whitened(observation.goals, scales(observation.covariance))


def correction_to(observed: Array, L: Array, goals: Array) -> Array:
    """z of goals (*, n, 4, 4), the shortest that leads there from what was seen, (n, 4, 4): (*, 6 n).

    Args:
        L: (n, 6, 6), or (n, 6, 6 n) of all twists together.
    """
    xi, unknowns = pose.log(pose.inverse(observed) @ goals), 6 * len(L)
    lead = goals.shape[:-3]
    if L.shape[-1] == unknowns:
        return np.asarray(np.linalg.solve(L.reshape(unknowns, unknowns), xi.reshape(*lead, unknowns, 1))[..., 0])
    return np.asarray(np.linalg.solve(L, xi[..., None]).reshape(*lead, unknowns))


def scales(covariance: Array) -> Array:
    """L with L L^t = covariance, (n, 6, 6).

    Raises:
        InputError: One is not positive definite.
    """
    try:
        L = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        if np.isfinite(L).all():
            return L
    except np.linalg.LinAlgError:
        pass
    L = np.zeros(covariance.shape)
    for k, C in enumerate(covariance):
        try:
            L[k] = np.linalg.cholesky(C)
        except np.linalg.LinAlgError:
            L[k] = np.nan
        if not np.isfinite(L[k]).all():
            raise InputError(
                f"the covariance of operation {k + 1} is not positive definite; "
                "state finite numbers and a variance above zero in every direction."
            )
    return L
