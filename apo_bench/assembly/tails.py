"""Errors with tails: Student t across a ray and along it, of shifts and of turns.

A covariance alone says nothing of how often errors are several times as large as usual. Where an observation states its
tails, tests and regions are taken from draws of them.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import final

import numpy as np

from apo_bench.geometry import Array, freeze, make_copyable

_COLUMNS = ((0, 1), (2,), (3, 4), (5,))
"""Of an error (x, y, along; rx, ry, about): across, along, tilt, turn about."""
_ANEW = 100
_SEED = 20


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class Tails:
    """How the errors of n operations are distributed; numbers in the order across, along, tilt, turn about."""

    frames: Array
    """(n, 3, 3): the axes of errors, in the frame of each part; the third is the one along."""
    scales: Array
    """(4,), of Student t, [m, m, rad, rad]."""
    freedom: Array
    """(4,), its degrees of freedom; 1e9 and more stand for a Gaussian."""
    variances: Array
    """(4,), of one direction of each, within the limits, [m^2, m^2, rad^2, rad^2]."""
    limits: Array
    """(2,): no shift, [m], and no turn, [rad], is longer."""
    joined: bool = False
    """Whether shift and turn are large together, by one number for all six directions."""

    def __post_init__(self) -> None:
        freeze(self, frames=(None, 3, 3), scales=(4,), freedom=(4,), variances=(4,), limits=(2,))
        for name in ("scales", "freedom", "variances", "limits"):
            if not (getattr(self, name) > 0.0).all():
                raise ValueError(f"`{name}` must be above 0, {getattr(self, name).tolist()} was given")

    def draws(self, joint: Array, count: int) -> Array:
        """Body twists of all operations, (count, n, 6), [m, rad]: the same for the same tails, so that what is computed
        of them is a function of what was observed.

        Args:
            joint: (6 n, 6 n), the covariance that is stated; what of it is not of these tails is taken for Gaussian.
        """
        n = len(self.frames)
        numbers = (tuple(getattr(self, name).tolist()) for name in ("scales", "freedom", "limits"))
        unit, plain = _unit_draws(n, count, *numbers, self.joined)
        Q = np.zeros((n, 6, 6))
        Q[:, :3, :3] = Q[:, 3:, 3:] = self.frames
        # What the stated covariance has beyond these tails is drawn as a Gaussian, by its square root V sqrt(w).
        rest = np.array(joint).reshape(n, 6, n, 6)
        own = Q @ np.diag(self.variances[[0, 0, 1, 2, 2, 3]]) @ np.swapaxes(Q, 1, 2)
        rest[np.arange(n), :, np.arange(n)] -= own
        w, V = np.linalg.eigh(rest.reshape(6 * n, 6 * n))
        gaussian = plain.reshape(count, 6 * n) @ (V * np.sqrt(np.maximum(w, 0.0))).T
        return np.asarray((Q @ unit[..., None])[..., 0] + gaussian.reshape(count, n, 6))


@lru_cache(maxsize=32)
def _unit_draws(
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
        for _ in range(_ANEW):
            far = np.linalg.norm(errors[..., half], axis=-1) > limit
            if not far.any():
                break
            errors[far, half] = error((int(far.sum()),))[:, half]
    plain = rng.standard_normal((count, n, 6))
    for array in (errors, plain):
        array.setflags(write=False)
    return errors, plain
