"""Heavy-tailed pose errors: Student t for shifts and turns, across and along a ray.

A covariance does not say how often errors are several times as large as usual. Where an observation states its tails,
tests and regions are computed from draws of them.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import final

import numpy as np

from apo_bench.geometry import Array, freeze, make_copyable

_COLUMNS = ((0, 1), (2,), (3, 4), (5,))
"""Components of an error (x, y, along; rx, ry, about) by group: across, along, tilt, turn about."""
_MOST_REDRAWS = 100
"""Most redraws of errors beyond the limits."""
_SEED = 20
"""Seed of the draws, so that results depend on the observation alone."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Tails:
    """The error distribution of n operations; numbers in the order across, along, tilt, turn about."""

    frames: Array
    """(n, 3, 3): the axes of the errors as columns, in the frame of each part; the third is the ray."""
    scales: Array
    """(4,), of Student t, [m, m, rad, rad]."""
    freedom: Array
    """(4,), degrees of freedom; 1e9 and more stand for a Gaussian."""
    variances: Array
    """(4,), variance of one component of each group, within the limits, [m^2, m^2, rad^2, rad^2]."""
    limits: Array
    """(2,): largest length of a shift, [m], and of a turn, [rad]."""
    joined: bool = False
    """Whether one random scale is common to all six components, so that shift and turn are large together."""

    def __post_init__(self) -> None:
        freeze(self, frames=(None, 3, 3), scales=(4,), freedom=(4,), variances=(4,), limits=(2,))
        for name in ("scales", "freedom", "variances", "limits"):
            if not (getattr(self, name) > 0.0).all():
                raise ValueError(f"`{name}` must be above 0, {getattr(self, name).tolist()} was given")

    def draws(self, joint: Array, count: int) -> Array:
        """Draw body twists of all operations, (count, n, 6), [m, rad]; equal arguments give equal draws.

        Args:
            joint: (6 n, 6 n), the stated covariance; what it has beyond these tails is drawn as a Gaussian.
        """
        n = len(self.frames)
        numbers = (tuple(getattr(self, name).tolist()) for name in ("scales", "freedom", "limits"))
        tail_errors, normal_numbers = _draw_unit_errors(n, count, *numbers, self.joined)
        Q = np.zeros((n, 6, 6))
        Q[:, :3, :3] = Q[:, 3:, 3:] = self.frames
        # What the stated covariance has beyond these tails is drawn as a Gaussian, by its square root V sqrt(w).
        remaining = np.array(joint).reshape(n, 6, n, 6)
        tail_covariance = Q @ np.diag(self.variances[[0, 0, 1, 2, 2, 3]]) @ np.swapaxes(Q, 1, 2)
        remaining[np.arange(n), :, np.arange(n)] -= tail_covariance
        w, V = np.linalg.eigh(remaining.reshape(6 * n, 6 * n))
        gaussian = normal_numbers.reshape(count, 6 * n) @ (V * np.sqrt(np.maximum(w, 0.0))).T
        return np.asarray((Q @ tail_errors[..., None])[..., 0] + gaussian.reshape(count, n, 6))


@lru_cache(maxsize=32)
def _draw_unit_errors(
    n: int, count: int, scales: tuple[float, ...], freedom: tuple[float, ...], limits: tuple[float, ...], joined: bool
) -> tuple[Array, Array]:
    """Errors in their own axes, and standard normal numbers, (count, n, 6) each."""
    rng = np.random.default_rng(_SEED)

    def error(shape: tuple[int, ...]) -> Array:
        drawn = rng.standard_normal((*shape, 6))
        # Student t with nu degrees of freedom: a normal number over the root of chi^2_nu / nu.
        common = rng.chisquare(freedom[0], shape) / freedom[0] if joined else None
        for columns, scale, nu in zip(_COLUMNS, scales, freedom, strict=True):
            mixed = rng.chisquare(nu, shape) / nu if common is None else common
            drawn[..., list(columns)] *= (scale / np.sqrt(mixed))[..., None]
        return drawn

    errors = error((count, n))
    for half, limit in zip((slice(0, 3), slice(3, 6)), limits, strict=True):
        for _ in range(_MOST_REDRAWS):
            # Errors beyond the limit are drawn again: the distribution is truncated.
            far = np.linalg.norm(errors[..., half], axis=-1) > limit
            if not far.any():
                break
            errors[far, half] = error((int(far.sum()),))[:, half]
    plain = rng.standard_normal((count, n, 6))
    for array in (errors, plain):
        array.setflags(write=False)
    return errors, plain
