"""Where the camera stands: solved from parts that stand still on known places, with residuals."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import final

import numpy as np

from apo_bench.geometry import Array, frozen, pose
from apo_bench.recording.averaging import Mean

_ROUNDS = 50
_PLACED = frozen(np.repeat([2e-4, 2e-3], 3), 6)
"""How well a place is known, per axis, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class CameraPose:
    """The pose of a camera, and how it is known."""

    T_world_camera: Array
    """(4, 4), [m]."""
    residuals: Mapping[str, Array] = field(default_factory=dict)
    """Part -> (6,), the body twist from its known place to where the camera sees it; empty of a pose that was given."""
    covariance: Array | None = None
    """(6, 6), of the body twist by which the pose is wrong, [m, rad]; None of a pose that was given."""

    @property
    def off_mm(self) -> float:
        """Largest distance of a part from its known place, [mm]."""
        return max((1e3 * float(np.linalg.norm(r[:3])) for r in self.residuals.values()), default=0.0)

    @property
    def off_deg(self) -> float:
        """Largest turn of a part from its known place."""
        return max((float(np.degrees(np.linalg.norm(r[3:]))) for r in self.residuals.values()), default=0.0)


def solve_camera(known: Mapping[str, Array], seen: Mapping[str, Mean], stays: Array) -> CameraPose:
    """The pose at which the parts stand on their places, by weighted least squares on SE(3).

    X exp(d) M = K exp(r): residuals r of parts seen at M and standing at K change by Ad(M^-1) d.

    Args:
        known: Part -> (4, 4), where it stands in the world, [m].
        seen: Part -> where it was seen.
        stays: (6, 6), covariance of an error of the estimator that stays, [m, rad].
    """
    parts = tuple(known)
    K = np.array([known[p] for p in parts])
    M = np.array([seen[p].T for p in parts])
    W = np.array([np.linalg.inv(seen[p].covariance + stays + np.diag(_PLACED**2)) for p in parts])
    # Normal equations of r + A d = 0, the sum of A^t W A over parts; A hardly depends on X.
    A = pose.adjoint(pose.inverse(M))
    normal = np.einsum("kji,kjl,klm->im", A, W, A)
    # Each part alone says X = K M^-1; the one that fits all of them best is where Gauss-Newton begins.
    X = min((K @ pose.inverse(M)), key=lambda X: _cost(_residuals(X, K, M), W))
    for _ in range(_ROUNDS):
        r = _residuals(X, K, M)
        step = -np.linalg.solve(normal, np.einsum("kji,kjl,kl->i", A, W, r))
        X = X @ pose.exp(step)
        if np.abs(step).max() < 1e-12:
            break
    r = _residuals(X, K, M)
    # Where residuals are larger than stated, chi-square over its degrees of freedom says how much too sure that was.
    excess = max(1.0, _cost(r, W) / max(6 * len(parts) - 6, 1)) if len(parts) > 1 else 1.0
    return CameraPose(X, MappingProxyType(dict(zip(parts, r, strict=True))), excess * np.linalg.inv(normal))


def _residuals(X: Array, K: Array, M: Array) -> Array:
    return pose.log(pose.inverse(K) @ X @ M)


def _cost(r: Array, W: Array) -> float:
    return float(np.einsum("ki,kij,kj->", r, W, r))
